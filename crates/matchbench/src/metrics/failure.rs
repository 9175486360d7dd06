//! Why a pair has no estimate.

use matchbench_vision::robust::NoModel;

/// Why there is no estimate to compare. Every such pair stays in the denominator of every ratio.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// Not enough matches for an estimate.
    TooFewMatches,
    /// No pose or homography that enough matches agree with.
    NoSupport,
    /// A stage broke: an unreadable image, an error of a matcher.
    Broken,
    /// No estimate, and the results do not say why (the authors' text format cannot).
    Unexplained,
    /// The dataset lists the pair, but the results do not have it.
    Missing,
}

impl From<&NoModel> for Failure {
    fn from(reason: &NoModel) -> Self {
        match reason {
            NoModel::TooFewMatches { .. } => Self::TooFewMatches,
            NoModel::NoSupport { .. } => Self::NoSupport,
        }
    }
}
