//! Least median of squares: a score that needs no threshold, as long as more than half of the data are right.

use std::ops::Range;

use super::{Scoring, Support};

/// Least median of squares: the score is the median squared residual, which is minimised. It needs no
/// threshold, and fails if half of the data or more are wrong (Rousseeuw, "Least Median of Squares Regression",
/// Journal of the American Statistical Association 79, 1984; Rousseeuw, Leroy, "Robust Regression and Outlier
/// Detection", 1987, sec. 5.1).
///
/// Inliers are data within 2.5 robust standard deviations. One robust standard deviation is
/// `1.4826 (1 + 5 / (n - s)) sqrt(med)` for n data and samples of s data. It is 0 if more than half of the data agree
/// exactly; then only these are inliers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MedianOfSquares {
    /// s: number of data in a sample.
    pub sample: usize,
}

impl Scoring for MedianOfSquares {
    fn support(&self, _range: Range<usize>, squared_residuals: &mut [f64]) -> Support {
        let count = squared_residuals.len();
        if count == 0 {
            return Support {
                quality: f64::NEG_INFINITY,
                inliers: 0,
                squared_threshold: 0.0,
            };
        }
        // In the total order NaN is the largest.
        let (_, &mut median, _) =
            squared_residuals.select_nth_unstable_by(count / 2, |x, y| x.abs().total_cmp(&y.abs()));
        let few = 1.0 + 5.0 / count.saturating_sub(self.sample).max(1) as f64;
        let limit = 2.5 * 1.4826 * few;
        let squared_threshold = limit * limit * median;
        let inliers = squared_residuals
            .iter()
            .filter(|&&squared| squared <= squared_threshold)
            .count();
        Support {
            quality: if median.is_nan() {
                f64::NEG_INFINITY
            } else {
                -median
            },
            inliers,
            squared_threshold,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_decides() {
        let score = MedianOfSquares { sample: 2 };
        let support = |values: &[f64]| score.support(0..values.len(), &mut values.to_vec());
        let small = support(&[1.0, 1.0, 1.0, 90.0, f64::NAN]);
        assert_eq!(small.quality, -1.0);
        assert_eq!(small.inliers, 4);
        assert!(support(&[2.0; 5]).quality < small.quality);
        assert_eq!(support(&[f64::NAN; 3]).inliers, 0);
        assert_eq!(support(&[]).inliers, 0);
    }

    #[test]
    fn of_an_even_number_the_upper_middle_is_the_median() {
        let score = MedianOfSquares { sample: 2 };
        for (values, median) in [
            (&mut [5.0, 1.0, 3.0, 2.0, 4.0][..], 3.0),
            (&mut [6.0, 5.0, 1.0, 3.0, 2.0, 4.0], 4.0),
        ] {
            let count = values.len() as f64;
            let found = score.support(0..values.len(), values);
            assert_eq!(found.quality, -median);
            let deviations = 2.5 * 1.4826 * (1.0 + 5.0 / (count - 2.0));
            let expected = deviations * deviations * median;
            assert!(
                (found.squared_threshold - expected).abs() < 1e-9,
                "{found:?}"
            );
        }
    }
}
