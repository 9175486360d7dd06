//! What came of a pair, in words.

use crate::metrics::{Angle, Failure, PairResult};
use crate::records::{MIN_MATCHES, MIN_SUPPORT};

/// In a word or two, for tables.
pub(super) fn outcome(pair: &PairResult) -> &'static str {
    match pair.outcome {
        Ok(_) => "pose",
        Err(failure) => name(failure),
    }
}

/// All failures, in the order of their numbers in the page.
pub(super) const FAILURES: [Failure; 5] = [
    Failure::TooFewMatches,
    Failure::NoSupport,
    Failure::Broken,
    Failure::Unexplained,
    Failure::Missing,
];

/// A failure in a word or two.
pub(super) fn name(failure: Failure) -> &'static str {
    match failure {
        Failure::TooFewMatches => "too few matches",
        Failure::NoSupport => "no support",
        Failure::Broken => "broken",
        Failure::Unexplained => "unexplained",
        Failure::Missing => "missing",
    }
}

/// A failure in a sentence.
pub(super) fn reason(failure: Failure) -> String {
    match failure {
        Failure::TooFewMatches => format!(
            "Too few selected matches to estimate a pose: at least {MIN_MATCHES} are needed."
        ),
        Failure::NoSupport => format!(
            "No pose that enough matches agree with: at least {MIN_SUPPORT} must lie in front of both cameras."
        ),
        Failure::Broken => {
            "A stage broke: an image that cannot be read, or an error of the matcher. The record says which.".into()
        }
        Failure::Unexplained => "No pose, and the results do not say why.".into(),
        Failure::Missing => "The dataset lists this pair, but the results do not have it.".into(),
    }
}

/// What came of a pair, in a sentence.
pub fn sentence(pair: &PairResult) -> String {
    match (&pair.outcome, pair.error(Angle::Pose)) {
        (Err(failure), _) => reason(*failure),
        (Ok(error), None) => format!("rotation off by {:.2}°; no true direction", error.rotation),
        (Ok(error), Some(pose)) => format!(
            "pose off by {pose:.2}° (rotation {:.2}°, translation {:.2}°), {} correspondences",
            error.rotation,
            error.translation.unwrap_or(f64::NAN),
            pair.correspondences
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_failure_has_one_name_everywhere() {
        for failure in FAILURES {
            let pair = PairResult::failed(0, 1, failure);
            assert_eq!(outcome(&pair), name(failure));
            assert_eq!(sentence(&pair), reason(failure));
        }
    }
}
