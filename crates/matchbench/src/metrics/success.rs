//! SP curves: the share of pairs whose pose is right, over the error that is allowed.
//!
//! Bian et al.: "MatchBench: An Evaluation of Feature Matchers", Sec. 3.
//!
//! `SP(k) = #(e < k) / #pairs` for k = 1, 2, ..., 15 degrees, strictly below. All pairs that the
//! dataset lists are in the denominator: one without a pose is below no threshold. The paper's
//! AUC is the mean of the fifteen values.

use std::ops::RangeInclusive;

use serde::{Serialize, Serializer};

use super::{Angle, Model, PairResult};

/// Pixels at which the AUC of homographies is the one that methods are ranked by.
pub const HEADLINE_PX: f64 = 3.0;

/// The thresholds of the paper, in degrees.
pub const THRESHOLDS: RangeInclusive<usize> = 1..=15;

/// SP(1) ... SP(15), as the counts that they are ratios of: equal scores are equal to the last bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SuccessCurve {
    /// `below[k - 1]` pairs have an error below k degrees.
    pub below: [usize; 15],
    /// The denominator: all pairs.
    pub pairs: usize,
}

impl SuccessCurve {
    /// The curve of one angle of the error, of the pairs whose pose was to be estimated; of none where only the larger
    /// angle of one was told and another is asked for.
    pub fn new(pairs: &[PairResult], angle: Angle) -> Self {
        let is_known = |pair: &PairResult| angle == Angle::Pose || pair.larger_error().is_none();
        let pairs = if pairs.iter().all(is_known) {
            pairs
        } else {
            &[]
        };
        let poses = || pairs.iter().filter(|pair| pair.model == Model::Pose);
        Self::count(
            poses().filter_map(|pair| pair.error(angle)),
            poses().count(),
        )
    }

    /// The same of the corner error, in pixels.
    pub fn of_corners(pairs: &[PairResult]) -> Self {
        let homographies = || pairs.iter().filter(|pair| pair.model == Model::Homography);
        Self::count(
            homographies().filter_map(PairResult::corner_error),
            homographies().count(),
        )
    }

    fn count(errors: impl Iterator<Item = f64>, pairs: usize) -> Self {
        let mut below = [0; 15];
        for error in errors {
            for k in THRESHOLDS {
                below[k - 1] += usize::from(error < k as f64);
            }
        }
        Self { below, pairs }
    }

    /// SP(k): the share of pairs with an error below `k` degrees. NaN where there are no pairs.
    ///
    /// # Panics
    /// If `k` is not one of [`THRESHOLDS`].
    pub fn at(&self, k: usize) -> f64 {
        self.values()[k - 1]
    }

    /// SP(1) ... SP(15), each in `[0, 1]`, or NaN where there are no pairs.
    pub fn values(&self) -> [f64; 15] {
        self.below.map(|count| count as f64 / self.pairs as f64)
    }

    /// The paper's AUC: the mean of SP(1) ... SP(15). NaN where there are no pairs.
    pub fn auc(&self) -> f64 {
        self.below.iter().sum::<usize>() as f64 / (self.below.len() * self.pairs) as f64
    }
}

/// Written as its fifteen values.
impl Serialize for SuccessCurve {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.values().serialize(serializer)
    }
}

/// The share of the paper's thresholds that an error is below: what one pair adds to the AUC.
pub(super) fn share_of_thresholds(error: Option<f64>) -> f64 {
    let passed = error.map_or(0, |e| THRESHOLDS.filter(|&k| e < k as f64).count());
    passed as f64 / 15.0
}

#[cfg(test)]
mod tests {
    use super::super::Failure;
    use super::super::pair_result::tests::solved;
    use super::*;

    #[test]
    fn threshold_is_strict() {
        // An error of exactly 5 degrees is not below 5, but below 6.
        let curve = SuccessCurve::new(&[solved(0, 5.0, 1.0, 30)], Angle::Pose);
        assert_eq!((curve.at(5), curve.at(6)), (0.0, 1.0));
        assert_eq!(curve.auc(), 10.0 / 15.0);
    }

    #[test]
    fn translation_is_signed() {
        // 179 degrees is nearly the opposite direction, and wrong at every threshold.
        let curve = SuccessCurve::new(&[solved(0, 0.0, 179.0, 30)], Angle::Pose);
        assert_eq!(curve.values(), [0.0; 15]);
    }

    #[test]
    fn failed_and_missing_pairs_count_in_the_denominator() {
        let pairs = [
            solved(0, 0.5, 0.5, 30),
            PairResult::failed(0, 2, Failure::NoSupport),
            PairResult::failed(0, 3, Failure::Missing),
            solved(0, 90.0, 0.5, 30),
        ];
        assert_eq!(SuccessCurve::new(&pairs, Angle::Pose).values(), [0.25; 15]);
        assert_eq!(
            SuccessCurve::new(&pairs, Angle::Translation).values(),
            [0.5; 15]
        );
        assert_eq!(SuccessCurve::new(&pairs, Angle::Rotation).auc(), 0.25);
    }

    #[test]
    fn nan_is_below_no_threshold() {
        for (rotation, translation) in [(f64::NAN, 0.1), (0.1, f64::NAN), (f64::NAN, f64::NAN)] {
            let pair = solved(0, rotation, translation, 30);
            assert_eq!(SuccessCurve::new(&[pair], Angle::Pose).below, [0; 15]);
        }
    }

    #[test]
    fn without_pairs_nothing_is_known() {
        let curve = SuccessCurve::new(&[], Angle::Pose);
        assert!(curve.auc().is_nan());
        let json = serde_json::to_string(&curve).expect("numbers can be written");
        assert!(json.starts_with("[null,"), "{json}");
    }
}
