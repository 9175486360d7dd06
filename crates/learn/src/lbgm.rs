//! Learns LBGM, which projects the answers of BGM's weak learners to real values. It is the stage between BGM
//! and BinBoost.
//!
//! T. Trzcinski, M. Christoudias, V. Lepetit, P. Fua: "Learning Image Descriptors with the Boosting-
//! Trick", Advances in Neural Information Processing Systems (NIPS) 2012, section 3.
//!
//! Given are the weak learners h that BGM chose, and pairs of patches with labels l = 1 (same point) or -1. The
//! similarity is `f(x, y) = h(x)^T A h(y)` with A positive semidefinite. It minimises a loss of the margins
//! `l_n (f(x_n, y_n) - b)`. A is found by gradient descent and is projected to positive semidefinite matrices
//! after each step. The step size is doubled after a success, and halved until there is one. The descriptor is
//! `B^T h(x)`. The columns of B are the leading eigenvectors of A times the square roots of their eigenvalues.
//!
//! *Differs from the paper*: the loss is logistic, not exponential, with the best offset b (as in the training
//! of BinBoost here). The gradient is that of all pairs and not of one after the other. h is taken relative to
//! its mean, which changes no distance between descriptors.

use anyhow::{Context, Result, ensure};
use indicatif::ProgressBar;
use matchbench_vision::features::FloatRows;
use matchbench_vision::features::binboost::{BinBoost, BinBoostParams, BinBoostTable};
use matchbench_vision::seed::Seed;
use nalgebra::DMatrix;

use crate::metric::sorted_eigen;
use crate::pairs::{logistic_weights, training_pairs};
use crate::patches::PatchSet;

/// First bytes of a table.
const MAGIC: &[u8; 4] = b"LBG1";

/// BGM's weak learners and a projection of their answers.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LbgmTable {
    /// One weak learner for each bit.
    bgm: BinBoostTable,
    /// One row per value, one column per weak learner.
    projection: DMatrix<f32>,
}

impl LbgmTable {
    /// Learns `dimensions` rows from pairs of patches of the set.
    pub(crate) fn learn(
        set: &PatchSet,
        bgm: BinBoostTable,
        dimensions: usize,
        pairs: usize,
        seed: Seed,
        bar: &ProgressBar,
    ) -> Result<Self> {
        const STEPS: u64 = 40;
        bar.set_length(STEPS);
        bar.set_position(0);
        let pairs = training_pairs(set, pairs, seed);
        let answers = answers(set, &bgm)?;
        let mean = answers.column_mean();
        let end = |patch: &dyn Fn(usize) -> usize| {
            let columns = (0..pairs.len()).map(|n| answers.column(patch(n)) - &mean);
            DMatrix::from_columns(&columns.collect::<Vec<_>>())
        };
        let [x, y] = [end(&|n| pairs[n].first), end(&|n| pairs[n].second)];
        let labels = pairs.iter().map(|pair| if pair.same { 1.0 } else { -1.0 });
        let data = Pairs {
            x,
            y,
            labels: labels.collect(),
        };

        let size = bgm.bits();
        let mut best = DMatrix::zeros(size, size);
        let (mut loss, mut factors) = data.loss(&best);
        let mut step = 1.0 / size as f64;
        for _ in 0..STEPS {
            let gradient = data.gradient(&factors);
            loop {
                let next = positive(&best - &gradient * step);
                let (next_loss, next_factors) = data.loss(&next);
                if next_loss < loss {
                    (best, loss, factors) = (next, next_loss, next_factors);
                    step *= 2.0;
                    break;
                }
                step *= 0.5;
                if step < 1e-12 {
                    break;
                }
            }
            bar.set_message(format!("loss {loss:.4}"));
            bar.inc(1);
        }
        let root = root(best);
        ensure!(
            root.ncols() >= dimensions,
            "the projection has rank {}, less than {dimensions} dimensions; use more weak learners",
            root.ncols()
        );
        Ok(Self {
            bgm,
            projection: root.columns(0, dimensions).transpose().cast(),
        })
    }

    /// The descriptors of all patches of a set.
    pub(crate) fn describe(&self, set: &PatchSet) -> Result<FloatRows> {
        let values = &self.projection * answers(set, &self.bgm)?;
        Ok(FloatRows::from_vec(
            self.projection.nrows(),
            values.as_slice().to_vec(),
        ))
    }

    /// The table as bytes: magic number, length of BGM's table and that table, number of rows, their values
    /// column by column; little-endian.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let bgm = self.bgm.to_bytes();
        let mut bytes = MAGIC.to_vec();
        bytes.extend((bgm.len() as u32).to_le_bytes());
        bytes.extend(bgm);
        bytes.extend((self.projection.nrows() as u32).to_le_bytes());
        bytes.extend(self.projection.iter().flat_map(|value| value.to_le_bytes()));
        bytes
    }

    /// The table that was written as `bytes`.
    ///
    /// # Errors
    /// If they are not such a table.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Result<Self> {
        Self::parse(bytes).context("not a table of LBGM")
    }

    fn parse(bytes: &[u8]) -> Option<Self> {
        let (length, bytes) = bytes.strip_prefix(MAGIC)?.split_first_chunk()?;
        let (bgm, bytes) = bytes.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        let bgm = BinBoostTable::from_bytes(bgm).ok()?;
        let (rows, values) = bytes.split_first_chunk()?;
        let rows = u32::from_le_bytes(*rows) as usize;
        let whole = bgm.learners_per_bit == 1 && rows > 0 && values.len() == 4 * rows * bgm.bits();
        let values = values.as_chunks().0.iter();
        whole.then(|| Self {
            projection: DMatrix::from_iterator(
                rows,
                bgm.bits(),
                values.map(|&value| f32::from_le_bytes(value)),
            ),
            bgm,
        })
    }
}

