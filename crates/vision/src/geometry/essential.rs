//! The essential matrix: the relation between two calibrated views of a rigid scene.
//!
//! Hartley, Zisserman, "Multiple View Geometry in Computer Vision", 2nd edition, 2004, sec. 9.6.
//!
//! For points at depth 1 that show the same scene point, `b^T E a = 0` with `E = [t]x R` and `x_b = R x_a + t`.
//! E has two equal singular values, and the third is zero (result 9.17). E determines R and t up to a choice of
//! four (result 9.19); cheirality decides between these.

use nalgebra::{Matrix3, Rotation3, SVD, UnitQuaternion, UnitVector3};

use super::RelativePose;

/// This number of steps is enough for the singular values of any 3 x 3 matrix of finite numbers.
pub(super) const MAX_SVD_STEPS: usize = 100;

/// The essential matrix `[t]x R` of a pose, of Frobenius norm sqrt 2.
pub fn essential_from_pose(b_from_a: &RelativePose) -> Matrix3<f64> {
    b_from_a.direction.cross_matrix() * b_from_a.rotation.to_rotation_matrix()
}

/// How far `e` is from being an essential matrix: the Frobenius norm of
/// `E E^T E - trace(E E^T) E / 2` for E scaled to norm 1. It is zero (up to about 1e-16) if and
/// only if two singular values are equal and the third is zero.
pub fn essential_defect(e: &Matrix3<f64>) -> f64 {
    let e = scaled(e).normalize();
    let gram = e * e.transpose();
    (gram * e - e * (0.5 * gram.trace())).norm()
}

/// The four poses whose essential matrix is the one nearest to `e`, up to sign. Their order is (R1, t), (R2,
/// t), (R1, -t), (R2, -t), where `U diag(1, 1, 0) V^T` is the singular value decomposition of `e`, of which U and V are
/// taken as rotations, `R1 = U W V^T`, `R2 = U W^T V^T`, and t is the third column of U. The rows of W are (0, 1, 0),
/// (-1, 0, 0) and (0, 0, 1), as in OpenCV; Hartley and Zisserman call the transpose of this W. `None` if `e` is zero or
/// not finite.
pub fn decompose_essential(e: &Matrix3<f64>) -> Option<[RelativePose; 4]> {
    let e = scaled(e);
    if !(e.iter().all(|x| x.is_finite()) && e.norm_squared() > 0.0) {
        return None;
    }
    let svd = SVD::try_new(e.normalize(), true, true, f64::EPSILON, MAX_SVD_STEPS)?;
    let (u, v_t) = (proper(svd.u?), proper(svd.v_t?));
    let w = Matrix3::new(0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    let [r1, r2] = [u * w * v_t, u * w.transpose() * v_t]
        .map(|r| UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(r)));
    let t = UnitVector3::new_normalize(u.column(2).into_owned());
    Some(
        [(r1, t), (r2, t), (r1, -t), (r2, -t)].map(|(rotation, direction)| RelativePose {
            rotation,
            direction,
        }),
    )
}

/// A matrix whose scale does not matter, as it is, or divided by its largest entry where products of entries would be
/// too large or too small for a number.
pub(super) fn scaled(m: &Matrix3<f64>) -> Matrix3<f64> {
    let largest = m.amax();
    let is_extreme = largest > 0.0 && !(1e-90..=1e90).contains(&largest);
    if is_extreme { m / largest } else { *m }
}

/// The orthogonal matrix or its negative, whichever is a rotation; E is known up to sign only.
fn proper(m: Matrix3<f64>) -> Matrix3<f64> {
    if m.determinant() < 0.0 { -m } else { m }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::seed::{Rng, Seed};

    #[test]
    fn the_scale_of_an_essential_matrix_does_not_matter() {
        let pose = RelativePose {
            rotation: UnitQuaternion::from_euler_angles(0.1, -0.2, 0.3),
            direction: UnitVector3::new_normalize(Vector3::new(1.0, 2.0, -0.5)),
        };
        let e = essential_from_pose(&pose);
        for scale in [1.0, 1e-200, 1e200, -1e-300] {
            let poses = decompose_essential(&(e * scale)).expect("it is not zero");
            let is_it = |found: &RelativePose| {
                let turned = found.rotation.angle_to(&pose.rotation);
                turned < 1e-7 && (found.direction.dot(&pose.direction) - 1.0).abs() < 1e-12
            };
            assert!(poses.iter().any(is_it), "{scale}");
        }
        assert!(decompose_essential(&Matrix3::zeros()).is_none());
        assert!(decompose_essential(&(e * f64::NAN)).is_none());
    }

    fn pose(rng: &mut Rng) -> RelativePose {
        let mut direction = || UnitVector3::new_normalize(Vector3::from_fn(|_, _| rng.normal()));
        let (axis, direction) = (direction(), direction());
        RelativePose {
            rotation: UnitQuaternion::from_axis_angle(&axis, 3.0 * rng.uniform()),
            direction,
        }
    }

    #[test]
    fn one_of_the_four_poses_is_the_one_we_started_from() {
        let mut rng = Seed(1).rng();
        for sign in [1.0, -1.0, 1e-9, 1e9] {
            let truth = pose(&mut rng);
            let e = essential_from_pose(&truth);
            assert!(essential_defect(&e) < 1e-15);
            let poses = decompose_essential(&(e * sign)).unwrap();
            let same = |p: &RelativePose| p.error(&truth).max() < 1e-7;
            assert_eq!(poses.iter().filter(|p| same(p)).count(), 1);
            for p in &poses {
                let back = essential_from_pose(p);
                assert!((back - e).norm().min((back + e).norm()) < 1e-12);
            }
        }
    }

    #[test]
    fn defect_tells_essential_matrices_from_others() {
        assert!(essential_defect(&Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0))) < 1e-16);
        assert!(essential_defect(&Matrix3::from_diagonal(&Vector3::new(1.0, 0.9, 0.0))) > 1e-2);
        assert!(essential_defect(&Matrix3::identity()) > 0.1);
        let e = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0));
        for scale in [1e-300, 1e-170, 1e170, 1e300] {
            assert!(essential_defect(&(e * scale)) < 1e-15, "{scale}");
            assert!(
                essential_defect(&Matrix3::from_diagonal_element(scale)) > 0.1,
                "{scale}"
            );
        }
    }

    #[test]
    fn what_is_not_a_matrix_has_no_poses() {
        assert_eq!(decompose_essential(&Matrix3::zeros()), None);
        assert_eq!(decompose_essential(&Matrix3::from_element(f64::NAN)), None);
        assert_eq!(
            decompose_essential(&Matrix3::from_element(f64::INFINITY)),
            None
        );
    }
}
