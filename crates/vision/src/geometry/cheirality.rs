//! Cheirality: of the four poses of an essential matrix, the one is chosen for which scene points lie in front
//! of both cameras.
//!
//! Hartley, Zisserman, "Multiple View Geometry in Computer Vision", 2nd edition, 2004, sec. 9.6.3.
//! The rule is that of OpenCV's `recoverPose` without a mask, which the reference protocol uses. Every match is
//! triangulated, inlier or not. A match supports a pose if its depth in both views is positive and below a
//! limit; a point beyond this limit says nothing about the translation. The pose with most support is chosen.
//! If two have the same support, the earlier in the order of [`decompose_essential`] is chosen.
//!
//! Two triangulations are enough for four poses. If t is replaced by -t, the scene point (X, w) becomes (X,
//! -w), so both depths change sign.

use nalgebra::Matrix3;

use super::triangulation::triangulate_depths;
use super::{PointPairs, RelativePose, decompose_essential};

/// The pose of `essential` that most matches support, and the number of these matches. A match supports a pose
/// if its depth in both views is in `(0, max_depth)`, in baselines. `None` if the matrix is zero or not finite.
pub fn choose_pose(
    essential: &Matrix3<f64>,
    pairs: &PointPairs,
    max_depth: f64,
) -> Option<(RelativePose, usize)> {
    let poses = decompose_essential(essential)?;
    let mut depths = (vec![0.0; pairs.len()], vec![0.0; pairs.len()]);
    let mut support = [0; 4];
    for rotation in 0..2 {
        triangulate_depths(&poses[rotation], pairs, &mut depths.0, &mut depths.1);
        support[rotation] = supporting(&depths, 1.0, max_depth);
        support[rotation + 2] = supporting(&depths, -1.0, max_depth);
    }
    let best = (1..4).fold(
        0,
        |best, i| if support[i] > support[best] { i } else { best },
    );
    Some((poses[best], support[best]))
}

/// Number of matches that support a pose, as [`choose_pose`] counts them.
pub(crate) fn pose_support(pose: &RelativePose, pairs: &PointPairs, max_depth: f64) -> usize {
    let mut depths = (vec![0.0; pairs.len()], vec![0.0; pairs.len()]);
    triangulate_depths(pose, pairs, &mut depths.0, &mut depths.1);
    supporting(&depths, 1.0, max_depth)
}

/// Number of matches whose depths in both views, times `sign`, are in `(0, max_depth)`.
fn supporting(depths: &(Vec<f64>, Vec<f64>), sign: f64, max_depth: f64) -> usize {
    let within = |depth: f64| depth * sign > 0.0 && depth * sign < max_depth;
    (depths.0.iter().zip(&depths.1))
        .filter(|&(&a, &b)| within(a) && within(b))
        .count()
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point2, UnitQuaternion, UnitVector3, Vector3};

    use super::*;
    use crate::geometry::{essential_from_pose, ray_depths};
    use crate::seed::Seed;

    fn pose() -> RelativePose {
        RelativePose {
            rotation: UnitQuaternion::from_euler_angles(0.1, -0.3, 0.2),
            direction: UnitVector3::new_normalize(Vector3::new(0.8, 0.1, 0.3)),
        }
    }

    /// Matches of points at these depths in view `a`.
    fn seen(depths: &[f64]) -> PointPairs {
        let mut rng = Seed(1).rng();
        (depths.iter())
            .map(|&depth| {
                let a = Point2::new(rng.uniform() - 0.5, rng.uniform() - 0.5);
                let x =
                    pose().rotation * (a.to_homogeneous() * depth) + pose().direction.into_inner();
                (a, Point2::new(x.x / x.z, x.y / x.z))
            })
            .collect()
    }

    #[test]
    fn depths_are_those_of_the_scene() {
        let truth = [1.0, 2.5, 10.0, 49.0, 200.0, -3.0, 5.0, 6.0, 7.0, 8.0, 9.0];
        let pairs = seen(&truth);
        for depths in [triangulate_depths, ray_depths] {
            let (mut a, mut b) = (vec![0.0; 11], vec![0.0; 11]);
            depths(&pose(), &pairs, &mut a, &mut b);
            for i in 0..11 {
                let expected = truth[i];
                assert!((a[i] / expected - 1.0).abs() < 1e-6, "{} {expected}", a[i]);
                let x = pose().rotation * (pairs.get(i).0.to_homogeneous() * truth[i]);
                let expected = x.z + pose().direction.z;
                assert!((b[i] / expected - 1.0).abs() < 1e-6, "{} {expected}", b[i]);
            }
        }
    }

    #[test]
    fn only_points_in_front_and_not_too_far_support_a_pose() {
        let pairs = seen(&[2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 60.0, -3.0]);
        for sign in [1.0, -1.0] {
            let e = essential_from_pose(&pose()) * sign;
            let (found, support) = choose_pose(&e, &pairs, 50.0).unwrap();
            assert!(found.error(&pose()).max() < 1e-7);
            assert_eq!(support, 6);
        }
    }

    #[test]
    fn nothing_supports_a_pose_where_there_is_nothing() {
        let e = essential_from_pose(&pose());
        assert_eq!(choose_pose(&e, &PointPairs::default(), 50.0).unwrap().1, 0);
        let nan = Point2::new(f64::NAN, 0.0);
        let pairs: PointPairs = [(nan, nan)].into_iter().collect();
        assert_eq!(choose_pose(&e, &pairs, 50.0).unwrap().1, 0);
        assert_eq!(choose_pose(&Matrix3::zeros(), &pairs, 50.0), None);
    }

    #[test]
    #[should_panic(expected = "one entry for each match")]
    fn depths_need_room_for_each_match() {
        let pairs: PointPairs = [(Point2::origin(), Point2::origin()); 3]
            .into_iter()
            .collect();
        ray_depths(&pose(), &pairs, &mut [0.0; 2], &mut [0.0; 2]);
    }

    #[test]
    fn of_poses_with_as_much_support_the_first_is_chosen() {
        let essential = essential_from_pose(&pose());
        let poses = decompose_essential(&essential).expect("four poses");
        let chosen = choose_pose(&essential, &PointPairs::default(), 50.0);
        assert_eq!(chosen, Some((poses[0], 0)));
    }
}
