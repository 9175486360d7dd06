//! How many pairs have no estimate, by reason.

use serde::Serialize;

use super::{Failure, PairResult};

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
