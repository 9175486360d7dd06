//! Learns DLCO in two stages: which pooling regions are used, then which projection.
//!
//! K. Simonyan, A. Vedaldi, A. Zisserman: "Learning Local Feature Descriptors Using Convex
//! Optimisation", IEEE Transactions on Pattern Analysis and Machine Intelligence 36(8), 2014.
//!
//! Both stages require that an anchor is nearer to its positive than to its negative, by a margin of 1. Both
//! are solved by regularised dual averaging (Xiao, "Dual Averaging Methods for Regularized Stochastic Learning
//! and Online Optimization", JMLR 11, 2010): the next solution minimises
//! `<mean gradient, w> + penalty(w) + gamma / (2 sqrt t) |w|^2`, in closed form.
//!
//! 1. *Regions* (section 3): `d(x, y) = sum_i w_i psi_i(x, y)`, where `psi_i` is the squared distance of the
//!    values pooled in ring i. The penalty `mu sum w` with w >= 0 sets most w to 0:
//!    `w_i = sqrt(t) / gamma max(0, -(mean gradient_i + mu))`. `mu` is the smallest value for which the
//!    selected rings give at most the wanted number of values.
//! 2. *Projection* (section 4): `d(x, y) = (x - y)^T A (x - y)` with A positive semidefinite. The penalty
//!    `mu trace(A)` makes its rank low: `A = sqrt(t) / gamma` times the positive part of
//!    `-(mean gradient + mu I)`. The rows of the projection are the leading eigenvectors of A times the square
//!    roots of their eigenvalues.
//!
//! *Differs from the paper*: gradients are those of batches of triplets. Half of the negatives are the most
//! similar keypoint elsewhere in the other image, and half are random. The second stage works in the leading
//! principal directions, which hold nearly all of the variance.

use anyhow::{Context, Result, bail, ensure};
use indicatif::ProgressBar;
use matchbench_vision::features::dlco::{DlcoTable, Pooling, Ring};
use matchbench_vision::seed::Seed;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use serde::Serialize;

use crate::pairs::{shuffled, stranger};
use crate::patches::PatchSet;
use crate::resume::Checkpoint;

const DIRECTIONS: usize = 8;
/// The state is saved after this many steps.
const CHECKPOINT: usize = 10;

/// Parameters of the training of DLCO.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct MetricParams {
    /// Number of values of the descriptor. Only the last step of the training depends on it.
    #[serde(skip)]
    pub(crate) dimensions: usize,
    /// Most values that the selected rings may give together.
    pub(crate) values: usize,
    /// Number of triplets for the selection of rings.
    pub(crate) ring_triplets: usize,
    /// Number of triplets for the projection.
    pub(crate) triplets: usize,
    /// Number of principal directions that are kept.
    pub(crate) principal: usize,
    /// Number of triplets in a step.
    pub(crate) batch: usize,
    /// Number of steps. What was learned does not depend on it, so steps can be added later.
    #[serde(skip)]
    pub(crate) steps: usize,
    /// Weight of the nuclear norm.
    pub(crate) mu: f64,
    /// Inverse step size.
    pub(crate) gamma: f64,
    pub(crate) seed: u64,
}

/// The state of the training.
#[derive(Debug, PartialEq)]
struct State {
    /// Index and weight of each ring.
    rings: Vec<(usize, f32)>,
    steps: usize,
    /// Sum of the gradients so far, column by column; empty before the first step.
    gradients: Vec<f64>,
}

impl State {
    /// Number of rings, index and weight of each, number of steps, gradients; little-endian.
    fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = (self.rings.len() as u32).to_le_bytes().to_vec();
        for &(ring, weight) in &self.rings {
            bytes.extend((ring as u32).to_le_bytes());
            bytes.extend(weight.to_le_bytes());
        }
        bytes.extend((self.steps as u32).to_le_bytes());
        bytes.extend(self.gradients.iter().flat_map(|value| value.to_le_bytes()));
        bytes
    }

    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (count, bytes) = bytes.split_first_chunk()?;
        let (rings, bytes) = bytes.split_at_checked(8 * u32::from_le_bytes(*count) as usize)?;
        let (steps, gradients) = bytes.split_first_chunk()?;
        let rings = rings.as_chunks::<4>().0.as_chunks::<2>().0.iter();
        Some(Self {
            rings: rings
                .map(|&[ring, weight]| {
                    (
                        u32::from_le_bytes(ring) as usize,
                        f32::from_le_bytes(weight),
                    )
                })
                .collect(),
            steps: u32::from_le_bytes(*steps) as usize,
            gradients: (gradients.as_chunks().0.iter())
                .map(|&value| f64::from_le_bytes(value))
                .collect(),
        })
    }
}

