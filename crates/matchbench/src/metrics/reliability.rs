//! Whether the stated probability of a pose to be right is true: of the poses that are right with probability 0.8, 8 of
//! 10 should be.
//!
//! Reliability diagram: Murphy, Winkler, "Reliability of Subjective Probability Forecasts of Precipitation and
//! Temperature", Applied Statistics 26(1), 1977. Brier score: Brier, "Verification of Forecasts Expressed in Terms of
//! Probability", Monthly Weather Review 78(1), 1950. Expected calibration error: Naeini, Cooper, Hauskrecht,
//! "Obtaining Well Calibrated Probabilities Using Bayesian Binning", AAAI 2015.

use matchbench_vision::robust::RIGHT_POSE;

use super::{Angle, PairResult};

/// Ranges of equal width that probabilities are put into.
const RANGES: usize = 10;
/// The least number of poses whose share of right ones is drawn as a mark: of 10 it has a standard deviation of up to
/// 0.16.
const MIN_IN_RANGE: usize = 10;
/// The least number of poses of a method of which a curve is drawn: three marks.
pub const MIN_FOR_CURVE: usize = 3 * MIN_IN_RANGE;

/// Stated probabilities beside what became of the poses. Pairs without a pose state none and do not count.
#[derive(Clone, Debug, PartialEq)]
pub struct Reliability {
    /// Poses whose probability was stated and whose error is known.
    pub poses: usize,
    /// Share of them that are right: less than 10 degrees from the truth.
    pub right: f64,
    /// Mean stated probability.
    pub stated: f64,
    /// Brier score, the mean of `(p - y)^2` with y = 1 for right poses and 0 for others; 0 is perfect.
    pub brier: f64,
    /// Expected calibration error, the mean distance of stated probability and share over ten ranges of equal width,
    /// each of the weight of its poses; 0 is perfect.
    pub calibration_error: f64,
    /// The same ranges, ascending, but with neighbours merged: from the lowest probability on, a range takes in the
    /// next ones until it has at least 10 poses, and what is left at the end goes to the last range.
    pub ranges: Vec<ReliabilityRange>,
    /// Poses of pairs that are more likely than not said to have [no overlap](PairResult::has_no_overlap).
    pub no_overlap: usize,
    /// Those of them that are right all the same.
    pub no_overlap_right: usize,
}

/// Poses of about the same stated probability.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReliabilityRange {
    /// Number of poses.
    pub poses: usize,
    /// Mean stated probability.
    pub stated: f64,
    /// Share of right ones.
    pub right: f64,
}

impl Reliability {
    /// What the probabilities of these results are worth; `None` where none was stated.
    pub fn of(pairs: &[PairResult]) -> Option<Self> {
        let is_right = |pair: &PairResult| Some(pair.error(Angle::Pose)? < RIGHT_POSE);
        let poses: Vec<(f64, f64)> = (pairs.iter())
            .filter_map(|pair| Some((pair.pose_probability?, f64::from(u8::from(is_right(pair)?)))))
            .collect();
        if poses.is_empty() {
            return None;
        }
        let equal_width: Vec<Vec<(f64, f64)>> = (0..RANGES)
            .map(|range| {
                let here = |p: f64| ((p * RANGES as f64) as usize).min(RANGES - 1) == range;
                poses.iter().copied().filter(|(p, _)| here(*p)).collect()
            })
            .filter(|inside: &Vec<_>| !inside.is_empty())
            .collect();
        let no_overlap: Vec<bool> = (pairs.iter())
            .filter(|pair| pair.has_no_overlap())
            .filter_map(is_right)
            .collect();
        let off = |inside: &Vec<(f64, f64)>| {
            let range = ReliabilityRange::of(inside);
            range.poses as f64 * (range.stated - range.right).abs()
        };
        Some(Self {
            poses: poses.len(),
            right: mean(poses.iter().map(|(_, y)| *y)),
            stated: mean(poses.iter().map(|(p, _)| *p)),
            brier: mean(poses.iter().map(|(p, y)| (p - y) * (p - y))),
            calibration_error: equal_width.iter().map(off).sum::<f64>() / poses.len() as f64,
            ranges: (merged(equal_width).iter())
                .map(|inside| ReliabilityRange::of(inside))
                .collect(),
            no_overlap: no_overlap.len(),
            no_overlap_right: no_overlap.iter().filter(|right| **right).count(),
        })
    }

    /// Whether there are poses enough for a curve.
    pub fn has_curve(&self) -> bool {
        self.poses >= MIN_FOR_CURVE
    }
}

impl ReliabilityRange {
    /// Of these poses, each with its stated probability and with 1 if it is right, else 0.
    fn of(poses: &[(f64, f64)]) -> Self {
        Self {
            poses: poses.len(),
            stated: mean(poses.iter().map(|(p, _)| *p)),
            right: mean(poses.iter().map(|(_, y)| *y)),
        }
    }
}

