//! The essential matrix of two views, from five matches at a time.
//!
//! Nistér, "An Efficient Solution to the Five-Point Relative Pose Problem", IEEE Transactions on Pattern Analysis
//! and Machine Intelligence 26(6), 2004.
//!
//! Matches are points at depth 1, so calibration and lens distortion are undone already. Five of them give up to
//! ten essential matrices ([`five_point_of_each`], eight samples at a time). A residual is the squared Sampson
//! distance of a match.

use std::ops::Range;

use nalgebra::Matrix3;

use super::consensus::{NEAR, inliers_within, near};
use super::plane_poses::plane_poses;
use super::pose_probabilities::pose_probabilities;
use super::{KeypointChanges, Problem};
use crate::geometry::solvers::{FivePoints, SAMPLES_AT_ONCE, Solutions, five_point_of_each};
use crate::geometry::{
    Loss, PointPairs, RelativePose, decompose_essential, essential_from_pose, ray_depths,
    refine_pose, squared_sampson_distances,
};
use crate::seed::Rng;

/// The problem of an essential matrix; residuals are squared Sampson distances.
#[derive(Clone, Copy, Debug)]
pub struct EssentialProblem<'a> {
    /// The matches, at depth 1.
    pub pairs: &'a PointPairs,
    /// Whether scene points must lie in front of both cameras. Then a model is dropped unless the matches of its own
    /// sample [agree in orientation](crate::geometry::agree_in_orientation): under one of its poses, both depths of
    /// each have the same sign. Matches with a negative depth of less than 50 baselines under the best of the four poses
    /// count neither for the quality of a model nor for the number of its inliers. They stay in the list
    /// [`Consensus::inliers`](super::Consensus::inliers). A score that counts distances beyond its threshold
    /// ([`EvenMarginal`](super::EvenMarginal)) still counts such matches there.
    pub cheirality: bool,
    /// Whether the best pose is compared with the poses that a plane of its inliers allows.
    pub plane_poses: bool,
    /// How the keypoints of each match turned and grew, by which a match is [trusted](Problem::trust) more or less;
    /// `None` if it is not known, or not to be used.
    pub changes: Option<&'a KeypointChanges>,
    /// Which poses are [hopeless](Problem::is_hopeless); `None` if none is.
    pub hopeless: Option<Hopeless>,
}

/// Poses that are hardly right, by their [probability](super::PoseProbabilities).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hopeless {
    /// A pose is hopeless if the probability that it is right is below this.
    pub below: f64,
    /// Pixels per unit at depth 1.
    pub pixels: f64,
}