/// Learns a table; continues from the state in `checkpoint`.
pub(crate) fn learn(
    set: &PatchSet,
    params: &MetricParams,
    checkpoint: &Checkpoint,
    bar: &ProgressBar,
) -> Result<DlcoTable> {
    ensure!(!set.triplets.is_empty(), "the set has no triplets");
    let seed = Seed(params.seed).child("dlco");
    let candidates = candidates();
    let mut state = if let Some(bytes) = checkpoint.load()? {
        let state = State::from_bytes(&bytes)
            .filter(|state| {
                let known = |&(ring, _): &(usize, f32)| ring < candidates.len();
                !state.rings.is_empty() && state.rings.iter().all(known)
            })
            .with_context(|| checkpoint.damaged())?;
        // What the earlier steps found is not kept.
        ensure!(
            state.steps <= params.steps,
            "{}: took {} steps already; give --steps that many at least, or delete it to begin anew",
            checkpoint.path().display(),
            state.steps
        );
        state
    } else {
        let rings = select_rings(set, params, &candidates, seed, bar);
        ensure!(
            !rings.is_empty(),
            "no pooling regions of at most {} values tell these patches apart; allow more --values, or learn from more patches",
            params.values
        );
        let state = State {
            rings,
            steps: 0,
            gradients: Vec::new(),
        };
        checkpoint.save(&state.to_bytes())?;
        state
    };
    let rings: Vec<Ring> = state
        .rings
        .iter()
        .map(|&(ring, _)| candidates[ring])
        .collect();
    bar.set_message("pooling");
    let (mut triplets, basis) = Triplets::pool(set, params, &rings, &state.rings, seed);
    triplets.normalise();
    let size = triplets.size;
    let mut gradients = match state.gradients.len() {
        0 => DMatrix::zeros(size, size),
        n if n == size * size => DMatrix::from_column_slice(size, size, &state.gradients),
        _ => bail!("{}", checkpoint.damaged()),
    };
    bar.set_length(params.steps as u64);
    bar.set_position(state.steps as u64);
    let mut metric = solve(&gradients, state.steps, params);
    while state.steps < params.steps {
        let (gradient, violated) = triplets.gradient(&metric, params, state.steps);
        gradients += gradient;
        state.steps += 1;
        metric = solve(&gradients, state.steps, params);
        bar.set_message(format!("violated {violated:.3}, rank {}", metric.ncols()));
        bar.inc(1);
        if state.steps.is_multiple_of(CHECKPOINT) {
            state.gradients = gradients.as_slice().to_vec();
            checkpoint.save(&state.to_bytes())?;
        }
    }
    let rank = metric.ncols();
    ensure!(
        rank >= params.dimensions,
        "the metric has rank {rank}, less than {} dimensions; make --mu smaller",
        params.dimensions
    );
    // The rows apply to the pooled values directly: the weights of the rings and the basis are multiplied in.
    let projection = (metric.columns(0, params.dimensions).transpose() * basis.transpose()).cast();
    Ok(DlcoTable {
        rings,
        projection: (projection.row_iter())
            .map(|row| row.iter().copied().collect())
            .collect(),
    })
}

/// All rings to choose from.
fn candidates() -> Vec<Ring> {
    let mut rings = Vec::new();
    for sigma in [2.0, 3.0, 4.2, 6.0, 8.5] {
        for step in 0..11_u8 {
            let radius = 2.75 * f32::from(step);
            for turn in [0.0, 0.0625, 0.125] {
                if radius > 0.0 || turn == 0.0 {
                    rings.push(Ring {
                        radius,
                        turn,
                        sigma,
                    });
                }
            }
        }
    }
    rings
}

/// Number of values that a ring gives.
fn values(ring: &Ring) -> usize {
    DIRECTIONS * ring.centres().len()
}

