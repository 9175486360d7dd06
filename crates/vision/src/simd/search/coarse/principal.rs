//! The directions in which rows differ most: their principal components.
//!
//! *How it works.*
//! 1. The covariance of some candidates gives orthogonal axes, sorted by the variance along them. Of 128 values
//!    of SIFT the first [`COMPONENTS`] components hold 82 % of the variance, so the distance along these
//!    alone nearly always tells that a candidate is out: it is at most the distance of the rows.
//! 2. This bound holds for any orthogonal axes of length 1. The axes that were found are rounded, so two errors are
//!    bounded: by how much the axes may lengthen a row at most, from their products ([`Principal::stretch`]), and how
//!    much rounding may change a projected row ([`Projected::rounding`]). So no bound relies on the axes being the
//!    right ones.
//! 3. Rows are sorted by the signs of their first components, those of one side of the mean along the
//!    first axis first. Rows that are near to each other are then near in this order as well, and a query
//!    that starts with candidates near to it knows small distances soon.

use nalgebra::{DMatrix, SymmetricEigen};

/// Components that are compared.
pub(super) const COMPONENTS: usize = 32;

/// Candidates whose covariance is taken, at most.
const SAMPLES: usize = 1_000;

/// Share of the variance that the components must have: of rows without any structure they have a
/// quarter (of 128 values), and rule too little out.
const SHARE: f64 = 0.6;

/// Components whose signs sort the rows: each set of signs has few enough of 100,000 rows for some panels.
const SIGNS: usize = 12;

/// The principal components of candidates.
pub(super) struct Principal {
    mean: Vec<f32>,
    /// Of each column its part of each of the axes.
    axes: Vec<[f32; COMPONENTS]>,
    /// The largest ratio of a distance of projected rows to that of the rows, but for rounding: nearly 1.
    pub(super) stretch: f32,
}

/// Rows along the axes.
pub(super) struct Projected {
    /// [`COMPONENTS`] values of each row.
    pub(super) rows: Vec<f32>,
    /// By how much rounding may have changed the place of a row, at most.
    pub(super) rounding: f32,
}

impl Principal {
    /// `None` where a value of those that are looked at is not finite or the components hold too little of the variance.
    #[target_feature(enable = "avx2,fma")]
    pub(super) fn of(rows: &[f32], dim: usize) -> Option<Self> {
        let step = (rows.len() / dim).div_ceil(SAMPLES).max(1) * dim;
        let sample: Vec<&[f32]> = rows.chunks(step).map(|rows| &rows[..dim]).collect();
        let mean = mean(&sample, dim);
        let axes = axes(&covariance(&sample, &mean), dim)?;
        Some(Self {
            stretch: stretch(&axes),
            mean,
            axes,
        })
    }

    /// Rows along the axes; `None` where a value is not finite.
    pub(super) fn project(&self, rows: &[f32]) -> Option<Projected> {
        let (rows, longest) = project(rows, &self.mean, &self.axes)?;
        // Each sum of products has at most the relative error of as many roundings and that of the
        // difference from the mean, in terms of the lengths of the row and of the axis (Cauchy and Schwarz).
        let roundings = (self.mean.len() + 4) as f32;
        let relative = roundings * f32::EPSILON * (COMPONENTS as f32).sqrt();
        Some(Projected {
            rows,
            rounding: relative * longest,
        })
    }
}

/// The order of projected rows by the signs of their first components: rows that are near to each other are near in it.
pub(super) fn order(rows: &[f32]) -> Vec<u32> {
    let key = |row: &[f32; COMPONENTS]| {
        let signs = row[..SIGNS].iter();
        signs.fold(0, |key, &value| 2 * key + u32::from(value > 0.0))
    };
    let keys: Vec<u32> = rows.as_chunks().0.iter().map(key).collect();
    let mut order: Vec<u32> = (0..keys.len() as u32).collect();
    order.sort_by_key(|&row| keys[row as usize]);
    order
}

/// The mean of some of the projected `rows`.
pub(super) fn mean_of(rows: &[f32], chosen: &[u32]) -> [f32; COMPONENTS] {
    let mut sums = [0.0_f32; COMPONENTS];
    for &row in chosen {
        let row = &rows[row as usize * COMPONENTS..][..COMPONENTS];
        for (sum, value) in sums.iter_mut().zip(row) {
            *sum += value;
        }
    }
    sums.map(|sum| sum / chosen.len() as f32)
}

/// The mean of each column.
fn mean(rows: &[&[f32]], dim: usize) -> Vec<f32> {
    let mut sums = vec![0.0_f64; dim];
    for row in rows {
        for (sum, &value) in sums.iter_mut().zip(*row) {
            *sum += f64::from(value);
        }
    }
    sums.iter()
        .map(|sum| (sum / rows.len() as f64) as f32)
        .collect()
}

