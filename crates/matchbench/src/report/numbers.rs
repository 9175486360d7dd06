//! Numbers as tables show them.

use crate::metrics::{Interval, Notation, Score};

/// Shown if there is no number.
pub(super) const NONE: &str = "–";

/// The interval of a share behind its value: ` [0.386, 0.528]`; empty if there is none.
pub(super) fn bracketed(score: &Score) -> String {
    (score.interval).map_or_else(String::new, |Interval { low, high }| {
        format!(" [{}, {}]", ratio(low), ratio(high))
    })
}

/// A ratio to three decimals.
pub(super) fn ratio(value: impl Into<Option<f64>>) -> String {
    decimals(value, 3)
}

/// A mean count to one decimal.
pub(super) fn count(value: impl Into<Option<f64>>) -> String {
    decimals(value, 1)
}

/// A score in the notation that its entry asks for.
pub(super) fn score(notation: Notation, value: impl Into<Option<f64>>) -> String {
    match notation {
        Notation::Ratio => ratio(value),
        Notation::Count => count(value),
    }
}

/// A median count, without decimals.
pub(super) fn whole(value: impl Into<Option<f64>>) -> String {
    decimals(value, 0)
}

/// Seconds in milliseconds, to one decimal.
pub(super) fn milliseconds(seconds: impl Into<Option<f64>>) -> String {
    match seconds.into().map(|s| s * 1e3) {
        Some(value) if 0.0 < value && value < 0.05 => "<0.1".to_owned(),
        value => decimals(value, 1),
    }
}

/// A time with the unit that suits it: `830 µs`, `12 ms`, `1.5 s`.
pub(super) fn duration(seconds: f64) -> String {
    let (value, unit) = match seconds {
        s if s < 0.9995e-3 => (s * 1e6, "µs"),
        s if s < 0.9995 => (s * 1e3, "ms"),
        s => (s, "s"),
    };
    let decimals = usize::from(value < 9.95 && (value - value.round()).abs() > 0.05);
    format!("{value:.decimals$} {unit}")
}

/// A quantity to three significant digits.
pub(super) fn short(value: f64) -> String {
    let decimals = match value.abs() {
        v if v >= 100.0 => 0,
        v if v >= 10.0 => 1,
        v if v >= 1.0 => 2,
        _ => 3,
    };
    fixed(value, decimals)
}

/// With so many decimals, and never with the sign of a number that is rounded to zero.
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(zero) if zero.bytes().all(|byte| matches!(byte, b'0' | b'.')) => zero.to_owned(),
        _ => text,
    }
}

/// The same of a difference, whose sign is always there: `+0.012`.
pub fn signed(value: f64, decimals: usize) -> String {
    let text = fixed(value, decimals);
    if text.starts_with('-') {
        text
    } else {
        format!("+{text}")
    }
}

/// The chance of a difference where there is none: `0.012`, or `<0.001`.
pub fn p_value(value: impl Into<Option<f64>>) -> String {
    match value.into() {
        Some(value) if value < 0.001 => "<0.001".to_owned(),
        value => ratio(value),
    }
}

fn decimals(value: impl Into<Option<f64>>, decimals: usize) -> String {
    match value.into().filter(|value| value.is_finite()) {
        Some(value) => fixed(value, decimals),
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
        assert_eq!(milliseconds(0.000_012), "<0.1");
    }

    #[test]
    fn an_interval_goes_from_its_low_end_to_its_high_one() {
        let (low, high) = (0.386, 0.528);
        let mut score = Score {
            value: Some(0.45),
            interval: Some(Interval { low, high }),
        };
        assert_eq!(bracketed(&score), " [0.386, 0.528]");
        assert_eq!(interval(&score, ratio), "0.386 to 0.528");
        score.interval = None;
        assert_eq!((&*bracketed(&score), &*interval(&score, ratio)), ("", "–"));
    }

    #[test]
    fn zero_has_no_sign() {
        assert_eq!(ratio(-1e-17), "0.000");
        assert_eq!([fixed(-0.0004, 3), fixed(-0.0, 0)], ["0.000", "0"]);
        assert_eq!([fixed(-0.0006, 3), fixed(-10.0, 1)], ["-0.001", "-10.0"]);
        let both = [-1e-17, 0.0004, 0.5, -0.5].map(|value| signed(value, 3));
        assert_eq!(both, ["+0.000", "+0.000", "+0.500", "-0.500"]);
    }

    #[test]
    fn a_small_p_value_is_not_zero() {
        let shown = [None, Some(1.0), Some(0.0123), Some(0.001), Some(1e-9)].map(p_value);
        assert_eq!(shown, ["–", "1.000", "0.012", "0.001", "<0.001"]);
    }

    #[test]
    fn times_have_the_unit_that_suits_them() {
        let shown = [0.00083, 0.0123, 0.1, 1.0, 1.54].map(duration);
        assert_eq!(shown, ["830 µs", "12 ms", "100 ms", "1 s", "1.5 s"]);
        assert_eq!(
            [0.1234, 12.34, 1234.5].map(short),
            ["0.123", "12.3", "1234"]
        );
    }
}
