//! A pose estimator of parts: any score, any sampler, local optimisation and final refinement.
//!
//! Chum, Matas, Kittler, "Locally Optimized RANSAC", DAGM 2003; Lebeda, Matas, Chum, "Fixing the
//! Locally Optimized RANSAC", BMVC 2012; and the papers of the parts (see [`Msac`](super::Msac),
//! [`Prosac`](super::Prosac), [`refine_pose`]).
//!
//! 1. Matched pixels become points at depth 1, each by its own camera, lens distortion undone. Distances can be
//!    measured in units of the image all the same (see [`Covariances`](crate::geometry::Covariances)).
//! 2. [`consensus_until`](super::consensus_until) over minimal samples finds the best essential matrix. Each new
//!    best one is improved on the tangent space of poses, with a truncated loss. With `geometry.plane_poses`, the
//!    best is compared in the end with the poses that a plane of its inliers allows.
//! 3. A final refinement over the matches near the result, with the loss of choice.
//! 4. The inliers decide which of the four poses it is ([`choose_pose`]): those near enough to support one, or those at
//!    any depth where fewer than a tenth are. Then all matches in front of both cameras are counted as its support. If no
//!    match at all is near enough, there is no pose.
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | | `score` | [`Score::Msac`](super::Score::Msac) | Lebeda et al. |
//! | | `sampler` | [`Sampler::Uniform`](super::Sampler::Uniform) | |
//! | p | `early_stop.confidence` | 0.999 | the benchmark's protocol |
//! | t | `score.threshold_px` | 1.0 | the benchmark's protocol |
//! | | `geometry.cheirality` | yes | Chum, Werner, Matas, ICPR 2004; Hartley, Zisserman, sec. 9.6.3 |
//! | | `geometry.plane_poses` | no | ours |
//! | | `geometry.tangent_sampson` | no | Terekhov, Larsson, ICCV 2023 |
//! | | `geometry.hypotheses` | 1 | ours |
//! | | `geometry.hopeless` | 0 | ours |
//! | | `geometry.degensac` | yes | Chum, Werner, Matas, CVPR 2005 |
//! | | `score.sprt` | yes | Matas, Chum, ICCV 2005 |
//! | | `early_stop.min_iterations` | 50 | ours; as many as Lebeda et al. draw before they optimise |
//! | | `max_iterations` | 1000 | the benchmark's protocol |
//! | | `local_steps` | 10 | ours |
//! | | `final_refinement.loss` | truncated | |
//! | | `final_refinement.steps` | 25 | ours |
//! | | `sampler.horizon` (PROSAC) | 200,000 | Chum, Matas, CVPR 2005 |
//! | | `sampler.cells` (spread) | 20 | GMS's grid |
//! | | `score.cells` (even MSAC) | 10 | tuned on the kitchen of 7-Scenes |
//! | | `score.turns` (even MSAC) | no | Jegou, Douze, Schmid, ECCV 2008, adapted |
//! | | `max_depth` | 50 | OpenCV 4's `recoverPose` |
//!
//! *Choices the papers leave open*: local optimisation is non-linear from the start, where the papers fit linear
//! models to inner samples of a larger size. A pose has only five degrees of freedom, and with the truncated loss
//! non-minimal linear solvers have no advantage.
//!
//! *Differs* from Lebeda et al.: their local optimisation begins after 50 samples, ours with the first (see
//! [`consensus_until`](super::consensus_until)). `min_iterations` only says how many samples are drawn at least.

mod params;
#[cfg(feature = "serde")]
mod settings;

use nalgebra::Matrix3;

pub use params::{Geometry, SampleConsensusParams};

use super::consensus::inliers_within;
use super::grid::FAR_AT_DEPTH_1;
use super::search::{DistanceFrom, Shuffled, Task, squared_cauchy_scale};
use super::{
    Consensus, EssentialProblem, FundamentalProblem, Hopeless, NoModel, PoseEstimate,
    PoseEstimator, Problem, TwoViews,
};
use crate::geometry::{
    Loss, PointPairs, RelativePose, choose_pose, decompose_essential, essential_from_pose,
    pose_support, refine_pose, squared_sampson_distances,
};
use crate::params::ParamError;
use crate::seed::Seed;

/// Sample consensus for poses, combined from parts. [`presets`](crate::robust::presets) has named combinations.
#[derive(Clone, Copy, Debug)]
pub struct SampleConsensus {
    params: SampleConsensusParams,
}

impl SampleConsensus {
    /// An estimator with these parameters.
    ///
    /// # Errors
    /// If one of them is out of its range.
    pub fn new(params: SampleConsensusParams) -> Result<Self, ParamError> {
        params.check()?;
        Ok(Self { params })
    }