/// The answers of the weak learners to all patches of a set, 1 or -1, one column per patch.
fn answers(set: &PatchSet, bgm: &BinBoostTable) -> Result<DMatrix<f32>> {
    let describer = BinBoost::with_table(BinBoostParams::default(), bgm.clone())?;
    let rows = describer.describe_patches(set.len(), |i, patch| {
        patch.copy_from_slice(set.small(i));
    });
    Ok(DMatrix::from_fn(bgm.bits(), set.len(), |bit, patch| {
        if rows.row(patch)[bit / 64] >> (bit % 64) & 1 == 1 {
            1.0
        } else {
            -1.0
        }
    }))
}

/// The answers to both patches of each pair, relative to their mean, and the labels: 1 if both patches show the
/// same point, else -1.
struct Pairs {
    x: DMatrix<f32>,
    y: DMatrix<f32>,
    labels: Vec<f32>,
}

impl Pairs {
    /// Mean loss, and the factor of each pair's `x y^T` in its gradient.
    fn loss(&self, metric: &DMatrix<f64>) -> (f64, Vec<f64>) {
        let projected = metric.clone().cast::<f32>() * &self.y;
        let count = self.labels.len() as f64;
        let similarities = self.x.column_iter().zip(projected.column_iter());
        let scores: Vec<f32> = similarities.map(|(x, p)| x.dot(&p)).collect();
        let (weights, offset) = logistic_weights(&self.labels, &scores);
        let losses = (scores.iter().zip(&self.labels))
            .map(|(score, label)| libm::log1p(libm::exp(f64::from(label * (offset - score)))));
        let factors = (weights.iter().zip(&self.labels))
            .map(|(weight, label)| f64::from(-label * weight) / count);
        (losses.sum::<f64>() / count, factors.collect())
    }

    fn gradient(&self, factors: &[f64]) -> DMatrix<f64> {
        let mut weighted = self.y.clone();
        for (mut column, &factor) in weighted.column_iter_mut().zip(factors) {
            column *= factor as f32;
        }
        let sum: DMatrix<f64> = (&self.x * weighted.transpose()).cast();
        (&sum + sum.transpose()) * 0.5
    }
}

/// The nearest positive semidefinite matrix.
fn positive(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let root = root(matrix);
    &root * root.transpose()
}

/// B such that `B B^T` is the positive part of a symmetric matrix. Columns are in decreasing order of length.
fn root(matrix: DMatrix<f64>) -> DMatrix<f64> {
    let (values, vectors) = sorted_eigen(matrix);
    let rank = values.iter().take_while(|&&value| value > 0.0).count();
    let mut root = vectors.columns(0, rank.max(1)).into_owned();
    for (mut column, value) in root.column_iter_mut().zip(values) {
        column *= value.max(0.0).sqrt();
    }
    root
}

#[cfg(test)]
mod tests {
    use matchbench_vision::features::binboost::WeakLearner;

    use super::*;

    #[test]
    fn a_table_survives_being_written_and_damage_is_seen() {
        let learner = |feature| WeakLearner {
            feature,
            threshold: 9,
            weight: 127,
        };
        let table = LbgmTable {
            bgm: BinBoostTable {
                boxes: vec![[0, 0, 30, 30]],
                learners_per_bit: 1,
                learners: vec![learner(1), learner(5)],
                offsets: vec![0; 2],
            },
            projection: DMatrix::from_row_slice(3, 2, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
        };
        let bytes = table.to_bytes();
        assert_eq!(LbgmTable::from_bytes(&bytes).unwrap(), table);
        for end in 0..bytes.len() {
            assert!(LbgmTable::from_bytes(&bytes[..end]).is_err(), "{end} bytes");
        }
    }

    #[test]
    fn the_root_is_that_of_the_positive_part() {
        let matrix = DMatrix::from_row_slice(2, 2, &[0.0, 2.0, 2.0, 0.0]); // eigenvalues 2, -2
        let positive = positive(matrix);
        assert!((positive - DMatrix::from_element(2, 2, 1.0)).norm() < 1e-12);
    }

    #[test]
    fn the_gradient_is_the_slope_of_the_loss() {
        let signs = |seed: u64| {
            let mut rng = Seed(seed).rng();
            DMatrix::from_fn(3, 50, |_, _| if rng.below(2) == 0 { 1.0 } else { -1.0 })
        };
        let data = Pairs {
            x: signs(1),
            y: signs(2),
            labels: (0..50)
                .map(|n| if n % 3 == 0 { 1.0 } else { -1.0 })
                .collect(),
        };
        let metric = DMatrix::from_diagonal_element(3, 3, 0.1);
        let (loss, factors) = data.loss(&metric);
        let gradient = data.gradient(&factors);
        let direction = DMatrix::from_row_slice(3, 3, &[0., 1., 0., 1., 2., -1., 0., -1., 1.]);
        let (further, _) = data.loss(&(metric + &direction * 1e-3));
        assert!(((further - loss) / 1e-3 - gradient.dot(&direction)).abs() < 0.01);
    }
}