/// The covariance of the columns, times the number of rows.
#[target_feature(enable = "avx2,fma")]
fn covariance(rows: &[&[f32]], mean: &[f32]) -> Vec<f32> {
    let dim = mean.len();
    let mut sums = vec![0.0_f32; dim * dim];
    let mut centred = vec![0.0_f32; dim];
    for row in rows {
        for ((centred, value), mean) in centred.iter_mut().zip(*row).zip(mean) {
            *centred = value - mean;
        }
        for (sums, &x) in sums.chunks_exact_mut(dim).zip(&centred) {
            for (sum, &y) in sums.iter_mut().zip(&centred) {
                *sum = x.mul_add(y, *sum);
            }
        }
    }
    sums
}

/// The axes of largest variance: for each column its part of each of them. `None` if there are none
/// or they hold too little of the variance.
fn axes(covariance: &[f32], dim: usize) -> Option<Vec<[f32; COMPONENTS]>> {
    // The decomposition would not end with values that are no numbers.
    if dim <= COMPONENTS || !covariance.iter().all(|value| value.is_finite()) {
        return None;
    }
    let covariance = covariance.iter().map(|&value| f64::from(value));
    let covariance = DMatrix::from_iterator(dim, dim, covariance);
    let eigen = SymmetricEigen::try_new(covariance, f64::EPSILON, 100 * dim)?;
    let mut order: Vec<usize> = (0..dim).collect();
    order.sort_by(|&i, &j| eigen.eigenvalues[j].total_cmp(&eigen.eigenvalues[i]));
    let kept: f64 = order[..COMPONENTS]
        .iter()
        .map(|&axis| eigen.eigenvalues[axis])
        .sum();
    let value = |column, axis: usize| eigen.eigenvectors[(column, order[axis])] as f32;
    let of_column = |column| std::array::from_fn(|axis| value(column, axis));
    (kept >= SHARE * eigen.eigenvalues.sum()).then(|| (0..dim).map(of_column).collect())
}

/// See [`Principal::stretch`]: the root of the largest eigenvalue of the products of the axes, which is no
/// larger than the largest sum of their sizes in a row (Gershgorin).
fn stretch(axes: &[[f32; COMPONENTS]]) -> f32 {
    let product = |i: usize, j: usize| -> f64 {
        axes.iter()
            .map(|axis| f64::from(axis[i]) * f64::from(axis[j]))
            .sum()
    };
    let sums = (0..COMPONENTS).map(|i| (0..COMPONENTS).map(|j| product(i, j).abs()).sum::<f64>());
    let largest = sums.fold(0.0, f64::max);
    largest.sqrt() as f32 * (1.0 + f32::EPSILON)
}

multiversioned! {
    #![avx512]

    /// Rows less `mean` along the axes, and the length of the longest of them; `None` if that is not finite.
    fn project(rows: &[f32], mean: &[f32], axes: &[[f32; COMPONENTS]]) -> Option<(Vec<f32>, f32)> {
        // Some rows at once: the sums of one alone would wait for each other.
        const AT_ONCE: usize = 4;
        const LANES: usize = 16;
        let dim = mean.len();
        let padded = dim.next_multiple_of(LANES);
        let mut projected = Vec::with_capacity(rows.len() / dim * COMPONENTS);
        let mut longest = 0.0_f32;
        let mut centred = vec![0.0_f32; AT_ONCE * padded];
        for few in rows.chunks(AT_ONCE * dim) {
            for (row, centred) in few.chunks_exact(dim).zip(centred.chunks_exact_mut(padded)) {
                for ((centred, value), mean) in centred.iter_mut().zip(row).zip(mean) {
                    *centred = value - mean;
                }
                let mut squares = [0.0_f32; LANES];
                for centred in centred.as_chunks::<LANES>().0 {
                    for (sum, value) in squares.iter_mut().zip(centred) {
                        *sum = value.mul_add(*value, *sum);
                    }
                }
                let length: f32 = squares.iter().sum();
                if !length.is_finite() {
                    return None;
                }
                longest = longest.max(length);
            }
            let mut sums = [[0.0_f32; COMPONENTS]; AT_ONCE];
            let [a, b, c, d]: [&[f32]; AT_ONCE] =
                std::array::from_fn(|row| &centred[row * padded..][..dim]);
            for ((((axes, &a), &b), &c), &d) in axes.iter().zip(a).zip(b).zip(c).zip(d) {
                for (sums, value) in sums.iter_mut().zip([a, b, c, d]) {
                    for (sum, axis) in sums.iter_mut().zip(axes) {
                        *sum = value.mul_add(*axis, *sum);
                    }
                }
            }
            // Beyond the last row are some of those before.
            projected.extend_from_slice(&sums.as_flattened()[..few.len() / dim * COMPONENTS]);
        }
        Some((projected, longest.sqrt()))
    }
}

