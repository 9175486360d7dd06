//! The two functions of CODE that say whether a match is coherent with others, the likelihood and the motion:
//! how they are learned from some matches (the seeds) and evaluated for any match.

use nalgebra::{DMatrix, Matrix2, Point2, Vector2};

use super::CodeParams;
use super::regression::{Point, SparseRow, evaluate, fit, kernels};
use crate::features::Features;
use crate::matching::Correspondence;
use crate::seed::Rng;

/// Number of kernels of the motion; each has three coefficients.
const MOTION_CENTRES: usize = 60;
/// A seed is verified if its likelihood is above this.
const VERIFIED: f64 = 0.5;
/// Number of matches that determine an affine motion.
const MIN_VERIFIED: usize = 3;

/// Matches in the form that the learned functions take.
pub(in crate::matching) struct Motions {
    /// `None` for matches that the functions cannot judge.
    points: Vec<Option<Point>>,
    /// Their places in image b, normalised.
    places_b: Vec<Point2<f64>>,
}

impl Motions {
    pub(in crate::matching) fn new(
        a: &Features,
        b: &Features,
        matches: &[Correspondence],
        params: &CodeParams,
    ) -> Self {
        let places_a = normalised(a, matches, |m| m.a);
        let places_b = normalised(b, matches, |m| m.b);
        let frames = |m: &Correspondence| (a.frame(m.a as usize), b.frame(m.b as usize));
        let points = (matches.iter().zip(&places_a).zip(&places_b))
            .map(|((m, &from), &to)| point(frames(m), from, to, params))
            .collect();
        Self { points, places_b }
    }
}

/// The functions that were learned from some matches.
pub(in crate::matching) struct Coherence {
    centres: Vec<Point>,
    likelihood: Vec<[f64; 1]>,
    motion_centres: Vec<Point>,
    motion: Vec<[f64; 2]>,
}

impl Coherence {
    /// Learns from at most `params.seeds` of the matches with the indices `candidates`, drawn at random. `None`
    /// if they do not determine the functions.
    pub(in crate::matching) fn learn(
        motions: &Motions,
        mut candidates: Vec<usize>,
        params: &CodeParams,
        rng: &mut Rng,
    ) -> Option<Self> {
        let points = &motions.points;
        candidates.retain(|&i| points[i].is_some());
        shuffle_first(&mut candidates, params.seeds, rng);
        let seeds: Vec<Point> = candidates.iter().filter_map(|&i| points[i]).collect();
        let centres = seeds[..seeds.len().min(params.centres)].to_vec();
        let likelihood = learn_likelihood(&seeds, &centres, params)?;
        let verified: Vec<(Point, Point2<f64>)> = (candidates.iter().zip(&seeds))
            .filter(|(_, point)| evaluate(&kernels(point, &centres), &likelihood)[0] > VERIFIED)
            .map(|(&i, &point)| (point, motions.places_b[i]))
            .collect();
        // With fewer matches the ridge would still give a motion; with none at all, one to the middle of b.
        if verified.len() < MIN_VERIFIED {
            return None;
        }
        let motion_centres: Vec<Point> = (verified.iter().map(|&(point, _)| point))
            .take(MOTION_CENTRES)
            .collect();
        let motion = learn_motion(&verified, &motion_centres, params)?;
        Some(Self {
            centres,
            likelihood,
            motion_centres,
            motion,
        })
    }

    /// Whether match `index` has a likelihood above `least`, or ends where the motion maps it.
    pub(in crate::matching) fn accepts(
        &self,
        motions: &Motions,
        index: usize,
        least: f64,
        squared_transfer: f64,
    ) -> bool {
        motions.points[index].is_some_and(|point| {
            let [likelihood] = evaluate(&kernels(&point, &self.centres), &self.likelihood);
            if likelihood > least {
                return true;
            }
            let [u, v] = evaluate(&affine_row(&point, &self.motion_centres), &self.motion);
            let to = motions.places_b[index];
            let (du, dv) = (u - to.x, v - to.y);
            du * du + dv * dv < squared_transfer
        })
    }
}

/// A match as a point; `None` if its frames differ too much or are invalid.
fn point(
    (a, b): ([f32; 4], [f32; 4]),
    from: Point2<f64>,
    to: Point2<f64>,
    params: &CodeParams,
) -> Option<Point> {
    let matrix = |m: [f32; 4]| Matrix2::from_row_slice(&m.map(f64::from));
    let relative = matrix(b) * matrix(a).try_inverse()?;
    let scale = relative.determinant().abs().sqrt();
    let m = relative / scale;
    // With determinant 1 the squared norm is r + 1 / r for the ratio r of the axes.
    let aspect = params.max_aspect;
    let regular = m.norm_squared() <= aspect + 1.0 / aspect;
    let moved = (to - from) * params.displacement_scale;
    (regular && moved.x.is_finite() && moved.y.is_finite())
        .then_some([from.x, from.y, moved.x, moved.y, m.m11, m.m12, m.m21, m.m22])
}

/// Coefficients of the likelihood.
fn learn_likelihood(
    seeds: &[Point],
    centres: &[Point],
    params: &CodeParams,
) -> Option<Vec<[f64; 1]>> {
    let rows: Vec<SparseRow> = seeds.iter().map(|seed| kernels(seed, centres)).collect();
    // The penalty is on the coefficients and not on the norm of the function, since truncated kernels are not
    // positive definite. A seed on its own would get 1 / (1 + ridge) by squares alone. By Huber's loss it gets less where
    // `huber` is below ridge / (1 + ridge): nearly huber / ridge.
    let penalty = DMatrix::identity(centres.len(), centres.len()) * params.ridge;
    fit(&rows, &vec![[1.0]; seeds.len()], &penalty, params.huber)
}

/// Coefficients of the motion, from matches and the places where they end.
fn learn_motion(
    verified: &[(Point, Point2<f64>)],
    centres: &[Point],
    params: &CodeParams,
) -> Option<Vec<[f64; 2]>> {
    let (rows, targets): (Vec<_>, Vec<_>) = (verified.iter())
        .map(|(point, to)| (affine_row(point, centres), [to.x, to.y]))
        .unzip();
    let count = 3 * (centres.len() + 1);
    // The affine motion that all matches share has next to no penalty: enough that the system stays regular.
    let penalty = DMatrix::from_fn(count, count, |i, j| match (i == j, i < 3) {
        (false, _) => 0.0,
        (true, true) => 1e-9,
        (true, false) => params.ridge,
    });
    fit(&rows, &targets, &penalty, params.huber)
}

/// The row of the linear system for an affine motion that varies with the match.
fn affine_row(point: &Point, centres: &[Point]) -> SparseRow {
    let monomials = [point[0], point[1], 1.0];
    let mut row: SparseRow = monomials.into_iter().enumerate().collect();
    for (index, k) in kernels(point, centres) {
        let first = 3 * (index + 1);
        row.extend((0..3).map(|i| (first + i, k * monomials[i])));
    }
    row
}

/// Places of matched keypoints, shifted to zero mean and scaled to a mean distance of sqrt(2) from it.
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
    let mean = finite().fold(Vector2::zeros(), |sum, p| sum + p.coords) / count;
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