/// The patches of some triplets; hard and random negatives alternate.
fn patches_of(set: &PatchSet, most: usize, seed: Seed) -> impl Iterator<Item = [usize; 3]> {
    let order = shuffled(set.triplets.len(), seed);
    order
        .into_iter()
        .take(most)
        .enumerate()
        .map(move |(n, index)| {
            let triplet = set.triplets[index];
            let negative = if n.is_multiple_of(2) {
                triplet.negative as usize
            } else {
                stranger(set, index, seed)
            };
            [triplet.anchor as usize, triplet.positive as usize, negative]
        })
}

/// Indices of the selected rings and their weights; none if there is no selection of at most `values` values.
fn select_rings(
    set: &PatchSet,
    params: &MetricParams,
    candidates: &[Ring],
    seed: Seed,
    bar: &ProgressBar,
) -> Vec<(usize, f32)> {
    let count = params.ring_triplets.min(set.triplets.len());
    bar.set_message("rings");
    bar.set_length(count as u64);
    let mut pooling = Pooling::new(candidates);
    let mut pooled: [Vec<[f32; DIRECTIONS]>; 3] =
        std::array::from_fn(|_| vec![[0.0; DIRECTIONS]; pooling.len()]);
    // psi of the negative minus psi of the positive, one row per triplet.
    let mut margins: Vec<f32> = Vec::with_capacity(count * candidates.len());
    for patches in patches_of(set, count, seed.child("rings")) {
        for (pooled, patch) in pooled.iter_mut().zip(patches) {
            pooling.compute(set.large(patch), pooled);
        }
        let mut first = 0;
        for ring in candidates {
            let range = first..first + values(ring) / DIRECTIONS;
            first = range.end;
            let row = |i: usize| pooled[i][range.clone()].as_flattened();
            let squares = |i: usize| -> f32 {
                row(0)
                    .iter()
                    .zip(row(i))
                    .map(|(x, y)| (x - y) * (x - y))
                    .sum()
            };
            margins.push(squares(2) - squares(1));
        }
        bar.inc(1);
    }
    // Finds the smallest penalty whose selection is small enough, by bisection of its logarithm.
    let (mut low, mut high) = (-16.0, 4.0);
    let mut best = Vec::new();
    for _ in 0..16 {
        let mu = libm::exp2(0.5 * (low + high));
        let weights = sparse_weights(&margins, candidates.len(), mu);
        let kept: Vec<(usize, f32)> = weights
            .into_iter()
            .enumerate()
            .filter(|k| k.1 > 0.0)
            .collect();
        let size: usize = kept
            .iter()
            .map(|&(ring, _)| values(&candidates[ring]))
            .sum();
        if size > params.values {
            low = 0.5 * (low + high);
        } else {
            high = 0.5 * (low + high);
            if !kept.is_empty() {
                best = kept;
            }
        }
    }
    best
}

/// Weights of the rings for the penalty `mu`, after some passes over the triplets.
fn sparse_weights(margins: &[f32], rings: usize, mu: f64) -> Vec<f32> {
    const PASSES: usize = 4;
    const GAMMA: f64 = 2.0;
    let mut weights = vec![0.0_f64; rings];
    let mut sums = vec![0.0_f64; rings];
    let mut t = 0.0_f64;
    for _ in 0..PASSES {
        for row in margins.chunks_exact(rings) {
            t += 1.0;
            let margin: f64 = row
                .iter()
                .zip(&weights)
                .map(|(m, w)| f64::from(*m) * w)
                .sum();
            if margin < 1.0 {
                for (sum, margin) in sums.iter_mut().zip(row) {
                    *sum -= f64::from(*margin);
                }
            }
            let scale = t.sqrt() / GAMMA;
            for (weight, sum) in weights.iter_mut().zip(&sums) {
                *weight = scale * (-(sum / t + mu)).max(0.0);
            }
        }
    }
    weights.into_iter().map(|weight| weight as f32).collect()
}

/// Differences of pooled vectors in principal directions, from anchor to positive and from anchor to negative.
struct Triplets {
    size: usize,
    /// A column for each triplet.
    differences: [DMatrix<f32>; 2],
}

