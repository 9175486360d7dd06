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
//! | | `score` | [`Score::Msac`] | Lebeda et al. |
//! | | `sampler` | [`Sampler::Uniform`] | |
//! | p | `early_stop.confidence` | 0.999 | the benchmark's protocol |
//! | t | `score.threshold_px` | 1.0 | the benchmark's protocol |
//! | | `geometry.cheirality` | yes | Chum, Werner, Matas, ICPR 2004; Hartley, Zisserman, sec. 9.6.3 |
//! | | `geometry.degensac` | yes | Chum, Werner, Matas, CVPR 2005 |
//! | | `score.sprt` | yes | Matas, Chum, ICCV 2005 |
//! | | `early_stop.min_iterations` | 50 | Lebeda et al.: the first models are not worth optimising |
//! | | `max_iterations` | 1000 | the benchmark's protocol |
//! | | `local_steps` | 10 | ours |
//! | | `final_refinement.loss` | truncated | |
//! | | `final_refinement.steps` | 25 | ours |
//! | | `sampler.horizon` (PROSAC) | 200,000 | Chum, Matas, CVPR 2005 |
//! | | `sampler.cells` (spread) | 20 | GMS's grid |
//! | | `score.cells` (even MSAC) | 10 | tuned on the kitchen of 7-Scenes |
//! | | `max_depth` | 50 | OpenCV 4's `recoverPose` |
//!
//! *Choices the papers leave open*: local optimisation is non-linear from the start instead of
//! inner samples of a larger size, since five degrees of freedom and the truncated loss leave the
//! non-minimal linear solvers no advantage.

mod params;
#[cfg(feature = "serde")]
mod settings;

use nalgebra::Matrix3;

pub use params::{EarlyStop, FinalRefinement, Geometry, SampleConsensusParams, Sampler, Score};
#[cfg(feature = "serde")]
pub use settings::{GeometryName, SamplerName, ScoreName, Settings};

use super::consensus::inliers_within;
use super::essential_problem::near;
use super::{
    Consensus, ConsensusParams, EssentialProblem, EvenMsac, EvenSampler, Extras,
    FundamentalProblem, InlierCount, Magsac, MedianOfSquares, Mlesac, Msac, NoPose, PoseEstimate,
    PoseEstimator, Problem, Prosac, Sampling, Scoring, TwoViews, Uniform, consensus_until,
};
use crate::geometry::{
    Loss, PointPairs, RelativePose, choose_pose, decompose_essential, essential_from_pose,
    refine_pose, squared_sampson_distances, triangulate_depths,
};
use crate::params::ParamError;
use crate::seed::Seed;

/// Sample consensus of chosen parts: [`presets`](crate::robust::presets) has combinations with names.
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

    /// The best model by samples, before the final refinement; `focal` takes units of depth 1 to pixels.
    fn search(
        &self,
        pairs: &PointPairs,
        ambiguity: &[f32],
        focal: f64,
        seed: Seed,
        stop: &dyn Fn(usize) -> bool,
    ) -> Option<Consensus<Matrix3<f64>>> {
        let task = Task {
            params: &self.params,
            pairs,
            ambiguity,
            focal,
            seed,
            stop,
        };
        match self.params.geometry {
            Geometry::Essential { cheirality } => {
                task.solve(&EssentialProblem { pairs, cheirality })
            }
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
        let limit = found.support.squared_threshold;
        let (Some(refinement), Some([start, ..])) = (
            self.params.final_refinement,
            decompose_essential(&found.model),
        ) else {
            return (found.model, found.inliers);
        };
        let near = near(pairs, &found.model, NEAR * limit);
        let squared_scale = match refinement.loss {
            Loss::Truncated => limit,
            Loss::Cauchy => squared_cauchy_scale(&found, pairs).min(limit),
        };
        let pose = refine_pose(
            &start,
            &near,
            refinement.loss,
            squared_scale,
            refinement.steps,
        );
        let model = essential_from_pose(&pose);
        let mut residuals = vec![0.0; pairs.len()];
        squared_sampson_distances(&model, pairs, 0..pairs.len(), &mut residuals);
        (model, inliers_within(&residuals, limit))
    }
}

/// The numbers below `count` in random order: the sequential test wants data so, and what comes from
/// a detector is sorted by place or by scale.
fn shuffled(count: usize, seed: Seed) -> Vec<u32> {
    let count = u32::try_from(count).expect("matches are numbered by u32");
    let mut order: Vec<u32> = (0..count).collect();
    seed.rng().shuffle(&mut order);
    order
}

/// The final refinement takes the matches within this multiple of the squared threshold.
const NEAR: f64 = 4.0;

/// The square of the scale at which Cauchy's loss keeps 95 % of the efficiency of least squares:
/// 2.385 standard deviations (Holland, Welsch, "Robust Regression Using Iteratively Reweighted Least-Squares",
/// Communications in Statistics 6(9), 1977), of which 1.4826 medians of the inliers' distances
/// are an estimate.
fn squared_cauchy_scale(found: &Consensus<Matrix3<f64>>, pairs: &PointPairs) -> f64 {
    let inliers: PointPairs = (found.inliers.iter())
        .map(|&index| pairs.get(index as usize))
        .collect();
    let mut squared = vec![0.0; inliers.len()];
    squared_sampson_distances(&found.model, &inliers, 0..inliers.len(), &mut squared);
    if squared.is_empty() {
        return f64::MIN_POSITIVE;
    }
    let middle = squared.len() / 2;
    let (_, median, _) = squared.select_nth_unstable_by(middle, f64::total_cmp);
    let factor = 2.385 * 1.4826;
    // Exact matches have no scale; any positive one will do.
    (factor * factor * *median).max(f64::MIN_POSITIVE)
}

