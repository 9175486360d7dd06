//! All smoothing of a map along its rows, as the weights of one sum.

use std::ops::RangeInclusive;

use super::BLOCK;
use crate::image::GaussianKernel;

/// The weights with which the pixels of a row enter the value at one place, after the row was
/// smoothed by several kernels and continued beyond its ends by its outermost values each time.
#[derive(Clone, Debug)]
pub(super) struct RowWeights {
    width: usize,
    /// Columns that the kernels reach to each side, one after the other.
    reach: usize,
    /// The weights for columns further than that from both ends. Here and below a block of zeros
    /// stands before and after them.
    middle: Vec<f32>,
    /// The weights for the other columns, from left to right.
    ends: Vec<Vec<f32>>,
}

impl RowWeights {
    /// For rows of `width` pixels.
    pub(super) fn new(kernels: &[GaussianKernel], width: usize) -> Self {
        let reach = kernels.iter().map(GaussianKernel::radius).sum();
        let is_end = |&column: &usize| column < reach || column + reach >= width;
        Self {
            width,
            reach,
            middle: spread(kernels, reach, reach, 2 * reach + 1),
            ends: (0..width)
                .filter(is_end)
                .map(|column| spread(kernels, column, reach, width))
                .collect(),
        }
    }

    /// The columns with a weight for the value at `column`.
    fn columns(&self, column: usize) -> RangeInclusive<usize> {
        columns_within(column, self.reach, self.width)
    }

    /// The weights for the value at `column`.
    fn at(&self, column: usize) -> &[f32] {
        let from_right = self.width - 1 - column;
        if column < self.reach {
            &self.ends[column]
        } else if from_right < self.reach {
            &self.ends[self.ends.len() - 1 - from_right]
        } else {
            &self.middle
        }
    }

    /// The columns with a weight for places between `column` and the next.
    pub(super) fn columns_between(&self, column: usize) -> RangeInclusive<usize> {
        *self.columns(column).start()..=*self.columns(column + 1).end()
    }

    /// The weights of the columns from `left` on for `column` and for the next one. One of them
    /// must be among [`Self::columns_between`].
    pub(super) fn block(&self, column: usize, left: usize) -> [&[f32; BLOCK]; 2] {
        [column, column + 1].map(|column| {
            let before = left + BLOCK - self.columns(column).start();
            let weights = self.at(column)[before..].first_chunk();
            weights.expect("a block with a weight, or next to one")
        })
    }
}

/// The columns up to `reach` from `column`.
fn columns_within(column: usize, reach: usize, width: usize) -> RangeInclusive<usize> {
    column.saturating_sub(reach)..=(column + reach).min(width - 1)
}

/// The weights for the value at `column`, of the columns up to `reach` from it, between two blocks
/// of zeros: handed on to the pixels that each value was made of, from the last kernel to the
/// first.
fn spread(kernels: &[GaussianKernel], column: usize, reach: usize, width: usize) -> Vec<f32> {
    let columns = columns_within(column, reach, width);
    let first = *columns.start();
    let mut weights = vec![0.0_f64; columns.count()];
    weights[column - first] = 1.0;
    for kernel in kernels.iter().rev() {
        let of_results = weights.clone();
        weights.fill(0.0);
        for (x, weight) in (first..).zip(of_results) {
            if weight != 0.0 {
                for (i, &tap) in kernel.taps().iter().enumerate() {
                    let from = (x + i).saturating_sub(kernel.radius()).min(width - 1);
                    weights[from - first] += weight * f64::from(tap);
                }
            }
        }
    }
    let zeros = [0.0; BLOCK];
    let weights = weights.into_iter().map(|weight| weight as f32);
    zeros.into_iter().chain(weights).chain(zeros).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The definition: smooth the row, kernel by kernel, then interpolate.
    fn smoothed(kernels: &[GaussianKernel], row: &[f32], column: usize, along: f32) -> f32 {
        let mut row = row.to_vec();
        for kernel in kernels {
            let value = |x: usize| {
                let tap = |(i, tap): (usize, &f32)| {
                    let from = (x + i).saturating_sub(kernel.radius()).min(row.len() - 1);
                    tap * row[from]
                };
                kernel.taps().iter().enumerate().map(tap).sum()
            };
            row = (0..row.len()).map(value).collect();
        }
        row[column] + along * (row[column + 1] - row[column])
    }

    #[test]
    fn one_sum_is_smoothing_and_interpolation_at_the_ends_and_between() {
        let kernels = [(1.5, 3), (2.5, 6), (4.3, 10)]
            .map(|(sigma, radius)| GaussianKernel::with_radius(sigma, radius));
        let row: Vec<f32> = (0..64).map(|x| ((x * x * 37) % 101) as f32).collect();
        for width in [2, 9, 19, 20, 38, 39, 40, 64] {
            let row = &row[..width];
            let weights = RowWeights::new(&kernels, width);
            for column in 0..width - 1 {
                let columns = weights.columns_between(column);
                let first = columns.start() / BLOCK * BLOCK;
                let mut sum = 0.0;
                for left in (first..=*columns.end()).step_by(BLOCK) {
                    let [here, next] = weights.block(column, left);
                    for (x, value) in row.iter().enumerate().skip(left).take(BLOCK) {
                        sum += (0.7 * here[x - left] + 0.3 * next[x - left]) * value;
                    }
                }
                let expected = smoothed(&kernels, row, column, 0.3);
                assert!(
                    (sum - expected).abs() < 1e-4,
                    "{sum} {expected} at {column} of {width}"
                );
            }
        }
    }
}