impl Triplets {
    /// Pools, weights and rotates. Also returns the matrix that maps principal directions back to pooled
    /// values.
    fn pool(
        set: &PatchSet,
        params: &MetricParams,
        rings: &[Ring],
        weighted: &[(usize, f32)],
        seed: Seed,
    ) -> (Self, DMatrix<f64>) {
        let weights: Vec<f32> = (rings.iter().zip(weighted))
            .flat_map(|(ring, &(_, weight))| std::iter::repeat_n(weight.sqrt(), values(ring)))
            .collect();
        let all = weights.len();
        let count = params.triplets.min(set.triplets.len());
        let mut pooling = Pooling::new(rings);
        let mut pooled = vec![[0.0; DIRECTIONS]; pooling.len()];
        let mut differences = [DMatrix::zeros(all, count), DMatrix::zeros(all, count)];
        let triplets = patches_of(set, count, seed.child("projection"));
        for (n, patches) in triplets.enumerate() {
            let mut vector = |patch: usize| -> DVector<f32> {
                pooling.compute(set.large(patch), &mut pooled);
                let values = pooled
                    .as_flattened()
                    .iter()
                    .zip(&weights)
                    .map(|(v, w)| v * w);
                DVector::from_iterator(all, values)
            };
            let vectors = patches.map(&mut vector);
            for k in 0..2 {
                differences[k].set_column(n, &(&vectors[0] - &vectors[k + 1]));
            }
        }
        // Differences of patches of different points have twice the covariance of the vectors, up to scale.
        let [_, apart] = &differences;
        let eigen = sorted_eigen((apart * apart.transpose()).cast());
        let size = params.principal.min(all);
        let basis = eigen.1.columns(0, size).into_owned();
        let rotate: DMatrix<f32> = basis.transpose().cast();
        let weights: DVector<f64> =
            DVector::from_iterator(all, weights.iter().map(|&w| f64::from(w)));
        let mut back = basis;
        for mut column in back.column_iter_mut() {
            column.component_mul_assign(&weights);
        }
        let rotated = differences.map(|d| &rotate * d);
        let triplets = Self {
            size,
            differences: rotated,
        };
        (triplets, back)
    }

    /// Scales the differences so that negatives have a mean distance of 1. Then `mu` and `gamma` have the same
    /// meaning for any data.
    fn normalise(&mut self) {
        let count = self.differences[1].ncols() as f32;
        let scale = (count / self.differences[1].norm_squared()).sqrt();
        for differences in &mut self.differences {
            *differences *= scale;
        }
    }

    /// Mean gradient of a batch at `metric = L L^T`, and the share of triplets that violate the margin.
    fn gradient(
        &self,
        metric: &DMatrix<f64>,
        params: &MetricParams,
        step: usize,
    ) -> (DMatrix<f64>, f64) {
        let count = self.differences[0].ncols();
        let batch = params.batch.min(count);
        let columns: Vec<usize> = batch_of(step, batch, count).collect();
        let [same, apart] = (self.differences.each_ref()).map(|d| d.select_columns(&columns));
        let rows: DMatrix<f32> = metric.transpose().cast();
        let squares = |d: &DMatrix<f32>, n: usize| d.column(n).norm_squared();
        let (near, far) = (&rows * &same, &rows * &apart);
        let violating: Vec<usize> = (0..batch)
            .filter(|&n| squares(&near, n) + 1.0 > squares(&far, n))
            .collect();
        let chosen = |d: &DMatrix<f32>| {
            let columns: Vec<_> = violating.iter().map(|&n| d.column(n)).collect();
            if columns.is_empty() {
                DMatrix::zeros(self.size, 1)
            } else {
                DMatrix::from_columns(&columns)
            }
        };
        let (near, far) = (chosen(&same), chosen(&apart));
        let sum = &near * near.transpose() - &far * far.transpose();
        let mean = sum.cast::<f64>() / batch as f64;
        (mean, violating.len() as f64 / batch as f64)
    }
}

/// The triplets of a step, out of `count`: each step goes on where the one before ended, and begins again at the end.
fn batch_of(step: usize, batch: usize, count: usize) -> impl Iterator<Item = usize> {
    (step * batch..(step + 1) * batch).map(move |number| number % count)
}

/// L of the solution `A = L L^T` after `steps` steps whose gradients sum to `gradients`. Columns are in
/// decreasing order of length.
fn solve(gradients: &DMatrix<f64>, steps: usize, params: &MetricParams) -> DMatrix<f64> {
    if steps == 0 {
        return DMatrix::zeros(gradients.nrows(), 1);
    }
    let t = steps as f64;
    let (values, vectors) = sorted_eigen(gradients * (-1.0 / t));
    let scale = t.sqrt() / params.gamma;
    let lengths: Vec<f64> = (values.iter())
        .map(|value| scale * (value - params.mu))
        .take_while(|&value| value > 0.0)
        .collect();
    let rank = lengths.len().max(1);
    let mut root = vectors.columns(0, rank).into_owned();
    for (i, mut column) in root.column_iter_mut().enumerate() {
        column *= lengths.get(i).map_or(0.0, |value| value.sqrt());
    }
    root
}

