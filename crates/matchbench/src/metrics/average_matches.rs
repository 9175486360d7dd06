//! AP bars: how many correspondences a matcher finds where it is right.
//!
//! Bian et al.: "MatchBench: An Evaluation of Feature Matchers", Sec. 3.
//!
//! `AP(k)` = mean number of correspondences over the pairs with `e < k`, strictly below; the paper
//! shows k = 5 degrees. Unlike SP it says nothing about the pairs that fail.

use super::{Angle, PairResult};

/// AP(k), for `k` in degrees; `None` if no pair is right, or if the results do not say how many correspondences a right
/// pair has.
pub fn average_matches(pairs: &[PairResult], k: f64) -> Option<f64> {
    let (mut sum, mut right) = (0_u64, 0_u64);
    for pair in pairs.iter().filter(|pair| is_right(pair, k)) {
        sum += u64::from(pair.correspondences?);
        right += 1;
    }
    (right > 0).then(|| sum as f64 / right as f64)
}

/// Whether the pose error of the pair is below `k` degrees.
pub(super) fn is_right(pair: &PairResult, k: f64) -> bool {
    pair.error(Angle::Pose).is_some_and(|error| error < k)
}

#[cfg(test)]
mod tests {
    use super::super::pair_result::tests::solved;
    use super::*;

    #[test]
    fn only_pairs_below_the_threshold_are_averaged() {
        let pairs = [
            solved(0, 4.9, 1.0, 100),
            solved(0, 1.0, 1.0, 201),
            solved(0, 5.0, 1.0, 900),
            solved(0, 1.0, 175.5, 900),
        ];
        assert_eq!(average_matches(&pairs, 5.0), Some(150.5));
    }

    #[test]
    fn no_right_pair_has_no_average() {
        assert_eq!(average_matches(&[solved(0, 9.0, 9.0, 50)], 5.0), None);
        assert_eq!(average_matches(&[], 5.0), None);
    }

    #[test]
    fn numbers_that_nobody_told_are_not_taken_for_none() {
        let told = solved(0, 1.0, 1.0, 50);
        let untold = PairResult {
            correspondences: None,
            ..told.clone()
        };
        let wrong = PairResult {
            correspondences: None,
            ..solved(0, 9.0, 9.0, 50)
        };
        assert_eq!(average_matches(&[told.clone(), untold], 5.0), None);
        assert_eq!(average_matches(&[told, wrong], 5.0), Some(50.0));
    }
}
