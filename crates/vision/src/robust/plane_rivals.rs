//! How a pose compares with the other poses that the plane of its matches allows.
//!
//! Matches on one plane allow two poses ([`essentials_of_plane`](crate::geometry::essentials_of_plane)). Often scene points
//! in front of both cameras rule one of them out, but not always. Then only matches off the plane tell, and where there are
//! none, both explain everything equally well and one is wrong. The local curvature of the cost does not show that.
//!
//! 1. If half of the near matches lie on a plane, its poses are refined over all near matches ([`plane_poses`]), and so is
//!    the given pose. A *rival* is one that is so far from the given pose that both cannot be right.
//! 2. The cost of a pose is the sum of squared distances of the near matches over the variance of their noise. A match
//!    behind a camera costs as much as one at the limit of near matches, and none costs more.
//! 3. A distance is that of noise across the epipolar line, and lines of two poses have different directions. So even if both
//!    poses are possible, the costs of `n` matches differ by chance, with a variance of at most `2 n + 2 n`. A difference of
//!    two standard deviations therefore says nothing. With `z` standard deviations more, each a factor of `e^2`, the share of
//!    the given pose is `1 / (1 + sum exp(-2 z))`: one half beside an equal rival, and 1 if some matches off the plane
//!    speak for it.
//!
//! | constant | value | source |
//! | --- | --- | --- |
//! | `BY_CHANCE` | 2 standard deviations | ours, as is the factor; not fitted to anything |

use super::plane_poses::plane_poses;
use crate::geometry::{
    Loss, PointPairs, RelativePose, choose_pose, essential_from_pose, ray_depths, refine_pose,
    squared_sampson_distances,
};
use crate::seed::Seed;

/// Steps of each refinement.
const STEPS: usize = 10;
/// How many standard deviations costs may differ by chance.
const BY_CHANCE: f64 = 2.0;
/// Logarithm of the factor by which each further standard deviation makes a pose more likely.
const EACH_FURTHER: f64 = 2.0;

/// The share of `pose` beside its rivals, from 0 to 1. The matches `near` have squared distances up to `squared_limit`
/// from it, and noise of this variance, in the squared unit of the points. Rivals are `apart` degrees from it, or more.
pub(super) fn share_beside_rivals(
    pose: &RelativePose,
    near: &PointPairs,
    squared_limit: f64,
    variance: f64,
    apart: f64,
) -> f64 {
    let refined =
        |start: &RelativePose| refine_pose(start, near, Loss::Truncated, squared_limit, STEPS);
    let rivals: Vec<RelativePose> = plane_poses(near, squared_limit, &mut Seed(0).rng())
        .iter()
        .filter_map(|essential| choose_pose(essential, near, f64::INFINITY))
        .map(|(start, _)| refined(&start))
        .filter(|rival| rival.error(pose).max().to_degrees() >= apart)
        .collect();
    if rivals.is_empty() {
        return 1.0;
    }
    let cost = |pose: &RelativePose| squared_distances(pose, near, squared_limit) / variance;
    let given = cost(&refined(pose));
    let deviation = 2.0 * (near.len() as f64).sqrt();
    let likelihood = |rival: &RelativePose| {
        let better = (given - cost(rival)) / deviation;
        let beyond_chance = better - better.clamp(-BY_CHANCE, BY_CHANCE);
        libm::exp(EACH_FURTHER * beyond_chance)
    };
    1.0 / (1.0 + rivals.iter().map(likelihood).sum::<f64>())
}