impl Problem for EssentialProblem<'_> {
    type Model = Matrix3<f64>;
    type Models = Solutions<Matrix3<f64>, 10>;
    const SAMPLE: usize = 5;
    const BATCH: usize = SAMPLES_AT_ONCE;

    fn len(&self) -> usize {
        self.pairs.len()
    }

    fn solve(&self, sample: &[u32]) -> Self::Models {
        let mut models = Vec::with_capacity(1);
        self.solve_each(sample, &mut models);
        models[0]
    }

    fn solve_each(&self, samples: &[u32], models: &mut Vec<Self::Models>) {
        let count = samples.len() / Self::SAMPLE;
        let mut points = [FivePoints::default(); Self::BATCH];
        for (points, sample) in points.iter_mut().zip(samples.chunks_exact(Self::SAMPLE)) {
            for (i, &index) in sample.iter().enumerate() {
                (points[0][i], points[1][i]) = self.pairs.get(index as usize);
            }
        }
        five_point_of_each(&points[..count], self.cheirality, models);
    }

    fn squared_residuals(&self, model: &Matrix3<f64>, range: Range<usize>, out: &mut [f64]) {
        squared_sampson_distances(model, self.pairs, range, out);
    }

    fn exclude_impossible(
        &self,
        model: &Matrix3<f64>,
        squared_threshold: f64,
        squared_residuals: &mut [f64],
    ) -> bool {
        self.cheirality && exclude_behind(model, self.pairs, squared_threshold, squared_residuals)
    }

    fn rivals(
        &self,
        model: &Matrix3<f64>,
        squared_threshold: f64,
        rng: &mut Rng,
    ) -> Vec<Matrix3<f64>> {
        if !self.plane_poses {
            return Vec::new();
        }
        plane_poses(
            &near(self, self.pairs, model, squared_threshold),
            squared_threshold,
            rng,
        )
    }

    /// The distance of the two matrices as vectors of nine entries, each of length 1 and of either sign; at most the
    /// square root of two.
    fn distance(&self, one: &Matrix3<f64>, other: &Matrix3<f64>) -> f64 {
        let squared = one.norm_squared() * other.norm_squared();
        let cosine = one.dot(other).abs() / squared.sqrt();
        (2.0 - 2.0 * cosine).max(0.0).sqrt()
    }

    /// Matches behind a camera are not trusted at all.
    fn trust(
        &self,
        model: &Matrix3<f64>,
        squared_threshold: f64,
        squared_residuals: &[f64],
    ) -> Option<Vec<f64>> {
        let changes = self.changes?;
        let near = inliers_within(squared_residuals, 4.0 * squared_threshold);
        let seen = Seen::under(model, &self.pairs.chosen(&near))?;
        let trust_in = changes.trust_in(&seen.pose, self.pairs, &near, &seen.depths[0]);
        let mut trust = vec![0.0; self.pairs.len()];
        for (at, (&index, trust_in)) in near.iter().zip(trust_in).enumerate() {
            if !seen.is_behind(at) {
                trust[index as usize] = trust_in;
            }
        }
        Some(trust)
    }

    fn is_hopeless(&self, found: Option<(&Matrix3<f64>, f64)>) -> bool {
        let Some(Hopeless { below, pixels }) = self.hopeless else {
            return false;
        };
        let seen = found.and_then(|(model, squared_threshold)| {
            Seen::under(model, &near(self, self.pairs, model, squared_threshold))
        });
        seen.is_none_or(|seen| pose_probabilities(self.pairs, pixels, &seen.pose).right < below)
    }

    /// Minimises the truncated squared distance over poses, using the matches near the model.
    fn refine(
        &self,
        model: &Matrix3<f64>,
        squared_threshold: f64,
        steps: usize,
    ) -> Option<Matrix3<f64>> {
        // All four poses have the same distances.
        let start = decompose_essential(model)?[0];
        let near = near(self, self.pairs, model, NEAR * squared_threshold);
        let refined = refine_pose(&start, &near, Loss::Truncated, squared_threshold, steps);
        Some(essential_from_pose(&refined))
    }
}

/// Sets the residuals of inliers behind a camera to infinity. The pose is the one with most inliers in front of
/// both cameras. A point farther than [`UNCERTAIN_DEPTH`] is not excluded, since noise can move it to the other side.
fn exclude_behind(
    model: &Matrix3<f64>,
    pairs: &PointPairs,
    squared_threshold: f64,
    squared_residuals: &mut [f64],
) -> bool {
    let inliers = inliers_within(squared_residuals, squared_threshold);
    let Some(seen) = Seen::under(model, &pairs.chosen(&inliers)) else {
        return false;
    };
    let mut any = false;
    for (at, &index) in inliers.iter().enumerate() {
        if seen.is_behind(at) {
            squared_residuals[index as usize] = f64::INFINITY;
            any = true;
        }
    }
    any
}

/// Matches under one of the four poses of an essential matrix.
struct Seen {
    pose: RelativePose,
    /// Their depths in view `a` and in view `b`.
    depths: [Vec<f64>; 2],
}

impl Seen {
    /// The matches under the pose that has the fewest of them behind a camera. `None` if the matrix has no pose.
    fn under(model: &Matrix3<f64>, matches: &PointPairs) -> Option<Self> {
        let poses = decompose_essential(model)?;
        let depths = [0, 1].map(|rotation| {
            let mut depths = [vec![0.0; matches.len()], vec![0.0; matches.len()]];
            let [a, b] = &mut depths;
            ray_depths(&poses[rotation], matches, a, b);
            depths
        });
        // Poses 2 and 3 are 0 and 1 with the direction, hence all depths, reversed.
        let signed = [(0, 1.0), (1, 1.0), (0, -1.0), (1, -1.0)];
        let behind = |(rotation, sign): (usize, f64)| {
            let [a, b] = &depths[rotation];
            let depths = a.iter().zip(b);
            depths
                .filter(|&(a, b)| lies_behind(sign * a) | lies_behind(sign * b))
                .count()
        };
        let (pose, (rotation, sign)) =
            (poses.into_iter().zip(signed)).min_by_key(|&(_, signed)| behind(signed))?;
        let depths = depths[rotation]
            .each_ref()
            .map(|depths| depths.iter().map(|depth| sign * depth).collect());
        Some(Self { pose, depths })
    }

