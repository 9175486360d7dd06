//! The covariance of image noise at depth 1, where a lens distorts (tangent Sampson error).
//!
//! Terekhov, Larsson, "Tangent Sampson Error: Fast Approximate Two-View Reprojection Error for Central Camera Models",
//! ICCV 2023.
//!
//! Keypoints have an error of some pixels, about the same everywhere in the image. To undo the lens stretches
//! the image, most of all at its edge, and stretches the noise with it. Let `J` be the derivative of the point
//! at depth 1 by the place where the lens shows it. Noise of covariance `s^2 I` in the image then has the
//! covariance `s^2 J J^T` at depth 1. The Sampson distance should say by how much the points must move *in the
//! image*. It uses the gradients `g` of the epipolar equation by the points. Their squared lengths are `g^T g`
//! if a pixel has the same length everywhere; with a lens they are `(J^T g)^T (J^T g) = g^T (J J^T) g`. The
//! matrix `J J^T` is called the *covariance* of a point: its covariance at depth 1 if the noise has the covariance `I` in
//! the distorted coordinates `((u - cx) / fx, (v - cy) / fy)`. It is the identity without a lens.
//!
//! *Choice the paper leaves open*: the polynomials of a lens model may fold the image over, or stretch it a lot,
//! beyond the pixels that they were fitted to. Where the image is folded, or the squared stretches along the axes of
//! the ellipse of noise sum up to more than 16, the model is not used, and the covariance is the identity. So no length
//! is stretched more than fourfold, and where both axes are stretched alike, not more than 2.83-fold. To undo a fisheye
//! stretches the image without bound towards 90 degrees, and rightly so: fourfold at 59 degrees, eightfold at 69. There
//! the bound is so many times what an ideal fisheye stretches, whose angles are the distances from the centre.
//!
//! *Differs*: the paper takes derivatives of unit rays by the pixel, here they are those of points at depth 1. Both agree where
//! the epipolar equation holds. Elsewhere a point at depth 1 also changes the length of its ray, so near 90 degrees, where the
//! stretch is huge, it seems near every line. What a fisheye shows beyond 90 degrees has no point at depth 1 and is put at the
//! last one, whose covariance would let it agree with every model; it has the identity instead.

use nalgebra::{Matrix2, Point2};

use super::{Fisheye, Lens};

/// Largest root of the sum of both squared stretches for which the lens model is used; of a fisheye, in those of an ideal
/// one.
const MAX_STRETCH: f64 = 4.0;

/// The covariance of each point of [`PointPairs`](super::PointPairs): the entries xx, xy and yy of a symmetric
/// matrix.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Covariances {
    /// Of the points in view `a`.
    pub a: [Vec<f64>; 3],
    /// Of the points in view `b`.
    pub b: [Vec<f64>; 3],
}

impl Covariances {
    /// The covariances of matched points at depth 1 under these two lenses; `None` if neither distorts.
    pub fn of_lenses(
        pairs: impl IntoIterator<Item = (Point2<f64>, Point2<f64>)>,
        lens_a: Option<&Lens>,
        lens_b: Option<&Lens>,
    ) -> Option<Self> {
        if lens_a.is_none() && lens_b.is_none() {
            return None;
        }
        let mut covariances = Self::default();
        for (a, b) in pairs {
            covariances.push(covariance(lens_a, a), covariance(lens_b, b));
        }
        Some(covariances)
    }

    /// Appends the covariances of the two points of a match.
    fn push(&mut self, a: [f64; 3], b: [f64; 3]) {
        for (view, covariance) in [(&mut self.a, a), (&mut self.b, b)] {
            for (entries, entry) in view.iter_mut().zip(covariance) {
                entries.push(entry);
            }
        }
    }
}

