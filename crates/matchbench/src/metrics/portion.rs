//! How a list of pairs is made: of fragments, or otherwise. It decides which datasets stand beside each other.
//!
//! Bian et al.: "MatchBench: An Evaluation of Feature Matchers", Sec. 4, has two portions. On short baselines a video is
//! cut into fragments and the first frame of each is matched with the others of its fragment; on wide baselines an image
//! is matched with several that are far away. The pairs tell the fragments, but not how far cameras are apart: the frames
//! of a window may be neighbours. So a portion here is named by its pairs alone.

use std::collections::BTreeSet;

use serde::Serialize;

use super::PairResult;

/// A portion of a benchmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Portion {
    /// Every image that is matched to another is matched to one alone, and none is matched to it: the paper's short
    /// baselines.
    Fragments,
    /// Everything else; the paper's wide baselines are among it.
    Other,
}

impl Portion {
    /// Both, in the order of the paper.
    pub const ALL: [Self; 2] = [Self::Fragments, Self::Other];

    /// The portion that the pairs belong to.
    pub fn of(pairs: &[PairResult]) -> Self {
        let pairs: BTreeSet<(u32, u32)> = pairs.iter().map(|pair| (pair.a, pair.b)).collect();
        let references: BTreeSet<u32> = pairs.iter().map(|pair| pair.0).collect();
        let mut seen = BTreeSet::new();
        let fragments = (pairs.iter()).all(|(_, b)| !references.contains(b) && seen.insert(*b));
        if fragments && !pairs.is_empty() {
            Self::Fragments
        } else {
            Self::Other
        }
    }

    /// In a word or two, for heads and titles.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fragments => "fragments",
            Self::Other => "other pairs",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Failure;
    use super::*;
    use crate::datasets::PairRule;

    #[test]
    fn the_rules_of_the_paper_are_told_apart() {
        for (rule, portion) in [
            ("fragments:5", Portion::Fragments),
            ("all", Portion::Other),
            ("window:9", Portion::Other),
        ] {
            let rule: PairRule = rule.parse().expect("a rule");
            let pairs: Vec<PairResult> = (rule.pairs(12).expect("no file is needed").into_iter())
                .map(|(a, b)| PairResult::failed(a, b, Failure::Missing))
                .collect();
            assert_eq!(Portion::of(&pairs), portion, "{rule}");
        }
        assert_eq!(Portion::of(&[]), Portion::Other);
    }
}
