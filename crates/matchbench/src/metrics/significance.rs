//! Whether the difference of two methods is significant, or could be chance.
//!
//! 1. The difference of two AUCs on the same pairs is a ratio of sums over reference images, each of which
//!    brings its pairs (see [`Bootstrap`](super::Bootstrap) for why images and not pairs).
//! 2. Its standard error follows from how far the images are from the ratio (Cochran, "Sampling Techniques",
//!    1977, sec. 2.11 and 6.3): with r the ratio, `sqrt(n / (n - 1) * sum (top - r bottom)^2) / sum bottom`.
//! 3. A difference of so many standard errors has a two-sided p-value by Student's t distribution with n - 1
//!    degrees of freedom ("The Probable Error of a Mean", Biometrika 6(1), 1908). With few images it asks for
//!    more than the interval between quantiles of a bootstrap, which is too narrow then: of two equal methods
//!    seen on 6, 10 and 20 images, such intervals leave out zero in some 14, 10 and 7 of 100 cases, not in 5.
//! 4. With fewer than [`MIN_IMAGES`] images nothing is said; there are no intervals either.

use super::bootstrap::{MIN_IMAGES, sums_by_cluster};
use super::ranks::ROUNDING;
use super::{Interval, Term};

/// The chance of calling a difference certain where there is none.
pub(super) const ALPHA: f64 = 0.05;

/// How far a score of one method is from that of another on the same pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Difference {
    /// The first less the second; `None` where there are no pairs.
    pub value: Option<f64>,
    /// Its paired bootstrap interval, where there is enough evidence for one.
    pub interval: Option<Interval>,
    /// Reference images of these pairs.
    pub images: usize,
    /// Whether its sign is certain: the interval leaves out 0, and the test says so too.
    pub is_certain: bool,
}

impl Difference {
    /// Of a score whose terms are differences on pairs, with the interval that these have.
    pub(super) fn new(terms: &[Term], interval: Option<Interval>) -> Self {
        let value = ratio(&sums_by_cluster(terms.iter().copied()));
        Self::of(value, interval, terms)
    }

    /// Of a score that is no mean over pairs, with its interval. The terms, whose mean is nearly the score, are what
    /// is tested.
    pub(super) fn of(value: Option<f64>, interval: Option<Interval>, terms: &[Term]) -> Self {
        let sums = sums_by_cluster(terms.iter().copied());
        let leaves_out_zero =
            interval.is_some_and(|interval| interval.low > ROUNDING || interval.high < -ROUNDING);
        // The mean of what is tested must have the sign of the score.
        let agrees = (value.zip(ratio(&sums))).is_some_and(|(value, mean)| value * mean > 0.0);
        Self {
            value,
            interval,
            images: sums.len(),
            is_certain: leaves_out_zero && agrees && p_value(&sums).is_some_and(|p| p <= ALPHA),
        }
    }

