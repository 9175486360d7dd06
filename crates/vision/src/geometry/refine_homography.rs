//! Refinement of a homography: the least robust sum of squared symmetric transfer distances.
//!
//! Hartley, Zisserman, "Multiple View Geometry in Computer Vision", 2nd edition, 2004, sec. 4.2.2 (the
//! distance) and app. 6 (Levenberg-Marquardt). Losses as in [`refine_pose`](super::refine_pose).
//!
//! A homography has eight degrees of freedom: its matrix is kept at norm 1 and moves along the eight
//! directions perpendicular to it. That is done in coordinates in which the points of either image have
//! their centroid at 0 and a mean distance of sqrt 2 from it (sec. 4.4): in pixels, the columns of a
//! homography differ by a factor of the image's size. Distances are pixels all the same.
//!
//! | constant | value | source |
//! | --- | --- | --- |
//! | `SMALLEST_STEP` | 1e-9 of the matrix's norm | ours |
//!
//! The damping is that of [`refine_pose`](super::refine_pose).

use nalgebra::{Matrix3, SMatrix, SVector};

use super::epipolar::row_major;
use super::refine::{DAMPING_FACTOR, FIRST_DAMPING, LARGEST_DAMPING};
use super::{Loss, PointPairs, squared_transfer_distances};
use crate::simd;

const SMALLEST_STEP: f64 = 1e-9;

/// The homography after at most `max_steps` steps from `start`, of Frobenius norm 1 and with the sign of
/// `start`: never one that costs more. The scale of the `loss` is given squared, in squared pixels.
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
    let mut residuals = vec![0.0; pairs.len()];
    let mut trial = vec![0.0; pairs.len()];
    let squared = |h: &Matrix3<f64>, out: &mut [f64]| {
        squared_transfer_distances(&frames.in_pixels(h), pairs, 0..pairs.len(), out);
        loss.cost(out, squared_scale)
    };
    let mut h = frames.normalised(start);
    let mut cost = squared(&h, &mut residuals);
    let mut damping = FIRST_DAMPING;
    let mut equations = None;
    for _ in 0..max_steps {
        if equations.is_none() {
            loss.weigh(&mut residuals, squared_scale);
            equations = frames.normal_equations(&h, pairs, &residuals);
        }
        let Some((normal, gradient, directions)) = &equations else {
            break;
        };
        let mut damped = *normal;
        for i in 0..8 {
            damped[(i, i)] *= 1.0 + damping;
        }
        let Some(cholesky) = damped.cholesky() else {
            break;
        };
        let step: SVector<f64, 8> = -cholesky.solve(gradient);
        let moved = directions
            .iter()
            .zip(&step)
            .fold(h, |h, (direction, by)| h + direction * *by);
        let moved = moved.normalize();
        let moved_cost = squared(&moved, &mut trial);
        if moved_cost < cost {
            (h, cost) = (moved, moved_cost);
            std::mem::swap(&mut residuals, &mut trial);
            equations = None;
            damping /= DAMPING_FACTOR;
        } else {
            damping *= DAMPING_FACTOR;
        }
        // The damping bounds the number of vain trials. A step of NaN is none.
        let moves = step.norm() > SMALLEST_STEP;
        if !moves || damping > LARGEST_DAMPING {
            break;
        }
    }
    let refined = frames.in_pixels(&h).normalize();
    if refined.iter().all(|x| x.is_finite()) {
        refined
    } else {
        *start
    }
}

/// What takes pixels of either image to coordinates in which a homography is well conditioned.
struct Frames {
    from_a: Matrix3<f64>,
    b_to_pixels: Matrix3<f64>,
    from_b: Matrix3<f64>,
}

type Equations = (SMatrix<f64, 8, 8>, SVector<f64, 8>, [Matrix3<f64>; 8]);

