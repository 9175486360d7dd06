//! What a [`SampleConsensus`](super::SampleConsensus) is made of. Each choice carries the parameters that
//! act on it and no others, so that no parameter can be set without effect.

use crate::geometry::Loss;
use crate::params::ParamError;
#[cfg(doc)]
use crate::robust::PoseProbabilities;
use crate::robust::parts::{EarlyStop, FinalRefinement, Sampler, Score};
use crate::robust::search::Search;

/// The matrix that relates the two views.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Geometry {
    /// An essential matrix, from five matches; the calibration is used.
    Essential {
        /// Whether scene points must lie in front of both cameras while models are compared. Then a model is
        /// dropped if the matches of its own sample do not
        /// [agree in orientation](crate::geometry::agree_in_orientation): if under each of its poses the two depths
        /// of some match differ in sign. And matches that the model puts behind a camera, by less than 50 baselines, do not
        /// count for it in the search; those within the threshold are still among the inliers of the result. Chum, Werner, Matas, ICPR
        /// 2004. Default: yes.
        cheirality: bool,
        /// Whether, at the end, the best pose is compared with the two poses that a plane of its inliers
        /// allows. Default: no.
        plane_poses: bool,
        /// Whether distances are measured in units of the image if a lens distorts (tangent Sampson distance),
        /// and not between points at depth 1, where undoing the lens has stretched them. Without distortion
        /// both are the same. Default: no, since with it wrong matches near the edge agree more often with a
        /// model.
        tangent_sampson: bool,
        /// Number of models that differ which the search keeps, to choose among them at the end by how well each
        /// predicts how far keypoints turned and grew; 1 to 1000, where 1 is the best alone. More than one needs a
        /// score that uses turns, and does nothing if neither [turns](crate::geometry::MatchedPoints::turns) nor
        /// [growths](crate::geometry::MatchedPoints::growths) are known. Default: 1.
        hypotheses: usize,
        /// The search is given up if the [probability](PoseProbabilities) that the pose so far is right is below this; 0 to
        /// 1, where 0 is never. That is asked once, after a quarter of `max_iterations` samples, or after
        /// [`EarlyStop::min_iterations`] if these are more. More than 0 needs an early stop, and more samples than that.
        /// Default: 0.
        hopeless: f64,
    },
    /// A fundamental matrix, from seven matches. Lens and calibration are undone before; that it is essential is not used.
    Fundamental {
        /// Whether a matrix whose sample lies mostly on one plane is replaced by one that also explains
        /// matches off the plane. Chum, Werner, Matas, CVPR 2005. Default: yes.
        degensac: bool,
    },
}

/// Parameters of [`SampleConsensus`](super::SampleConsensus).
///
/// ```
/// use matchbench_vision::robust::{SampleConsensus, SampleConsensusParams, Score, presets};
///
/// let strict = SampleConsensusParams {
///     score: Score::EvenMsac { threshold_px: 1.0, cells: 10, turns: false, sprt: true },
///     ..presets::best()
/// };
/// let estimator = SampleConsensus::new(strict)?;
/// # Ok::<(), matchbench_vision::ParamError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleConsensusParams {
    /// The matrix that is estimated.
    pub geometry: Geometry,
    /// The score, which says which model is best.
    pub score: Score,
    /// The sampler, which says which matches are tried next.
    pub sampler: Sampler,
    /// When sampling may stop before `max_iterations`; `None`: never.
    pub early_stop: Option<EarlyStop>,
    /// Largest number of samples, besides those of [`Score::EvenMarginal::noise_iterations`]; at least 1.
    pub max_iterations: usize,
    /// Largest number of steps of each local optimisation, 0 to 1000; 0 for none.
    pub local_steps: usize,
    /// The refinement of the best model at the end; `None`: none.
    pub final_refinement: Option<FinalRefinement>,
    /// Scene points farther than this, in baselines, do not support a pose; positive, infinite for no
    /// limit.
    pub max_depth: f64,
}

impl Default for SampleConsensusParams {
    fn default() -> Self {
        Self {
            geometry: Geometry::Essential {
                cheirality: true,
                plane_poses: false,
                tangent_sampson: false,
                hypotheses: 1,
                hopeless: 0.0,
            },
            score: Score::Msac {
                threshold_px: 1.0,
                sprt: true,
            },
            sampler: Sampler::Uniform,
            early_stop: Some(EarlyStop {
                confidence: 0.999,
                min_iterations: 50,
            }),
            max_iterations: 1000,
            local_steps: 10,
            final_refinement: Some(FinalRefinement {
                loss: Loss::Truncated,
                steps: 25,
            }),
            max_depth: 50.0,
        }
    }
}

impl SampleConsensusParams {
    /// The parts of the search itself.
    pub(in crate::robust) fn search(&self) -> Search {
        Search {
            score: self.score,
            sampler: self.sampler,
            early_stop: self.early_stop,
            max_iterations: self.max_iterations,
            local_steps: self.local_steps,
        }
    }

    /// Number of models that the search keeps.
    pub(super) fn hypotheses(&self) -> usize {
        match self.geometry {
            Geometry::Essential { hypotheses, .. } => hypotheses,
            Geometry::Fundamental { .. } => 1,
        }
    }

    /// Refuses a parameter that is out of its range. The error names it as
    /// [`Settings`](crate::robust::Settings) do.
    pub(super) fn check(&self) -> Result<(), ParamError> {
        self.search().check()?;
        FinalRefinement::check(self.final_refinement)?;
        if let Geometry::Essential {
            hypotheses,
            hopeless,
            ..
        } = self.geometry
        {
            let most = if self.score.uses_turns() { 1000 } else { 1 };
            ParamError::unless(
                (1..=most).contains(&hypotheses),
                "hypotheses",
                hypotheses,
                "1 to 1000 with `turns`, by which they are compared, and 1 without",
            )?;
            let most = self.search().hopeless_after().map_or(0.0, |_| 1.0);
            ParamError::unless(
                (0.0..=most).contains(&hopeless),
                "hopeless",
                hopeless,
                "0 to 1 where sampling may stop before `max_iterations`, and 0 where it may not",
            )?;
        }
        ParamError::unless(
            self.max_depth > 0.0,
            "max_depth",
            self.max_depth,
            "positive",
        )
    }
}
