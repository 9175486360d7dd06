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
//! | | `cheirality` | yes | Chum, Werner, Matas, ICPR 2004; Hartley, Zisserman, sec. 9.6.3 |
//! | | `degensac` | yes | Chum, Werner, Matas, CVPR 2005 |
//! | | `sprt` | yes | Matas, Chum, ICCV 2005 |
//! | | `min_iterations` | 50 | Lebeda et al.: the first models are not worth optimising |
//! | | `max_iterations` | 1000 | the benchmark's protocol |
//! | | `local_steps` | 10 | ours |
//! | | `final_loss` | truncated | |
//! | | `final_steps` | 25 | ours |
//! | | `prosac_horizon` | 200,000 | Chum, Matas, CVPR 2005 |
//! | | `cells` | 20 | GMS's grid |
//! | | `score_cells` | 10 | tuned on the kitchen of 7-Scenes |
//! | | `max_depth` | 50 | OpenCV 4's `recoverPose` |
//!
//! *Choices the papers leave open*: local optimisation is non-linear from the start instead of
//! inner samples of a larger size, since five degrees of freedom and the truncated loss leave the
//! non-minimal linear solvers no advantage.

use nalgebra::Matrix3;

use super::consensus::inliers_within;
use super::essential_problem::near;
use super::{
    Consensus, ConsensusParams, EssentialProblem, EvenMsac, Extras, FundamentalProblem,
    InlierCount, Magsac, MedianOfSquares, Mlesac, Msac, NoPose, PoseEstimate, PoseEstimator,
    Problem, Prosac, Sampler, Score, Spread, TwoViews, Uniform, consensus_until,
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
    /// [`EvenMsac`].
    EvenMsac,
    /// [`Mlesac`].
    Mlesac,
    /// [`MedianOfSquares`]; the threshold is not used.
    Median,
    /// [`Magsac`]; the threshold is the largest residual at the highest noise level.
    Magsac,
}

/// What two views are taken to have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum GeometryKind {
    /// An essential matrix, from five matches: the calibration is known.
    Essential,
    /// A fundamental matrix, from seven matches: the calibration is used afterwards only.
    Fundamental,
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
    /// What is estimated.
    pub geometry: GeometryKind,
    /// Which model is best.
    pub score: ScoreKind,
    /// What is tried next.
    pub sampler: SamplerKind,
    /// Wanted probability that at least one sample was free of wrong matches, in `[0, 1)`.
    pub confidence: f64,
    /// Largest Sampson distance of an inlier, in pixels.
    pub threshold_px: f64,
    /// Whether matches must be in front of both cameras (essential matrices only): models whose
    /// sample cannot be are not judged, and what lies behind supports nothing.
    pub cheirality: bool,
    /// Whether matrices from a plane are mended by what is off it (fundamental matrices only).
    pub degensac: bool,
    /// Whether models are given up early by a sequential probability ratio test.
    pub sprt: bool,
    /// Samples drawn at least.
    pub min_iterations: usize,
    /// Samples drawn at most.
    pub max_iterations: usize,
    /// Steps of each local optimisation; 0 for none.
    pub local_steps: usize,
    /// Loss of the final refinement. Truncated at the threshold; the scale of Cauchy's loss comes from
    /// the inliers.
    pub final_loss: Loss,
    /// Steps of the final refinement; 0 for none.
    pub final_steps: usize,
    /// Samples after which the progressive sampler is uniform.
    pub prosac_horizon: usize,
    /// Cells across and down of the spatially even sampler.
    pub cells: u32,
    /// Cells across and down of the spatially even score.
    pub score_cells: u32,
    /// Scene points farther than this, in baselines, do not support a pose.
    pub max_depth: f64,
}

