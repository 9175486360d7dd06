//! The homography of two images, from matches of which many are wrong.
//!
//! Hartley, Zisserman, "Multiple View Geometry in Computer Vision", 2nd edition, 2004, alg. 4.6; Chum,
//! Matas, Kittler, "Locally Optimized RANSAC", DAGM 2003; Lebeda, Matas, Chum, "Fixing the Locally
//! Optimized RANSAC", BMVC 2012.
//!
//! 1. [`consensus_until`](super::consensus_until) over samples of four matches finds the best homography
//!    by symmetric transfer distances in pixels; each new best one is improved by
//!    [`refine_homography`] with a truncated loss.
//! 2. A final refinement over the matches near the result, with the loss of choice. The scale of Cauchy's loss
//!    follows from the distances of the inliers. These distances change by the refinement, so with this loss it is
//!    done once more from its result.
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | | `score` | [`Score::Msac`](super::Score::Msac) | Lebeda et al. |
//! | | `sampler` | [`Sampler::Uniform`](super::Sampler::Uniform) | |
//! | p | `early_stop.confidence` | 0.999 | as for poses |
//! | t | `score.threshold_px` | 3.0 | OpenCV 4's `findHomography` |
//! | | `early_stop.min_iterations` | 50 | ours; as many as Lebeda et al. draw before they optimise |
//! | | `max_iterations` | 2000 | OpenCV 4 |
//! | | `local_steps` | 10 | ours |
//! | | `final_refinement.loss` | truncated | |
//! | | `final_refinement.steps` | 25 | ours |
//! | | `one_side` | yes | see below |
//!
//! *Choice*: a camera sees a surface from one side. With `one_side`, samples that would mirror it are
//! refused, and matches beyond the line that goes to infinity do not count (Chum, Werner, Matas,
//! "Epipolar Geometry Estimation via RANSAC Benefits from the Oriented Epipolar Constraint", ICPR 2004,
//! for homographies).
//!
//! *Differs* from Lebeda et al.: their local optimisation begins after 50 samples, ours with the first.
//! `min_iterations` only says how many samples are drawn at least.
//!
//! Cameras are not used. If a lens bends the image of a plane, no homography describes it exactly; where that
//! matters, straighten the image first.

mod params;

use nalgebra::Matrix3;

pub use params::HomographyParams;

use super::consensus::inliers_within;
use super::grid::NOTHING_IS_FAR;
use super::search::{DistanceFrom, Shuffled, Task, squared_cauchy_scale};
use super::{
    Consensus, HomographyEstimate, HomographyEstimator, HomographyProblem, NoModel, Problem,
};
use crate::geometry::{Loss, MatchedPoints, refine_homography};
use crate::params::ParamError;
use crate::seed::Seed;

/// Sample consensus for homographies, combined from parts. [`presets`](crate::robust::presets) has named
/// combinations.
#[derive(Clone, Copy, Debug)]
pub struct HomographyConsensus {
    params: HomographyParams,
}

impl HomographyConsensus {
    /// An estimator with these parameters.
    ///
    /// # Errors
    /// If one of them is out of its range.
    pub fn new(params: HomographyParams) -> Result<Self, ParamError> {
        params.check()?;
        Ok(Self { params })
    }

    /// The refined homography and the matches within the threshold of it.
    fn finish(
        &self,
        problem: &HomographyProblem<'_>,
        found: Consensus<Matrix3<f64>>,
    ) -> (Matrix3<f64>, Vec<u32>) {
        let squared_threshold = found.support.squared_threshold;
        let mut residuals = vec![0.0; problem.len()];
        let Some(refinement) = self.params.final_refinement else {
            let inliers = inliers_of(problem, &found.model, squared_threshold, &mut residuals);
            return (found.model, inliers);
        };
        let (mut model, mut inliers) = (found.model, found.inliers);
        let times = match refinement.loss {
            Loss::Truncated => 1,
            Loss::Cauchy => 2,
        };
        for _ in 0..times {
            problem.squared_residuals(&model, 0..problem.len(), &mut residuals);
            let squared_scale = match refinement.loss {
                Loss::Truncated => squared_threshold,
                Loss::Cauchy => squared_cauchy_scale(&residuals, &inliers, DistanceFrom::Point)
                    .min(squared_threshold),
            };
            let reach = self.params.score.reach() * squared_threshold;
            let near = problem.pairs.chosen(&inliers_within(&residuals, reach));
            let (loss, steps) = (refinement.loss, refinement.steps);
            model = refine_homography(&model, &near, loss, squared_scale, steps);
            inliers = inliers_of(problem, &model, squared_threshold, &mut residuals);
        }
        (model, inliers)
    }
}

/// The matches within the squared threshold that can belong to the model; `residuals` is working space for all
/// matches.
fn inliers_of(
    problem: &HomographyProblem<'_>,
    model: &Matrix3<f64>,
    squared_threshold: f64,
    residuals: &mut [f64],
) -> Vec<u32> {
    problem.squared_residuals(model, 0..problem.len(), residuals);
    problem.exclude_impossible(model, squared_threshold, residuals);
    inliers_within(residuals, squared_threshold)
}

impl HomographyEstimator for HomographyConsensus {
    fn estimate(&self, points: &MatchedPoints, seed: Seed) -> Result<HomographyEstimate, NoModel> {
        self.estimate_until(points, seed, &|_| false)
    }

    fn estimate_until(
        &self,
        points: &MatchedPoints,
        seed: Seed,
        stop: &dyn Fn(usize) -> bool,
    ) -> Result<HomographyEstimate, NoModel> {
        let pixels = points.in_pixels();
        let needed = HomographyProblem::SAMPLE;
        if points.len() < needed {
            let found = points.len();
            return Err(NoModel::TooFewMatches { found, needed });
        }
        let order = seed.child("order");
        let matches = Shuffled::new(&pixels, points, self.params.score, order);
        let problem = HomographyProblem {
            pairs: &matches.pairs,
            one_side: self.params.one_side,
        };
        let task = Task {
            search: self.params.search(),
            matches: &matches,
            pixels: 1.0,
            far: NOTHING_IS_FAR,
            hypotheses: 1,
            seed,
            stop,
        };
        let found = task.solve(&problem);
        let found = found.ok_or(NoModel::none_found(needed))?;
        let iterations = found.samples;
        let (b_from_a, inliers) = self.finish(&problem, found);
        if inliers.len() < needed || b_from_a.try_inverse().is_none() {
            let found = inliers.len();
            return Err(NoModel::NoSupport { found, needed });
        }
        Ok(HomographyEstimate {
            b_from_a,
            inliers: matches.before(&inliers),
            iterations,
        })
    }
}

#[cfg(test)]
mod tests;