    /// As seen on many images: certain if the interval leaves out 0.
    #[cfg(test)]
    pub(crate) fn seen(value: f64, interval: Option<[f64; 2]>) -> Self {
        let interval = interval.map(|[low, high]| Interval { low, high });
        Self {
            value: Some(value),
            interval,
            images: 4 * MIN_IMAGES,
            is_certain: interval.is_some_and(|interval| interval.low > 0.0 || interval.high < 0.0),
        }
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

/// The sum of all tops over that of all bottoms; `None` where there is nothing.
fn ratio(sums: &[(f64, f64)]) -> Option<f64> {
    let (top, bottom) = total(sums);
    (bottom > 0.0).then(|| top / bottom)
}

fn total(sums: &[(f64, f64)]) -> (f64, f64) {
    (sums.iter()).fold((0.0, 0.0), |total, sum| (total.0 + sum.0, total.1 + sum.1))
}

/// The chance of a ratio so far from 0 where the true one is 0, by the tops and bottoms of each reference image;
/// `None` with fewer than [`MIN_IMAGES`] of them.
pub(super) fn p_value(sums: &[(f64, f64)]) -> Option<f64> {
    let n = sums.len();
    if n < MIN_IMAGES {
        return None;
    }
    let ratio = ratio(sums)?;
    if ratio.abs() < ROUNDING {
        return Some(1.0);
    }
    let squares: f64 = (sums.iter())
        .map(|&(top, bottom)| (top - ratio * bottom) * (top - ratio * bottom))
        .sum();
    let error = (squares * n as f64 / (n - 1) as f64).sqrt() / total(sums).1;
    Some(beyond(ratio.abs() / error, n - 1))
}

/// The chance that Student's t, with so many degrees of freedom, is farther from 0 than `t`: the finite series
/// of Abramowitz and Stegun, "Handbook of Mathematical Functions", 26.7.3 and 26.7.4.
fn beyond(t: f64, freedom: usize) -> f64 {
    if t.is_infinite() {
        return 0.0;
    }
    let angle = libm::atan(t / (freedom as f64).sqrt());
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    let odd = freedom % 2 == 1;
    // 1 + a1 cos^2 + a1 a2 cos^4 + ..., up to cos^(freedom - 2) or, of odd ones, cos^(freedom - 3).
    let (mut term, mut series) = (1.0, 0.0);
    let mut power = if odd { 3 } else { 2 };
    while power <= freedom {
        series += term;
        term *= cos * cos * (power - 1) as f64 / power as f64;
        power += 2;
    }
    let within = if odd {
        std::f64::consts::FRAC_2_PI * (angle + sin * cos * series)
    } else {
        sin * series
    };
    (1.0 - within).max(0.0)
}

#[cfg(test)]
mod tests {
    use matchbench_vision::seed::Seed;

    use super::super::Bootstrap;
    use super::*;

    #[test]
    fn t_has_the_quantiles_of_tables() {
        let tables = [
            (1, 12.706_2),
            (2, 4.302_65),
            (3, 3.182_45),
            (4, 2.776_45),
            (5, 2.570_58),
            (9, 2.262_16),
            (10, 2.228_14),
            (29, 2.045_23),
            (120, 1.979_93),
            (100_001, 1.959_99),
        ];
        for (freedom, t) in tables {
            let p = beyond(t, freedom);
            assert!((p - 0.05).abs() < 3e-6, "{freedom}: {p}");
        }
        assert_eq!(beyond(0.0, 7), 1.0);
        assert_eq!(beyond(f64::INFINITY, 7), 0.0);
    }

    #[test]
    fn the_test_is_that_of_a_mean_where_images_have_one_pair() {
        // 1 to 8: mean 4.5, standard error sqrt(6 / 8), of which it is 5.196 times.
        let sums: Vec<_> = (1..=8).map(|i| (f64::from(i), 1.0)).collect();
        let expected = beyond(4.5 / 0.75_f64.sqrt(), 7);
        assert!((p_value(&sums).expect("eight images") - expected).abs() < 1e-12);
    }

    fn difference(tops: &[f64]) -> Difference {
        let terms: Vec<Term> = (tops.iter().zip(0..))
            .map(|(&numerator, cluster)| Term {
                cluster,
                numerator,
                denominator: 1.0,
            })
            .collect();
        let interval = Bootstrap::default().interval(terms.iter().copied());
        Difference::new(&terms, interval)
    }

    #[test]
    fn few_images_and_rounding_are_no_certainty() {
        let few = difference(&[0.2; 5]);
        assert!(!few.is_certain && few.has_few_images());
        assert!(difference(&[0.2; 6]).is_certain);
        assert!(!difference(&[1e-16; 30]).is_certain);
        assert!(difference(&[1e-16; 30]).is_zero());
        // Some images have a difference of 0, and the interval ends at what sums leave of it.
        let mut tops = [0.0; 8];
        (tops[0], tops[1]) = (0.1 + 0.2 - 0.3, 0.4);
        assert!(!difference(&tops).is_certain);
    }

    #[test]
    fn equal_methods_are_told_apart_in_one_case_of_twenty() {
        // By the bootstrap alone it would be 140 and 100 of 1000.
        for (images, at_most) in [(3, 0), (6, 70), (10, 70)] {
            let mut rng = Seed(17).child(&images.to_string()).rng();
            let certain = (0..1000)
                .filter(|_| {
                    let tops: Vec<f64> = (0..images).map(|_| rng.normal()).collect();
                    difference(&tops).is_certain
                })
                .count();
            assert!(certain <= at_most, "{images}: {certain}");
            assert!(images < MIN_IMAGES || certain >= 25, "{images}: {certain}");
        }
    }
}
