//! All smoothing of a map along its rows, as the weights of one sum.

use std::ops::RangeInclusive;

use crate::image::GaussianKernel;

/// The weights with which the pixels of a row enter the value at one place, after the row was
/// smoothed by several kernels and continued beyond its ends by its outermost values each time.
#[derive(Clone, Debug)]
pub(super) struct RowWeights {
    kernels: Vec<GaussianKernel>,
    /// The kernels in one, for places far from the ends.
    composite: Vec<f32>,
}

impl RowWeights {
    pub(super) fn new(kernels: &[GaussianKernel]) -> Self {
        let mut composite = vec![1.0_f64];
        for kernel in kernels {
            let taps = kernel.taps();
            let mut longer = vec![0.0; composite.len() + taps.len() - 1];
            for (i, weight) in composite.iter().enumerate() {
                for (j, &tap) in taps.iter().enumerate() {
                    longer[i + j] += weight * f64::from(tap);
                }
            }
            composite = longer;
        }
        Self {
            kernels: kernels.to_vec(),
            composite: composite.into_iter().map(|weight| weight as f32).collect(),
        }
    }

    fn radius(&self) -> usize {
        self.composite.len() / 2
    }

    /// The columns with a weight for places between `column` and the next.
    pub(super) fn columns(&self, column: usize, width: usize) -> RangeInclusive<usize> {
        column.saturating_sub(self.radius())..=(column + 1 + self.radius()).min(width - 1)
    }

    /// Sets `weights` to those for the place `along` of the way from `column` to the next, and
    /// says for which column the first of them is.
    pub(super) fn at(
        &self,
        column: usize,
        along: f32,
        width: usize,
        weights: &mut Vec<f32>,
    ) -> usize {
        let columns = self.columns(column, width);
        let first = *columns.start();
        weights.clear();
        if columns.count() == self.composite.len() + 1 {
            weights.push((1.0 - along) * self.composite[0]);
            let pairs = self.composite.windows(2);
            weights.extend(pairs.map(|pair| along.mul_add(pair[0], (1.0 - along) * pair[1])));
            weights.push(along * self.composite[self.composite.len() - 1]);
        } else {
            self.at_end(column, along, width, weights);
        }
        first
    }

    /// Near an end: weights are handed on to the pixels that each value was made of, from the last
    /// kernel to the first.
    fn at_end(&self, column: usize, along: f32, width: usize, weights: &mut Vec<f32>) {
        let columns = self.columns(column, width);
        let (first, last) = (*columns.start(), *columns.end());
        weights.resize(last - first + 1, 0.0);
        weights[column - first] = 1.0 - along;
        weights[column + 1 - first] = along;
        for kernel in self.kernels.iter().rev() {
            let of_results = std::mem::replace(weights, vec![0.0; weights.len()]);
            for (x, &weight) in (first..)
                .zip(&of_results)
                .filter(|(_, weight)| **weight != 0.0)
            {
                for (i, tap) in kernel.taps().iter().enumerate() {
                    let from = (x + i).saturating_sub(kernel.radius()).clamp(first, last);
                    weights[from - first] = tap.mul_add(weight, weights[from - first]);
                }
            }
        }
    }
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
        let weights = RowWeights::new(&kernels);
        let row: Vec<f32> = (0..64).map(|x| ((x * x * 37) % 101) as f32).collect();
        for width in [2, 9, 30, 64] {
            let row = &row[..width];
            for column in (0..width - 1).step_by(3) {
                let mut found = Vec::new();
                let first = weights.at(column, 0.3, width, &mut found);
                let sum: f32 = found.iter().zip(&row[first..]).map(|(w, v)| w * v).sum();
                let expected = smoothed(&kernels, row, column, 0.3);
                assert!(
                    (sum - expected).abs() < 1e-4,
                    "{sum} {expected} at {column} of {width}"
                );
            }
        }
    }
}
