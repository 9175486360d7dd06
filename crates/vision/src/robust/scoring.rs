//! How good a model is, given its residuals: the trait of scores, and the two simplest.

use std::ops::Range;

use crate::simd;

/// Rates models by their squared residuals. One of the three parts of [`consensus`](super::consensus()).
pub trait Scoring {
    /// Quality and number of inliers of a model over the data in `range`, given their squared residuals. A
    /// score without [upper bounds](Self::upper_bound) may reorder or overwrite the slice (a median and a
    /// likelihood need this).
    fn support(&self, range: Range<usize>, squared_residuals: &mut [f64]) -> Support;

    /// The most that the data in `range` can add to the quality of any model, if the quality is a sum over the
    /// data. With it, a model can be rejected before all data are used. `None` if the quality is not such a
    /// sum.
    fn upper_bound(&self, _range: Range<usize>) -> Option<f64> {
        None
    }
}

/// How well data agree with a model. ([`PoseEstimate::support`](super::PoseEstimate::support) is something else: the
/// number of all matches in front of both cameras.)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Support {
    /// Larger is better. Values can be compared only within one score.
    pub quality: f64,
    /// Number of inliers.
    pub inliers: usize,
    /// An inlier is a datum whose squared residual is at most this.
    pub squared_threshold: f64,
}

/// The least squared threshold of scores that divide by it: a smaller one is taken for this, so that none divides by 0. Only
/// data that agree exactly are within it.
pub(super) const LEAST_SQUARED_THRESHOLD: f64 = 1e-300;

/// Scores by the number of inliers (Fischler, Bolles, "Random Sample Consensus", Communications of the ACM
/// 24(6), 1981).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InlierCount {
    /// An inlier is a datum whose squared residual is at most this.
    pub squared_threshold: f64,
}

impl Scoring for InlierCount {
    fn support(&self, _range: Range<usize>, squared_residuals: &mut [f64]) -> Support {
        let inliers = simd::count_at_most(squared_residuals, self.squared_threshold);
        Support {
            quality: inliers as f64,
            inliers,
            squared_threshold: self.squared_threshold,
        }
    }

    fn upper_bound(&self, range: Range<usize>) -> Option<f64> {
        Some(range.len() as f64)
    }
}

/// MSAC: an inlier counts more the nearer it is, `sum max(0, 1 - r^2 / t^2)` (Torr, Zisserman, "MLESAC: A New
/// Robust Estimator with Application to Estimating Image Geometry", Computer Vision and Image Understanding 78,
/// 2000, sec. 4, as a quality and not as a cost).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Msac {
    /// t^2, positive: an inlier is a datum whose squared residual is at most this. With 0, inliers are data that agree
    /// exactly, and each counts 1.
    pub squared_threshold: f64,
}

impl Scoring for Msac {
    fn support(&self, _range: Range<usize>, squared_residuals: &mut [f64]) -> Support {
        let squared_threshold = self.squared_threshold.max(LEAST_SQUARED_THRESHOLD);
        let cost = simd::sum_truncated(squared_residuals, squared_threshold);
        Support {
            quality: squared_residuals.len() as f64 - cost / squared_threshold,
            inliers: simd::count_at_most(squared_residuals, squared_threshold),
            squared_threshold,
        }
    }

    fn upper_bound(&self, range: Range<usize>) -> Option<f64> {
        Some(range.len() as f64)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;
    use crate::geometry::PointPairs;
    use crate::robust::{EvenMarginal, EvenMsac, Magsac, Mlesac};

    #[test]
    fn msac_prefers_the_nearer_of_as_many_inliers() {
        let msac = Msac {
            squared_threshold: 4.0,
        };
        let near = msac.support(0..4, &mut [0.0, 1.0, 5.0, f64::NAN]);
        let far = msac.support(0..4, &mut [2.0, 3.0, 4.5, f64::INFINITY]);
        assert_eq!((near.inliers, near.quality), (2, 1.75));
        assert_eq!((far.inliers, far.quality), (2, 0.75));
    }

    #[test]
    fn a_threshold_of_0_counts_what_agrees_exactly() {
        let pairs: PointPairs = [(Point2::origin(), Point2::origin()); 3]
            .into_iter()
            .collect();
        let by_count = |score: &dyn Fn(&mut [f64]) -> Support, share: f64| {
            let support = score(&mut [0.0, 1e-30, f64::NAN]);
            assert_eq!(support.inliers, 1);
            assert!(
                (support.quality - share).abs() < 1e-9,
                "{}",
                support.quality
            );
        };
        let msac = Msac {
            squared_threshold: 0.0,
        };
        by_count(&|residuals| msac.support(0..3, residuals), 1.0);
        let even = EvenMsac::new(&pairs, 10, 0.0);
        by_count(&|residuals| even.support(0..3, residuals), 1.0);
        let marginal = EvenMarginal::new(&pairs, 10, 0.0);
        by_count(&|residuals| marginal.support(0..3, residuals), 1.0);
        let magsac = Magsac::new(0.0);
        by_count(&|residuals| magsac.support(0..3, residuals), 1.0);
        let mlesac = Mlesac {
            squared_threshold: 0.0,
            span: 1.0,
        };
        let likelihood = |residuals: &mut [f64]| mlesac.support(0..3, residuals).quality;
        let (none, one) = (
            likelihood(&mut [1.0; 3]),
            likelihood(&mut [0.0, 1.0, f64::NAN]),
        );
        assert!(one.is_finite() && one > none, "{none} {one}");
    }
}
