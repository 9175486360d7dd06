//! How good a model is, given its residuals: the trait of scores, and the two simplest.

use std::ops::Range;

use crate::simd;

/// Rates models by their squared residuals. One of the three parts of [`consensus`](super::consensus).
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
    /// t^2: an inlier is a datum whose squared residual is at most this.
    pub squared_threshold: f64,
}

impl Scoring for Msac {
    fn support(&self, _range: Range<usize>, squared_residuals: &mut [f64]) -> Support {
        let squared_threshold = self.squared_threshold;
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
    use super::*;

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
}