    /// The best model of all samples, before the final refinement. The matches are those of the `views`.
    fn search(
        &self,
        matches: &Shuffled,
        views: TwoViews<'_>,
        seed: Seed,
        stop: &dyn Fn(usize) -> bool,
    ) -> Option<Consensus<Matrix3<f64>>> {
        let pairs = &matches.pairs;
        let focal_ratio = views.camera_b.mean_focal() / views.camera_a.mean_focal();
        let hypotheses = self.params.hypotheses();
        let changes = (hypotheses > 1)
            .then(|| matches.changes_at_depth_1(focal_ratio))
            .flatten();
        let task = Task {
            search: self.params.search(),
            matches,
            pixels: views.mean_focal(),
            far: FAR_AT_DEPTH_1,
            // Several can be compared only where something is known of keypoints.
            hypotheses: changes.as_ref().map_or(1, |_| hypotheses),
            seed,
            stop,
        };
        match self.params.geometry {
            Geometry::Essential {
                cheirality,
                plane_poses,
                hopeless,
                ..
            } => task.solve(&EssentialProblem {
                pairs,
                cheirality,
                plane_poses,
                changes: changes.as_ref(),
                hopeless: (hopeless > 0.0).then(|| Hopeless {
                    below: hopeless,
                    pixels: views.mean_focal(),
                }),
            }),
            Geometry::Fundamental { degensac } => {
                task.solve(&FundamentalProblem { pairs, degensac })
            }
        }
    }

    /// The refined model and the matches within the threshold of it.
    fn finish(
        &self,
        found: Consensus<Matrix3<f64>>,
        pairs: &PointPairs,
    ) -> (Matrix3<f64>, Vec<u32>) {
        let squared_threshold = found.support.squared_threshold;
        let (Some(refinement), Some([start, ..])) = (
            self.params.final_refinement,
            decompose_essential(&found.model),
        ) else {
            return (found.model, found.inliers);
        };
        let mut residuals = vec![0.0; pairs.len()];
        squared_sampson_distances(&found.model, pairs, 0..pairs.len(), &mut residuals);
        let squared_scale = match refinement.loss {
            Loss::Truncated => squared_threshold,
            Loss::Cauchy => squared_cauchy_scale(&residuals, &found.inliers, DistanceFrom::Line)
                .min(squared_threshold),
        };
        let reach = self.params.score.reach() * squared_threshold;
        let near = pairs.chosen(&inliers_within(&residuals, reach));
        let pose = refine_pose(
            &start,
            &near,
            refinement.loss,
            squared_scale,
            refinement.steps,
        );
        let model = essential_from_pose(&pose);
        squared_sampson_distances(&model, pairs, 0..pairs.len(), &mut residuals);
        (model, inliers_within(&residuals, squared_threshold))
    }

    /// The pose of an essential matrix that its inliers choose; or all matches, if no inlier is near enough. `None` if
    /// they support none either. With a short baseline nearly all inliers lie beyond `max_depth`, and wrong matches,
    /// which seem near, would choose: then inliers at any depth do.
    fn pose_of(
        &self,
        model: &Matrix3<f64>,
        inliers: &PointPairs,
        pairs: &PointPairs,
    ) -> Option<RelativePose> {
        let near = |pairs| supported(model, pairs, self.params.max_depth);
        let (pose, support) = near(inliers).or_else(|| near(pairs).map(|(pose, _)| (pose, 0)))?;
        if NEAR_ENOUGH * support >= inliers.len() {
            return Some(pose);
        }
        let far = supported(model, inliers, f64::INFINITY);
        Some(far.map_or(pose, |(pose, _)| pose))
    }
}

/// One of so many inliers must support a pose, or inliers at any depth choose it.
const NEAR_ENOUGH: usize = 10;

/// The pose that most matches support, and how many do, if any does ([`choose_pose`]).
fn supported(
    model: &Matrix3<f64>,
    pairs: &PointPairs,
    max_depth: f64,
) -> Option<(RelativePose, usize)> {
    choose_pose(model, pairs, max_depth).filter(|&(_, support)| support > 0)
}

impl PoseEstimator for SampleConsensus {
    fn estimate(&self, views: TwoViews<'_>, seed: Seed) -> Result<PoseEstimate, NoModel> {
        self.estimate_until(views, seed, &|_| false)
    }

    fn estimate_until(
        &self,
        views: TwoViews<'_>,
        seed: Seed,
        stop: &dyn Fn(usize) -> bool,
    ) -> Result<PoseEstimate, NoModel> {
        let order = seed.child("order");
        let (given, needed) = match self.params.geometry {
            Geometry::Essential {
                tangent_sampson: true,
                ..
            } => (
                views.at_depth_1_with_covariances(),
                EssentialProblem::SAMPLE,
            ),
            Geometry::Essential { .. } => (views.at_depth_1(), EssentialProblem::SAMPLE),
            Geometry::Fundamental { .. } => (views.at_depth_1(), FundamentalProblem::SAMPLE),
        };
        let matches = Shuffled::new(&given, views.points, self.params.score, order);
        let pairs = &matches.pairs;
        if pairs.len() < needed {
            return Err(NoModel::TooFewMatches {
                found: pairs.len(),
                needed,
            });
        }
        let found = self
            .search(&matches, views, seed, stop)
            .ok_or(NoModel::none_found(needed))?;
        let iterations = found.samples;
        let (model, inliers) = self.finish(found, pairs);
        let agreeing = pairs.chosen(&inliers);
        let b_from_a = self
            .pose_of(&model, &agreeing, pairs)
            .ok_or(NoModel::NOTHING_IN_FRONT)?;
        let support = pose_support(&b_from_a, pairs, self.params.max_depth);
        Ok(PoseEstimate {
            b_from_a,
            inliers: matches.before(&inliers),
            support,
            iterations,
        })
    }
}

#[cfg(test)]
mod tests;
