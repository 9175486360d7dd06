//! The relative poses that a homography of a plane allows.
//!
//! Ma, Soatto, Kosecka, Sastry, "An Invitation to 3-D Vision", 2004, sec. 5.3.3; first by Faugeras, Lustman, "Motion and
//! Structure from Motion in a Piecewise Planar Environment", International Journal of Pattern Recognition and
//! Artificial Intelligence 2(3), 1988.
//!
//! Two calibrated views of a plane are related by `H = R + t n^T / d`, scaled such that its middle singular
//! value is 1. The vectors whose length H does not change lie in two planes. One of these is parallel to the
//! plane of the scene, and each of them determines a rotation and a translation. So a plane alone allows two
//! poses, up to the side of the plane. With `H^T H = V diag(s1^2, 1, s3^2) V^T` the two planes are spanned by
//! `v2` and `u = (sqrt(1 - s3^2) v1 +- sqrt(s1^2 - 1) v3) / sqrt(s1^2 - s3^2)`. R takes the triple
//! `v2, u, v2 x u` to `H v2, H u, H v2 x H u`; then `t = (H - R) (v2 x u)`. Both cameras are on the same side of the plane,
//! so H has a positive determinant.

use nalgebra::{Matrix3, SVD};

use super::essential::{MAX_SVD_STEPS, essential_defect, scaled};
use super::solvers::Solutions;

/// If the singular values are this close together, H is taken for a rotation, which says nothing about a plane.
const MIN_SPAN: f64 = 1e-9;

/// With a larger defect ([`essential_defect`]) the rotation is none: H has hardly more than one direction, and the rest of
/// it is rounding.
const MAX_DEFECT: f64 = 1e-6;

