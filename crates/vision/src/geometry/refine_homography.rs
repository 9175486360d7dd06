//! Refinement of a homography: minimises a robust sum of squared symmetric transfer distances.
//!
//! Hartley, Zisserman, "Multiple View Geometry in Computer Vision", 2nd edition, 2004, sec. 4.2.2 (the
//! distance) and app. 6 (Levenberg-Marquardt). Losses as in [`refine_pose`](super::refine_pose).
//!
//! A homography has eight degrees of freedom: its matrix is kept at norm 1, and moves along the eight
//! directions perpendicular to it. This is done in normalised coordinates, where the points of each image have
//! their centroid at 0 and a mean distance of sqrt 2 from it (sec. 4.4), since in pixels the columns of a
//! homography differ by a factor of the size of the image. Distances are still measured in pixels.
//!
//! Steps are those of Levenberg and Marquardt, relative to the norm of the matrix.

use nalgebra::{Matrix3, SVector};

use super::epipolar::row_major;
use super::levenberg_marquardt::{LeastSquares, Loss, NormalEquations, minimise};
use super::{PointPairs, normalisation, squared_transfer_distances};
use crate::simd;

/// The homography after at most `max_steps` steps from `start`, of Frobenius norm 1 and with the sign of
/// `start`. Its cost is never larger than that of `start`. It is `start` itself, of whatever norm, where nothing can be
/// refined: if all points of an image coincide or none is finite, or if `start` is zero or not finite. The scale of the
/// `loss` is given squared, in the squared unit of the points.
pub fn refine_homography(
    start: &Matrix3<f64>,
    pairs: &PointPairs,
    loss: Loss,
    squared_scale: f64,
    max_steps: usize,
) -> Matrix3<f64> {
    let Some(frames) = Frames::around(pairs, start) else {
        return *start;
    };
    let distances = TransferDistances { frames, pairs };
    let from = distances.frames.normalised(start);
    let h = minimise(&distances, from, loss, squared_scale, max_steps);
    let refined = distances.frames.denormalised(&h).normalize();
    if refined.iter().all(|x| x.is_finite()) {
        refined
    } else {
        *start
    }
}

/// The symmetric transfer distances of matches, in the unit of the points, under a homography between normalised coordinates.
struct TransferDistances<'a> {
    frames: Frames,
    pairs: &'a PointPairs,
}

impl LeastSquares<8> for TransferDistances<'_> {
    type Model = Matrix3<f64>;

    fn len(&self) -> usize {
        self.pairs.len()
    }

    fn squared_residuals(&self, h: &Matrix3<f64>, out: &mut [f64]) {
        let denormalised = self.frames.denormalised(h);
        squared_transfer_distances(&denormalised, self.pairs, 0..self.pairs.len(), out);
    }

    /// The normal equations along the directions [`perpendicular`] to `h`; `None` if the homography has no
    /// inverse.
    fn normal_equations(&self, h: &Matrix3<f64>, weights: &[f64]) -> Option<NormalEquations<8>> {
        let (frames, pairs) = (&self.frames, self.pairs);
        let there = frames.denormalised(h);
        let back = there.try_inverse()?;
        let there_by = perpendicular(h).map(|direction| frames.denormalised(&direction));
        // The derivative of an inverse.
        let back_by = there_by.map(|direction| row_major(&-(back * direction * back)));
        let sums = simd::transfer_normal_equations(
            (&row_major(&there), &there_by.map(|d| row_major(&d))),
            (&row_major(&back), &back_by),
            [&pairs.a_x, &pairs.a_y, &pairs.b_x, &pairs.b_y],
            weights,
        );
        Some(NormalEquations::from_sums(&sums))
    }

    fn moved(&self, h: &Matrix3<f64>, step: &SVector<f64, 8>) -> Matrix3<f64> {
        let along = perpendicular(h);
        let along = along.iter().zip(step);
        let moved = along.fold(*h, |h, (direction, by)| h + direction * *by);
        moved.normalize()
    }
}

/// The transformations from the points of each image to coordinates in which a homography is well conditioned.
struct Frames {
    from_a: Matrix3<f64>,
    b_from_normalised: Matrix3<f64>,
    from_b: Matrix3<f64>,
}

impl Frames {
    /// `None` if there are no finite points, if all points of an image coincide (rounding may hide this), or if `h` is
    /// zero or not finite.
    fn around(pairs: &PointPairs, h: &Matrix3<f64>) -> Option<Self> {
        let of = |x: &[f64], y: &[f64]| {
            let points = x.iter().zip(y).map(|(x, y)| (*x, *y));
            let frame = normalisation(points.filter(|(x, y)| x.is_finite() && y.is_finite()));
            (frame.iter().all(|x| x.is_finite()) && frame[0] > 0.0).then_some(frame)
        };
        let from_a = of(&pairs.a_x, &pairs.a_y)?;
        let from_b = of(&pairs.b_x, &pairs.b_y)?;
        let sound = h.norm() > 0.0 && h.iter().all(|x| x.is_finite());
        Some(Self {
            from_a,
            b_from_normalised: from_b.try_inverse().filter(|_| sound)?,
            from_b,
        })
    }

    fn denormalised(&self, h: &Matrix3<f64>) -> Matrix3<f64> {
        self.b_from_normalised * h * self.from_a
    }

