//! Intervals of scores: how far a score would move with other reference images, by a percentile bootstrap
//! over clusters.
//!
//! Efron and Tibshirani: "An Introduction to the Bootstrap", 1993, ch. 13 (percentile intervals);
//! Field and Welsh: "Bootstrapping clustered data", JRSS B 69(3), 2007 (clusters).
//!
//! 1. The pairs of one reference image `a` share its features and its difficulty, so they are not
//!    independent; the images are resampled, each with all of its pairs. Resampling pairs would
//!    give intervals that are too narrow.
//! 2. A score is a ratio of sums over pairs ([`Term`]): for the AUC the share of thresholds passed
//!    over 1, for AP the correspondences over "is right".
//! 3. Draw as many reference images as there are, with replacement; take the ratio; repeat; the
//!    interval is between the 2.5 and the 97.5 % quantile (linear between order statistics).
//! 4. With few reference images such intervals are too narrow: of 3, 5, 10 and 20 images they hold the true
//!    difference of two methods in some 74, 83, 90 and 93 of 100 cases (normal differences). Below
//!    [`MIN_IMAGES`] there is none. Whether a difference is certain is another question
//!    (`significance.rs`).
//! 5. The difference of two matchers on the same pairs is a score too, whose term is the difference of
//!    theirs. Its interval is much narrower than the two separate intervals suggest, because hard images
//!    are hard for both.
//!
//! | parameter | field | default | source |
//! | --- | --- | --- | --- |
//! | resamples | `resamples` | 1000 | Efron and Tibshirani, ch. 13.3 |
//! | confidence | `level` | 0.95 | convention |
//! | seed | `seed` | 0 | ours; the same for every score, so the same images are drawn |

use std::collections::BTreeMap;

use matchbench_vision::seed::Seed;
use serde::Serialize;

/// Reference images below which there is no interval, and no difference is certain. A difference that has the
/// same sign on each of five images has it by chance in 1 of 16 cases, and no resample of these has another.
pub const MIN_IMAGES: usize = 6;

/// What one pair adds to a score.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Term {
    /// The reference image that the pair belongs to.
    pub cluster: u32,
    /// Added above the fraction bar.
    pub numerator: f64,
    /// Added below the fraction bar.
    pub denominator: f64,
}

/// The range in which a score lies with the confidence of [`Bootstrap::level`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Percentile bootstrap over reference images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bootstrap {
    /// How often the reference images are drawn anew.
    pub resamples: usize,
    /// Confidence, in `(0, 1)`.
    pub level: f64,
    /// The same seed gives the same intervals.
    pub seed: Seed,
}

impl Default for Bootstrap {
    fn default() -> Self {
        Self {
            resamples: 1000,
            level: 0.95,
            seed: Seed(0),
        }
    }
}

impl Bootstrap {
    /// The interval of `sum of numerators / sum of denominators`.
    ///
    /// `None` with fewer than [`MIN_IMAGES`] reference images, and where
    /// fewer than half of the resamples have a score at all (AP of a matcher that is hardly ever
    /// right).
    pub fn interval(&self, terms: impl IntoIterator<Item = Term>) -> Option<Interval> {
        let clusters = sums_by_cluster(terms);
        if clusters.len() < MIN_IMAGES || self.resamples == 0 {
            return None;
        }
        let mut rng = self.seed.child("bootstrap").rng();
        let mut scores: Vec<f64> = (0..self.resamples)
            .filter_map(|_| {
                let (mut numerator, mut denominator) = (0.0, 0.0);
                for _ in 0..clusters.len() {
                    let drawn = clusters[rng.below(clusters.len() as u32) as usize];
                    numerator += drawn.0;
                    denominator += drawn.1;
                }
                (denominator > 0.0).then(|| numerator / denominator)
            })
            .collect();
        self.between_tails(&mut scores)
    }
}

impl Bootstrap {
    /// The interval of a score of so many reference images that is no ratio of sums: `score` is given
    /// how often each of them was drawn.
    ///
    /// `None` as [`Bootstrap::interval`].
    pub(super) fn interval_of(
        &self,
        images: usize,
        score: impl Fn(&[u32]) -> f64,
    ) -> Option<Interval> {
        if images < MIN_IMAGES || self.resamples == 0 {
            return None;
        }
        let mut rng = self.seed.child("bootstrap").rng();
        let mut scores: Vec<f64> = (0..self.resamples)
            .map(|_| {
                let mut times = vec![0; images];
                for _ in 0..images {
                    times[rng.below(images as u32) as usize] += 1;
                }
                score(&times)
            })
            .filter(|score| score.is_finite())
            .collect();
        self.between_tails(&mut scores)
    }

