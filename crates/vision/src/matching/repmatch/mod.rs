//! RepMatch: coherence learned on the matches that one epipolar geometry explains, repeated
//! structure included.
//!
//! W.-Y. Lin, S. Liu, N. Jiang, M. N. Do, P. Tan, J. Lu: "RepMatch: Robust Feature Matching and Pose
//! for Reconstructing Modern Cities", European Conference on Computer Vision (ECCV) 2016.
//!
//! A repeated structure has two features that look alike, so its matches fail the ratio test and
//! are no seeds of [`Code`]: nothing is learned where facades repeat. Epipolar geometry tells
//! matches apart without looking at them:
//!
//! 1. [`Code`] selects matches.
//! 2. Sample consensus finds the fundamental matrix of the selected ones, with spatially even
//!    samples.
//! 3. *All* matches near their epipolar lines, whether or not they passed a ratio test, are the
//!    training set, from which both functions of CODE are learned anew.
//! 4. All matches are decided by these functions (one of which is enough) and by the epipolar line.
//! 5. Steps 2 to 4 are repeated with what was kept.
//!
//! | field | default | source |
//! | --- | --- | --- |
//! | `coherence` | those of CODE | the paper builds on it |
//! | `rounds` | 2 | - |
//! | `likelihood` | 0.7 | CODE's second pass |
//! | `max_epipolar` | 1/400 | 2 pixels of 640x480 |
//!
//! *Choices the paper leaves open*: no program was published, so what it does not say is ours: the
//! number of rounds, the thresholds, the fundamental matrix (seven points, truncated quadratic
//! score, local optimisation), which asks for no calibration. Where no epipolar geometry is found
//! the matches of CODE stay.

use nalgebra::{Matrix3, Point2};

use super::code::{Code, CodeParams, Coherence, Motions};
use super::{Correspondence, Correspondences, Selector, View};
use crate::features::Features;
use crate::geometry::{PointPairs, squared_sampson_distances};
use crate::image::Size;
use crate::params::ParamError;
use crate::robust::{ConsensusParams, Extras, FundamentalProblem, Msac, Spread, consensus_until};
use crate::seed::Seed;

/// Parameters of [`RepMatch`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct RepMatchParams {
    /// Of the functions, and of the first selection.
    pub coherence: CodeParams,
    /// Times that the functions are learned from what agrees with the epipolar geometry; at most
    /// 10.
    pub rounds: usize,
    /// Least likelihood of a match.
    pub likelihood: f64,
    /// Largest Sampson distance from the epipolar lines, relative to the diagonals of the images;
    /// positive.
    pub max_epipolar: f64,
}

impl Default for RepMatchParams {
    fn default() -> Self {
        Self {
            coherence: CodeParams::default(),
            rounds: 2,
            likelihood: 0.7,
            max_epipolar: 1.0 / 400.0,
        }
    }
}

/// Selection by coherent motion along one epipolar geometry.
#[derive(Clone, Copy, Debug)]
pub struct RepMatch {
    params: RepMatchParams,
    code: Code,
}

impl RepMatch {
    /// A selector with these parameters.
    ///
    /// # Errors
    /// If one of them is out of its range.
    pub fn new(params: RepMatchParams) -> Result<Self, ParamError> {
        let (rounds, max_epipolar) = (params.rounds, params.max_epipolar);
        ParamError::unless(rounds <= 10, "rounds", rounds, "at most 10")?;
        ParamError::unless(
            max_epipolar > 0.0 && max_epipolar.is_finite(),
            "max_epipolar",
            max_epipolar,
            "positive and finite",
        )?;
        ParamError::unless(
            params.likelihood.is_finite(),
            "likelihood",
            params.likelihood,
            "finite",
        )?;
        let code = Code::new(params.coherence)?;
        Ok(Self { params, code })
    }

    /// For each match whether it stays.
    fn decide(
        &self,
        a: &Features,
        b: &Features,
        matches: &[Correspondence],
        seed: Seed,
    ) -> Vec<bool> {
        let coherence = &self.params.coherence;
        let motions = Motions::new(a, b, matches, coherence);
        let mut kept = self.code.decide(&motions, matches, seed.child("code"));
        let pairs = point_pairs(a, b, matches);
        for round in 0..self.params.rounds {
            let seed = seed.number(round as u64);
            let Some(fundamental) = self.fundamental(&pairs, &kept, seed.child("geometry")) else {
                break;
            };
            let near = self.near(&pairs, &fundamental);
            let candidates = (0..matches.len()).filter(|&i| near[i]).collect();
            let rng = &mut seed.child("coherence").rng();
            let Some(learned) = Coherence::learn(&motions, candidates, coherence, rng) else {
                break;
            };
            let (least, transfer) = (self.params.likelihood, coherence.squared_transfer);
            for (i, kept) in kept.iter_mut().enumerate() {
                *kept = near[i] && learned.accepts(&motions, i, least, transfer);
            }
        }
        kept
    }

    /// The epipolar geometry of the matches that are kept.
    fn fundamental(&self, pairs: &PointPairs, kept: &[bool], seed: Seed) -> Option<Matrix3<f64>> {
        let pairs: PointPairs = (0..pairs.len())
            .filter(|&i| kept[i])
            .map(|i| pairs.get(i))
            .collect();
        let score = Msac {
            squared_threshold: self.params.max_epipolar * self.params.max_epipolar,
        };
        let found = consensus_until(
            &FundamentalProblem {
                pairs: &pairs,
                degensac: false,
            },
            &score,
            &mut Spread::new(&pairs, CELLS),
            ConsensusParams {
                confidence: 0.999,
                max_samples: 1000,
            },
            Extras {
                min_samples: 50,
                local_steps: 4,
                sprt: false,
            },
            &mut seed.rng(),
            &|_| false,
        )?;
        Some(found.model)
    }

    /// For each match whether it lies near its epipolar lines.
    fn near(&self, pairs: &PointPairs, fundamental: &Matrix3<f64>) -> Vec<bool> {
        let mut squared = vec![0.0; pairs.len()];
        squared_sampson_distances(fundamental, pairs, 0..pairs.len(), &mut squared);
        let limit = self.params.max_epipolar * self.params.max_epipolar;
        squared.iter().map(|&squared| squared <= limit).collect()
    }
}

impl Selector for RepMatch {
    fn select(&self, a: View<'_>, b: View<'_>, matches: &mut Correspondences, seed: Seed) {
        let kept = self.decide(a.features, b.features, matches, seed);
        let mut kept = kept.into_iter();
        matches.retain(|_| kept.next().unwrap_or(false));
    }
}

/// Cells across and down from which samples are drawn evenly.
const CELLS: u32 = 20;

/// Matched places from the centres of their images, in diagonals.
fn point_pairs(a: &Features, b: &Features, matches: &[Correspondence]) -> PointPairs {
    (matches.iter())
        .map(|m| (place(a, m.a), place(b, m.b)))
        .collect()
}

fn place(features: &Features, index: u32) -> Point2<f64> {
    let Size { width, height } = features.size;
    let (width, height) = (width as f64, height as f64);
    let diagonal = (width * width + height * height).sqrt().max(1.0);
    let at = features.keypoints[index as usize].at.cast::<f64>();
    Point2::new(at.x - 0.5 * width, at.y - 0.5 * height) / diagonal
}

#[cfg(test)]
mod tests;
