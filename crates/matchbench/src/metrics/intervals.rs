//! How far a score would move with other images: its standard error, and the 95 % interval that follows from it.
//!
//! Aronow, Samii, Assenova, "Cluster-Robust Variance Estimation for Dyadic Data", Political Analysis 23(4), 2015; of
//! ratios Cochran, "Sampling Techniques", 1977, sec. 2.11 and 6.3; of few images Bell, McCaffrey, "Bias Reduction in
//! Standard Errors for Linear Regression with Multi-Stage Samples", Survey Methodology 28(2), 2002.
//!
//! 1. A score is a ratio r of sums over pairs of images ([`Term`]): of the AUC the share of thresholds passed over 1,
//!    of AP the correspondences over "is right". The residual of a pair is `u = numerator - r denominator`, added up
//!    over its repetitions.
//! 2. Two pairs that share an image, in either place, share its features and its difficulty. So they are not
//!    independent, and the variance of r is the sum of `u_p u_q` over all pairs p and q that are the same or share an
//!    image, divided by the squared sum of the denominators. With S_i the sum of the residuals of all pairs of image
//!    i, that sum is `sum_i S_i^2 - sum_p u_p^2`.
//! 3. Residuals are differences from what they themselves make up, so they are too small where there are few images. The
//!    variance is multiplied by the factor by which it would be too small if every pair were worth the sum of two
//!    numbers, one of each image, all independent and of one variance. Of n first images, each with second images of its
//!    own, the factor is n / (n - 1); of all pairs of n images it is n (n - 1) / ((n - 2) (n - 3)).
//! 4. Sums of few residuals may cancel by chance. So the variance is at least that of independent pairs.
//! 5. The number n of *units* says how much was seen: images that are in more than one pair, and pairs that share no
//!    image with another. All pairs of n images have n units, and so have n first images, each with second images of
//!    its own.
//! 6. The interval is `r +- t s`, with s the standard error and t the quantile of Student's t distribution with n - 1
//!    degrees of freedom. That of a share between 0 and 1 is computed for its logit (log r / (1 - r)), so that it stays
//!    between 0 and 1. If no pair differs from another, s is 0 and tells nothing. Of n units that are all alike, up to a
//!    share f of others may be unlike them, by Clopper and Pearson (Biometrika 26(4), 1934). These may be
//!    wholly wrong or wholly right, so the interval is from `r (1 - f)` to `r + (1 - r) f`.
//! 7. Below [`MIN_IMAGES`] units there is no interval.
//! 8. The difference of two methods on the same pairs is a score too, whose terms are the differences of theirs. Its
//!    interval is much narrower than the two separate intervals suggest, because hard images are hard for both.
//!
//! *Limit*: images are taken to be independent of each other. Those of a video are not, since neighbours show nearly the
//! same.

use std::collections::BTreeMap;

use serde::Serialize;

use super::ranks::ROUNDING;
use super::students_t::{self, ALPHA};

/// Units below which there is no interval, and no difference is certain. A difference that has the same sign on each
/// of five images has it by chance in 1 of 16 cases.
pub const MIN_IMAGES: usize = 6;

/// What one pair adds to a score.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Term {
    /// The two images of the pair.
    pub images: (u32, u32),
    /// Added above the fraction bar.
    pub numerator: f64,
    /// Added below the fraction bar; 0 if the score is not about this pair.
    pub denominator: f64,
}

/// The range in which a score lies with a confidence of 95 %.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Pairs of images, without their order and repetitions.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Dyads {
    /// The two images of each, numbered as they come.
    images: Vec<[usize; 2]>,
    /// The number of images.
    count: usize,
    /// The number of units.
    units: usize,
}