    /// The interval between the tails of resampled scores, if most resamples have one.
    fn between_tails(&self, scores: &mut [f64]) -> Option<Interval> {
        if scores.len() * 2 < self.resamples {
            return None;
        }
        scores.sort_by(f64::total_cmp);
        let tail = (1.0 - self.level) / 2.0;
        Some(Interval {
            low: quantile(scores, tail),
            high: quantile(scores, 1.0 - tail),
        })
    }
}

/// Numerators and denominators added up for each reference image, in the order of the images.
pub(super) fn sums_by_cluster(terms: impl IntoIterator<Item = Term>) -> Vec<(f64, f64)> {
    let mut sums = BTreeMap::<u32, (f64, f64)>::new();
    for term in terms {
        let sum = sums.entry(term.cluster).or_default();
        sum.0 += term.numerator;
        sum.1 += term.denominator;
    }
    sums.into_values().collect()
}

/// The value that a share `q` of the sorted values lies below, linear between neighbours (the
/// default of R and numpy). The values must not be empty.
pub(super) fn quantile(sorted: &[f64], q: f64) -> f64 {
    let position = q * (sorted.len() - 1) as f64;
    let below = position.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (position - below as f64) * (sorted[above] - sorted[below])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn term(cluster: u32, numerator: f64) -> Term {
        Term {
            cluster,
            numerator,
            denominator: 1.0,
        }
    }

    #[test]
    fn interval_covers_the_mean_as_theory_says() {
        // 400 clusters of one pair, values 0 or 1 in equal numbers: the standard error of the mean
        // is 0.5 / sqrt(400) = 0.025, so the interval is about 0.5 -+ 1.96 * 0.025 = 0.451 to 0.549.
        let terms = (0..400).map(|i| term(i, f64::from(i % 2)));
        let interval = Bootstrap::default()
            .interval(terms)
            .expect("400 clusters are enough");
        assert!((interval.low - 0.451).abs() < 0.008, "{interval:?}");
        assert!((interval.high - 0.549).abs() < 0.008, "{interval:?}");
    }

    #[test]
    fn pairs_of_one_image_stay_together() {
        // The same 400 values, but in 20 images that are wholly right or wholly wrong: there are
        // 20 independent draws, not 400, and the interval is sqrt(20) times as wide.
        let width = |cluster: fn(u32) -> u32, value: fn(u32) -> u32| {
            let terms = (0..400).map(|i| term(cluster(i), f64::from(value(i))));
            let interval = Bootstrap::default().interval(terms).expect("enough images");
            interval.high - interval.low
        };
        let apart = width(|i| i, |i| i / 20 % 2);
        let together = width(|i| i / 20, |i| i / 20 % 2);
        assert!((together / apart - 20_f64.sqrt()).abs() < 0.5);
    }

    #[test]
    fn paired_differences_are_sharper() {
        // Two matchers, one 0.1 better on every image, whatever the image: no doubt about it.
        let hard = |i: u32| f64::from(i % 10) / 20.0;
        let terms = (0..50).map(|i| term(i, (hard(i) + 0.1) - hard(i)));
        let interval = Bootstrap::default().interval(terms).expect("enough images");
        assert!((interval.low - 0.1).abs() < 1e-12 && (interval.high - 0.1).abs() < 1e-12);
    }

    #[test]
    fn the_same_seed_gives_the_same_interval() {
        let terms = || (0..30).map(|i| term(i, f64::from(i * i % 7)));
        let bootstrap = Bootstrap::default();
        assert_eq!(bootstrap.interval(terms()), bootstrap.interval(terms()));
        let other = Bootstrap {
            seed: Seed(1),
            ..bootstrap
        };
        assert_ne!(bootstrap.interval(terms()), other.interval(terms()));
    }

    #[test]
    fn no_interval_without_evidence() {
        let bootstrap = Bootstrap::default();
        assert_eq!(bootstrap.interval([]), None);
        assert_eq!(bootstrap.interval([term(3, 0.2), term(3, 0.9)]), None);
        let never_right = (0..20).map(|cluster| Term {
            cluster,
            numerator: 0.0,
            denominator: 0.0,
        });
        assert_eq!(bootstrap.interval(never_right), None);
    }

    #[test]
    fn quantiles_are_linear_between_values() {
        assert_eq!(quantile(&[1.0, 2.0, 4.0], 0.5), 2.0);
        assert_eq!(quantile(&[1.0, 2.0, 4.0], 0.75), 3.0);
        assert_eq!(quantile(&[1.0], 0.975), 1.0);
    }
}