/// Neighbours put together until all have [`MIN_IN_RANGE`], as far as there are as many.
fn merged(ranges: Vec<Vec<(f64, f64)>>) -> Vec<Vec<(f64, f64)>> {
    let is_small = |range: &Vec<_>| range.len() < MIN_IN_RANGE;
    let mut merged: Vec<Vec<(f64, f64)>> = Vec::new();
    for range in ranges {
        match merged.last_mut() {
            Some(last) if is_small(last) => last.extend(range),
            _ => merged.push(range),
        }
    }
    if merged.len() > 1
        && let Some(rest) = merged.pop_if(|last| is_small(last))
        && let Some(last) = merged.last_mut()
    {
        last.extend(rest);
    }
    merged
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len();
    values.sum::<f64>() / count as f64
}

#[cfg(test)]
mod tests {
    use super::super::Failure;
    use super::super::pair_result::tests::solved;
    use super::*;

    /// Poses of this stated probability, so many of them right.
    fn poses(pose_probability: f64, right: usize, wrong: usize) -> Vec<PairResult> {
        let errors = std::iter::repeat_n(1.0, right).chain(std::iter::repeat_n(80.0, wrong));
        (0..)
            .zip(errors)
            .map(|(a, error)| PairResult {
                pose_probability: Some(pose_probability),
                ..solved(a, 0.5, error, 100)
            })
            .collect()
    }

    #[test]
    fn probabilities_that_come_true_have_no_calibration_error() {
        let results = [poses(0.75, 75, 25), poses(0.15, 15, 85)].concat();
        let reliability = Reliability::of(&results).unwrap();
        assert!(reliability.calibration_error < 1e-12);
        assert!((reliability.brier - 0.5 * (0.1875 + 0.1275)).abs() < 1e-12);
        let stated: Vec<f64> = reliability.ranges.iter().map(|range| range.right).collect();
        assert_eq!(stated, [0.15, 0.75]);
    }

    #[test]
    fn small_ranges_are_put_together_and_the_calibration_error_is_of_the_ten() {
        let few = [poses(0.05, 0, 4), poses(0.15, 4, 2), poses(0.95, 3, 0)].concat();
        let reliability = Reliability::of(&few).unwrap();
        // 4 and 6 make 10, and the 3 that are left join them.
        let ranges: Vec<usize> = reliability.ranges.iter().map(|r| r.poses).collect();
        assert_eq!(ranges, [13]);
        let expected = (4.0 * 0.05 + 6.0 * (4.0 / 6.0 - 0.15) + 3.0 * 0.05) / 13.0;
        assert!((reliability.calibration_error - expected).abs() < 1e-12);
        assert!(!reliability.has_curve());
        let more = [few, poses(0.85, 10, 7)].concat();
        let reliability = Reliability::of(&more).unwrap();
        let ranges: Vec<usize> = reliability.ranges.iter().map(|r| r.poses).collect();
        assert_eq!(ranges, [10, 20]);
        assert!(reliability.has_curve());
    }

    #[test]
    fn sure_and_wrong_is_the_worst() {
        let reliability = Reliability::of(&poses(1.0, 0, 4)).unwrap();
        assert_eq!(
            (reliability.brier, reliability.calibration_error),
            (1.0, 1.0)
        );
        assert_eq!(reliability.ranges.len(), 1);
    }

    #[test]
    fn no_overlap_is_an_answer_that_may_be_wrong() {
        let mut results = poses(0.1, 1, 9);
        for (pair, p) in results.iter_mut().zip([0.2, 0.2, 0.2, 0.6]) {
            pair.overlap_probability = Some(p);
        }
        let reliability = Reliability::of(&results).unwrap();
        let answers = (reliability.no_overlap, reliability.no_overlap_right);
        assert_eq!(answers, (3, 1));
    }

    #[test]
    fn pairs_without_a_pose_or_a_probability_do_not_count() {
        let silent = [
            PairResult::failed(0, 1, Failure::Missing),
            solved(2, 1.0, 1.0, 50),
        ];
        assert_eq!(Reliability::of(&silent), None);
        let results = [silent.to_vec(), poses(0.5, 1, 0)].concat();
        assert_eq!(Reliability::of(&results).unwrap().poses, 1);
    }

    #[test]
    fn a_pose_is_right_below_ten_degrees() {
        let results: Vec<PairResult> = ([9.9, 10.0, 10.1].into_iter())
            .map(|error| PairResult {
                pose_probability: Some(0.5),
                ..solved(0, 0.5, error, 100)
            })
            .collect();
        assert_eq!(Reliability::of(&results).unwrap().right, 1.0 / 3.0);
    }
}