/// Eigenvalues in decreasing order and their eigenvectors as columns.
pub(crate) fn sorted_eigen(matrix: DMatrix<f64>) -> (Vec<f64>, DMatrix<f64>) {
    let eigen = SymmetricEigen::new(matrix);
    let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
    order.sort_by(|&i, &j| eigen.eigenvalues[j].total_cmp(&eigen.eigenvalues[i]));
    let values = order.iter().map(|&i| eigen.eigenvalues[i]).collect();
    (values, eigen.eigenvectors.select_columns(&order))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_ring_that_tells_patches_apart_is_kept() {
        let mut rng = Seed(1).rng();
        let margins: Vec<f32> = (0..2000)
            .flat_map(|_| [0.3, 0.0, -0.1].map(|mean| mean + 0.5 * (rng.uniform() - 0.5)))
            .map(|margin| margin as f32)
            .collect();
        let weights = sparse_weights(&margins, 3, 0.05);
        assert!(weights[0] > 1.0, "{weights:?}");
        assert_eq!(weights[1..], [0.0, 0.0]);
    }

    #[test]
    fn a_state_of_more_steps_or_unknown_rings_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let mut set = PatchSet::default();
        set.triplets.push(crate::patches::Triplet {
            anchor: 0,
            positive: 1,
            negative: 2,
            source: 0,
        });
        let params = MetricParams {
            dimensions: 1,
            values: 8,
            ring_triplets: 1,
            triplets: 1,
            principal: 8,
            batch: 1,
            steps: 10,
            mu: 1e-5,
            gamma: 1e-3,
            seed: 1,
        };
        let checkpoint = Checkpoint::new(&folder.path().join("t"), &set, &()).unwrap();
        let error = |ring, steps| {
            let state = State {
                rings: vec![(ring, 1.0)],
                steps,
                gradients: Vec::new(),
            };
            checkpoint.save(&state.to_bytes()).unwrap();
            let learnt = learn(&set, &params, &checkpoint, &ProgressBar::hidden());
            learnt.unwrap_err().to_string()
        };
        assert!(error(0, 11).contains("t.part: took 11 steps"));
        assert!(error(1_000_000, 0).contains("t.part: damaged"));
    }

    #[test]
    fn every_triplet_is_used_as_often_as_any_other() {
        for count in [50, 60, 75, 99, 149, 503] {
            let mut uses = vec![0; count];
            for step in 0..60 {
                batch_of(step, 50, count).for_each(|triplet| uses[triplet] += 1);
            }
            let (least, most) = (uses.iter().min().unwrap(), uses.iter().max().unwrap());
            assert!(
                *least >= 5 && most - least <= 1,
                "{count}: {least} to {most}"
            );
        }
    }

    #[test]
    fn the_metric_weighs_the_direction_that_tells_apart() {
        let mut rng = Seed(2).rng();
        let mut random =
            |spread: [f64; 3]| DMatrix::from_fn(3, 4000, |i, _| (spread[i] * rng.normal()) as f32);
        // Patches of one point differ only in the third direction, those of different points in the first two.
        let mut triplets = Triplets {
            size: 3,
            differences: [random([0.1, 0.1, 1.0]), random([1.0, 0.5, 1.0])],
        };
        triplets.normalise();
        let params = MetricParams {
            dimensions: 1,
            values: 0,
            ring_triplets: 0,
            triplets: 0,
            principal: 3,
            batch: 500,
            steps: 40,
            mu: 0.01,
            gamma: 0.1,
            seed: 0,
        };
        let mut gradients = DMatrix::zeros(3, 3);
        let mut metric = solve(&gradients, 0, &params);
        for step in 0..params.steps {
            let (gradient, _) = triplets.gradient(&metric, &params, step);
            gradients += gradient;
            metric = solve(&gradients, step + 1, &params);
        }
        assert_eq!(metric.ncols(), 2, "{metric}");
        assert!(
            metric[(0, 0)].abs() > 10.0 * metric[(2, 0)].abs(),
            "{metric}"
        );
        assert!(metric.column(0).norm() > metric.column(1).norm());
    }
}
