//! Even MSAC over several thresholds at once, for matches whose noise is known roughly.
//!
//! The best threshold depends on the noise of the matches, which differs between pairs: some images are blurred,
//! and some keypoints are found at coarse scales. MAGSAC (Barath, Noskova, Matas, "MAGSAC: Marginalizing Sample
//! Consensus", CVPR 2019) does not choose one noise level but averages the score over all of them. This score does
//! the same with that of [`EvenMsac`](super::EvenMsac): it is the mean of `sum w max(0, 1 - r^2 / t_k^2)` over
//! thresholds t_k in steps of two about the given threshold. Equal steps of the logarithm say that no order of
//! magnitude is likelier than another (Jeffreys' prior of a scale).
//!
//! The given threshold need not be right either. First `noise_iterations` samples are drawn with this first guess.
//! The best model of these gives the noise sigma of the pair (see `noise_scale`), and the search begins anew with
//! a threshold of 5 sigma.
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | t_k | - | 1/2, 1 and 2 times the threshold | tuned, up to five from 1/8 to 4 |
//! | - | `threshold_px` | 2, the first guess of 5 sigma | any from 0.5 to 4 does |
//! | - | `noise_iterations` | 100 | tuned, 100 and 300 |
//! | - | - | threshold of 5 sigma | tuned, 2.5 to 6 |
//!
//! *Tuned* on the kitchen of 7-Scenes and four rendered scenes, with SIFT, ORB, AKAZE and KAZE. The mean AUC of
//! three repetitions is 0.574 on the rendered scenes (`best` 0.567) and 0.267 on the kitchen (`best` 0.265).
//! Thresholds down to 1/8 are better still where images are rendered, but worse in the kitchen, where calibration
//! and lens are not exact and so no match is.

use std::ops::Range;

use super::even_weights::EvenWeights;
use super::grid::NOTHING_IS_FAR;
use super::scoring::LEAST_SQUARED_THRESHOLD;
use super::{Scoring, Support};
use crate::geometry::PointPairs;
use crate::simd::{self, THRESHOLDS};

/// Thresholds, as multiples of the given one.
const MULTIPLES: [f64; THRESHOLDS] = [0.5, 1.0, 2.0];

/// The even marginal score. At every noise level an inlier counts more if it is nearer to the model, and if
/// fewer matches lie around it.
#[derive(Clone, Debug)]
pub struct EvenMarginal {
    squared_threshold: f64,
    squared_thresholds: [f64; THRESHOLDS],
    weights: EvenWeights,
}

impl EvenMarginal {
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
        let squared_threshold = squared_threshold.max(LEAST_SQUARED_THRESHOLD);
        Self {
            squared_threshold,
            squared_thresholds: multiples(squared_threshold),
            weights,
        }
    }

    /// The same score with another threshold.
    pub(super) fn at(self, squared_threshold: f64) -> Self {
        Self::weighing(self.weights, squared_threshold)
    }
}

/// The three squared thresholds around this one.
fn multiples(squared_threshold: f64) -> [f64; THRESHOLDS] {
    MULTIPLES.map(|multiple| multiple * multiple * squared_threshold)
}

impl Scoring for EvenMarginal {
    fn support(&self, range: Range<usize>, squared_residuals: &mut [f64]) -> Support {
        let weights = self.weights.of(range);
        Support {
            quality: simd::mean_gain(squared_residuals, weights, &self.squared_thresholds),
            inliers: simd::count_at_most(squared_residuals, self.squared_threshold),
            squared_threshold: self.squared_threshold,
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
    use crate::robust::EvenMsac;

    fn grid() -> PointPairs {
        (0..100)
            .map(|i| {
                let at = Point2::new(f64::from(i % 10), f64::from(i / 10));
                (at, at)
            })
            .collect()
    }

    #[test]
    fn it_is_the_mean_of_even_msac_over_the_thresholds() {
        let mut residuals: Vec<f64> = (0..100).map(|i| 0.17 * f64::from(i)).collect();
        residuals[3] = f64::NAN;
        residuals[4] = f64::INFINITY;
        let quality = EvenMarginal::new(&grid(), 7, 4.0)
            .support(0..100, &mut residuals)
            .quality;
        let each = [1.0, 4.0, 16.0].map(|squared| {
            let score = EvenMsac::new(&grid(), 7, squared);
            score.support(0..100, &mut residuals).quality
        });
        let mean = each.iter().sum::<f64>() / 3.0;
        assert!((quality - mean).abs() < 1e-9 * mean, "{quality} {mean}");
    }

    #[test]
    fn the_nearer_of_two_models_wins_at_every_noise() {
        let score = EvenMarginal::new(&grid(), 10, 1.0);
        let of = |squared: f64| score.support(0..100, &mut vec![squared; 100]).quality;
        let qualities = [1e-6, 1e-3, 0.01, 0.1, 1.0, 3.9].map(of);
        assert!(qualities.is_sorted_by(|a, b| a > b), "{qualities:?}");
        assert!((of(0.0) - 100.0).abs() < 1e-9 && of(4.1) == 0.0);
    }
}
