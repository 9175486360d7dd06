//! Whether the difference of two methods is significant, or could be chance.
//!
//! The difference of two AUCs on the same pairs is a score too, with a standard error (see [`intervals`](super::intervals)).
//! A difference of so many standard errors has a two-sided p-value by Student's t distribution, with as many degrees of
//! freedom as units less one. It is at most 5 % exactly where the 95 % interval of the difference leaves out 0.
//!
//! A difference that is the same on all of n units has no standard error. Then the p-value is that of the signs alone: n
//! signs agree by chance in one case of 2^(n-1).

use super::intervals::{MIN_IMAGES, Ratio};
use super::ranks::ROUNDING;
use super::students_t::{self, ALPHA};
use super::{Interval, Term};

/// How far a score of one method is from that of another on the same pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Difference {
    /// The first less the second; `None` where there are no pairs.
    pub value: Option<f64>,
    /// Its paired interval, where there is enough evidence for one.
    pub interval: Option<Interval>,
    /// Two-sided p-value of this difference alone, whatever it is one of; `None` where there is no interval.
    pub p_value: Option<f64>,
    /// Units of these pairs, see [`MIN_IMAGES`].
    pub images: usize,
    /// Whether its sign is certain: the interval leaves out 0; or, if it is one of several, what all of these tell
    /// together.
    pub is_certain: bool,
    /// How many comparisons decide together what is certain; `None` if this one is decided alone.
    pub together: Option<usize>,
}

impl Difference {
    /// Of a score whose terms are differences on pairs.
    pub(super) fn new(terms: &[Term]) -> Self {
        let Some(ratio) = Ratio::of(terms.iter().copied()) else {
            return Self::default();
        };
        // Scores are shares, so no difference is larger than 1.
        let interval = ratio.interval().map(|Interval { low, high }| Interval {
            low: low.max(-1.0),
            high: high.min(1.0),
        });
        let p_value = p_value(&ratio);
        let is_significant = p_value.is_some_and(|p| p <= ALPHA);
        let mut difference = Self {
            value: Some(ratio.value),
            interval,
            p_value,
            images: ratio.units,
            is_certain: false,
            together: None,
        };
        difference.is_certain = difference.leaves_out_zero() && is_significant;
        difference
    }

    /// As seen on many images: certain if the interval leaves out 0.
    #[cfg(test)]
    pub(crate) fn seen(value: f64, interval: Option<[f64; 2]>) -> Self {
        let interval = interval.map(|[low, high]| Interval { low, high });
        Self {
            value: Some(value),
            interval,
            p_value: None,
            images: 4 * MIN_IMAGES,
            is_certain: interval.is_some_and(|interval| interval.low > 0.0 || interval.high < 0.0),
            together: None,
        }
    }

    /// Whether its interval leaves out 0, but for rounding.
    pub fn leaves_out_zero(&self) -> bool {
        (self.interval).is_some_and(|interval| interval.low > ROUNDING || interval.high < -ROUNDING)
    }

    /// Whether there is none, but for rounding.
    pub fn is_zero(&self) -> bool {
        self.value.is_some_and(|value| value.abs() < ROUNDING)
    }

    /// Whether there are pairs, but of too few images to be certain of anything.
    pub fn has_few_images(&self) -> bool {
        self.value.is_some() && self.images < MIN_IMAGES
    }
}

/// The chance of a ratio so far from 0 where the true one is 0; `None` with fewer than [`MIN_IMAGES`] units.
pub(super) fn p_value(ratio: &Ratio) -> Option<f64> {
    if ratio.units < MIN_IMAGES {
        return None;
    }
    if ratio.value.abs() < ROUNDING {
        return Some(1.0);
    }
    if ratio.error < ROUNDING {
        return Some(libm::exp2(1.0 - ratio.units as f64));
    }
    let t = ratio.value.abs() / ratio.error;
    Some(students_t::beyond(t, ratio.units - 1))
}

#[cfg(test)]
mod tests {
    use matchbench_vision::seed::Seed;

    use super::*;

    fn difference(tops: &[f64]) -> Difference {
        let terms: Vec<Term> = (tops.iter().zip(0..))
            .map(|(&numerator, image)| Term {
                images: (image, 1000 + image),
                numerator,
                denominator: 1.0,
            })
            .collect();
        Difference::new(&terms)
    }

    #[test]
    fn the_test_is_that_of_a_mean_where_images_have_one_pair() {
        // 1 to 8: mean 4.5, standard error sqrt(6 / 8), of which it is 5.196 times.
        let terms = (1..=8).map(|i| Term {
            images: (i, 100 + i),
            numerator: f64::from(i),
            denominator: 1.0,
        });
        let ratio = Ratio::of(terms).expect("there are pairs");
        let expected = students_t::beyond(4.5 / 0.75_f64.sqrt(), 7);
        assert!((p_value(&ratio).expect("eight images") - expected).abs() < 1e-12);
    }

    #[test]
    fn few_images_and_rounding_are_no_certainty() {
        let few = difference(&[0.2; 5]);
        assert!(!few.is_certain && few.has_few_images());
        assert!(difference(&[0.2; 6]).is_certain);
        let terms = (0..6).map(|image| Term {
            images: (image, 1000 + image),
            numerator: 0.2,
            denominator: 1.0,
        });
        let alike = Ratio::of(terms).expect("there are pairs");
        assert_eq!(p_value(&alike), Some(1.0 / 32.0));
        let p_values = [&[0.2; 5][..], &[0.2; 6]].map(|tops| difference(tops).p_value);
        assert_eq!(p_values, [None, Some(1.0 / 32.0)]);
        assert!(!difference(&[1e-16; 30]).is_certain);
        assert!(difference(&[1e-16; 30]).is_zero());
        // Some images have a difference of 0, the others what sums leave of it.
        let mut tops = [0.0; 8];
        (tops[0], tops[1]) = (0.1 + 0.2 - 0.3, 0.4);
        assert!(!difference(&tops).is_certain);
        assert_eq!(Difference::new(&[]), Difference::default());
    }

    #[test]
    fn equal_methods_are_told_apart_in_one_case_of_twenty() {
        for images in [3, 6, 10] {
            let mut rng = Seed(17).child(&images.to_string()).rng();
            let certain = (0..1000)
                .filter(|_| {
                    let tops: Vec<f64> = (0..images).map(|_| rng.normal()).collect();
                    difference(&tops).is_certain
                })
                .count();
            let expected = if images < MIN_IMAGES { 0..=0 } else { 30..=70 };
            assert!(expected.contains(&certain), "{images}: {certain}");
        }
    }

    #[test]
    fn no_difference_of_shares_is_larger_than_1() {
        // Mean 0.8, standard error 0.2 of 2.57.
        let mostly = [1.0, 1.0, 1.0, 1.0, 1.0, -0.2];
        let interval = |tops: &[f64]| difference(tops).interval.expect("six images");
        let (better, worse) = (interval(&mostly), interval(&mostly.map(|top| -top)));
        assert_eq!((better.high, worse.low), (1.0, -1.0));
        let expected = 0.8 - 0.2 * 2.570_582;
        assert!((better.low - expected).abs() < 1e-6 && (worse.high + expected).abs() < 1e-6);
    }
}