impl Frames {
    /// `None` where there are no points, or all of an image are one.
    fn around(pairs: &PointPairs, h: &Matrix3<f64>) -> Option<Self> {
        let from_a = normalisation(&pairs.a_x, &pairs.a_y)?;
        let from_b = normalisation(&pairs.b_x, &pairs.b_y)?;
        let sound = h.norm() > 0.0 && h.iter().all(|x| x.is_finite());
        Some(Self {
            from_a,
            b_to_pixels: from_b.try_inverse().filter(|_| sound)?,
            from_b,
        })
    }

    fn in_pixels(&self, h: &Matrix3<f64>) -> Matrix3<f64> {
        self.b_to_pixels * h * self.from_a
    }

    fn normalised(&self, h: &Matrix3<f64>) -> Matrix3<f64> {
        let a_to_pixels = (self.from_a.try_inverse()).expect("a similarity has an inverse");
        (self.from_b * h * a_to_pixels).normalize()
    }

    /// `J^T W J` and `J^T W r` for the weights W, and the directions that they are along; `None` where
    /// the homography has no inverse.
    fn normal_equations(
        &self,
        h: &Matrix3<f64>,
        pairs: &PointPairs,
        weights: &[f64],
    ) -> Option<Equations> {
        let there = self.in_pixels(h);
        let back = there.try_inverse()?;
        let directions = perpendicular(h);
        let there_by = directions.map(|direction| self.in_pixels(&direction));
        // The derivative of an inverse.
        let back_by = there_by.map(|direction| row_major(&-(back * direction * back)));
        let sums = simd::transfer_normal_equations(
            (&row_major(&there), &there_by.map(|d| row_major(&d))),
            (&row_major(&back), &back_by),
            [&pairs.a_x, &pairs.a_y, &pairs.b_x, &pairs.b_y],
            weights,
        );
        let mut normal = SMatrix::zeros();
        let mut next = 0;
        for i in 0..8 {
            for j in 0..=i {
                normal[(i, j)] = sums[next];
                normal[(j, i)] = sums[next];
                next += 1;
            }
        }
        Some((normal, SVector::from_column_slice(&sums[36..]), directions))
    }
}

/// Moves the centroid of the finite points to the origin and their mean distance from it to sqrt 2;
/// `None` where they have no such distance.
fn normalisation(x: &[f64], y: &[f64]) -> Option<Matrix3<f64>> {
    let finite = || (x.iter().zip(y)).filter(|(x, y)| x.is_finite() && y.is_finite());
    let count = finite().count() as f64;
    let (sum_x, sum_y) = finite().fold((0.0, 0.0), |sums, (x, y)| (sums.0 + x, sums.1 + y));
    let (mean_x, mean_y) = (sum_x / count, sum_y / count);
    let distances = finite().map(|(x, y)| {
        let (dx, dy) = (x - mean_x, y - mean_y);
        (dx * dx + dy * dy).sqrt()
    });
    let scale = std::f64::consts::SQRT_2 * count / distances.sum::<f64>();
    let frame = Matrix3::new(
        scale,
        0.0,
        -scale * mean_x,
        0.0,
        scale,
        -scale * mean_y,
        0.0,
        0.0,
        1.0,
    );
    (frame.iter().all(|x| x.is_finite()) && scale > 0.0).then_some(frame)
}

/// Eight matrices of norm 1 perpendicular to `h`, of norm 1, and to each other: the columns but the first
/// of the reflection that takes `h` to an axis (Householder).
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
        let half_cost = |h: &Matrix3<f64>| {
            let mut squared = vec![0.0; pairs.len()];
            squared_transfer_distances(&frames.in_pixels(h), &pairs, 0..pairs.len(), &mut squared);
            // The distance is the mean of both squares, the residuals are all four.
            squared.iter().sum::<f64>()
        };
        let weights = vec![1.0; pairs.len()];
        let (_, gradient, directions) = frames
            .normal_equations(&h, &pairs, &weights)
            .expect("invertible");
        for (slope, direction) in gradient.iter().zip(&directions) {
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
