//! CODE: matches that move as their neighbours do, decided for all of them at once.
//!
//! W.-Y. Lin, F. Wang, M.-M. Cheng, S.-K. Yeung, P. H. S. Torr, M. N. Do, J. Lu: "CODE: Coherence
//! Based Decision Boundaries for Feature Correspondence", IEEE Transactions on Pattern Analysis
//! and Machine Intelligence 40(1), 34-47, 2018 (online 2017).
//!
//! 1. A match is a point `[x, y, u - x, v - y, A]`: its place, its displacement, and the affine map
//!    between the two local frames without its scale. Places are normalised (zero mean, mean
//!    distance sqrt(2) from it).
//! 2. *Likelihood*: seeds are matches that pass a strict ratio test. The constant 1 is regressed on them with
//!    a Gaussian kernel, a ridge and Huber's loss. A seed without similar neighbours cannot pull the function
//!    to 1, so the value of the function says how coherent a match is.
//! 3. *Motion*: on the seeds that are likely, an affine motion that varies smoothly with the point
//!    of a match is regressed to the places in `b`, again with Huber's loss.
//! 4. *All* matches are decided by both functions: those of high likelihood and those whose
//!    transfer error is small stay, whether or not they passed the ratio test.
//! 5. A second pass takes its seeds from what the first one kept.
//!
//! | field | default | source |
//! | --- | --- | --- |
//! | `seed_ratio` | 2/3 | the authors' program: squared ratio 2.25 |
//! | `seeds` | 1000 | the authors' program |
//! | `centres` | 300 | - (the authors' program: all seeds) |
//! | `ridge` | 1 | the authors' program |
//! | `huber` | 0.1 | the authors' program |
//! | `likelihoods` | 0.6, 0.7 | the authors' program, one for each pass |
//! | `squared_transfer` | 0.01 | the authors' program |
//! | `max_aspect` | 5 | the authors' program |
//! | `displacement_scale` | 3 | - |
//!
//! *Differs from the authors' program*: kernels are centred at some of the seeds only, the
//! likelihood's at `centres` of them, the motion's at 60 of the likely ones (see `regression`),
//! which makes the cost of a decision that of a few hundred kernels; displacements weigh
//! `displacement_scale` times as much as places.

mod coherence;
mod regression;

pub(super) use coherence::{Coherence, Motions};

use super::correspondence::retain_masked;
use super::{Correspondence, Correspondences, RatioTest, Selector, View};
use crate::params::ParamError;
use crate::seed::Seed;

/// Parameters of [`Code`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct CodeParams {
    /// Largest ratio of nearest to second nearest distance of a seed, in `(0, 1]`.
    pub seed_ratio: f32,
    /// Largest number of seeds, drawn at random from those that pass; 10 to 20,000.
    pub seeds: usize,
    /// Largest number of kernels of the likelihood; 10 to 2000. Memory grows with its square, time with its cube.
    pub centres: usize,
    /// Weight of the squared coefficients relative to the data, positive.
    pub ridge: f64,
    /// Residuals above this count linearly, positive.
    pub huber: f64,
    /// Least likelihood of a match, one for each of the two passes; finite.
    pub likelihoods: [f64; 2],
    /// Largest squared distance between the place of a match and the place where the motion maps it, in
    /// normalised units.
    pub squared_transfer: f64,
    /// Largest ratio of the axes of a relative affine frame.
    pub max_aspect: f64,
    /// Weight of displacements relative to places in the kernel, positive.
    pub displacement_scale: f64,
}

impl Default for CodeParams {
    fn default() -> Self {
        Self {
            seed_ratio: 2.0 / 3.0,
            seeds: 1000,
            centres: 300,
            ridge: 1.0,
            huber: 0.1,
            likelihoods: [0.6, 0.7],
            squared_transfer: 0.01,
            max_aspect: 5.0,
            displacement_scale: 3.0,
        }
    }
}

/// Selection by coherent motion.
#[derive(Clone, Copy, Debug)]
pub struct Code {
    params: CodeParams,
}

impl Code {
    /// A selector with these parameters.
    ///
    /// # Errors
    /// If one of them is out of its range.
    pub fn new(params: CodeParams) -> Result<Self, ParamError> {
        let positive = [
            ("seed_ratio", f64::from(params.seed_ratio)),
            ("ridge", params.ridge),
            ("huber", params.huber),
            ("squared_transfer", params.squared_transfer),
            ("displacement_scale", params.displacement_scale),
        ];
        for (name, value) in positive {
            let fine = value > 0.0 && value.is_finite();
            ParamError::unless(fine, name, value, "positive and finite")?;
        }
        let ratio = params.seed_ratio;
        ParamError::unless(ratio <= 1.0, "seed_ratio", ratio, "above 0 and at most 1")?;
        let (seeds, centres) = (params.seeds, params.centres);
        let allowed = (10..=20_000).contains(&seeds);
        ParamError::unless(allowed, "seeds", seeds, "10 to 20000")?;
        let allowed = (10..=2000).contains(&centres);
        ParamError::unless(allowed, "centres", centres, "10 to 2000")?;
        for least in params.likelihoods {
            ParamError::unless(
                least.is_finite(),
                "likelihoods",
                least,
                "two finite numbers",
            )?;
        }
        ParamError::unless(
            params.max_aspect >= 1.0,
            "max_aspect",
            params.max_aspect,
            "at least 1",
        )?;
        Ok(Self { params })
    }

    /// For each match, whether it moves as its neighbours do.
    pub(super) fn decide(
        &self,
        motions: &Motions,
        matches: &[Correspondence],
        seed: Seed,
    ) -> Vec<bool> {
        let params = &self.params;
        let clear = RatioTest {
            ratio: params.seed_ratio,
        };
        let mut candidates: Vec<usize> = (0..matches.len())
            .filter(|&i| clear.keeps(&matches[i]))
            .collect();
        let mut kept = vec![false; matches.len()];
        for (pass, &least) in params.likelihoods.iter().enumerate() {
            let rng = &mut seed.number(pass as u64).rng();
            let Some(coherence) = Coherence::learn(motions, candidates, params, rng) else {
                // What an earlier pass kept stays.
                break;
            };
            for (i, kept) in kept.iter_mut().enumerate() {
                *kept = coherence.accepts(motions, i, least, params.squared_transfer);
            }
            candidates = (0..matches.len()).filter(|&i| kept[i]).collect();
        }
        kept
    }
}

impl Selector for Code {
    fn select(&self, a: View<'_>, b: View<'_>, matches: &mut Correspondences, seed: Seed) {
        let motions = Motions::new(a.features, b.features, matches, &self.params);
        let kept = self.decide(&motions, matches, seed);
        retain_masked(matches, &kept);
    }
}

#[cfg(test)]
mod tests;
