//! What a [`SampleConsensus`](super::SampleConsensus) is made of. Each choice carries the parameters that
//! act on it and no others, so that no parameter can be set without effect.

use crate::geometry::Loss;
use crate::params::ParamError;

/// What two views are taken to have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Geometry {
    /// An essential matrix, from five matches: the calibration is known.
    Essential {
        /// Whether scene points must lie in front of both cameras while models are compared: models
        /// that put a match of their own sample behind one are dropped, and matches that the model puts
        /// behind one do not count as its inliers. Chum, Werner, Matas, ICPR 2004. Default: yes.
        cheirality: bool,
    },
    /// A fundamental matrix, from seven matches: the calibration is used afterwards only.
    Fundamental {
        /// Whether a matrix whose sample lies mostly on one plane is replaced by one that also explains
        /// matches off the plane. Chum, Werner, Matas, CVPR 2005. Default: yes.
        degensac: bool,
    },
}

/// Which model is best. `threshold_px` is the largest Sampson distance of an inlier, in pixels; `sprt` says
/// whether bad models are abandoned early by a sequential probability ratio test (Matas, Chum, ICCV 2005),
/// which only scores that are sums over the matches allow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Score {
    /// [`InlierCount`](crate::robust::InlierCount).
    InlierCount {
        /// Largest distance of an inlier, in pixels.
        threshold_px: f64,
        /// Whether bad models are abandoned early.
        sprt: bool,
    },
    /// [`Msac`](crate::robust::Msac).
    Msac {
        /// Largest distance of an inlier, in pixels.
        threshold_px: f64,
        /// Whether bad models are abandoned early.
        sprt: bool,
    },
    /// [`EvenMsac`](crate::robust::EvenMsac).
    EvenMsac {
        /// Largest distance of an inlier, in pixels.
        threshold_px: f64,
        /// Cells across and down of the grid that finds crowds of matches; 1 to 1000.
        cells: u32,
        /// Whether bad models are abandoned early.
        sprt: bool,
    },
    /// [`Magsac`](crate::robust::Magsac).
    Magsac {
        /// Largest distance of an inlier at the highest noise level, in pixels.
        threshold_px: f64,
        /// Whether bad models are abandoned early.
        sprt: bool,
    },
    /// [`Mlesac`](crate::robust::Mlesac).
    Mlesac {
        /// Distance below which 95 % of the right matches lie, in pixels.
        threshold_px: f64,
    },
    /// [`MedianOfSquares`](crate::robust::MedianOfSquares), which needs no threshold.
    Lmeds,
}

impl Score {
    /// The threshold, where the score has one.
    pub fn threshold_px(&self) -> Option<f64> {
        match *self {
            Self::InlierCount { threshold_px, .. }
            | Self::Msac { threshold_px, .. }
            | Self::EvenMsac { threshold_px, .. }
            | Self::Magsac { threshold_px, .. }
            | Self::Mlesac { threshold_px } => Some(threshold_px),
            Self::Lmeds => None,
        }
    }

    /// Whether bad models are abandoned early, where the score allows it.
    pub fn sprt(&self) -> Option<bool> {
        match *self {
            Self::InlierCount { sprt, .. }
            | Self::Msac { sprt, .. }
            | Self::EvenMsac { sprt, .. }
            | Self::Magsac { sprt, .. } => Some(sprt),
            Self::Mlesac { .. } | Self::Lmeds => None,
        }
    }
}

/// Which matches are tried next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sampler {
    /// [`Uniform`](crate::robust::Uniform): all are equally likely.
    Uniform,
    /// [`Prosac`](crate::robust::Prosac): the least ambiguous first.
    Prosac {
        /// Samples after which all matches are equally likely; at least 1.
        horizon: usize,
    },
    /// [`EvenSampler`](crate::robust::EvenSampler): sparse parts of the image as often as dense ones.
    Spread {
        /// Cells across and down of the grid over image `a`; 1 to 1000.
        cells: u32,
    },
}

