//! How well a match agrees with an essential or fundamental matrix.
//!
//! The *algebraic* residual `b^T E a` is not a distance. The *Sampson distance* is a first-order approximation
//! of the distance by which the two points must move together to satisfy the equation (Sampson, "Fitting Conic
//! Sections to 'Very Scattered' Data", Computer Graphics and Image Processing 18, 1982; Hartley, Zisserman,
//! "Multiple View Geometry in Computer Vision", 2nd edition, 2004, eq. 11.9). Its square is
//!
//! `(b^T E a)^2 / ((E a)_1^2 + (E a)_2^2 + (E^T b)_1^2 + (E^T b)_2^2)`
//!
//! in the squared unit of the points. For points at depth 1, multiply it by the squared focal length to get
//! squared pixels. Where a lens distorts, a pixel does not have the same length everywhere. Then each two
//! squares of the denominator that belong to one point are replaced by `g^T S g`, where g holds the two numbers
//! and `S` is the [covariance](super::Covariances) of the point (the *tangent Sampson* distance).

use std::ops::Range;

use nalgebra::{Matrix3, Point2, Vector3};

use super::PointPairs;
use crate::simd;

/// Writes the squared Sampson distance of each match in `range` to `out`, in the squared unit of the points. If the
/// pairs have covariances, that is a unit of depth 1 where the lens shows the points. NaN or infinite for matches that
/// are not finite.
///
/// # Panics
/// If `range` is not within `pairs`, or `out` has another length.
pub fn squared_sampson_distances(
    e: &Matrix3<f64>,
    pairs: &PointPairs,
    range: Range<usize>,
    out: &mut [f64],
) {
    let e = row_major(e);
    let points = [&pairs.a_x, &pairs.a_y, &pairs.b_x, &pairs.b_y].map(|x| &x[range.clone()]);
    match &pairs.covariances {
        None => {
            let [a_x, a_y, b_x, b_y] = points;
            simd::squared_sampson(&e, a_x, a_y, b_x, b_y, out);
        }
        Some(covariances) => {
            let [a, b] = [&covariances.a, &covariances.b]
                .map(|view| view.each_ref().map(|x| &x[range.clone()]));
            simd::squared_tangent_sampson(&e, points, [a, b], out);
        }
    }
}

/// Whether all matches lie on the same side of their epipoles. This is the part of "in front of both cameras"
/// that can be tested if only the matrix is known (Chum, Werner, Matas, "Epipolar Geometry Estimation via
/// RANSAC Benefits from the Oriented Epipolar Constraint", ICPR 2004, eq. 2).
///
/// With `e_b` the epipole in b, `e_b x b` and `E a` are the same epipolar line, so they are equal up to a
/// factor. The factors of all scene points in front of both cameras have the same sign, and so have those of points
/// behind both.
pub fn agree_in_orientation(
    e: &Matrix3<f64>,
    matches: impl IntoIterator<Item = (Point2<f64>, Point2<f64>)>,
) -> bool {
    let epipole = epipole_in_b(e);
    let mut signs = matches.into_iter().map(|(a, b)| {
        let factor = epipole
            .cross(&b.to_homogeneous())
            .dot(&(e * a.to_homogeneous()));
        factor > 0.0
    });
    let first = signs.next();
    signs.all(|sign| Some(sign) == first)
}

/// The epipole in b of a matrix, in homogeneous coordinates: its left null vector, of any length and sign.
pub fn epipole_in_b(e: &Matrix3<f64>) -> Vector3<f64> {
    null_vector([0, 1, 2].map(|i| e.column(i).into_owned()))
}

/// The vector that is perpendicular to three vectors of one plane: the longest of their three cross products, which
/// determines it best.
fn null_vector([k, l, m]: [Vector3<f64>; 3]) -> Vector3<f64> {
    let mut null = k.cross(&l);
    for other in [l.cross(&m), m.cross(&k)] {
        if other.norm_squared() > null.norm_squared() {
            null = other;
        }
    }
    null
}

/// The entries of a matrix, row after row, as kernels take them.
pub(super) fn row_major(m: &Matrix3<f64>) -> [f64; 9] {
    m.transpose()
        .as_slice()
        .try_into()
        .expect("a 3 x 3 matrix has nine entries")
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point2, UnitQuaternion, UnitVector3, Vector3};

    use super::*;
    use crate::geometry::{RelativePose, essential_from_pose};

    #[test]
    fn distance_is_what_moving_the_points_costs_to_first_order() {
        let pose = RelativePose {
            rotation: UnitQuaternion::from_euler_angles(0.1, -0.3, 0.2),
            direction: UnitVector3::new_normalize(Vector3::new(0.3, 0.1, 0.9)),
        };
        let e = essential_from_pose(&pose);
        let scene = Vector3::new(0.4, -0.7, 5.0);
        let seen = pose.rotation * scene + pose.direction.into_inner();
        let a = Point2::new(scene.x / scene.z, scene.y / scene.z);
        let b = Point2::new(seen.x / seen.z, seen.y / seen.z);
        // Off by 1e-4 perpendicularly to its epipolar line; half of the square remains, for
        // the cheapest correction moves both points.
        let line = e * a.to_homogeneous();
        let normal = line.xy().normalize();
        let pairs: PointPairs = [(a, b), (a, b + normal * 1e-4)].into_iter().collect();
        let mut squared = [0.0; 2];
        squared_sampson_distances(&e, &pairs, 0..2, &mut squared);
        assert!(squared[0] < 1e-30);
        let back = e.transpose() * (b + normal * 1e-4).to_homogeneous();
        let share =
            line.xy().norm_squared() / (line.xy().norm_squared() + back.xy().norm_squared());
        assert!((squared[1] / (1e-8 * share) - 1.0).abs() < 1e-6);
        let mut second = [0.0];
        squared_sampson_distances(&e, &pairs, 1..2, &mut second);
        assert_eq!(second[0], squared[1]);
    }

    #[test]
    fn matches_agree_in_orientation_unless_one_is_behind() {
        let pose = RelativePose {
            rotation: UnitQuaternion::from_euler_angles(0.1, -0.3, 0.2),
            direction: UnitVector3::new_normalize(Vector3::new(0.8, 0.1, 0.3)),
        };
        let e = essential_from_pose(&pose);
        let seen = |x: f64, y: f64, depth: f64| {
            let scene = Vector3::new(x * depth, y * depth, depth);
            let b = pose.rotation * scene + pose.direction.into_inner();
            (Point2::new(x, y), Point2::new(b.x / b.z, b.y / b.z))
        };
        let front = [
            seen(0.1, 0.2, 3.0),
            seen(-0.3, 0.4, 5.0),
            seen(0.5, -0.1, 2.0),
            seen(-0.2, -0.4, 9.0),
        ];
        // Behind a, in front of b.
        let behind = seen(-0.4, 0.1, -0.2);
        for sign in [1.0, -1e-3] {
            assert!(agree_in_orientation(&(e * sign), front));
            let mixed = front.into_iter().chain([behind]);
            assert!(!agree_in_orientation(&(e * sign), mixed));
        }
        assert!(agree_in_orientation(&e, []));
    }
}
