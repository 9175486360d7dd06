//! Why pairs came to nothing.

use matchbench_vision::robust::NoPose;
use serde::Serialize;

use super::PairResult;

/// Why there is no pose to compare. Every such pair stays in the denominator of every ratio.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// Not enough matches to estimate a pose.
    TooFewMatches,
    /// No pose that enough matches agree with.
    NoSupport,
    /// A stage broke: an unreadable image, an error of a matcher.
    Broken,
    /// No pose, and the results do not say why (the authors' text format cannot).
    Unexplained,
    /// The dataset lists the pair, but the results do not have it.
    Missing,
}

impl From<&NoPose> for Failure {
    fn from(reason: &NoPose) -> Self {
        match reason {
            NoPose::TooFewMatches { .. } => Self::TooFewMatches,
            NoPose::NoSupport { .. } => Self::NoSupport,
        }
    }
}

/// How many pairs failed, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Failures {
    /// Pairs with [`Failure::TooFewMatches`].
    pub too_few_matches: usize,
    /// Pairs with [`Failure::NoSupport`].
    pub no_support: usize,
    /// Pairs with [`Failure::Broken`].
    pub broken: usize,
    /// Pairs with [`Failure::Unexplained`].
    pub unexplained: usize,
    /// Pairs with [`Failure::Missing`].
    pub missing: usize,
}

impl Failures {
    /// Counts the pairs without a pose.
    pub fn count(pairs: &[PairResult]) -> Self {
        let mut failures = Self::default();
        for failure in pairs.iter().filter_map(|pair| pair.outcome.err()) {
            *match failure {
                Failure::TooFewMatches => &mut failures.too_few_matches,
                Failure::NoSupport => &mut failures.no_support,
                Failure::Broken => &mut failures.broken,
                Failure::Unexplained => &mut failures.unexplained,
                Failure::Missing => &mut failures.missing,
            } += 1;
        }
        failures
    }

    /// All of them.
    pub fn total(&self) -> usize {
        self.too_few_matches + self.no_support + self.broken + self.unexplained + self.missing
    }
}

#[cfg(test)]
mod tests {
    use super::super::pair_result::tests::solved;
    use super::*;

    #[test]
    fn each_reason_is_counted_once_and_poses_never() {
        let pairs = [
            solved(0, 100.0, 100.0, 30),
            PairResult::failed(0, 1, Failure::TooFewMatches),
            PairResult::failed(0, 2, Failure::NoSupport),
            PairResult::failed(0, 3, Failure::NoSupport),
            PairResult::failed(0, 4, Failure::Broken),
            PairResult::failed(0, 5, Failure::Unexplained),
            PairResult::failed(0, 6, Failure::Missing),
        ];
        let failures = Failures::count(&pairs);
        assert_eq!(failures.no_support, 2);
        assert_eq!(failures.total(), 6);
        assert_eq!(Failures::count(&[]), Failures::default());
    }
}