/// One search: everything but the problem, the score and the sampler, which are types.
struct Task<'a> {
    params: &'a SampleConsensusParams,
    pairs: &'a PointPairs,
    ambiguity: &'a [f32],
    focal: f64,
    seed: Seed,
    stop: &'a dyn Fn(usize) -> bool,
}

impl Task<'_> {
    fn solve<P>(&self, problem: &P) -> Option<Consensus<Matrix3<f64>>>
    where
        P: Problem<Model = Matrix3<f64>>,
    {
        let squared = |threshold_px: f64| {
            let threshold = threshold_px / self.focal;
            threshold * threshold
        };
        match self.params.score {
            Score::InlierCount { threshold_px, sprt } => {
                let squared_threshold = squared(threshold_px);
                self.sampled(problem, &InlierCount { squared_threshold }, sprt)
            }
            Score::Msac { threshold_px, sprt } => {
                let squared_threshold = squared(threshold_px);
                self.sampled(problem, &Msac { squared_threshold }, sprt)
            }
            Score::EvenMsac {
                threshold_px,
                cells,
                sprt,
            } => {
                let score = EvenMsac::new(self.pairs, cells, squared(threshold_px));
                self.sampled(problem, &score, sprt)
            }
            Score::Magsac { threshold_px, sprt } => {
                self.sampled(problem, &Magsac::new(squared(threshold_px)), sprt)
            }
            Score::Mlesac { threshold_px } => {
                let score = Mlesac {
                    squared_threshold: squared(threshold_px),
                    span: diagonal(self.pairs).max(f64::MIN_POSITIVE),
                };
                self.sampled(problem, &score, false)
            }
            Score::Lmeds => self.sampled(problem, &MedianOfSquares { sample: P::SAMPLE }, false),
        }
    }

    fn sampled<P>(
        &self,
        problem: &P,
        score: &impl Scoring,
        sprt: bool,
    ) -> Option<Consensus<Matrix3<f64>>>
    where
        P: Problem<Model = Matrix3<f64>>,
    {
        match self.params.sampler {
            Sampler::Uniform => self.run(problem, score, sprt, &mut Uniform::new(self.pairs.len())),
            Sampler::Prosac { horizon } => self.run(
                problem,
                score,
                sprt,
                &mut Prosac::new(self.ambiguity, horizon),
            ),
            Sampler::Spread { cells } => self.run(
                problem,
                score,
                sprt,
                &mut EvenSampler::new(self.pairs, cells),
            ),
        }
    }

    fn run<P>(
        &self,
        problem: &P,
        score: &impl Scoring,
        sprt: bool,
        sampler: &mut impl Sampling,
    ) -> Option<Consensus<Matrix3<f64>>>
    where
        P: Problem<Model = Matrix3<f64>>,
    {
        let max_samples = self.params.max_iterations;
        // Whatever the confidence, a least number of samples that is the largest one leaves none out.
        let stop_early = self.params.early_stop.unwrap_or(EarlyStop {
            confidence: 0.0,
            min_iterations: max_samples,
        });
        consensus_until(
            problem,
            score,
            sampler,
            ConsensusParams {
                confidence: stop_early.confidence,
                max_samples,
            },
            Extras {
                min_samples: stop_early.min_iterations,
                local_steps: self.params.local_steps,
                sprt,
            },
            &mut self.seed.rng(),
            self.stop,
        )
    }
}

/// Diagonal of the rectangle around the points in b.
fn diagonal(pairs: &PointPairs) -> f64 {
    let span = |values: &[f64]| {
        let finite = || values.iter().copied().filter(|x| x.is_finite());
        (finite().fold(f64::MIN, f64::max) - finite().fold(f64::MAX, f64::min)).max(0.0)
    };
    let (width, height) = (span(&pairs.b_x), span(&pairs.b_y));
    (width * width + height * height).sqrt()
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
        let order = shuffled(views.points.len(), seed.child("order"));
        let given = views.at_depth_1();
        let pairs: PointPairs = order.iter().map(|&i| given.get(i as usize)).collect();
        let needed = match self.params.geometry {
            Geometry::Essential { .. } => EssentialProblem::SAMPLE,
            Geometry::Fundamental { .. } => FundamentalProblem::SAMPLE,
        };
        if pairs.len() < needed {
            return Err(NoPose::TooFewMatches {
                found: pairs.len(),
                needed,
            });
        }
        let ambiguity: Vec<f32> = (order.iter())
            .map(|&i| views.points.ambiguity[i as usize])
            .collect();
        let found = self
            .search(&pairs, &ambiguity, views.mean_focal(), seed, stop)
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
        let mut inliers: Vec<u32> = inliers.iter().map(|&i| order[i as usize]).collect();
        inliers.sort_unstable();
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