/// The essential matrices of the two poses that explain a homography from a to b of points at depth 1. They
/// have Frobenius norm 1 and any sign. Scale and sign of `h` do not matter. There are none if `h` is a rotation
/// or has no inverse, and none that are not essential if it has hardly one.
pub fn essentials_of_plane(h: &Matrix3<f64>) -> Solutions<Matrix3<f64>, 2> {
    let mut found = Solutions::none();
    let h = &scaled(h);
    if !h.iter().all(|x| x.is_finite()) {
        return found;
    }
    let Some(svd) = SVD::try_new(*h, false, true, f64::EPSILON, MAX_SVD_STEPS) else {
        return found;
    };
    let Some(v_t) = svd.v_t else {
        return found;
    };
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| svd.singular_values[j].total_cmp(&svd.singular_values[i]));
    let [largest, middle, least] = order.map(|i| svd.singular_values[i]);
    let [v1, v2, v3] = order.map(|i| v_t.row(i).transpose());
    let (s1, s3) = (largest / middle, least / middle);
    let squared_span = s1 * s1 - s3 * s3;
    if squared_span.is_nan() || squared_span < MIN_SPAN || least <= 0.0 {
        return found;
    }
    let h = h / middle.copysign(h.determinant());
    let along = (1.0 - s3 * s3).max(0.0).sqrt();
    let across = (s1 * s1 - 1.0).max(0.0).sqrt();
    for sign in [1.0, -1.0] {
        let u = (v1 * along + v3 * (sign * across)) / squared_span.sqrt();
        let normal = v2.cross(&u);
        let (moved_v, moved_u) = (h * v2, h * u);
        let moved = Matrix3::from_columns(&[moved_v, moved_u, moved_v.cross(&moved_u)]);
        let rotation = moved * Matrix3::from_columns(&[v2, u, normal]).transpose();
        let translation = (h - rotation) * normal;
        let essential = translation.cross_matrix() * rotation;
        let norm = essential.norm();
        if norm.is_finite() && norm > MIN_SPAN && essential_defect(&essential) < MAX_DEFECT {
            found.push(essential / norm);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, UnitVector3, Vector3};

    use super::*;
    use crate::geometry::{RelativePose, essential_from_pose};
    use crate::seed::Seed;

    #[test]
    fn one_of_the_two_is_the_pose_that_saw_the_plane() {
        let mut rng = Seed(4).rng();
        for round in 0..200 {
            let mut direction =
                || UnitVector3::new_normalize(Vector3::from_fn(|_, _| rng.normal()));
            let (axis, direction, normal) = (direction(), direction(), direction());
            let pose = RelativePose {
                rotation: UnitQuaternion::from_axis_angle(&axis, 0.8 * rng.uniform()),
                direction,
            };
            let distance = 1.5 + 5.0 * rng.uniform();
            let h = pose.rotation.to_rotation_matrix().matrix()
                + direction.into_inner() * normal.transpose() / distance;
            let scale = [1.0, 3e-4, -2e5, -1.0, 1e200, 1e-200][round % 6];
            let truth = essential_from_pose(&pose).normalize();
            let found = essentials_of_plane(&(h * scale));
            let off = |e: &Matrix3<f64>| (e - truth).norm().min((e + truth).norm());
            assert_eq!(found.len(), 2);
            assert!(found.iter().all(|e| essential_defect(e) < 1e-9));
            let nearest = found.iter().map(off).fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-6, "{nearest}");
        }
    }

    #[test]
    fn both_are_the_pose_where_the_camera_moves_straight_at_the_plane() {
        let normal = UnitVector3::new_normalize(Vector3::new(0.2, -0.1, 1.0));
        let rotation = UnitQuaternion::from_euler_angles(0.1, -0.2, 0.3);
        for (side, distance) in [(1.0, 3.0), (-1.0, 3.0), (-1.0, 1.2), (1.0, 50.0)] {
            // In the frame of b, so that H = R (I + side n n^T / d).
            let direction = UnitVector3::new_normalize(rotation * (normal.into_inner() * side));
            let truth = essential_from_pose(&RelativePose {
                rotation,
                direction,
            })
            .normalize();
            let h = rotation.to_rotation_matrix().matrix()
                + direction.into_inner() * normal.transpose() / distance;
            let found = essentials_of_plane(&h);
            assert_eq!(found.len(), 2);
            for e in found.iter() {
                let off = (e - truth).norm().min((e + truth).norm());
                assert!(off < 1e-6, "{side} {distance}: {off}");
            }
        }
    }

    #[test]
    fn where_b_is_almost_in_the_plane_the_matrices_stay_finite() {
        let normal = Vector3::z();
        for above in [1e-3, 1e-9, 1e-15, 0.0] {
            let h = Matrix3::identity() - normal * normal.transpose() * (1.0 - above);
            let found = essentials_of_plane(&h);
            // In the plane itself there is no inverse.
            assert_eq!(found.len(), if above > 0.0 { 2 } else { 0 }, "{above}");
            for e in found.iter() {
                assert!(
                    (e.norm() - 1.0).abs() < 1e-9 && essential_defect(e) < 1e-6,
                    "{above}: {e}"
                );
            }
        }
    }

    #[test]
    fn of_almost_singular_matrices_only_essential_ones_come_back() {
        let mut rng = Seed(9).rng();
        let mut found = 0;
        for round in 0..4000 {
            let mut vector = || Vector3::from_fn(|_, _| rng.normal());
            // One direction, and less and less beside it.
            let h = vector() * vector().transpose();
            let beside = Matrix3::from_columns(&[(); 3].map(|()| vector()));
            let h = h + beside * 10_f64.powi(-(round % 20));
            for e in essentials_of_plane(&h).iter() {
                let defect = essential_defect(e);
                assert!(defect < 1e-6, "{round}: {defect}, {h}");
                found += usize::from(round % 20 < 5);
            }
        }
        // Nothing is lost where the singular values are as far apart as 10,000.
        assert_eq!(found, 2 * 200 * 5);
    }

    #[test]
    fn a_rotation_and_what_is_no_homography_have_none() {
        let rotation = UnitQuaternion::from_euler_angles(0.1, -0.4, 0.2).to_rotation_matrix();
        let none = [
            *rotation.matrix(),
            Matrix3::zeros(),
            Matrix3::from_element(f64::NAN),
            Matrix3::from_element(f64::INFINITY),
        ];
        for h in none {
            assert!(essentials_of_plane(&h).is_empty(), "{h}");
        }
    }
}
