//! CODE: matches that move as their neighbours do, decided for all of them at once.
//!
//! W.-Y. Lin, F. Wang, M.-M. Cheng, S.-K. Yeung, P. H. S. Torr, M. N. Do, J. Lu: "CODE: Coherence
//! Based Decision Boundaries for Feature Correspondence", IEEE Transactions on Pattern Analysis
//! and Machine Intelligence 40(1), 34-47, 2018 (online 2017).
//!
//! 1. A match is a point `[x, y, u - x, v - y, A]`: its place, its displacement, and the affine map
//!    between the two local frames without its scale. Places are normalised (zero mean, mean
//!    distance sqrt(2) from it).
//! 2. *Likelihood*: seeds are matches that pass a strict ratio test. The constant 1 is regressed on
//!    them with a Gaussian kernel, a ridge and Huber's loss; a seed without like neighbours
//!    cannot pull the function to 1, so its value says how coherent a match is.
//! 3. *Motion*: on the seeds that are likely, an affine motion that varies smoothly with the point
//!    of a match is regressed to the places in `b`, again with Huber's loss.
//! 4. *All* matches are decided by both functions: those of high likelihood whose transfer error
//!    is small stay, whether or not they passed the ratio test.
//! 5. A second pass takes its seeds from what the first one kept.
//!
//! | field | default | source |
//! | --- | --- | --- |
//! | `seed_ratio` | 2/3 | the authors' program: squared ratio 2.25 |
//! | `seeds` | 1000 | the authors' program |
//! | `centres` | 300 | the motion's seeds in the authors' program |
//! | `ridge` | 1 | the authors' program |
//! | `huber` | 0.1 | the authors' program |
//! | `likelihoods` | 0.6, 0.7 | the authors' program, one for each pass |
//! | `squared_transfer` | 0.01 | the authors' program |
//! | `max_aspect` | 5 | the authors' program |
//! | `displacement_scale` | 3 | - |
//!
//! *Differs from the authors' program*: kernels are centred at some of the seeds only (see
//! `regression`), which makes the cost of a decision that of a few hundred kernels; displacements
//! weigh `displacement_scale` times as much as places; a match must satisfy both functions, there
//! one of them is enough.

mod regression;

use nalgebra::{DMatrix, Matrix2, Point2};

use super::{Correspondence, Correspondences, Selector, View};
use crate::features::Features;
use crate::params::ParamError;
use crate::seed::{Rng, Seed};
use regression::{Point, SparseRow, evaluate, fit, kernels};

