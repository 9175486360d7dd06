//! Quantiles, mean and deviation of a list of numbers.

/// The value that a share `q` of the sorted values lies below, linear between neighbours (the
/// default of R and numpy). The values must not be empty.
pub(super) fn quantile(sorted: &[f64], q: f64) -> f64 {
    let position = q * (sorted.len() - 1) as f64;
    let below = position.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (position - below as f64) * (sorted[above] - sorted[below])
}

/// The mean of the values; NaN where there are none.
pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The sample standard deviation of the values; `None` where there are fewer than two, or one is not finite.
pub(super) fn deviation(values: &[f64]) -> Option<f64> {
    let mean = mean(values);
    let squares: f64 = (values.iter())
        .map(|value| (value - mean) * (value - mean))
        .sum();
    let variance = squares / (values.len() as f64 - 1.0);
    (values.len() > 1 && variance.is_finite()).then(|| variance.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_linear_between_values() {
        assert_eq!(quantile(&[1.0, 2.0, 4.0], 0.5), 2.0);
        assert_eq!(quantile(&[1.0, 2.0, 4.0], 0.75), 3.0);
        assert_eq!(quantile(&[1.0], 0.975), 1.0);
    }

    #[test]
    fn the_deviation_is_that_of_a_sample() {
        // 0.2 below and above the mean: 0.04 + 0 + 0.04, over 2.
        let found = deviation(&[0.2, 0.4, 0.6]).expect("three values");
        assert!((found - 0.2).abs() < 1e-15);
        assert_eq!(deviation(&[1.0, 1.0]), Some(0.0));
        assert_eq!(deviation(&[0.4]), None);
        assert_eq!(deviation(&[]), None);
        assert_eq!(deviation(&[0.4, f64::NAN]), None);
    }
}
