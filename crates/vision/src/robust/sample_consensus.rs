//! A pose estimator of parts: any score, any sampler, local optimisation and final refinement.
//!
//! Chum, Matas, Kittler, "Locally Optimized RANSAC", DAGM 2003; Lebeda, Matas, Chum, "Fixing the
//! Locally Optimized RANSAC", BMVC 2012; and the papers of the parts (see [`Msac`], [`Prosac`],
//! [`refine_pose`]).
//!
//! 1. Matched pixels become points at depth 1, each by its own camera, lens distortion undone.
//! 2. [`consensus_until`] over minimal samples finds the best essential matrix; each new best one is
//!    improved on the tangent space of poses, with a truncated loss.
//! 3. A final refinement over the matches near the result, with the loss of choice.
//! 4. The inliers decide which of the four poses it is ([`choose_pose`]); then all matches in front
//!    of both cameras are counted as its support.
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | | `score` | MSAC | Lebeda et al. |
//! | | `sampler` | uniform | |
//! | p | `confidence` | 0.999 | the benchmark's protocol |
//! | t | `threshold_px` | 1.0 | the benchmark's protocol |
//! | | `min_iterations` | 50 | Lebeda et al.: the first models are not worth optimising |
//! | | `max_iterations` | 1000 | the benchmark's protocol |
//! | | `local_steps` | 10 | ours |
//! | | `final_loss` | truncated | |
//! | | `final_steps` | 25 | ours |
//! | | `prosac_horizon` | 200,000 | Chum, Matas, CVPR 2005 |
//! | | `cells` | 20 | GMS's grid |
//! | | `max_depth` | 50 | OpenCV 4's `recoverPose` |
//!
//! *Choices the papers leave open*: local optimisation is non-linear from the start instead of
//! inner samples of a larger size, since five degrees of freedom and the truncated loss leave the
//! non-minimal linear solvers no advantage.

use nalgebra::Matrix3;

use super::essential_problem::near;
use super::{
    Consensus, ConsensusParams, EssentialProblem, Extras, InlierCount, Msac, NoPose, PoseEstimate,
    PoseEstimator, Problem, Prosac, Sampler, Score, Spread, TwoViews, Uniform, consensus_until,
};
use crate::geometry::{
    Loss, PointPairs, RelativePose, choose_pose, decompose_essential, essential_from_pose,
    refine_pose, squared_sampson_distances, triangulate_depths,
};
use crate::params::ParamError;
use crate::seed::Seed;

/// Which model is best.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum ScoreKind {
    /// [`InlierCount`].
    InlierCount,
    /// [`Msac`].
    Msac,
}

/// What is tried next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum SamplerKind {
    /// [`Uniform`].
    Uniform,
    /// [`Prosac`].
    Prosac,
    /// [`Spread`].
    Spread,
}

/// Parameters of [`SampleConsensus`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct SampleConsensusParams {
    /// Which model is best.
    pub score: ScoreKind,
    /// What is tried next.
    pub sampler: SamplerKind,
    /// Wanted probability that at least one sample was free of wrong matches, in `[0, 1)`.
    pub confidence: f64,
    /// Largest Sampson distance of an inlier, in pixels.
    pub threshold_px: f64,
    /// Samples drawn at least.
    pub min_iterations: usize,
    /// Samples drawn at most.
    pub max_iterations: usize,
    /// Steps of each local optimisation; 0 for none.
    pub local_steps: usize,
    /// Loss of the final refinement; its scale is the threshold.
    pub final_loss: Loss,
    /// Steps of the final refinement; 0 for none.
    pub final_steps: usize,
    /// Samples after which the progressive sampler is uniform.
    pub prosac_horizon: usize,
    /// Cells across and down of the spatially even sampler.
    pub cells: u32,
    /// Scene points farther than this, in baselines, do not support a pose.
    pub max_depth: f64,
}

impl Default for SampleConsensusParams {
    fn default() -> Self {
        Self {
            score: ScoreKind::Msac,
            sampler: SamplerKind::Uniform,
            confidence: 0.999,
            threshold_px: 1.0,
            min_iterations: 50,
            max_iterations: 1000,
            local_steps: 10,
            final_loss: Loss::Truncated,
            final_steps: 25,
            prosac_horizon: 200_000,
            cells: 20,
            max_depth: 50.0,
        }
    }
}

