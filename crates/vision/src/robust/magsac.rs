//! MAGSAC++: a score that averages over all noise levels up to a largest one, so that its threshold need not be
//! exact.

use std::ops::Range;

use super::{Scoring, Support};

/// k: 99 % of the residuals of right matches are within k sigma (4 degrees of freedom).
const QUANTILE: f64 = 3.64;
/// Number of entries of the table of the loss.
const ENTRIES: usize = 2048;

/// The loss of a residual, marginalised over all noise levels up to a largest one (Barath, Noskova,
/// Ivashechkin, Matas, "MAGSAC++, a Fast, Reliable and Accurate Robust Estimator", CVPR 2020,
/// sec. 3.1).
///
/// For `s = r^2 / (2 sigma_max^2)` and n = 4 degrees of freedom, as in the paper for two-view geometry, the
/// loss is, up to a factor, `gamma(5/2, s) / 2 + s/2 (Gamma(3/2, s) - Gamma(3/2, k^2/2))` up to `k sigma_max`,
/// and constant beyond. A datum adds one minus its loss, divided by the loss of an outlier, to the quality.
#[derive(Clone, Debug, PartialEq)]
pub struct Magsac {
    squared_threshold: f64,
    /// The contribution of a datum to the quality, over its squared residual from 0 to the threshold.
    table: Vec<f64>,
}

impl Magsac {
    /// The score, where the residuals of right matches are at most `k sigma_max`; the square of this is given,
    /// which is positive.
    pub fn new(squared_threshold: f64) -> Self {
        let last = 0.5 * QUANTILE * QUANTILE;
        let worst = loss(last, last);
        let table = (0..=ENTRIES)
            .map(|entry| 1.0 - loss(last * entry as f64 / ENTRIES as f64, last) / worst)
            .collect();
        Self {
            squared_threshold,
            table,
        }
    }
}

/// The loss at s, up to a factor, for s up to `last`.
fn loss(s: f64, last: f64) -> f64 {
    let complete = 0.5 * std::f64::consts::PI.sqrt();
    let upper = |s| complete - lower_three_halves(s);
    let lower_five_halves = 1.5 * lower_three_halves(s) - s * s.sqrt() * libm::exp(-s);
    0.5 * lower_five_halves + 0.5 * s * (upper(s) - upper(last))
}

/// The lower incomplete gamma function at 3/2.
fn lower_three_halves(s: f64) -> f64 {
    let root = s.sqrt();
    0.5 * std::f64::consts::PI.sqrt() * libm::erf(root) - root * libm::exp(-s)
}

impl Scoring for Magsac {
    fn support(&self, _range: Range<usize>, squared_residuals: &mut [f64]) -> Support {
        let scale = ENTRIES as f64 / self.squared_threshold;
        let (mut quality, mut inliers) = (0.0, 0);
        for &squared in &*squared_residuals {
            if squared <= self.squared_threshold {
                // A threshold may be so small that its inverse is infinite.
                quality += self.table[((squared * scale) as usize).min(ENTRIES)];
                inliers += 1;
            }
        }
        Support {
            quality,
            inliers,
            squared_threshold: self.squared_threshold,
        }
    }

    fn upper_bound(&self, range: Range<usize>) -> Option<f64> {
        Some(range.len() as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gamma_functions_are_those_of_tables() {
        // Gamma(3/2, 1) = 0.5072822, so the lower one is 0.8862269 - 0.5072822.
        assert!((lower_three_halves(1.0) - 0.378_944_7).abs() < 1e-6);
        assert!(lower_three_halves(0.0).abs() < 1e-15);
    }

    #[test]
    fn what_a_datum_adds_falls_from_one_to_nothing() {
        let score = Magsac::new(4.0);
        assert!((score.table[0] - 1.0).abs() < 1e-12);
        assert!(score.table[ENTRIES].abs() < 1e-12);
        assert!(score.table.windows(2).all(|pair| pair[1] < pair[0]));
        let support = score.support(0..5, &mut [0.0, 4.0, 4.1, f64::NAN, f64::INFINITY]);
        assert_eq!(support.inliers, 2);
        assert!((support.quality - 1.0).abs() < 1e-12);
    }

    /// The loss with its gamma functions integrated step by step.
    #[test]
    fn the_loss_is_that_of_its_integrals() {
        let gamma = |power: f64, from: f64, to: f64| {
            let (steps, width) = (20_000, (to - from) / 20_000.0);
            let middles = (0..steps).map(|step| from + (f64::from(step) + 0.5) * width);
            middles
                .map(|t| width * t.powf(power - 1.0) * (-t).exp())
                .sum::<f64>()
        };
        let last = 3.64 * 3.64 / 2.0;
        let loss = |s: f64| gamma(2.5, 0.0, s) / 2.0 + s / 2.0 * gamma(1.5, s, last);
        let score = Magsac::new(9.0);
        for share in [0.1, 0.25, 0.5, 0.9] {
            let found = score.support(0..1, &mut [9.0 * share]).quality;
            let expected = 1.0 - loss(share * last) / loss(last);
            // The table has 2048 entries.
            assert!(
                (found - expected).abs() < 2e-3,
                "{share}: {found} {expected}"
            );
        }
    }
}