impl Dyads {
    /// Those of these pairs, and for each pair the place of its dyad.
    pub(super) fn of(pairs: impl Iterator<Item = (u32, u32)>) -> (Self, Vec<usize>) {
        let mut numbers = BTreeMap::<u32, usize>::new();
        let mut places = BTreeMap::<(u32, u32), usize>::new();
        let mut images = Vec::new();
        let of_pairs = pairs
            .map(|(a, b)| {
                *places.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let mut number = |image| {
                        let next = numbers.len();
                        *numbers.entry(image).or_insert(next)
                    };
                    images.push([number(a), number(b)]);
                    images.len() - 1
                })
            })
            .collect();
        let mut pairs_of = vec![0; numbers.len()];
        for image in images.iter().flatten() {
            pairs_of[*image] += 1;
        }
        let shared = pairs_of.iter().filter(|&&pairs| pairs > 1).count();
        let alone = (images.iter()).filter(|[a, b]| pairs_of[*a] == 1 && pairs_of[*b] == 1);
        let units = shared + alone.count();
        let dyads = Self {
            images,
            count: numbers.len(),
            units,
        };
        (dyads, of_pairs)
    }

    pub(super) fn len(&self) -> usize {
        self.images.len()
    }

    pub(super) fn units(&self) -> usize {
        self.units
    }

    /// The ratio of these sums, numerators and denominators for each dyad; `None` if the denominators add up to 0.
    pub(super) fn ratio(&self, sums: &[(f64, f64)]) -> Option<Ratio> {
        let (top, bottom) =
            (sums.iter()).fold((0.0, 0.0), |total, sum| (total.0 + sum.0, total.1 + sum.1));
        if bottom.is_nan() || bottom <= 0.0 {
            return None;
        }
        let value = top / bottom;
        let mut of_images = vec![0.0; self.count];
        let mut own = 0.0;
        for (&[a, b], &(top, bottom)) in self.images.iter().zip(sums) {
            let residual = top - value * bottom;
            of_images[a] += residual;
            of_images[b] += residual;
            own += residual * residual;
        }
        let shared: f64 = of_images.iter().map(|sum| sum * sum).sum();
        let independent = self.len() as f64 / self.len().saturating_sub(1).max(1) as f64 * own;
        let squared = (self.correction(sums, bottom) * (shared - own)).max(independent);
        Some(Ratio {
            value,
            error: squared.sqrt() / bottom,
            units: self.units,
        })
    }
}

impl Dyads {
    /// The factor of step 3, for these sums, whose denominators add up to `bottom`. Infinite if so few images would have
    /// no variance left.
    ///
    /// With e_i the number of image i, d_i the sum of the denominators w of its pairs, D that of all and q the sum of
    /// d_i^2, the ratio is `sum d_i e_i / D` and its variance `q / D^2`. The residual of a pair (a, b) is
    /// `w (e_a + e_b - sum d_i e_i / D)`. Sums of these over images are linear in e too, so the expected squares of both
    /// follow.
    fn correction(&self, sums: &[(f64, f64)], bottom: f64) -> f64 {
        let mut of_images = vec![0.0; self.count];
        for (&[a, b], &(_, weight)) in self.images.iter().zip(sums) {
            of_images[a] += weight;
            of_images[b] += weight;
        }
        let q: f64 = of_images.iter().map(|d| d * d).sum();
        let cubes: f64 = of_images.iter().map(|d| d * d * d).sum();
        let (mut shared, mut own) = (q * q / (bottom * bottom) + q - 2.0 * cubes / bottom, 0.0);
        for (&[a, b], &(_, weight)) in self.images.iter().zip(sums) {
            let (a, b) = (of_images[a], of_images[b]);
            shared += 2.0 * weight * weight - 4.0 * weight * a * b / bottom;
            own += weight * weight * (2.0 - 2.0 * (a + b) / bottom + q / (bottom * bottom));
        }
        let left = (shared - own) / q;
        if left > 1e-9 {
            1.0 / left
        } else {
            f64::INFINITY
        }
    }
}

/// A ratio of sums over pairs, with its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ratio {
    pub(super) value: f64,
    pub(super) error: f64,
    pub(super) units: usize,
}

impl Ratio {
    /// That of these terms; `None` if the score is about none of them.
    pub(super) fn of(terms: impl IntoIterator<Item = Term>) -> Option<Self> {
        let terms = terms.into_iter().filter(|term| term.denominator != 0.0);
        let terms: Vec<Term> = terms.collect();
        let (dyads, places) = Dyads::of(terms.iter().map(|term| term.images));
        let mut sums = vec![(0.0, 0.0); dyads.len()];
        for (term, place) in terms.iter().zip(places) {
            sums[place].0 += term.numerator;
            sums[place].1 += term.denominator;
        }
        dyads.ratio(&sums)
    }

    /// Half the width of the interval, in the unit of the score.
    fn reach(&self) -> Option<f64> {
        (self.units >= MIN_IMAGES).then(|| students_t::quantile(self.units - 1) * self.error)
    }

    /// The interval of any number.
    pub(super) fn interval(&self) -> Option<Interval> {
        let reach = self.reach()?;
        Some(Interval {
            low: self.value - reach,
            high: self.value + reach,
        })
    }

    /// The interval of a mean count, which is not negative.
    pub(super) fn interval_of_count(&self) -> Option<Interval> {
        let Interval { low, high } = self.interval()?;
        let low = low.max(0.0);
        Some(Interval { low, high })
    }

