//! The parts that a search by sample consensus is made of. Each choice carries the parameters that act on it
//! and no others, so that no parameter can be set without effect.

use crate::geometry::Loss;
use crate::params::ParamError;

/// The score, which says which model is best. `threshold_px` is the largest distance of an inlier, in pixels: the
/// Sampson distance where a pose is estimated, the symmetric transfer distance where it is a homography. `sprt`
/// says whether bad models are abandoned early by a sequential probability ratio test (Matas, Chum, ICCV 2005).
/// Only scores that are sums over the matches allow that.
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
        /// Whether matches whose keypoints are turned by another angle than most are trusted less, if
        /// [turns](crate::geometry::MatchedPoints::turns) are known.
        turns: bool,
        /// Whether bad models are abandoned early.
        sprt: bool,
    },
    /// [`EvenMarginal`](crate::robust::EvenMarginal).
    EvenMarginal {
        /// Five times the standard deviation of the distances of right matches, in pixels. If the noise is
        /// estimated, this is only a first guess.
        threshold_px: f64,
        /// Number of samples that are drawn first to estimate the noise of the pair. 0: the noise is not
        /// estimated, and the threshold is used as it is.
        noise_iterations: usize,
        /// Cells across and down of the grid that finds crowds of matches; 1 to 1000.
        cells: u32,
        /// Whether matches whose keypoints are turned by another angle than most are trusted less, if
        /// [turns](crate::geometry::MatchedPoints::turns) are known.
        turns: bool,
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
    /// The threshold, if the score has one.
    pub fn threshold_px(&self) -> Option<f64> {
        match *self {
            Self::InlierCount { threshold_px, .. }
            | Self::Msac { threshold_px, .. }
            | Self::EvenMsac { threshold_px, .. }
            | Self::EvenMarginal { threshold_px, .. }
            | Self::Magsac { threshold_px, .. }
            | Self::Mlesac { threshold_px } => Some(threshold_px),
            Self::Lmeds => None,
        }
    }

    /// Cells across and down of the grid that finds crowds of matches, if the score has one.
    pub fn cells(&self) -> Option<u32> {
        match *self {
            Self::EvenMsac { cells, .. } | Self::EvenMarginal { cells, .. } => Some(cells),
            _ => None,
        }
    }

    /// Whether turns of keypoints are used, if the score can use them.
    pub fn turns(&self) -> Option<bool> {
        match *self {
            Self::EvenMsac { turns, .. } | Self::EvenMarginal { turns, .. } => Some(turns),
            _ => None,
        }
    }

    /// Whether it uses turns of keypoints.
    pub(super) fn uses_turns(&self) -> bool {
        self.turns() == Some(true)
    }

    /// The final refinement takes the matches within this multiple of the squared threshold. A tight threshold
    /// leaves out some right matches, so matches beyond it are taken too; a threshold of five standard deviations leaves out
    /// none, so there the factor is 1.
    pub(super) fn reach(&self) -> f64 {
        match self {
            Self::EvenMarginal { .. } => 1.0,
            _ => 4.0,
        }
    }

    /// Whether bad models are abandoned early, if the score allows it.
    pub fn sprt(&self) -> Option<bool> {
        match *self {
            Self::InlierCount { sprt, .. }
            | Self::Msac { sprt, .. }
            | Self::EvenMsac { sprt, .. }
            | Self::EvenMarginal { sprt, .. }
            | Self::Magsac { sprt, .. } => Some(sprt),
            Self::Mlesac { .. } | Self::Lmeds => None,
        }
    }
}

/// The sampler, which says which matches are tried next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sampler {
    /// [`Uniform`](crate::robust::Uniform): all matches are equally likely.
    Uniform,
    /// [`Prosac`](crate::robust::Prosac): the least ambiguous matches first.
    Prosac {
        /// Number of samples after which all matches are equally likely; at least 1.
        horizon: usize,
    },
    /// [`SpreadSampler`](crate::robust::SpreadSampler): draws from sparse parts of the image as often as from dense
    /// ones, unless matches lie in very few parts.
    Spread {
        /// Cells across and down of the grid over image `a`; 1 to 1000.
        cells: u32,
    },
}

/// When sampling may stop before the largest number of samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EarlyStop {
    /// Required probability that at least one sample is free of wrong matches, in `[0, 1)`, as if samples were drawn
    /// uniformly.
    pub confidence: f64,
    /// Least number of samples.
    pub min_iterations: usize,
}

/// The refinement of the best model, using the matches near it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FinalRefinement {
    /// The cost of residuals. The truncated loss is cut off at the threshold of the score; the scale of
    /// Cauchy's loss is computed from the inliers.
    pub loss: Loss,
    /// Largest number of steps; 1 to 1000.
    pub steps: usize,
}

impl FinalRefinement {
    /// Refuses one whose steps are out of their range.
    pub(super) fn check(refinement: Option<Self>) -> Result<(), ParamError> {
        let Some(Self { steps, .. }) = refinement else {
            return Ok(());
        };
        ParamError::unless(
            (1..=1000).contains(&steps),
            "final_steps",
            steps,
            "1 to 1000",
        )
    }
}
