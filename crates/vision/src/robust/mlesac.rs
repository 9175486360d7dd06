//! MLESAC: a score that is the likelihood of all residuals, instead of a count of inliers.

use std::ops::Range;

use super::scoring::LEAST_SQUARED_THRESHOLD;
use super::{Scoring, Support};

/// Largest ratio of the densities of a right and of a wrong match. The product of 16 of them is still a finite number.
const MOST_LIKELY: f64 = 1e19;

/// Steps of expectation maximisation for the share of inliers.
const STEPS: usize = 3;

/// The likelihood of all residuals under a mixture of a normal distribution (inliers) and a uniform
/// one (outliers), whose share is estimated for each model (Torr, Zisserman, "MLESAC: A New Robust
/// Estimator with Application to Estimating Image Geometry", Computer Vision and Image
/// Understanding 78(1), 2000, sec. 4).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mlesac {
    /// (1.96 sigma)^2, positive: an inlier is a datum whose squared residual is at most this. This holds for 95 % of the
    /// right data.
    pub squared_threshold: f64,
    /// v: the length of the interval over which wrong residuals are uniform.
    pub span: f64,
}

impl Scoring for Mlesac {
    fn support(&self, _range: Range<usize>, squared_residuals: &mut [f64]) -> Support {
        let squared_sigma = self.squared_threshold.max(LEAST_SQUARED_THRESHOLD) / (1.96 * 1.96);
        let scale = 1.0 / (2.0 * std::f64::consts::PI * squared_sigma).sqrt();
        let inliers = squared_residuals
            .iter()
            .filter(|&&squared| squared <= self.squared_threshold)
            .count();
        // From here on the values are the densities of a right match.
        for squared in squared_residuals.iter_mut() {
            let exponent = -*squared / (2.0 * squared_sigma);
            *squared = if exponent > -50.0 {
                scale * libm::exp(exponent)
            } else {
                0.0
            };
        }
        // Only a span that is no distance in an image needs a limit.
        let outlier = (1.0 / self.span).max(scale / MOST_LIKELY).min(f64::MAX);
        let mut share = 0.5;
        for _ in 0..STEPS {
            let right: f64 = (squared_residuals.iter())
                .map(|density| share * density / (share * density + (1.0 - share) * outlier))
                .sum();
            share = (right / squared_residuals.len().max(1) as f64).clamp(1e-6, 1.0 - 1e-6);
        }
        // Up to 16 densities are multiplied before each logarithm, which is the slow part.
        let quality = (squared_residuals.chunks(16))
            .map(|densities| {
                let likelihood: f64 = (densities.iter())
                    .map(|density| (share * density + (1.0 - share) * outlier) / outlier)
                    .product();
                libm::log(likelihood)
            })
            .sum();
        Support {
            quality,
            inliers,
            squared_threshold: self.squared_threshold,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_and_better_inliers_are_likelier() {
        let score = Mlesac {
            squared_threshold: 1.0,
            span: 100.0,
        };
        let quality = |inliers: usize, squared: f64| {
            let mut residuals = vec![1e4; 100];
            residuals[..inliers].fill(squared);
            let support = score.support(0..100, &mut residuals);
            assert_eq!(support.inliers, inliers);
            support.quality
        };
        assert!(quality(50, 0.1) > quality(40, 0.1));
        assert!(quality(50, 0.1) > quality(50, 0.8));
        assert!(quality(0, 0.0).is_finite());
        let broken = score.support(0..2, &mut [f64::NAN, f64::INFINITY]);
        assert_eq!(broken.inliers, 0);
        assert!(score.support(0..0, &mut []).quality == 0.0);
    }

    #[test]
    fn however_wide_the_points_are_spread_more_inliers_are_likelier() {
        for span in [1e18, 1e20, 1e155, f64::MAX, f64::INFINITY] {
            let score = Mlesac {
                squared_threshold: 1.0,
                span,
            };
            let qualities = [0, 16, 17, 40, 100].map(|inliers| {
                let mut residuals = vec![1e4; 100];
                residuals[..inliers].fill(0.1);
                score.support(0..100, &mut residuals).quality
            });
            assert!(
                qualities.iter().all(|quality| quality.is_finite()),
                "{span}: {qualities:?}"
            );
            assert!(
                qualities.is_sorted_by(|a, b| a < b),
                "{span}: {qualities:?}"
            );
        }
    }

    /// A normal density that is that of wrong matches at 0 makes every step simple: a datum at 0 is right with the probability
    /// of the share, and one far away is wrong. So with half of the data at 0 the share s becomes s / 2 each time.
    #[test]
    fn the_quality_is_the_logarithm_of_the_likelihood() {
        let sigma = 2.0 / 1.96;
        let score = Mlesac {
            squared_threshold: 4.0,
            span: sigma * (2.0 * std::f64::consts::PI).sqrt(),
        };
        let mut residuals = vec![0.0; 100];
        residuals[50..].fill(1e6);
        let found = score.support(0..100, &mut residuals);
        // 1/2, 1/4, 1/8, 1/16: those at 0 have the likelihood of a wrong datum, the others 15/16 of it.
        let expected = 50.0 * f64::ln(15.0 / 16.0);
        assert!((found.quality - expected).abs() < 1e-9, "{found:?}");
        assert_eq!(found.inliers, 50);
    }
}