    /// The interval of a share between 0 and 1.
    pub(super) fn interval_of_share(&self) -> Option<Interval> {
        let (reach, value) = (self.reach()?, self.value);
        if self.error < ROUNDING || value <= 0.0 || value >= 1.0 {
            let value = value.clamp(0.0, 1.0);
            let unlike = 1.0 - libm::pow(ALPHA / 2.0, 1.0 / self.units as f64);
            return Some(Interval {
                low: value * (1.0 - unlike),
                high: value + (1.0 - value) * unlike,
            });
        }
        let logit = libm::log(value / (1.0 - value));
        let reach = reach / (value * (1.0 - value));
        let share = |logit: f64| 1.0 / (1.0 + libm::exp(-logit));
        Some(Interval {
            low: share(logit - reach),
            high: share(logit + reach),
        })
    }
}

#[cfg(test)]
mod tests {
    use matchbench_vision::seed::{Rng, Seed};

    use super::*;

    fn term(images: (u32, u32), numerator: f64) -> Term {
        Term {
            images,
            numerator,
            denominator: 1.0,
        }
    }

    #[test]
    fn of_pairs_that_share_nothing_it_is_the_error_of_a_mean() {
        // Values 0 or 1 in equal numbers: the standard error of the mean is 0.5 / sqrt(399).
        let terms = (0..400).map(|i| term((2 * i, 2 * i + 1), f64::from(i % 2)));
        let ratio = Ratio::of(terms).expect("there are pairs");
        assert_eq!((ratio.value, ratio.units), (0.5, 400));
        assert!(
            (ratio.error - 0.5 / 399_f64.sqrt()).abs() < 1e-12,
            "{ratio:?}"
        );
        let interval = ratio.interval().expect("400 pairs are enough");
        assert!((interval.high - 0.5492).abs() < 1e-4, "{interval:?}");
    }

    #[test]
    fn of_first_images_with_second_images_of_their_own_it_is_the_error_over_first_images() {
        // Twenty images that are wholly right or wholly wrong, each with twenty pairs.
        let terms = (0..400).map(|i| term((i / 20, 1000 + i), f64::from(i / 20 % 2)));
        let ratio = Ratio::of(terms).expect("there are pairs");
        assert_eq!(ratio.units, 20);
        assert!(
            (ratio.error - 0.5 / 19_f64.sqrt()).abs() < 1e-12,
            "{ratio:?}"
        );
    }

    #[test]
    fn of_all_pairs_it_is_the_sum_over_pairs_that_share_an_image() {
        let mut rng = Seed(4).rng();
        let pairs: Vec<(u32, u32)> = (0..9)
            .flat_map(|a| (a + 1..9).map(move |b| (a, b)))
            .collect();
        let effects: Vec<f64> = (0..9).map(|_| rng.normal()).collect();
        let values: Vec<f64> = (pairs.iter())
            .map(|&(a, b)| effects[a as usize] + effects[b as usize] + rng.normal())
            .collect();
        let mean = values.iter().sum::<f64>() / 36.0;
        let mut sum = 0.0;
        for (p, u) in pairs.iter().zip(&values) {
            for (q, v) in pairs.iter().zip(&values) {
                if [p.0, p.1].iter().any(|image| [q.0, q.1].contains(image)) {
                    sum += (u - mean) * (v - mean);
                }
            }
        }
        let expected = (sum * (9.0 * 8.0) / (7.0 * 6.0)).sqrt() / 36.0;
        // The order within a pair, and repetitions of all, change nothing.
        let terms = (pairs.iter().zip(&values)).map(|(&(a, b), &value)| term((a, b), value));
        let turned = (pairs.iter().zip(&values)).map(|(&(a, b), &value)| term((b, a), value));
        for ratio in [
            Ratio::of(terms.clone()),
            Ratio::of(turned.clone()),
            Ratio::of(terms.chain(turned)),
        ] {
            let ratio = ratio.expect("there are pairs");
            assert_eq!(ratio.units, 9);
            assert!(
                (ratio.error - expected).abs() < 1e-12,
                "{ratio:?}, {expected}"
            );
        }
    }

    /// A score of `images` images, all pairs of them, whose difficulty depends on both; its mean is 0.
    fn drawn(images: u32, rng: &mut Rng) -> Vec<Term> {
        let effects: Vec<f64> = (0..images).map(|_| rng.normal()).collect();
        let pairs = (0..images).flat_map(|a| (a + 1..images).map(move |b| (a, b)));
        let pairs: Vec<(u32, u32)> = pairs.collect();
        (pairs.into_iter())
            .map(|(a, b)| {
                let value = effects[a as usize] + effects[b as usize] + rng.normal();
                term((a, b), value)
            })
            .collect()
    }

