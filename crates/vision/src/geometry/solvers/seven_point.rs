//! The seven-point solver: from seven matches, one or three fundamental matrices.
//!
//! Hartley, Zisserman, "Multiple View Geometry in Computer Vision", 2nd edition, 2004, sec. 11.1.2.
//!
//! 1. Seven equations `b^T F a = 0` leave `F = s X + Y`, up to scale.
//! 2. F is singular: `det F = 0` is a cubic in s. Its coefficients follow from its values at 0, 1 and -1, and from
//!    `det X`, which is the leading one. [`real_roots`] finds its roots.
//!
//! *Differs from the book*, which has `F = s X + (1 - s) Y`. Both leave out one matrix, X - Y there and X here (s
//! is infinite), which is singular only by chance.
//!
//! The points may be pixels or points at depth 1, which are better conditioned. With points at depth 1 the
//! result is `K_b^T F K_a` for the fundamental matrix F of the pixels. This is the essential matrix, as far as
//! seven points without calibration determine it.

use nalgebra::{Matrix3, Point2};

use super::null_space::null_space;
use super::{Solutions, real_roots};

/// All singular matrices with `b[i]^T F a[i] = 0` for seven matches, of Frobenius norm 1; the sign is
/// arbitrary. There are none where the matches are degenerate or not finite.
pub fn seven_point(a: &[Point2<f64>; 7], b: &[Point2<f64>; 7]) -> Solutions<Matrix3<f64>, 4> {
    let mut solutions = Solutions::none();
    let Some(basis) = null_space::<7, 2>(a, b) else {
        return solutions;
    };
    let [x, y] = basis.map(|flat| Matrix3::from_row_slice(&flat));
    // X alone, where s is infinite, is left out.
    let determinant = |s: f64| (x * s + y).determinant();
    let (at_0, at_1, at_minus_1) = (determinant(0.0), determinant(1.0), determinant(-1.0));
    let c3 = x.determinant();
    let c2 = f64::midpoint(at_1, at_minus_1) - at_0;
    let c1 = at_1 - at_0 - c2 - c3;
    for &s in real_roots(&[at_0, c1, c2, c3]).iter() {
        solutions.push((x * s + y).normalize());
    }
    solutions
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, UnitVector3, Vector3};

    use super::*;
    use crate::geometry::{RelativePose, essential_from_pose};
    use crate::seed::Seed;

    #[test]
    fn the_true_matrix_is_one_of_them() {
        let mut missed = 0;
        for seed in 0..1000 {
            let mut rng = Seed(seed).rng();
            let mut vector = || Vector3::from_fn(|_, _| rng.normal());
            let truth = RelativePose {
                rotation: UnitQuaternion::from_scaled_axis(vector() * 0.3),
                direction: UnitVector3::new_normalize(vector()),
            };
            let (mut a, mut b) = ([Point2::origin(); 7], [Point2::origin(); 7]);
            for (a, b) in a.iter_mut().zip(&mut b) {
                let scene = vector() + Vector3::new(0.0, 0.0, 5.0);
                let seen = truth.rotation * scene + truth.direction.into_inner();
                *a = Point2::new(scene.x / scene.z, scene.y / scene.z);
                *b = Point2::new(seen.x / seen.z, seen.y / seen.z);
            }
            let found = seven_point(&a, &b);
            let e = essential_from_pose(&truth).normalize();
            let distance = |f: &Matrix3<f64>| (f - e).norm().min((f + e).norm());
            missed += usize::from(!found.iter().any(|f| distance(f) < 1e-5));
            for f in found.iter() {
                assert!(f.determinant().abs() < 1e-9);
                for (a, b) in a.iter().zip(&b) {
                    let residual = (b.to_homogeneous().transpose() * f * a.to_homogeneous()).x;
                    assert!(residual.abs() < 1e-9, "{residual}");
                }
            }
        }
        assert!(missed <= 2, "{missed} of 1000 are missed");
    }

    #[test]
    fn matches_that_leave_more_than_two_matrices_have_no_solution() {
        let rotation = UnitQuaternion::from_euler_angles(0.1, -0.4, 0.2).to_rotation_matrix();
        let plane = rotation.matrix() + Vector3::new(0.3, 0.1, -0.2) * Vector3::z().transpose();
        for seed in 0..100 {
            let mut rng = Seed(seed).rng();
            let mut points = || -> [Point2<f64>; 7] {
                std::array::from_fn(|_| Point2::new(rng.uniform() - 0.5, rng.uniform() - 0.5))
            };
            let (a, any) = (points(), points());
            assert!(!seven_point(&a, &any).is_empty());
            // The camera only turns, or all points lie on a plane.
            for h in [rotation.matrix(), &plane] {
                let b =
                    a.map(|a| Point2::from_homogeneous(h * a.to_homogeneous()).expect("finite"));
                assert!(seven_point(&a, &b).is_empty());
            }
            // All points lie on a line.
            let on_line = |x: f64| Point2::new(x, 0.3 - 2.0 * x);
            let (a_line, b_line) = (a.map(|p| on_line(p.x)), any.map(|p| on_line(p.y)));
            assert!(seven_point(&a_line, &b_line).is_empty());
            let (mut twice_a, mut twice_b) = (a, any);
            (twice_a[5], twice_b[5]) = (a[2], any[2]);
            assert!(seven_point(&twice_a, &twice_b).is_empty());
        }
    }

    #[test]
    fn degenerate_matches_have_no_solution() {
        let same = [Point2::new(0.1, 0.2); 7];
        assert!(seven_point(&same, &same).is_empty());
        let mut broken: [_; 7] = std::array::from_fn(|i| Point2::new(i as f64, (i * i) as f64));
        broken[3].x = f64::NAN;
        assert!(seven_point(&broken, &broken).is_empty());
    }
}