/// The covariance of a point at depth 1.
fn covariance(lens: Option<&Lens>, point: Point2<f64>) -> [f64; 3] {
    const IDENTITY: [f64; 3] = [1.0, 0.0, 1.0];
    let Some(lens) = lens else {
        return IDENTITY;
    };
    if matches!(lens, Lens::Fisheye(_)) && Fisheye::is_last(point) {
        return IDENTITY;
    }
    let seen_by_point = lens.derivative(point);
    // A mirror image, or one turned around: the fold was passed once or twice.
    if seen_by_point.determinant() <= 0.0 || seen_by_point.trace() <= 0.0 {
        return IDENTITY;
    }
    let covariance = seen_by_point
        .try_inverse()
        .map(|j: Matrix2<f64>| j * j.transpose());
    match covariance {
        // The trace is the sum of the squared stretches along the axes of the ellipse; NaN is no stretch.
        Some(s) if s.trace() <= MAX_STRETCH * MAX_STRETCH * expected(lens, point) => {
            [s.m11, s.m12, s.m22]
        }
        _ => IDENTITY,
    }
}

/// The mean of both squared stretches that a lens of this kind has at a point at depth 1: 1, or those of an ideal fisheye.
fn expected(lens: &Lens, point: Point2<f64>) -> f64 {
    match lens {
        Lens::Brown(_) => 1.0,
        Lens::Fisheye(_) => {
            let tangent = point.coords.norm();
            let outwards = 1.0 + tangent * tangent;
            let around = if tangent > 0.0 {
                tangent / libm::atan(tangent)
            } else {
                1.0
            };
            0.5 * (outwards * outwards + around * around)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{
        Camera, Distortion, Fisheye, MatchedPoints, PointPairs, squared_sampson_distances,
    };
    use nalgebra::Matrix3;

    const LENS: Lens = Lens::Brown(Distortion {
        k1: -0.28,
        k2: 0.07,
        p1: 0.002,
        p2: -0.001,
        k3: 0.0,
    });

    fn camera() -> Camera {
        Camera {
            distortion: Some(LENS),
            ..Camera::pinhole(400.0, 400.0, 320.0, 240.0)
        }
    }

    #[test]
    fn the_distance_is_that_of_moves_in_the_image() {
        let (camera, ideal) = (camera(), Camera::pinhole(300.0, 300.0, 320.0, 240.0));
        let e = Matrix3::new(0.1, -0.5, 0.2, 0.7, 0.05, -0.9, -0.1, 0.8, 0.02);
        let matches = MatchedPoints::new(
            vec![Point2::new(30.0, 20.0), Point2::new(500.0, 400.0)],
            vec![Point2::new(620.0, 30.0), Point2::new(350.0, 260.0)],
            vec![0.5; 2],
        );
        let algebraic = |i: usize, moves: [f64; 4]| {
            // Moves are lengths at depth 1 of an ideal camera, as the lens shows them.
            let at = |camera: &Camera, p: Point2<f64>, dx: f64, dy: f64| {
                camera.normalize(Point2::new(p.x + camera.fx * dx, p.y + camera.fy * dy))
            };
            let a = at(&camera, matches.a[i], moves[0], moves[1]);
            let b = at(&ideal, matches.b[i], moves[2], moves[3]);
            b.to_homogeneous().dot(&(e * a.to_homogeneous()))
        };
        let pairs = matches.at_depth_1_with_covariances(&camera, &ideal);
        let mut squared = [0.0; 2];
        squared_sampson_distances(&e, &pairs, 0..2, &mut squared);
        for (i, squared) in squared.into_iter().enumerate() {
            let gradient: f64 = (0..4)
                .map(|k| {
                    let mut step = [0.0; 4];
                    step[k] = 1e-6;
                    let forth = algebraic(i, step);
                    step[k] = -1e-6;
                    ((forth - algebraic(i, step)) / 2e-6).powi(2)
                })
                .sum();
            let expected = algebraic(i, [0.0; 4]).powi(2) / gradient;
            assert!(
                (squared / expected - 1.0).abs() < 1e-6,
                "{squared} {expected}"
            );
        }
        // At the edge it differs from the distance at depth 1.
        let mut plain = [0.0; 2];
        let at_depth_1 = matches.at_depth_1(&camera, &ideal);
        squared_sampson_distances(&e, &at_depth_1, 0..2, &mut plain);
        assert!(plain[0] > 1.1 * squared[0], "{plain:?} {squared:?}");
    }

    #[test]
    fn where_no_lens_distorts_there_are_no_covariances() {
        let ideal = Camera::pinhole(300.0, 310.0, 320.0, 240.0);
        let mut matches = MatchedPoints::default();
        matches.push(Point2::new(3.0, 4.0), Point2::new(5.0, 6.0), 0.1);
        let pairs = matches.at_depth_1_with_covariances(&ideal, &ideal);
        assert_eq!(pairs, matches.at_depth_1(&ideal, &ideal));
        assert_eq!(pairs.covariances, None);
    }

    #[test]
    fn a_lens_beyond_belief_changes_nothing() {
        // r (1 - 0.5 r^2) has its fold at r = 0.816.
        let folding = Lens::Brown(Distortion {
            k1: -0.5,
            ..Distortion::default()
        });
        let stretch = |r: f64| covariance(Some(&folding), Point2::new(r, 0.0))[0].sqrt();
        assert!((stretch(0.5) - 1.0 / 0.625).abs() < 1e-12);
        for r in [0.8, 0.82, 1.0, 1e9, f64::INFINITY, f64::NAN] {
            assert_eq!(
                covariance(Some(&folding), Point2::new(r, 0.0)),
                [1.0, 0.0, 1.0]
            );
        }
    }

    #[test]
    fn a_fisheye_stretches_as_far_as_it_sees() {
        let ideal = Lens::Fisheye(Fisheye::default());
        for degrees in [0.0_f64, 1.0, 30.0, 59.0, 70.0, 80.0, 89.0] {
            let angle = degrees.to_radians();
            let [xx, xy, yy] = covariance(Some(&ideal), Point2::new(angle.tan(), 0.0));
            let around = if angle > 0.0 {
                angle.tan() / angle
            } else {
                1.0
            };
            let outwards = 1.0 / angle.cos().powi(2);
            assert!((xx.sqrt() / outwards - 1.0).abs() < 1e-6, "{degrees} {xx}");
            assert!((yy.sqrt() / around - 1.0).abs() < 1e-6, "{degrees} {yy}");
            assert!(xy.abs() < 1e-6 * xx, "{degrees} {xy}");
        }
        // angle (1 - 0.3 angle^2) has its fold at 1.054, 60.4 degrees.
        let folding = Lens::Fisheye(Fisheye {
            k1: -0.3,
            ..Fisheye::default()
        });
        for degrees in [60.0_f64, 65.0, 80.0] {
            let at = Point2::new(degrees.to_radians().tan(), 0.0);
            assert_eq!(covariance(Some(&folding), at), [1.0, 0.0, 1.0], "{degrees}");
        }
    }

    #[test]
    fn what_a_fisheye_shows_beyond_90_degrees_agrees_with_no_model_by_its_covariance() {
        let lens = Lens::Fisheye(Fisheye::default());
        for (degrees, has_own) in [(89.0_f64, true), (90.5, false), (120.0, false)] {
            let seen = Point2::new(degrees.to_radians() * 0.6, degrees.to_radians() * 0.8);
            let stated = covariance(Some(&lens), lens.undistort(seen));
            assert_eq!(stated != [1.0, 0.0, 1.0], has_own, "{degrees}: {stated:?}");
        }
    }

    #[test]
    fn chosen_matches_keep_their_covariances() {
        let mut matches = MatchedPoints::default();
        for i in 0..4 {
            let x = f64::from(100 * i);
            matches.push(Point2::new(x, 5.0), Point2::new(5.0, x), 0.1);
        }
        let pairs = matches.at_depth_1_with_covariances(&camera(), &camera());
        let chosen = pairs.chosen(&[3, 1]);
        assert_eq!((chosen.get(0), chosen.get(1)), (pairs.get(3), pairs.get(1)));
        let covariances = |pairs: &PointPairs, i: usize| {
            let covariances = pairs.covariances.as_ref().expect("lenses that distort");
            [&covariances.a, &covariances.b].map(|view| view.each_ref().map(|entry| entry[i]))
        };
        assert_eq!(covariances(&chosen, 0), covariances(&pairs, 3));
        assert_eq!(covariances(&chosen, 1), covariances(&pairs, 1));
    }
}