/// Parameters of [`Code`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct CodeParams {
    /// Largest ratio of nearest to second nearest distance of a seed, in `(0, 1]`.
    pub seed_ratio: f32,
    /// Seeds at most, drawn at random from those that pass; at least 10.
    pub seeds: usize,
    /// Kernels at most; at least 10.
    pub centres: usize,
    /// Weight of the squared coefficients against the data, positive.
    pub ridge: f64,
    /// Residuals above this count linearly, positive.
    pub huber: f64,
    /// Least likelihood of a match, for each of the two passes.
    pub likelihoods: [f64; 2],
    /// Largest squared distance from where the motion takes a match, in normalised units.
    pub squared_transfer: f64,
    /// Largest ratio of the axes of a relative affine frame.
    pub max_aspect: f64,
    /// Weight of displacements against places in the kernel, positive.
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
        for (name, value) in [("seeds", params.seeds), ("centres", params.centres)] {
            ParamError::unless(value >= 10, name, value, "at least 10")?;
        }
        ParamError::unless(
            params.max_aspect >= 1.0,
            "max_aspect",
            params.max_aspect,
            "at least 1",
        )?;
        Ok(Self { params })
    }

    /// For each match whether it moves as its neighbours do.
    fn decide(
        &self,
        a: &Features,
        b: &Features,
        matches: &[Correspondence],
        seed: Seed,
    ) -> Vec<bool> {
        let (places_a, places_b) = (
            normalised(a, matches, |m| m.a),
            normalised(b, matches, |m| m.b),
        );
        let points: Vec<Option<Point>> = (matches.iter().enumerate())
            .map(|(i, m)| {
                self.point(
                    a.frame(m.a as usize),
                    b.frame(m.b as usize),
                    places_a[i],
                    places_b[i],
                )
            })
            .collect();
        let mut candidates: Vec<usize> = (0..matches.len())
            .filter(|&i| matches[i].distance < self.params.seed_ratio * matches[i].second)
            .collect();
        let mut kept = vec![false; matches.len()];
        for (pass, &least) in self.params.likelihoods.iter().enumerate() {
            candidates.retain(|&i| points[i].is_some());
            shuffle_first(
                &mut candidates,
                self.params.seeds,
                &mut seed.number(pass as u64).rng(),
            );
            let seeds: Vec<Point> = candidates.iter().filter_map(|&i| points[i]).collect();
            let centres = &seeds[..seeds.len().min(self.params.centres)];
            let Some(likelihood) = self.likelihood(&seeds, centres) else {
                return vec![false; matches.len()];
            };
            let verified: Vec<usize> = (candidates.iter().copied().zip(&seeds))
                .filter(|(_, point)| evaluate(&kernels(point, centres), &likelihood)[0] > 0.5)
                .map(|(i, _)| i)
                .collect();
            let motion_centres: Vec<Point> = (verified.iter().filter_map(|&i| points[i]))
                .take(MOTION_CENTRES)
                .collect();
            let Some(motion) = self.motion(&verified, &points, &motion_centres, &places_b) else {
                return vec![false; matches.len()];
            };
            for (i, point) in points.iter().enumerate() {
                kept[i] = point.is_some_and(|point| {
                    let [likelihood] = evaluate(&kernels(&point, centres), &likelihood);
                    if likelihood <= least {
                        return false;
                    }
                    let [u, v] = evaluate(&affine_row(&point, &motion_centres), &motion);
                    let (du, dv) = (u - places_b[i].x, v - places_b[i].y);
                    du * du + dv * dv < self.params.squared_transfer
                });
            }
            candidates = (0..matches.len()).filter(|&i| kept[i]).collect();
        }
        kept
    }

    /// A match as a point; `None` where its frames are too unlike or broken.
    fn point(&self, a: [f32; 4], b: [f32; 4], from: Point2<f64>, to: Point2<f64>) -> Option<Point> {
        let matrix = |m: [f32; 4]| Matrix2::from_row_slice(&m.map(f64::from));
        let relative = matrix(b) * matrix(a).try_inverse()?;
        let scale = relative.determinant().abs().sqrt();
        let m = relative / scale;
        // With determinant 1 the squared norm is r + 1 / r for the ratio r of the axes.
        let aspect = self.params.max_aspect;
        let regular = m.norm_squared() <= aspect + 1.0 / aspect;
        let moved = (to - from) * self.params.displacement_scale;
        (regular && moved.x.is_finite() && moved.y.is_finite())
            .then_some([from.x, from.y, moved.x, moved.y, m.m11, m.m12, m.m21, m.m22])
    }

    /// Coefficients of the likelihood.
    fn likelihood(&self, seeds: &[Point], centres: &[Point]) -> Option<Vec<[f64; 1]>> {
        let rows: Vec<SparseRow> = seeds.iter().map(|seed| kernels(seed, centres)).collect();
        // On the coefficients and not on the function's norm: truncated kernels are not positive
        // definite. A seed on its own still gets 1 / (1 + ridge).
        let penalty = DMatrix::identity(centres.len(), centres.len()) * self.params.ridge;
        fit(
            &rows,
            &vec![[1.0]; seeds.len()],
            &penalty,
            self.params.huber,
        )
    }

    /// Coefficients of the motion, from the matches `verified`.
    fn motion(
        &self,
        verified: &[usize],
        points: &[Option<Point>],
        centres: &[Point],
        places_b: &[Point2<f64>],
    ) -> Option<Vec<[f64; 2]>> {
        let (rows, targets): (Vec<_>, Vec<_>) = (verified.iter())
            .filter_map(|&i| {
                Some((
                    affine_row(&points[i]?, centres),
                    [places_b[i].x, places_b[i].y],
                ))
            })
            .unzip();
        let count = 3 * (centres.len() + 1);
        // The affine motion common to all is free.
        let penalty = DMatrix::from_fn(count, count, |i, j| match (i == j, i < 3) {
            (false, _) => 0.0,
            (true, true) => 1e-9,
            (true, false) => self.params.ridge,
        });
        fit(&rows, &targets, &penalty, self.params.huber)
    }
}

impl Selector for Code {
    fn select(&self, a: View<'_>, b: View<'_>, matches: &mut Correspondences, seed: Seed) {
        let kept = self.decide(a.features, b.features, matches, seed);
        let mut kept = kept.into_iter();
        matches.retain(|_| kept.next().unwrap_or(false));
    }
}

/// Kernels of the motion: each stands for three coefficients.
const MOTION_CENTRES: usize = 60;

/// What the coefficients of an affine motion that varies with the match are multiplied by.
fn affine_row(point: &Point, centres: &[Point]) -> SparseRow {
    let monomials = [point[0], point[1], 1.0];
    let mut row: SparseRow = monomials.into_iter().enumerate().collect();
    for (index, k) in kernels(point, centres) {
        let first = 3 * (index + 1);
        row.extend((0..3).map(|i| (first + i, k * monomials[i])));
    }
    row
}

/// Places of matched keypoints with zero mean and a mean distance of sqrt(2) from it.
fn normalised(
    features: &Features,
    matches: &[Correspondence],
    index: fn(&Correspondence) -> u32,
) -> Vec<Point2<f64>> {
    let places: Vec<Point2<f64>> = (matches.iter())
        .map(|m| features.keypoints[index(m) as usize].at.cast())
        .collect();
    let finite = || places.iter().filter(|p| p.x.is_finite() && p.y.is_finite());
    let count = finite().count().max(1) as f64;
    let mean = finite().fold(nalgebra::Vector2::zeros(), |sum, p| sum + p.coords) / count;
    let distance = finite().map(|p| (p.coords - mean).norm()).sum::<f64>() / count;
    let scale = std::f64::consts::SQRT_2 / distance.max(f64::MIN_POSITIVE);
    (places.iter())
        .map(|p| Point2::from((p.coords - mean) * scale))
        .collect()
}

/// Keeps `count` at most, drawn at random and in random order.
fn shuffle_first(values: &mut Vec<usize>, count: usize, rng: &mut Rng) {
    for i in 0..count.min(values.len()) {
        let other = i + rng.below((values.len() - i) as u32) as usize;
        values.swap(i, other);
    }
    values.truncate(count);
}

#[cfg(test)]
mod tests;