    #[test]
    fn intervals_hold_the_true_score_in_19_of_20_cases() {
        let mut rng = Seed(9).rng();
        for images in [6, 10, 30] {
            let holds = (0..1000)
                .filter(|_| {
                    let ratio = Ratio::of(drawn(images, &mut rng)).expect("there are pairs");
                    let interval = ratio.interval().expect("six images");
                    (interval.low..interval.high).contains(&0.0)
                })
                .count();
            assert!((920..=980).contains(&holds), "{images} images: {holds}");
        }
    }

    #[test]
    fn paired_differences_are_sharper() {
        // Two matchers, one 0.1 better on every image, whatever the image: no doubt about it.
        let hard = |i: u32| f64::from(i % 10) / 20.0;
        let terms = (0..50).map(|i| term((i, i + 1), (hard(i) + 0.1) - hard(i)));
        let ratio = Ratio::of(terms).expect("there are pairs");
        let interval = ratio.interval().expect("enough images");
        assert!((interval.low - 0.1).abs() < 1e-12 && (interval.high - 0.1).abs() < 1e-12);
    }

    #[test]
    fn shares_stay_between_0_and_1_and_are_unsure_at_both_ends() {
        let of = |right: u32| {
            let terms = (0..20).map(|i| term((i, 100 + i), f64::from(u8::from(i < right))));
            let ratio = Ratio::of(terms).expect("there are pairs");
            ratio.interval_of_share().expect("twenty pairs")
        };
        let (none, one, half, all) = (of(0), of(1), of(10), of(20));
        // Clopper and Pearson: 1 - 0.025^(1/20).
        assert_eq!(none.low, 0.0);
        assert!((none.high - 0.168_433).abs() < 1e-6, "{none:?}");
        assert!((all.low - (1.0 - none.high)).abs() < 1e-12 && all.high == 1.0);
        assert!(one.low > 0.0 && one.high > none.high && one.high < half.high);
        assert!((half.low + half.high - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_share_of_pairs_that_are_all_alike_is_not_certain() {
        // The AUC of 20 pairs that all pass 14 of 15 thresholds.
        let terms = (0..20).map(|i| term((i, 100 + i), 14.0 / 15.0));
        let ratio = Ratio::of(terms).expect("there are pairs");
        let interval = ratio.interval_of_share().expect("twenty pairs");
        let unlike = 1.0 - 0.025_f64.powf(1.0 / 20.0);
        assert!(
            (interval.low - 14.0 / 15.0 * (1.0 - unlike)).abs() < 1e-9,
            "{interval:?}"
        );
        assert!(
            (interval.high - (14.0 + unlike) / 15.0).abs() < 1e-9,
            "{interval:?}"
        );
    }

    #[test]
    fn no_interval_without_evidence() {
        assert_eq!(Ratio::of([]), None);
        let few = Ratio::of((0..5).map(|i| term((i, 10 + i), 0.5))).expect("there are pairs");
        assert_eq!((few.units, few.interval()), (5, None));
        // Pairs that a score is not about are no evidence.
        let never_right = (0..20).map(|i| Term {
            denominator: 0.0,
            ..term((i, 30 + i), 0.0)
        });
        assert_eq!(Ratio::of(never_right.clone()), None);
        let one = Ratio::of(never_right.chain([term((90, 91), 7.0)])).expect("one is right");
        assert_eq!((one.value, one.units), (7.0, 1));
        assert_eq!(one.interval_of_count(), None);
    }

    #[test]
    fn an_interval_reaches_as_many_errors_as_students_t_with_one_freedom_less_than_units() {
        // 0 to 5: mean 2.5, standard error sqrt(3.5 / 6), and t is 2.570582 with 5 degrees of freedom.
        let terms = (0..6).map(|i| term((i, 10 + i), f64::from(i)));
        let ratio = Ratio::of(terms).expect("there are pairs");
        let reach = 2.570_582 * (3.5_f64 / 6.0).sqrt();
        let interval = ratio.interval().expect("six units");
        assert!((interval.low - (2.5 - reach)).abs() < 1e-6, "{interval:?}");
        assert!((interval.high - (2.5 + reach)).abs() < 1e-6, "{interval:?}");
    }

    #[test]
    fn the_interval_of_a_count_ends_at_0() {
        // One of six pairs has 600, the others none: mean 100, standard error 100.
        let terms = (0..6).map(|i| term((i, 10 + i), if i == 0 { 600.0 } else { 0.0 }));
        let ratio = Ratio::of(terms).expect("there are pairs");
        let interval = ratio.interval_of_count().expect("six units");
        assert_eq!(interval.low, 0.0);
        assert!((interval.high - 357.0582).abs() < 1e-3, "{interval:?}");
    }
}