/// When fewer samples than the largest number are enough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EarlyStop {
    /// Wanted probability that at least one sample was free of wrong matches, in `[0, 1)`.
    pub confidence: f64,
    /// Samples drawn at least.
    pub min_iterations: usize,
}

/// The refinement of the best model over the matches near it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FinalRefinement {
    /// What residuals cost. The truncated loss is cut off at the threshold of the score; the scale of
    /// Cauchy's loss comes from the inliers.
    pub loss: Loss,
    /// Steps at most; 1 to 1000.
    pub steps: usize,
}

/// Parameters of [`SampleConsensus`](super::SampleConsensus).
///
/// ```
/// use matchbench_vision::robust::{SampleConsensus, SampleConsensusParams, Score, presets};
///
/// let strict = SampleConsensusParams {
///     score: Score::EvenMsac { threshold_px: 1.0, cells: 10, sprt: true },
///     ..presets::best()
/// };
/// let estimator = SampleConsensus::new(strict)?;
/// # Ok::<(), matchbench_vision::ParamError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleConsensusParams {
    /// What is estimated.
    pub geometry: Geometry,
    /// Which model is best.
    pub score: Score,
    /// Which matches are tried next.
    pub sampler: Sampler,
    /// When fewer than `max_iterations` samples are enough; `None`: never.
    pub early_stop: Option<EarlyStop>,
    /// Samples drawn at most; at least 1.
    pub max_iterations: usize,
    /// Steps of each local optimisation at most, 0 to 1000; 0 for none.
    pub local_steps: usize,
    /// How the best model is refined in the end; `None`: not at all.
    pub final_refinement: Option<FinalRefinement>,
    /// Scene points farther than this, in baselines, do not support a pose; positive, infinite for no
    /// limit.
    pub max_depth: f64,
}

impl Default for SampleConsensusParams {
    fn default() -> Self {
        Self {
            geometry: Geometry::Essential { cheirality: true },
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
    /// Refuses a parameter that is out of its range; the error calls it as
    /// [`Settings`](crate::robust::Settings) do.
    pub(super) fn check(&self) -> Result<(), ParamError> {
        if let Some(threshold) = self.score.threshold_px() {
            ParamError::unless(
                threshold > 0.0 && threshold.is_finite(),
                "threshold_px",
                threshold,
                "positive and finite",
            )?;
        }
        if let Score::EvenMsac { cells, .. } = self.score {
            ParamError::unless(
                (1..=1000).contains(&cells),
                "score_cells",
                cells,
                "1 to 1000",
            )?;
        }
        match self.sampler {
            Sampler::Uniform => {}
            Sampler::Prosac { horizon } => {
                ParamError::unless(horizon > 0, "prosac_horizon", horizon, "at least 1")?;
            }
            Sampler::Spread { cells } => {
                ParamError::unless((1..=1000).contains(&cells), "cells", cells, "1 to 1000")?;
            }
        }
        ParamError::unless(
            self.max_iterations > 0,
            "max_iterations",
            self.max_iterations,
            "at least 1",
        )?;
        if let Some(EarlyStop {
            confidence,
            min_iterations,
        }) = self.early_stop
        {
            ParamError::unless(
                (0.0..1.0).contains(&confidence),
                "confidence",
                confidence,
                "at least 0 and below 1",
            )?;
            ParamError::unless(
                min_iterations <= self.max_iterations,
                "min_iterations",
                min_iterations,
                "at most `max_iterations`",
            )?;
        }
        let local = self.local_steps;
        ParamError::unless(local <= 1000, "local_steps", local, "0 to 1000")?;
        if let Some(FinalRefinement { steps, .. }) = self.final_refinement {
            ParamError::unless(
                (1..=1000).contains(&steps),
                "final_steps",
                steps,
                "1 to 1000",
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
