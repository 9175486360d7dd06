//! How good a model is, given its residuals.

use crate::simd;

/// Judges models by their squared residuals. One of the three axes of
/// [`consensus`](super::consensus).
pub trait Score {
    /// The support of a model with these residuals. The slice may be reordered (a median needs it).
    fn support(&self, squared_residuals: &mut [f64]) -> Support;
}

/// What the data say about a model.
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

impl Score for InlierCount {
    fn support(&self, squared_residuals: &mut [f64]) -> Support {
        let inliers = simd::count_at_most(squared_residuals, self.squared_threshold);
        Support {
            quality: inliers as f64,
            inliers,
            squared_threshold: self.squared_threshold,
        }
    }
}
