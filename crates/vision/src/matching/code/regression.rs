//! Robust regression over a truncated Gaussian kernel of few centres.
//!
//! The functions of the paper live on all seeds. Here they are spanned by some of them (a Nystrom
//! approximation), so that fitting costs seeds x centres^2 and a value costs one row of kernels,
//! most of which are zero.

use nalgebra::{Cholesky, DMatrix, DVector};

/// The coordinates by which matches are compared: position, displacement, relative affine frame.
pub(super) type Point = [f64; 8];

/// Entries that are not zero: index and value, in order of the indices.
pub(super) type SparseRow = Vec<(usize, f64)>;

/// Kernels below this count as zero.
const TRUNCATED: f64 = 0.1;

/// Steps of reweighting; the weights hardly change after a few.
const STEPS: usize = 8;

/// `exp(-||x - y||^2)`, or `None` where it is below [`TRUNCATED`].
fn kernel(x: &Point, y: &Point) -> Option<f64> {
    let squared: f64 = (x.iter().zip(y)).map(|(x, y)| (x - y) * (x - y)).sum();
    // exp(-2.3026) = 0.1; NaN is no neighbour of anything.
    (squared < 2.303)
        .then(|| libm::exp(-squared))
        .filter(|&k| k >= TRUNCATED)
}

/// Kernels between `x` and each of the centres.
pub(super) fn kernels(x: &Point, centres: &[Point]) -> SparseRow {
    (centres.iter().enumerate())
        .filter_map(|(index, centre)| Some((index, kernel(x, centre)?)))
        .collect()
}

/// The coefficients `w` that minimise `sum_i huber(|rows_i w - targets_i|) + w^T penalty w`, by
/// iterated reweighting; `None` where they are not determined.
pub(super) fn fit<const R: usize>(
    rows: &[SparseRow],
    targets: &[[f64; R]],
    penalty: &DMatrix<f64>,
    huber: f64,
) -> Option<Vec<[f64; R]>> {
    let count = penalty.nrows();
    let mut weights = vec![1.0; rows.len()];
    let mut coefficients = vec![[0.0; R]; count];
    for _ in 0..STEPS {
        let mut normal = penalty.clone();
        let mut right: [DVector<f64>; R] = std::array::from_fn(|_| DVector::zeros(count));
        for ((row, target), &weight) in rows.iter().zip(targets).zip(&weights) {
            for (first, &(i, x)) in row.iter().enumerate() {
                let x = weight * x;
                // Cholesky reads the lower triangle alone, and rows are in order of their indices.
                for &(j, y) in &row[first..] {
                    normal[(j, i)] += x * y;
                }
                for (right, target) in right.iter_mut().zip(target) {
                    right[i] += x * target;
                }
            }
        }
        let factors = Cholesky::new(normal)?;
        for (axis, right) in right.iter().enumerate() {
            let solution = factors.solve(right);
            for (w, value) in coefficients.iter_mut().zip(solution.iter()) {
                w[axis] = *value;
            }
        }
        for ((row, target), weight) in rows.iter().zip(targets).zip(&mut weights) {
            let value = evaluate(row, &coefficients);
            let squared: f64 = (value.iter().zip(target))
                .map(|(v, t)| (v - t) * (v - t))
                .sum();
            let residual = squared.sqrt();
            *weight = if residual <= huber {
                1.0
            } else {
                huber / residual
            };
        }
    }
    Some(coefficients)
}

/// The value of a fitted function.
pub(super) fn evaluate<const R: usize>(row: &SparseRow, coefficients: &[[f64; R]]) -> [f64; R] {
    let mut value = [0.0; R];
    for &(index, x) in row {
        for (value, w) in value.iter_mut().zip(&coefficients[index]) {
            *value += x * w;
        }
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_wrong_target_of_many_does_not_matter() {
        // y = 2 x, sampled 20 times, once as 100.
        let rows: Vec<SparseRow> = (0..20).map(|i| vec![(0, f64::from(i))]).collect();
        let mut targets: Vec<[f64; 1]> = (0..20).map(|i| [2.0 * f64::from(i)]).collect();
        targets[3] = [100.0];
        let found = fit(&rows, &targets, &DMatrix::zeros(1, 1), 0.1).unwrap();
        assert!((found[0][0] - 2.0).abs() < 1e-2, "{found:?}");
    }

    /// Beyond Huber's limit the data pull with a force of 0.1, whatever the target is, against a ridge of 2 w.
    #[test]
    fn a_target_out_of_reach_pulls_with_the_force_of_the_limit() {
        let of = |target: f64, huber: f64| {
            let penalty = DMatrix::identity(1, 1) * 2.0;
            fit(&[vec![(0, 1.0)]], &[[target]], &penalty, huber).unwrap()[0][0]
        };
        for target in [1.0, 10.0] {
            assert!((of(target, 0.1) - 0.05).abs() < 1e-3, "{target}");
        }
        // Within it they are squares: w = target / (1 + ridge).
        assert!((of(1.0, 5.0) - 1.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn far_points_are_no_neighbours() {
        let centres = [[0.0; 8], [1.0; 8], [f64::NAN; 8]];
        assert_eq!(kernels(&[0.0; 8], &centres), [(0, 1.0)]);
        // exp(-0.5) is there, and exp(-2.4), below a tenth, is not.
        let at = |x: f64| [x, x, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let found = kernels(&at(0.0), &[at(0.5), at(1.2_f64.sqrt())]);
        assert_eq!(found, [(0, libm::exp(-0.5))]);
    }
}
