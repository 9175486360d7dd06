//! Numbers as tables show them.

use crate::metrics::{Interval, Score};

/// Shown where there is no number.
pub(super) const NONE: &str = "–";

/// A ratio to three decimals.
pub(super) fn ratio(value: impl Into<Option<f64>>) -> String {
    decimals(value, 3)
}

/// A mean count to one decimal.
pub(super) fn count(value: impl Into<Option<f64>>) -> String {
    decimals(value, 1)
}

/// Seconds in milliseconds, to one decimal.
pub(super) fn milliseconds(seconds: impl Into<Option<f64>>) -> String {
    decimals(seconds.into().map(|s| s * 1e3), 1)
}

fn decimals(value: impl Into<Option<f64>>, decimals: usize) -> String {
    match value.into().filter(|value| value.is_finite()) {
        Some(value) => format!("{value:.decimals$}"),
        None => NONE.to_owned(),
    }
}

/// `0.350 to 0.400`, or nothing.
pub(super) fn interval(score: &Score, number: impl Fn(Option<f64>) -> String) -> String {
    match score.interval {
        Some(Interval { low, high }) => {
            format!("{} to {}", number(Some(low)), number(Some(high)))
        }
        None => NONE.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_number_is_a_dash() {
        assert_eq!(ratio(0.3484), "0.348");
        assert_eq!(ratio(None), "–");
        assert_eq!(count(f64::NAN), "–");
        assert_eq!(milliseconds(0.0123), "12.3");
    }
}