    fn normalised(&self, h: &Matrix3<f64>) -> Matrix3<f64> {
        let a_from_normalised = (self.from_a.try_inverse()).expect("a similarity has an inverse");
        (self.from_b * h * a_from_normalised).normalize()
    }
}

/// Eight matrices of norm 1 that are perpendicular to `h`, which has norm 1, and to each other. They are the
/// columns, except the first, of the reflection that takes `h` to an axis (Householder).
fn perpendicular(h: &Matrix3<f64>) -> [Matrix3<f64>; 8] {
    let first = h[0];
    let mut mirror = *h;
    // Away from the axis, so that nothing cancels.
    mirror[0] += 1.0_f64.copysign(first);
    let squared = mirror.norm_squared();
    std::array::from_fn(|k| {
        let mut axis = Matrix3::zeros();
        axis[k + 1] = 1.0;
        axis - mirror * (2.0 * mirror[k + 1] / squared)
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::super::homography::transfer;
    use super::*;
    use crate::seed::Seed;

    fn truth() -> Matrix3<f64> {
        Matrix3::new(1.1, 0.05, 30.0, -0.1, 0.9, 20.0, 1e-4, -2e-4, 1.0).normalize()
    }

    /// Matches in 640 x 480 pixels with this noise, and then wrong ones.
    fn matches(right: usize, wrong: usize, noise: f64) -> PointPairs {
        let mut rng = Seed(4).rng();
        (0..right + wrong)
            .map(|i| {
                let mut pixel = || Point2::new(640.0 * rng.uniform(), 480.0 * rng.uniform());
                let (a, anywhere) = (pixel(), pixel());
                let b = transfer(&truth(), a);
                let b = Point2::new(b.x + noise * rng.normal(), b.y + noise * rng.normal());
                (a, if i < right { b } else { anywhere })
            })
            .collect()
    }

    /// Corners move by about this many pixels.
    fn disturbed(by: f64) -> Matrix3<f64> {
        let shift = Matrix3::new(1.0, 0.0, by, 0.001 * by, 1.0, -by, 0.0, 1e-6 * by, 1.0);
        (shift * truth()).normalize()
    }

    fn error(h: &Matrix3<f64>) -> f64 {
        super::super::corner_error(h, &truth(), (640, 480))
    }

    #[test]
    fn exact_matches_give_the_exact_homography() {
        for loss in [Loss::Truncated, Loss::Cauchy] {
            let start = disturbed(5.0);
            assert!(error(&start) > 4.0);
            let found = refine_homography(&start, &matches(50, 0, 0.0), loss, 1e3, 20);
            assert!(error(&found) < 1e-6, "{loss:?} {}", error(&found));
        }
    }

    #[test]
    fn wrong_matches_are_resisted() {
        let pairs = matches(200, 200, 0.5);
        for loss in [Loss::Truncated, Loss::Cauchy] {
            let found = refine_homography(&disturbed(1.0), &pairs, loss, 9.0, 20);
            assert!(error(&found) < 0.3, "{loss:?} {}", error(&found));
        }
    }

    #[test]
    fn directions_are_perpendicular() {
        for h in [truth(), -truth(), Matrix3::identity().normalize()] {
            let directions = perpendicular(&h);
            for (i, one) in directions.iter().enumerate() {
                assert!(one.dot(&h).abs() < 1e-14);
                for (j, other) in directions.iter().enumerate() {
                    let expected = f64::from(u8::from(i == j));
                    assert!((one.dot(other) - expected).abs() < 1e-14);
                }
            }
        }
    }

    #[test]
    fn derivatives_are_those_of_the_distance() {
        let pairs = matches(5, 5, 2.0);
        let frames = Frames::around(&pairs, &truth()).expect("points apart");
        let h = frames.normalised(&disturbed(3.0));
        let distances = TransferDistances {
            frames,
            pairs: &pairs,
        };
        let half_cost = |h: &Matrix3<f64>| {
            let mut squared = vec![0.0; pairs.len()];
            distances.squared_residuals(h, &mut squared);
            // The distance is the mean of both squares, the residuals are all four.
            squared.iter().sum::<f64>()
        };
        let weights = vec![1.0; pairs.len()];
        let equations = distances.normal_equations(&h, &weights);
        let NormalEquations { gradient, .. } = equations.expect("invertible");
        for (slope, direction) in gradient.iter().zip(&perpendicular(&h)) {
            let step = direction * 1e-6;
            let difference = (half_cost(&(h + step)) - half_cost(&(h - step))) / 2e-6;
            let scale = gradient.norm();
            assert!(
                (difference - slope).abs() < 1e-5 * scale,
                "{difference} {slope}"
            );
        }
    }

    #[test]
    fn what_is_not_finite_has_no_influence_and_nothing_stays_where_it_is() {
        let mut pairs = matches(50, 0, 0.0);
        pairs.a_x[3] = f64::NAN;
        pairs.b_y[7] = f64::INFINITY;
        for loss in [Loss::Truncated, Loss::Cauchy] {
            let start = disturbed(5.0);
            let found = refine_homography(&start, &pairs, loss, 1e3, 20);
            assert!(error(&found) < 1e-6, "{loss:?}");
            let nothing = PointPairs::default();
            assert_eq!(refine_homography(&start, &nothing, loss, 9.0, 20), start);
            let none = Matrix3::zeros();
            assert_eq!(refine_homography(&none, &pairs, loss, 9.0, 20), none);
        }
    }
}
