//! When to abandon a model: Wald's sequential probability ratio test.
//!
//! Matas, Chum, "Randomized RANSAC with Sequential Probability Ratio Test", ICCV 2005; Chum, Matas,
//! "Optimal Randomized RANSAC", PAMI 30(8), 2008.
//!
//! A datum agrees with a good model with probability epsilon, with a bad one with probability delta.
//! Data are looked at in random order; the likelihood ratio bad : good is
//! `(delta / epsilon)^agree ((1 - delta) / (1 - epsilon))^disagree`, and once it exceeds A the model is
//! taken for bad. Of good models, at most 1 in A is lost.
//!
//! A balances the time for looking at data against the time for samples drawn in vain (eq. 10): with
//! t_M the time of a sample in units of looking at one datum, m_S the models of a sample and
//! `C = (1 - delta) log((1 - delta) / (1 - epsilon)) + delta log(delta / epsilon)` (eq. 8), A is the
//! fixed point of `A = t_M C / m_S + 1 + log A`.
//!
//! Epsilon is the largest inlier ratio of any model that was the best, delta the mean over the models given up.
//!
//! | symbol | constant | value | source |
//! | --- | --- | --- | --- |
//! | epsilon | `FIRST_EPSILON` | 0.03 | ours: below it a pose is hardly ever found |
//! | delta | `FIRST_DELTA` | 0.01 | Raguram et al., "USAC", PAMI 2013 |
//! | t_M / m_S | `SAMPLE_COST` | 1000 | measured here, five points |
//! | | `CHANGE` | 5 % | Chum, Matas: delta is revised when it is off by more |
//!
//! *Simplified*: the number of samples that are needed is computed with the present A, as if it had been used from the
//! start. *Choice*: data come in blocks, so the test is made after each block only; it then errs less often
//! than planned.

const FIRST_EPSILON: f64 = 0.03;
const FIRST_DELTA: f64 = 0.01;
const SAMPLE_COST: f64 = 1000.0;
const CHANGE: f64 = 0.05;

/// The test, with the parameters for the best model so far.
#[derive(Clone, Debug)]
pub(super) struct Sprt {
    epsilon: f64,
    delta: f64,
    /// Logarithms of the factors for a datum that agrees and for one that does not.
    agree: f64,
    disagree: f64,
    /// log A; infinite if bad models look like good ones.
    limit: f64,
    /// Number of data that were seen of rejected models, and how many of them agreed.
    seen: usize,
    agreed: usize,
}

impl Sprt {
    pub(super) fn new() -> Self {
        let mut this = Self {
            epsilon: FIRST_EPSILON,
            delta: FIRST_DELTA,
            agree: 0.0,
            disagree: 0.0,
            limit: f64::INFINITY,
            seen: 0,
            agreed: 0,
        };
        this.design();
        this
    }

    fn design(&mut self) {
        let (epsilon, delta) = (self.epsilon, self.delta);
        self.agree = libm::log(delta / epsilon);
        self.disagree = libm::log((1.0 - delta) / (1.0 - epsilon));
        // If a bad model agrees with as many data as a good one, there is nothing to test.
        self.limit = f64::INFINITY;
        if delta < epsilon && epsilon < 1.0 {
            let k = SAMPLE_COST * ((1.0 - delta) * self.disagree + delta * self.agree) + 1.0;
            let a = (0..10).fold(k, |a, _| k + libm::log(a));
            self.limit = libm::log(a);
        }
    }

    /// Whether to reject a model that agrees with `agreed` of the first `seen` data.
    pub(super) fn gives_up(&mut self, agreed: usize, seen: usize) -> bool {
        // If all data agree with the best model, the ratio for another such model is not a number.
        if self.limit == f64::INFINITY {
            return false;
        }
        let ratio = agreed as f64 * self.agree + (seen - agreed) as f64 * self.disagree;
        if ratio <= self.limit {
            return false;
        }
        self.seen += seen;
        self.agreed += agreed;
        // At least one half, so that delta is never 0.
        let delta = (self.agreed as f64).max(0.5) / self.seen as f64;
        if (delta - self.delta).abs() > CHANGE * self.delta {
            self.delta = delta;
            self.design();
        }
        true
    }

    /// Uses the inlier ratio of a new best model.
    pub(super) fn best_is(&mut self, inlier_ratio: f64) {
        if inlier_ratio > self.epsilon {
            self.epsilon = inlier_ratio;
            self.design();
        }
    }

    /// A lower bound of the share of good models that are not rejected.
    pub(super) fn power(&self) -> f64 {
        1.0 - libm::exp(-self.limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::{Rng, Seed};

    /// Data after which a model that agrees with this share of them is given up.
    fn given_up(sprt: &mut Sprt, share: f64, rng: &mut Rng) -> Option<usize> {
        let mut agreed = 0;
        (1..2000).find(|&seen| {
            agreed += usize::from(rng.uniform() < share);
            sprt.gives_up(agreed, seen)
        })
    }

    #[test]
    fn bad_models_are_given_up_early_and_good_ones_hardly_ever() {
        let mut rng = Seed(1).rng();
        let mut sprt = Sprt::new();
        sprt.best_is(0.3);
        let looks: usize = (0..1000)
            .map(|_| given_up(&mut sprt, 0.02, &mut rng).expect("a bad model"))
            .sum();
        assert!(looks < 40_000, "{looks}");
        assert!((sprt.delta - 0.02).abs() < 0.01, "{}", sprt.delta);
        let lost = (0..2000)
            .filter(|_| given_up(&mut sprt.clone(), 0.3, &mut rng).is_some())
            .count() as f64;
        // Five standard deviations above the planned rate.
        let planned = 2000.0 * (1.0 - sprt.power());
        assert!(lost <= planned + 5.0 * planned.sqrt(), "{lost} {planned}");
        assert!(sprt.power() > 0.99);
    }

    #[test]
    fn where_bad_models_look_like_good_ones_none_is_given_up() {
        let mut sprt = Sprt::new();
        sprt.delta = 0.2;
        sprt.design();
        assert!(!sprt.gives_up(0, 1_000_000));
        sprt.best_is(1.0);
        for agreed in [0, 999_999, 1_000_000] {
            assert!(!sprt.gives_up(agreed, 1_000_000), "{agreed}");
        }
    }
}
