//! How good a model is, given its residuals: the trait of scores, and the two simplest.

use std::ops::Range;

use crate::simd;

/// Rates models by their squared residuals. One of the three axes of
/// [`consensus`](super::consensus).
pub trait Scoring {
    /// Quality and inliers of a model over the data in `range`, given their squared residuals. Of a
    /// score without [upper bounds](Self::upper_bound) the slice may be reordered or overwritten (a median and a
    /// likelihood need it).
    fn support(&self, range: Range<usize>, squared_residuals: &mut [f64]) -> Support;

    /// The most that the data in `range` can add to the quality of any model, where the quality is a sum
    /// over the data; it allows abandoning a model before all data are seen. `None` where the quality is no
    /// such sum.
    fn upper_bound(&self, _range: Range<usize>) -> Option<f64> {
        None
    }
}

/// How well data agree with a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Support {
    /// The larger, the better; comparable within one score.
    pub quality: f64,
    /// Number of inliers.
    pub inliers: usize,
    /// An inlier is a datum whose squared residual is at most this.
    pub squared_threshold: f64,
}

/// The number of inliers (Fischler, Bolles, "Random Sample Consensus", Communications of the ACM
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

/// Inliers count the more the nearer they are: `sum max(0, 1 - r^2 / t^2)`, MSAC (Torr, Zisserman,
/// "MLESAC: A New Robust Estimator with Application to Estimating Image Geometry", Computer Vision
/// and Image Understanding 78, 2000, eq. 17, upside down).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Msac {
    /// t^2: an inlier is a datum whose squared residual is at most this.
    pub squared_threshold: f64,
}

impl Scoring for Msac {
    fn support(&self, _range: Range<usize>, squared_residuals: &mut [f64]) -> Support {
        let limit = self.squared_threshold;
        let cost = simd::sum_truncated(squared_residuals, limit);
        Support {
            quality: squared_residuals.len() as f64 - cost / limit,
            inliers: simd::count_at_most(squared_residuals, limit),
            squared_threshold: limit,
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
