//! How a list of pairs is made: of fragments, or otherwise. It decides which datasets stand beside each other.
//!
//! Bian et al.: "MatchBench: An Evaluation of Feature Matchers", Sec. 4, has two portions. On short baselines a video is
//! cut into fragments and the first frame of each is matched with the others of its fragment; on wide baselines an image
//! is matched with several that are far away. The pairs tell the fragments, but not how far cameras are apart: the frames
//! of a window may be neighbours. So a portion here is named by its pairs alone.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

/// A portion of a benchmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Portion {
    /// Each first image has second images of its own, which follow it before the next first image, and at least half of
    /// the first images have several: the paper's short baselines.
    Fragments,
    /// Everything else; the paper's wide baselines are among it.
    Other,
}

impl Portion {
    /// Both, in the order of the paper.
    pub const ALL: [Self; 2] = [Self::Fragments, Self::Other];

    /// The portion that the pairs belong to. Give all listed pairs: a few of them may not tell.
    pub fn of(pairs: impl IntoIterator<Item = (u32, u32)>) -> Self {
        let pairs: BTreeSet<(u32, u32)> = pairs.into_iter().collect();
        let mut seconds = BTreeMap::<u32, usize>::new();
        for (a, _) in &pairs {
            *seconds.entry(*a).or_default() += 1;
        }
        let next = |a: u32| seconds.range(a + 1..).next().map(|(next, _)| *next);
        let follows = |&(a, b): &(u32, u32)| b > a && next(a).is_none_or(|next| b < next);
        let several = seconds.values().filter(|&&images| images > 1).count();
        if pairs.iter().all(follows) && several > 0 && 2 * several >= seconds.len() {
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
            let pairs = rule.pairs(12).expect("no file is needed");
            assert_eq!(Portion::of(pairs), portion, "{rule}");
        }
        // Pairs without a common image, and an image with one that is beyond the next.
        for list in [
            vec![],
            vec![(0, 9), (1, 10)],
            vec![(0, 1), (2, 3), (4, 5)],
            vec![(0, 1), (0, 2), (3, 4), (5, 6), (7, 8)],
            vec![(0, 1), (0, 9), (5, 6), (5, 7)],
            vec![(0, 1), (0, 2), (2, 3), (2, 4)],
            vec![(5, 3), (5, 4), (9, 7), (9, 8)],
        ] {
            assert_eq!(Portion::of(list.clone()), Portion::Other, "{list:?}");
        }
    }
}