impl Default for SampleConsensusParams {
    fn default() -> Self {
        Self {
            geometry: GeometryKind::Essential,
            score: ScoreKind::Msac,
            sampler: SamplerKind::Uniform,
            confidence: 0.999,
            threshold_px: 1.0,
            cheirality: true,
            degensac: true,
            sprt: true,
            min_iterations: 50,
            max_iterations: 1000,
            local_steps: 10,
            final_loss: Loss::Truncated,
            final_steps: 25,
            prosac_horizon: 200_000,
            cells: 20,
            score_cells: 10,
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
        for (name, cells) in [("cells", p.cells), ("score_cells", p.score_cells)] {
            ParamError::unless((1..=1000).contains(&cells), name, cells, "1 to 1000")?;
        }
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
        match self.params.geometry {
            GeometryKind::Essential => Run {
                params: &self.params,
                problem: EssentialProblem {
                    pairs,
                    cheirality: self.params.cheirality,
                },
                pairs,
                seed,
                stop,
            }
            .sampled(ambiguity, squared_threshold),
            GeometryKind::Fundamental => Run {
                params: &self.params,
                problem: FundamentalProblem {
                    pairs,
                    degensac: self.params.degensac,
                },
                pairs,
                seed,
                stop,
            }
            .sampled(ambiguity, squared_threshold),
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
        let squared_scale = match self.params.final_loss {
            Loss::Truncated => limit,
            Loss::Cauchy => squared_cauchy_scale(&found, pairs).min(limit),
        };
        let pose = refine_pose(
            &start,
            &near,
            self.params.final_loss,
            squared_scale,
            self.params.final_steps,
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

/// One search, but for its score and sampler.
struct Run<'a, P> {
    params: &'a SampleConsensusParams,
    problem: P,
    pairs: &'a PointPairs,
    seed: Seed,
    stop: &'a dyn Fn(usize) -> bool,
}

impl<P: Problem<Model = Matrix3<f64>>> Run<'_, P> {
    fn sampled(
        &self,
        ambiguity: &[f32],
        squared_threshold: f64,
    ) -> Option<Consensus<Matrix3<f64>>> {
        let pairs = self.pairs;
        match self.params.sampler {
            SamplerKind::Uniform => self.with(squared_threshold, Uniform::new(pairs.len())),
            SamplerKind::Prosac => {
                assert_eq!(ambiguity.len(), pairs.len(), "an ambiguity for each match");
                let sampler = Prosac::new(ambiguity, self.params.prosac_horizon);
                self.with(squared_threshold, sampler)
            }
            SamplerKind::Spread => {
                self.with(squared_threshold, Spread::new(pairs, self.params.cells))
            }
        }
    }

    fn with(
        &self,
        squared_threshold: f64,
        sampler: impl Sampler,
    ) -> Option<Consensus<Matrix3<f64>>> {
        match self.params.score {
            ScoreKind::InlierCount => self.go(&InlierCount { squared_threshold }, sampler),
            ScoreKind::Msac => self.go(&Msac { squared_threshold }, sampler),
            ScoreKind::EvenMsac => {
                let cells = self.params.score_cells;
                let score = EvenMsac::new(self.pairs, cells, squared_threshold);
                self.go(&score, sampler)
            }
            ScoreKind::Mlesac => {
                let span = diagonal(self.pairs).max(f64::MIN_POSITIVE);
                let score = Mlesac {
                    squared_threshold,
                    span,
                };
                self.go(&score, sampler)
            }
            ScoreKind::Median => self.go(&MedianOfSquares { sample: P::SAMPLE }, sampler),
            ScoreKind::Magsac => self.go(&Magsac::new(squared_threshold), sampler),
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
                sprt: self.params.sprt,
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
        let order = shuffled(views.a.len(), seed.child("order"));
        let given = views.at_depth_1();
        let pairs: PointPairs = order.iter().map(|&i| given.get(i as usize)).collect();
        let needed = match self.params.geometry {
            GeometryKind::Essential => EssentialProblem::SAMPLE,
            GeometryKind::Fundamental => FundamentalProblem::SAMPLE,
        };
        if pairs.len() < needed {
            return Err(NoPose::TooFewMatches {
                found: pairs.len(),
                needed,
            });
        }
        let ambiguity: Vec<f32> = (order.iter())
            .filter_map(|&i| views.ambiguity.get(i as usize).copied())
            .collect();
        let focal = f64::midpoint(views.camera_a.mean_focal(), views.camera_b.mean_focal());
        let threshold = self.params.threshold_px / focal;
        let found = self
            .search(&pairs, &ambiguity, threshold * threshold, seed, stop)
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