/// Sample consensus of chosen parts.
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
        let p = &params;
        ParamError::unless(
            (0.0..1.0).contains(&p.confidence),
            "confidence",
            p.confidence,
            "at least 0 and below 1",
        )?;
        ParamError::unless(
            p.threshold_px > 0.0 && p.threshold_px.is_finite(),
            "threshold_px",
            p.threshold_px,
            "positive and finite",
        )?;
        ParamError::unless(
            p.max_iterations > 0,
            "max_iterations",
            p.max_iterations,
            "at least 1",
        )?;
        ParamError::unless(
            p.min_iterations <= p.max_iterations,
            "min_iterations",
            p.min_iterations,
            "at most `max_iterations`",
        )?;
        for (name, steps) in [
            ("local_steps", p.local_steps),
            ("final_steps", p.final_steps),
        ] {
            ParamError::unless(steps <= 1000, name, steps, "0 to 1000")?;
        }
        ParamError::unless(
            p.prosac_horizon > 0,
            "prosac_horizon",
            p.prosac_horizon,
            "at least 1",
        )?;
        ParamError::unless((1..=1000).contains(&p.cells), "cells", p.cells, "1 to 1000")?;
        // Infinity is allowed: no limit.
        ParamError::unless(p.max_depth > 0.0, "max_depth", p.max_depth, "positive")?;
        Ok(Self { params })
    }

    fn search(
        &self,
        pairs: &PointPairs,
        ambiguity: &[f32],
        squared_threshold: f64,
        seed: Seed,
        stop: &dyn Fn(usize) -> bool,
    ) -> Option<Consensus<Matrix3<f64>>> {
        let run = Run {
            params: &self.params,
            problem: EssentialProblem { pairs },
            seed,
            stop,
        };
        match self.params.sampler {
            SamplerKind::Uniform => run.with(squared_threshold, Uniform::new(pairs.len())),
            SamplerKind::Prosac => {
                assert_eq!(ambiguity.len(), pairs.len(), "an ambiguity for each match");
                let sampler = Prosac::new(ambiguity, self.params.prosac_horizon);
                run.with(squared_threshold, sampler)
            }
            SamplerKind::Spread => {
                run.with(squared_threshold, Spread::new(pairs, self.params.cells))
            }
        }
    }

    /// The refined model and the matches within the threshold of it.
    fn finish(
        &self,
        found: Consensus<Matrix3<f64>>,
        pairs: &PointPairs,
    ) -> (Matrix3<f64>, Vec<u32>) {
        let limit = found.support.squared_threshold;
        let Some([start, ..]) = decompose_essential(&found.model) else {
            return (found.model, found.inliers);
        };
        if self.params.final_steps == 0 {
            return (found.model, found.inliers);
        }
        let near = near(pairs, &found.model, NEAR * limit);
        let pose = refine_pose(
            &start,
            &near,
            self.params.final_loss,
            limit,
            self.params.final_steps,
        );
        let model = essential_from_pose(&pose);
        let mut residuals = vec![0.0; pairs.len()];
        squared_sampson_distances(&model, pairs, 0..pairs.len(), &mut residuals);
        let inliers = (0_u32..)
            .zip(&residuals)
            .filter(|&(_, &residual)| residual <= limit)
            .map(|(index, _)| index)
            .collect();
        (model, inliers)
    }
}

/// The final refinement takes the matches within this multiple of the squared threshold.
const NEAR: f64 = 16.0;

/// One search, but for its score and sampler.
struct Run<'a> {
    params: &'a SampleConsensusParams,
    problem: EssentialProblem<'a>,
    seed: Seed,
    stop: &'a dyn Fn(usize) -> bool,
}

impl Run<'_> {
    fn with(
        &self,
        squared_threshold: f64,
        sampler: impl Sampler,
    ) -> Option<Consensus<Matrix3<f64>>> {
        match self.params.score {
            ScoreKind::InlierCount => self.go(&InlierCount { squared_threshold }, sampler),
            ScoreKind::Msac => self.go(&Msac { squared_threshold }, sampler),
        }
    }

    fn go(&self, score: &impl Score, mut sampler: impl Sampler) -> Option<Consensus<Matrix3<f64>>> {
        consensus_until(
            &self.problem,
            score,
            &mut sampler,
            ConsensusParams {
                confidence: self.params.confidence,
                max_samples: self.params.max_iterations,
            },
            Extras {
                min_samples: self.params.min_iterations,
                local_steps: self.params.local_steps,
            },
            &mut self.seed.rng(),
            self.stop,
        )
    }
}

/// Number of matches in front of both cameras, nearer than `max_depth`.
fn support(pose: &RelativePose, pairs: &PointPairs, max_depth: f64) -> usize {
    let mut depths = (vec![0.0; pairs.len()], vec![0.0; pairs.len()]);
    triangulate_depths(pose, pairs, &mut depths.0, &mut depths.1);
    let within = |depth: f64| depth > 0.0 && depth < max_depth;
    (depths.0.iter().zip(&depths.1))
        .filter(|&(&a, &b)| within(a) && within(b))
        .count()
}

impl PoseEstimator for SampleConsensus {
    fn estimate(&self, views: TwoViews<'_>, seed: Seed) -> Result<PoseEstimate, NoPose> {
        self.estimate_until(views, seed, &|_| false)
    }

    fn estimate_until(
        &self,
        views: TwoViews<'_>,
        seed: Seed,
        stop: &dyn Fn(usize) -> bool,
    ) -> Result<PoseEstimate, NoPose> {
        let pairs = views.at_depth_1();
        let needed = EssentialProblem::SAMPLE;
        if pairs.len() < needed {
            return Err(NoPose::TooFewMatches {
                found: pairs.len(),
                needed,
            });
        }
        let focal = f64::midpoint(views.camera_a.mean_focal(), views.camera_b.mean_focal());
        let threshold = self.params.threshold_px / focal;
        let found = self
            .search(&pairs, views.ambiguity, threshold * threshold, seed, stop)
            .ok_or(NoPose::NoSupport { found: 0, needed })?;
        let iterations = found.samples;
        let (model, inliers) = self.finish(found, &pairs);
        let agreeing: PointPairs = inliers.iter().map(|&i| pairs.get(i as usize)).collect();
        let b_from_a = match choose_pose(&model, &agreeing, self.params.max_depth) {
            Some((pose, support)) if support > 0 => pose,
            // No inlier is near enough: then all matches decide.
            _ => match choose_pose(&model, &pairs, self.params.max_depth) {
                Some((pose, support)) if support > 0 => pose,
                _ => {
                    return Err(NoPose::NoSupport {
                        found: 0,
                        needed: 1,
                    });
                }
            },
        };
        let support = support(&b_from_a, &pairs, self.params.max_depth);
        Ok(PoseEstimate {
            b_from_a,
            inliers,
            support,
            iterations,
        })
    }
}

#[cfg(test)]
mod tests;
