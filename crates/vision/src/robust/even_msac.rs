//! MSAC in which a crowd of matches does not outvote the rest of the scene.
//!
//! The score is that of [`Msac`](super::Msac), but a match counts by its weight (see `even_weights`):
//! `sum w max(0, 1 - r^2 / t^2)`.

use std::ops::Range;

use super::even_weights::EvenWeights;
use super::grid::NOTHING_IS_FAR;
use super::scoring::LEAST_SQUARED_THRESHOLD;
use super::{Scoring, Support};
use crate::geometry::PointPairs;
use crate::simd;

/// The even MSAC score: an inlier counts more if it is nearer to the model, and if fewer matches lie around it.
#[derive(Clone, Debug)]
pub struct EvenMsac {
    squared_threshold: f64,
    weights: EvenWeights,
}

impl EvenMsac {
    /// The score for models of these matches. A grid of `cells` x `cells` cells is laid over the points of each
    /// view. An inlier is a match whose squared residual is at most `squared_threshold`, which is positive.
    ///
    /// # Panics
    /// If there are no cells, or more than 1000 across.
    pub fn new(pairs: &PointPairs, cells: u32, squared_threshold: f64) -> Self {
        let weights = EvenWeights::new(pairs, cells, NOTHING_IS_FAR, None);
        Self::weighing(weights, squared_threshold)
    }

    /// The same score with given weights of the matches.
    pub(super) fn weighing(weights: EvenWeights, squared_threshold: f64) -> Self {
        Self {
            squared_threshold: squared_threshold.max(LEAST_SQUARED_THRESHOLD),
            weights,
        }
    }
}

impl Scoring for EvenMsac {
    fn support(&self, range: Range<usize>, squared_residuals: &mut [f64]) -> Support {
        let squared_threshold = self.squared_threshold;
        let gain = simd::sum_below(squared_residuals, self.weights.of(range), squared_threshold);
        Support {
            quality: gain / squared_threshold,
            inliers: simd::count_at_most(squared_residuals, squared_threshold),
            squared_threshold,
        }
    }

    fn upper_bound(&self, range: Range<usize>) -> Option<f64> {
        Some(self.weights.sum(range))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;

    /// 90 matches in one corner, 10 single ones on the diagonal.
    fn crowd_and_others() -> PointPairs {
        (0..100)
            .map(|i| {
                let at = f64::from(if i < 90 { 0 } else { i - 90 + 1 });
                (Point2::new(at, at), Point2::new(at, -at))
            })
            .collect()
    }

    #[test]
    fn a_crowd_says_as_much_as_the_root_of_its_number_of_lonely_matches() {
        let score = EvenMsac::new(&crowd_and_others(), 11, 4.0);
        let quality = |right: Range<usize>| {
            let mut residuals = vec![9.0; 100];
            residuals[right.clone()].fill(1.0);
            let support = score.support(0..100, &mut residuals);
            assert_eq!(support.inliers, right.len());
            support.quality
        };
        let lonely = quality(90..91);
        assert!((quality(0..90) / lonely - 90_f64.sqrt()).abs() < 1e-9);
        assert!((quality(90..100) / lonely - 10.0).abs() < 1e-9);
        // Everything at a quarter of the squared threshold.
        assert!((quality(0..100) - 75.0).abs() < 1e-9);
    }

    #[test]
    fn blocks_add_up_and_never_exceed_what_is_possible() {
        let score = EvenMsac::new(&crowd_and_others(), 7, 4.0);
        let mut residuals: Vec<f64> = (0..100).map(|i| f64::from(i % 7)).collect();
        residuals[3] = f64::NAN;
        residuals[4] = f64::INFINITY;
        let whole = score.support(0..100, &mut residuals).quality;
        let mut sum = 0.0;
        for start in (0..100).step_by(30) {
            let range = start..100.min(start + 30);
            let part = score.support(range.clone(), &mut residuals[range.clone()]);
            assert!(part.quality <= score.upper_bound(range).unwrap() + 1e-12);
            sum += part.quality;
        }
        assert!((sum - whole).abs() < 1e-9);
        assert!((score.upper_bound(0..100).unwrap() - 100.0).abs() < 1e-9);
    }

    #[test]
    #[should_panic(expected = "1 to 1000 cells")]
    fn a_grid_too_fine_to_count_in_is_refused() {
        EvenMsac::new(&crowd_and_others(), u32::MAX, 4.0);
    }

    #[test]
    fn one_match_none_and_broken_ones_have_weights() {
        for count in [0, 1, 5] {
            let pairs: PointPairs = (0..count)
                .map(|i| (Point2::new(f64::NAN, f64::from(i)), Point2::origin()))
                .collect();
            let score = EvenMsac::new(&pairs, 10, 1.0);
            let mut residuals = vec![0.0; pairs.len()];
            let quality = score.support(0..pairs.len(), &mut residuals).quality;
            assert!((quality - f64::from(count)).abs() < 1e-12);
        }
    }
}