/// The sum of squared Sampson distances, none of which counts more than `limit`, and as much if a depth is negative.
fn squared_distances(pose: &RelativePose, pairs: &PointPairs, limit: f64) -> f64 {
    let mut squared = vec![0.0; pairs.len()];
    squared_sampson_distances(
        &essential_from_pose(pose),
        pairs,
        0..pairs.len(),
        &mut squared,
    );
    let (mut a, mut b) = (vec![0.0; pairs.len()], vec![0.0; pairs.len()]);
    ray_depths(pose, pairs, &mut a, &mut b);
    let depths = a.iter().zip(&b);
    let counted = depths.zip(squared).map(|((&a, &b), squared)| {
        let is_behind = a < 0.0 || b < 0.0;
        if is_behind { limit } else { squared.min(limit) }
    });
    counted.sum()
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point2, UnitQuaternion, UnitVector3, Vector3};

    use super::*;

    fn truth() -> RelativePose {
        RelativePose {
            rotation: UnitQuaternion::from_euler_angles(0.05, -0.1, 0.02),
            direction: UnitVector3::new_normalize(Vector3::new(0.3, 0.2, 0.9)),
        }
    }

    /// 200 matches, all but `off` of them on one plane, with noise of a standard deviation of 0.0005.
    fn matches(off: usize) -> PointPairs {
        noisy(off, 0.0005)
    }

    fn noisy(off: usize, deviation: f64) -> PointPairs {
        let mut rng = Seed(4).rng();
        let pairs = (0..200).map(|i| {
            let a = Point2::new(rng.uniform() - 0.5, rng.uniform() - 0.5);
            let ray = a.to_homogeneous();
            let plane = 4.0 / ray.dot(&Vector3::new(0.3, -0.2, 1.0));
            let depth = if i < off { 0.6 * plane } else { plane };
            let x = truth().rotation * (ray * depth) + truth().direction.into_inner();
            let mut noise = || deviation * rng.normal();
            (a, Point2::new(x.x / x.z + noise(), x.y / x.z + noise()))
        });
        pairs.collect()
    }

    fn share(pose: &RelativePose, pairs: &PointPairs) -> f64 {
        share_beside_rivals(pose, pairs, 0.004 * 0.004, 0.0005 * 0.0005, 10.0)
    }

    #[test]
    fn both_poses_of_a_plane_are_as_likely_and_a_few_matches_off_it_decide() {
        let pairs = matches(0);
        let both: Vec<RelativePose> = plane_poses(&pairs, 1e-6, &mut Seed(1).rng())
            .iter()
            .filter_map(|essential| choose_pose(essential, &pairs, f64::INFINITY))
            .map(|(pose, _)| pose)
            .collect();
        let (right, wrong): (Vec<_>, Vec<_>) =
            (both.into_iter()).partition(|pose| pose.error(&truth()).max().to_degrees() < 10.0);
        assert_eq!((right.len(), wrong.len()), (1, 1));
        for pose in [&right[0], &wrong[0]] {
            assert_eq!(share(pose, &pairs), 0.5);
        }
        let pairs = matches(8);
        let found = [&right[0], &wrong[0]].map(|pose| share(pose, &pairs));
        assert!(found[0] > 0.999 && found[1] < 0.001, "{found:?}");
    }

    #[test]
    fn no_match_at_all_has_no_rival() {
        assert_eq!(share(&truth(), &PointPairs::default()), 1.0);
    }

    /// Without noise all costs are known: each match off the plane costs the rival as much as any can.
    #[test]
    fn each_standard_deviation_beyond_two_makes_a_pose_more_likely_by_a_factor() {
        let (limit, most) = (1e-4_f64, 64.0);
        let share = |pose: &RelativePose, pairs: &PointPairs| {
            let squared = limit * limit;
            share_beside_rivals(pose, pairs, squared, squared / most, 10.0)
        };
        for off in [0, 1, 2, 3] {
            let pairs = noisy(off, 0.0);
            // The variance of 200 costs is 2 * 200 of either pose.
            let deviations = f64::from(off as u32) * most / 800.0_f64.sqrt();
            let expected = 1.0 / (1.0 + (-2.0 * (deviations - 2.0).max(0.0)).exp());
            let found = share(&truth(), &pairs);
            assert!((found - expected).abs() < 1e-6, "{off}: {found} {expected}");
            let other = plane_poses(&pairs, limit * limit, &mut Seed(1).rng())
                .iter()
                .filter_map(|essential| choose_pose(essential, &pairs, f64::INFINITY))
                .find(|(pose, _)| pose.error(&truth()).max().to_degrees() > 10.0);
            let found = share(&other.expect("a plane allows two poses").0, &pairs);
            assert!((found + expected - 1.0).abs() < 1e-6, "{off}: {found}");
            // The pose that is given counts as what it is refined to.
            let near = RelativePose {
                rotation: truth().rotation * UnitQuaternion::from_euler_angles(3e-5, 0.0, 0.0),
                ..truth()
            };
            let found = share(&near, &pairs);
            assert!((found - expected).abs() < 1e-6, "{off}: {found} {expected}");
        }
    }

    #[test]
    fn a_match_behind_either_camera_costs_as_much_as_one_far_from_its_line() {
        let along = |z: f64| RelativePose {
            rotation: UnitQuaternion::identity(),
            direction: UnitVector3::new_normalize(Vector3::new(0.0, 0.0, z)),
        };
        let cost = |z: f64, a: [f64; 2], b: [f64; 2]| {
            let pairs = [(Point2::from(a), Point2::from(b))].into_iter().collect();
            squared_distances(&along(z), &pairs, 0.01)
        };
        // At depth 3, and 4 from the camera that stepped back; then 0.03 beside its line.
        assert!(cost(1.0, [0.4, 0.0], [0.3, 0.0]) < 1e-30);
        let beside = (0.4_f64 * 0.03).powi(2) / (0.16 + 0.09 + 0.0009);
        assert!((cost(1.0, [0.4, 0.0], [0.3, 0.03]) - beside).abs() < 1e-12);
        // A quarter of a baseline before a or before b alone, which is not behind it.
        assert!(cost(1.0, [0.5, 0.0], [0.1, 0.0]) < 1e-30);
        assert!(cost(-1.0, [0.1, 0.0], [0.5, 0.0]) < 1e-30);
        // On its line, and half a baseline behind a or behind b alone.
        assert_eq!(cost(1.0, [0.2, 0.0], [-0.2, 0.0]), 0.01);
        assert_eq!(cost(-1.0, [0.2, 0.0], [-0.2, 0.0]), 0.01);
        assert_eq!(cost(1.0, [0.4, 0.0], [0.0, 0.9]), 0.01);
    }
}