    /// Whether match number `at` lies behind a camera, and not so far away that noise may have moved it there.
    fn is_behind(&self, at: usize) -> bool {
        (self.depths.iter()).any(|depths| lies_behind(depths[at]))
    }
}

/// Whether a point at this depth lies behind the camera, and not so far away that noise may have moved it there.
fn lies_behind(depth: f64) -> bool {
    (-UNCERTAIN_DEPTH..0.0).contains(&depth)
}

/// Depth, in baselines, beyond which noise can flip its sign.
const UNCERTAIN_DEPTH: f64 = 50.0;

#[cfg(test)]
mod tests {
    use nalgebra::{Point2, UnitQuaternion, UnitVector3, Vector3};

    use super::*;
    use crate::geometry::RelativePose;

    #[test]
    fn what_lies_behind_a_camera_supports_nothing() {
        let pose = RelativePose {
            rotation: UnitQuaternion::from_euler_angles(0.1, -0.3, 0.2),
            direction: UnitVector3::new_normalize(Vector3::new(0.8, 0.1, 0.3)),
        };
        // Scene points at these depths in a; those below zero are behind camera a, and the last is too far to say.
        let depths = [2.0, 3.0, -3.0, 4.0, -0.5, 5.0, -1e4];
        let pairs: PointPairs = (depths.iter().enumerate())
            .map(|(i, &depth)| {
                let a = Point2::new(0.1 * i as f64 - 0.3, 0.02 * (i * i) as f64);
                let x = pose.rotation * (a.to_homogeneous() * depth) + pose.direction.into_inner();
                (a, Point2::new(x.x / x.z, x.y / x.z))
            })
            .collect();
        let e = essential_from_pose(&pose);
        let mut residuals = vec![0.0; depths.len()];
        let excluded = |cheirality, residuals: &mut [f64]| {
            let problem = EssentialProblem {
                pairs: &pairs,
                cheirality,
                plane_poses: false,
                changes: None,
                hopeless: None,
            };
            problem.squared_residuals(&e, 0..depths.len(), residuals);
            problem.exclude_impossible(&e, 1e-12, residuals)
        };
        assert!(!excluded(false, &mut residuals));
        assert!(residuals.iter().all(|&r| r < 1e-12));
        assert!(excluded(true, &mut residuals));
        let infinite: Vec<usize> = (0..depths.len())
            .filter(|&i| residuals[i].is_infinite())
            .collect();
        assert_eq!(infinite, [2, 4]);
        // No more are they trusted, whatever is known of keypoints.
        let changes = KeypointChanges::default();
        let problem = EssentialProblem {
            pairs: &pairs,
            cheirality: true,
            plane_poses: false,
            changes: Some(&changes),
            hopeless: None,
        };
        problem.squared_residuals(&e, 0..depths.len(), &mut residuals);
        // Those as far as twice the threshold are, and no farther ones.
        residuals[3] = 3.9e-12;
        residuals[5] = 4.1e-12;
        let trust = problem.trust(&e, 1e-12, &residuals);
        assert_eq!(trust, Some(vec![1.0, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0]));
    }

    #[test]
    fn the_distance_of_matrices_knows_no_length_and_no_sign() {
        let problem = EssentialProblem {
            pairs: &PointPairs::default(),
            cheirality: true,
            plane_poses: false,
            changes: None,
            hopeless: None,
        };
        let [x, y] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.1]].map(|at: [f64; 3]| {
            essential_from_pose(&RelativePose {
                rotation: UnitQuaternion::identity(),
                direction: UnitVector3::new_normalize(Vector3::from(at)),
            })
        });
        assert!(problem.distance(&x, &(-3.0 * x)) < 1e-7);
        let expected = (x / x.norm() - y / y.norm())
            .norm()
            .min((x / x.norm() + y / y.norm()).norm());
        assert!((problem.distance(&x, &y) - expected).abs() < 1e-9);
    }
}