#[cfg(test)]
mod tests {
    use super::super::has_avx2_and_fma;
    use super::*;
    use crate::seed::Seed;

    /// Principal components of the candidates `b`, and queries and candidates along them.
    fn principal(a: &[f32], b: &[f32], dim: usize) -> Option<(Principal, [Projected; 2])> {
        // SAFETY: AVX2 and FMA were detected on this processor.
        let principal = unsafe { Principal::of(b, dim) }?;
        let projected = [principal.project(a)?, principal.project(b)?];
        Some((principal, projected))
    }

    /// `count` rows of rank `rank`, with every value changed by `change(value, column)`.
    fn rows_of(
        count: usize,
        dim: usize,
        rank: usize,
        change: impl Fn(f32, usize) -> f32,
    ) -> Vec<f32> {
        let mut rng = Seed(2).rng();
        let directions: Vec<f32> = (0..rank * dim).map(|_| rng.normal() as f32).collect();
        let mut rows = Vec::new();
        for _ in 0..count {
            let weights: Vec<f32> = (0..rank).map(|_| rng.normal() as f32).collect();
            rows.extend((0..dim).map(|k| {
                let parts = weights.iter().zip(directions[k..].iter().step_by(dim));
                change(parts.map(|(weight, value)| weight * value).sum(), k)
            }));
        }
        rows
    }

    fn rows(dim: usize, rank: usize, change: impl Fn(f32, usize) -> f32) -> Vec<f32> {
        rows_of(120, dim, rank, change)
    }

    /// Checks that no projected distance is longer than allowed; returns the smallest ratio of one to the
    /// distance of the rows.
    fn check(rows: &[f32], dim: usize) -> f64 {
        let (principal, [a, b]) = principal(rows, rows, dim).expect("few directions");
        assert!(
            (0.999..1.001).contains(&principal.stretch),
            "{}",
            principal.stretch
        );
        let distance = |a: &[f32], b: &[f32]| -> f64 {
            let squares = a
                .iter()
                .zip(b)
                .map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2));
            squares.sum::<f64>().sqrt()
        };
        let rounding = a.rounding + b.rounding;
        let mut smallest = f64::INFINITY;
        for (a, low_a) in rows.chunks_exact(dim).zip(a.rows.chunks_exact(COMPONENTS)) {
            for (b, low_b) in rows.chunks_exact(dim).zip(b.rows.chunks_exact(COMPONENTS)) {
                let (distance, low) = (distance(a, b), distance(low_a, low_b));
                let rounding = f64::from(rounding);
                let most = distance * f64::from(principal.stretch) + rounding;
                assert!(low <= most, "{low} of {distance}, not {most}");
                if distance > 0.0 {
                    smallest = smallest.min((low + rounding) / distance);
                }
            }
        }
        smallest
    }

    #[test]
    fn projected_distances_are_no_longer_than_those_of_the_rows() {
        if !has_avx2_and_fma() {
            return;
        }
        for dim in [33, 64, 128, 259] {
            check(&rows(dim, 40, |value, _| value), dim);
            check(
                &rows(dim, 20, |value, column| value + 1e4 * column as f32),
                dim,
            );
            check(
                &rows(dim, 20, |value, k| if k == 7 { 1e5 * value } else { value }),
                dim,
            );
            check(&rows(dim, 40, |value, _| value.round()), dim);
        }
    }

    #[test]
    fn rows_of_few_directions_keep_their_distances() {
        if !has_avx2_and_fma() {
            return;
        }
        for (dim, rank) in [(33, 1), (128, 3), (128, 32), (259, 31)] {
            let smallest = check(&rows(dim, rank, |value, _| value), dim);
            assert!(smallest > 0.999, "{smallest} of rank {rank}");
        }
    }

    #[test]
    fn rows_without_few_directions_have_no_components() {
        if !has_avx2_and_fma() {
            return;
        }
        let none = |rows: &[f32], dim| principal(rows, rows, dim).is_none();
        assert!(none(&rows_of(1_000, 128, 400, |value, _| value), 128));
        assert!(none(&rows(32, 3, |value, _| value), 32));
        for other in [f32::NAN, f32::INFINITY, 1e30] {
            let mut rows = rows(128, 3, |value, _| value);
            rows[128 * 119 + 5] = other;
            assert!(none(&rows, 128), "{other}");
            assert!(
                principal(&rows, &rows[..128 * 50], 128).is_none(),
                "{other}"
            );
        }
    }
}
