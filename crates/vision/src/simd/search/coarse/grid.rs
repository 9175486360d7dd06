//! The grid by which real values become bytes, and the bytes of rows with the rounding of each.

use std::arch::x86_64::{
    _mm_add_ps, _mm_add_ss, _mm_cvtss_f32, _mm_movehdup_ps, _mm_movehl_ps, _mm256_add_ps,
    _mm256_castps256_ps128, _mm256_extractf128_ps, _mm256_fmadd_ps, _mm256_loadu_ps,
    _mm256_setzero_ps, _mm256_sub_ps,
};

use crate::simd::prefetch::prefetch;

/// Longest row: with more values the rounding would take a noticeable part of [`PRODUCT`].
pub(super) const MAX_DIM: usize = 1024;

/// Largest product of the lengths of two rows of bytes: their sum of products, and each part of it,
/// fits 16 bits with a sign (the inequality of Cauchy and Schwarz).
const PRODUCT: f32 = 32_700.0;

/// How values become bytes. Less the `least` of their column, times `scale`, rounded: these are the
/// bytes of a query. Candidates' bytes have a sign; they are the same less the `centre` of their
/// column, which makes rows shorter and so allows a finer grid, or less 128 where sums may be wide.
///
/// A grid follows from candidates alone, so that these are rounded once for any number of searches. Queries
/// may lie outside of it; their bytes are then the nearest that it has.
pub(super) struct Grid {
    least: Vec<f32>,
    centre: Vec<i32>,
    /// Units of a byte in one unit of the values.
    pub(super) scale: f32,
    /// Whether the candidates are whole numbers, which as bytes lose nothing.
    pub(super) is_whole: bool,
    /// The greatest length of a query's bytes with which sums of products fit.
    longest: f32,
}

/// Rows of bytes.
pub(super) struct Bytes {
    /// Four bytes in each; the last of a row ends with zeros.
    pub(super) quads: Vec<i32>,
    /// What the squared distance of a query and a candidate consists of, besides minus two times the
    /// sum of the products of their bytes: one part of it for each row.
    pub(super) norms: Vec<i32>,
    /// Length of what rounding took from each row, in units of the bytes.
    pub(super) errors: Vec<f32>,
}

impl Bytes {
    /// The largest of the errors.
    pub(super) fn error(&self) -> f32 {
        self.errors.iter().copied().fold(0.0, f32::max)
    }
}

impl Grid {
    /// The finest grid for candidates, whose sums of products fit 16 bits unless they may be `is_wide`, of
    /// 32 bits; `None` where a value is not finite or the values are all the same or so large or small that
    /// squared distances lose digits.
    #[target_feature(enable = "avx2,fma")]
    pub(super) fn of(rows: &[f32], dim: usize, is_wide: bool) -> Option<Self> {
        let columns = Columns::of(rows, dim);
        let range = columns.range();
        if rows.is_empty() || !columns.is_finite || !(1e-10..1e10).contains(&range) {
            return None;
        }
        if is_wide {
            return Some(Self::of_columns(columns, range));
        }
        let (least, mean) = (columns.least, mean(rows, dim));
        let mut half = 0.0_f32;
        for ((least, most), mean) in least.iter().zip(&columns.most).zip(&mean) {
            half = half.max((most - mean).max(mean - least));
        }
        // Queries are taken to be as long as candidates.
        let (of_query, of_candidate) = (longest(rows, &least), longest(rows, &mean));
        let scale =
            (254.0 / range)
                .min(126.0 / half)
                .min(scale_of_rows(of_query, of_candidate, dim));
        // A mean may be infinite where no value is.
        if !scale.is_normal() {
            return None;
        }
        let centre = mean.iter().zip(&least);
        let centre = centre.map(|(mean, least)| ((mean - least) * scale + 0.5) as i32);
        Some(Self {
            centre: centre.collect(),
            least,
            scale,
            is_whole: false,
            longest: PRODUCT / (of_candidate * scale + 2.0 * rounding(dim)),
        })
    }

    /// The grid where sums may be of any size.
    fn of_columns(columns: Columns, range: f32) -> Self {
        // Whole numbers lose nothing when they become bytes, nor do those of queries if they are alike.
        let is_whole = columns.is_whole && range <= 255.0;
        let are_bytes = is_whole && columns.lie_within(0.0, 255.0);
        Self {
            centre: vec![128; columns.least.len()],
            scale: if is_whole { 1.0 } else { 255.0 / range },
            is_whole,
            least: if are_bytes {
                vec![0.0; columns.least.len()]
            } else {
                columns.least
            },
            longest: f32::INFINITY,
        }
    }

    /// Whether queries whose bytes lost nothing are whole numbers too: a fraction may be lost already when the least
    /// value of a column is taken off, which then counts as no error.
    pub(super) fn is_whole_for(&self, queries: &[f32]) -> bool {
        self.is_whole && (self.least.iter().all(|&least| least == 0.0) || are_whole(queries))
    }

    /// The bytes of queries, 0 to 255, in an order; `None` where a value is not finite or so far from all candidates
    /// that squared distances lose digits.
    pub(super) fn queries(&self, rows: &[f32], order: &[u32]) -> Option<Bytes> {
        /// Far below the root of the largest number.
        const FAR: f32 = 1e15;
        let bytes = round_queries(self, rows, order);
        let far = FAR.min(FAR * self.scale);
        bytes
            .errors
            .iter()
            .all(|&error| error < far)
            .then_some(bytes)
    }

    /// The bytes of candidates, -128 to 127, in an order.
    pub(super) fn candidates(&self, rows: &[f32], order: &[u32]) -> Bytes {
        round_candidates(self, rows, order)
    }
}

multiversioned! {
    #![avx512]

    fn round_queries(grid: &Grid, rows: &[f32], order: &[u32]) -> Bytes {
        round(grid, rows, order, grid.longest, |value, centre| {
            (value, (value - centre) * (value - centre))
        })
    }

    fn round_candidates(grid: &Grid, rows: &[f32], order: &[u32]) -> Bytes {
        round(grid, rows, order, f32::INFINITY, |value, centre| {
            (value - centre, value * value - centre * centre)
        })
    }
}

/// A row is prefetched so many rows before its turn: in an order that is not theirs, rows come from anywhere.
const AHEAD: usize = 2;

/// Values of a row that are rounded side by side.
const LANES: usize = 16;

/// Rounds rows to bytes of at most length `longest`; `byte` gives the byte of a rounded value and its part of the norm.
#[inline(always)]
fn round(
    grid: &Grid,
    rows: &[f32],
    order: &[u32],
    longest: f32,
    byte: impl Fn(i32, i32) -> (i32, i32),
) -> Bytes {
    let dim = grid.least.len();
    let padded = dim.next_multiple_of(LANES);
    let mut least = grid.least.clone();
    least.resize(padded, 0.0);
    let mut centre = grid.centre.clone();
    centre.resize(padded, 0);
    let mut values = vec![0.0_f32; padded];
    let mut rounded = vec![0_u8; padded];
    let width = dim.div_ceil(4);
    let mut bytes = Bytes {
        quads: vec![0; order.len() * width],
        norms: vec![0; order.len()],
        errors: vec![0.0; order.len()],
    };
    let outputs = bytes.quads.chunks_exact_mut(width);
    for ((((place, &row), quads), norm), error) in (order.iter().enumerate())
        .zip(outputs)
        .zip(&mut bytes.norms)
        .zip(&mut bytes.errors)
    {
        if let Some(&row) = order.get(place + AHEAD) {
            prefetch(&rows[row as usize * dim..][..dim]);
        }
        let row = &rows[row as usize * dim..][..dim];
        for ((value, of_row), least) in values.iter_mut().zip(row).zip(&least) {
            *value = (of_row - least) * grid.scale;
        }
        (*norm, *error) = round_row(&values, &centre, 1.0, &mut rounded, &byte);
        if longest < f32::INFINITY {
            let squares = rounded
                .iter()
                .map(|&byte| u32::from(byte) * u32::from(byte));
            let length = (squares.sum::<u32>() as f32).sqrt();
            if length > longest {
                // Rounding adds to both lengths.
                let rounding = rounding(dim);
                let share = (longest - rounding) / (length + rounding);
                (*norm, *error) = round_row(&values, &centre, share.max(0.0), &mut rounded, &byte);
            }
        }
        for (quad, bytes) in quads.iter_mut().zip(rounded.as_chunks().0) {
            *quad = i32::from_le_bytes(*bytes);
        }
    }
    bytes
}

/// Rounds a `share` of the values that the grid has in place of some scaled ones; the row's part of squared distances
/// and the length of what is lost.
#[inline(always)]
fn round_row(
    scaled: &[f32],
    centre: &[i32],
    share: f32,
    rounded: &mut [u8],
    byte: impl Fn(i32, i32) -> (i32, i32),
) -> (i32, f32) {
    /// Numbers at least as large have no digits behind the point.
    const WHOLE: f32 = (1 << 23) as f32;
    let mut parts = [0_i32; LANES];
    let mut errors = [0.0_f32; LANES];
    let columns = (scaled.as_chunks::<LANES>().0.iter())
        .zip(centre.as_chunks::<LANES>().0)
        .zip(rounded.as_chunks_mut::<LANES>().0);
    for ((scaled, centre), rounded) in columns {
        for lane in 0..LANES {
            let whole = share * scaled[lane].clamp(0.0, 255.0) + WHOLE;
            let error = scaled[lane] - (whole - WHOLE);
            let (byte, part) = byte((whole.to_bits() & 0xff) as i32, centre[lane]);
            rounded[lane] = byte as u8;
            parts[lane] += part;
            errors[lane] = error.mul_add(error, errors[lane]);
        }
    }
    (parts.iter().sum(), errors.iter().sum::<f32>().sqrt())
}

/// By how much rounding each value to the nearest whole number may lengthen a row, at most.
fn rounding(dim: usize) -> f32 {
    (dim as f32).sqrt() / 2.0
}

/// The largest scale with which the lengths of two rows of bytes multiply to [`PRODUCT`] at most,
/// where the values have at most lengths `a` and `b`. Rounding each value may add half a unit to a
/// byte of a query, and to one of a candidate, whose centre is rounded too, a whole one.
fn scale_of_rows(a: f32, b: f32, dim: usize) -> f32 {
    let rounding = rounding(dim);
    // The positive root of (a scale + rounding) (b scale + 2 rounding) = PRODUCT.
    let linear = 2.0 * rounding * a + rounding * b;
    let constant = PRODUCT - 2.0 * rounding * rounding;
    2.0 * constant / (linear + (linear * linear + 4.0 * a * b * constant).sqrt())
}

/// What values the columns have.
struct Columns {
    least: Vec<f32>,
    most: Vec<f32>,
    /// Whether all values are.
    is_finite: bool,
    /// Whether all values are whole numbers.
    is_whole: bool,
}

impl Columns {
    fn of(rows: &[f32], dim: usize) -> Self {
        let mut least = vec![f32::INFINITY; dim];
        let mut most = vec![f32::NEG_INFINITY; dim];
        let [is_finite, is_whole] = widen(&mut least, &mut most, rows);
        Self {
            least,
            most,
            is_finite,
            is_whole,
        }
    }

    /// The largest of the columns' ranges.
    fn range(&self) -> f32 {
        let ranges = self.least.iter().zip(&self.most);
        ranges.map(|(least, most)| most - least).fold(0.0, f32::max)
    }

    /// Whether all values do.
    fn lie_within(&self, least: f32, most: f32) -> bool {
        self.least.iter().all(|&value| value >= least)
            && self.most.iter().all(|&value| value <= most)
    }
}

multiversioned! {
    #![avx512]

    /// Widens the range of each column, `least` to `most`, to the values of `rows`; whether all values are finite,
    /// and whether all are whole numbers.
    fn widen(least: &mut [f32], most: &mut [f32], rows: &[f32]) -> [bool; 2] {
        let (mut is_finite, mut is_whole) = (true, true);
        for row in rows.chunks_exact(least.len()) {
            for ((least, most), &value) in least.iter_mut().zip(&mut *most).zip(row) {
                *least = if value < *least { value } else { *least };
                *most = if value > *most { value } else { *most };
                is_finite &= value.is_finite();
                is_whole &= value.floor() == value;
            }
        }
        [is_finite, is_whole]
    }

    /// Whether all values are whole numbers.
    fn are_whole(values: &[f32]) -> bool {
        values.iter().fold(true, |are_whole, value| are_whole & (value.floor() == *value))
    }
}

/// The mean of each column, about.
#[target_feature(enable = "avx2,fma")]
fn mean(rows: &[f32], dim: usize) -> Vec<f32> {
    let mut mean = vec![0.0; dim];
    for row in rows.chunks_exact(dim) {
        for (sum, value) in mean.iter_mut().zip(row) {
            *sum += value;
        }
    }
    for sum in &mut mean {
        *sum *= dim as f32 / rows.len() as f32;
    }
    mean
}

/// The length of the longest row less `origin`.
#[target_feature(enable = "avx2,fma")]
fn longest(rows: &[f32], origin: &[f32]) -> f32 {
    let rows = rows.chunks_exact(origin.len());
    let lengths = rows.map(|row| squared_distance(row, origin));
    lengths.fold(0.0, f32::max).sqrt()
}

/// The squared distance of two rows, summed in an order that suits vectors.
#[inline]
#[target_feature(enable = "avx2,fma")]
pub(super) fn squared_distance(a: &[f32], b: &[f32]) -> f32 {
    let ((a, last_a), (b, last_b)) = (a.as_chunks::<32>(), b.as_chunks::<32>());
    let mut sums = [_mm256_setzero_ps(); 4];
    for (a, b) in a.iter().zip(b) {
        for (quarter, sum) in sums.iter_mut().enumerate() {
            // SAFETY: 8 of 32 values can be read from value 0, 8, 16, and 24.
            let (a, b) = unsafe {
                let (a, b) = (a.as_ptr().add(8 * quarter), b.as_ptr().add(8 * quarter));
                (_mm256_loadu_ps(a), _mm256_loadu_ps(b))
            };
            let difference = _mm256_sub_ps(a, b);
            *sum = _mm256_fmadd_ps(difference, difference, *sum);
        }
    }
    let sum = _mm256_add_ps(
        _mm256_add_ps(sums[0], sums[1]),
        _mm256_add_ps(sums[2], sums[3]),
    );
    let sum = _mm_add_ps(_mm256_castps256_ps128(sum), _mm256_extractf128_ps::<1>(sum));
    let sum = _mm_add_ps(sum, _mm_movehl_ps(sum, sum));
    let sum = _mm_cvtss_f32(_mm_add_ss(sum, _mm_movehdup_ps(sum)));
    let last = last_a.iter().zip(last_b);
    sum + last.map(|(a, b)| (a - b) * (a - b)).sum::<f32>()
}

#[cfg(test)]
mod tests {
    use super::super::has_avx2_and_fma;
    use super::*;
    use crate::seed::Seed;

    /// Rows of one kind or the other: each byte as `signed` says.
    fn rows(bytes: &Bytes, dim: usize, signed: bool) -> Vec<Vec<i32>> {
        let value = |byte: u8| {
            if signed {
                i32::from(byte as i8)
            } else {
                i32::from(byte)
            }
        };
        let row = |quads: &[i32]| -> Vec<i32> {
            let bytes = quads.iter().flat_map(|quad| quad.to_le_bytes());
            bytes.take(dim).map(value).collect()
        };
        bytes.quads.chunks_exact(dim.div_ceil(4)).map(row).collect()
    }

    /// Checks the bytes of two sets of rows, in both widths; returns the largest product of the lengths of
    /// two rows of the narrower.
    fn check(a: &[f32], b: &[f32], dim: usize) -> f64 {
        check_of_width(a, b, dim, true);
        let longest = check_of_width(a, b, dim, false);
        assert!(longest < 32_768.0, "{longest}");
        longest
    }

    fn check_of_width(a: &[f32], b: &[f32], dim: usize, is_wide: bool) -> f64 {
        let all = |rows: &[f32]| (0..(rows.len() / dim) as u32).collect::<Vec<u32>>();
        // SAFETY: AVX2 and FMA were detected on this processor.
        let (grid, queries, candidates) = unsafe {
            let grid = Grid::of(b, dim, is_wide).unwrap();
            let queries = grid.queries(a, &all(a)).unwrap();
            let candidates = grid.candidates(b, &all(b));
            (grid, queries, candidates)
        };
        let (rows_a, rows_b) = (rows(&queries, dim, false), rows(&candidates, dim, true));
        let length = |row: &[i32]| row.iter().map(|v| f64::from(v * v)).sum::<f64>().sqrt();
        let mut longest = 0.0_f64;
        for (i, (bytes_a, row_a)) in rows_a.iter().zip(a.chunks_exact(dim)).enumerate() {
            for (j, (bytes_b, row_b)) in rows_b.iter().zip(b.chunks_exact(dim)).enumerate() {
                let products: i32 = bytes_a.iter().zip(bytes_b).map(|(a, b)| a * b).sum();
                let squared = queries.norms[i] + candidates.norms[j] - 2 * products;
                let squares = row_a
                    .iter()
                    .zip(row_b)
                    .map(|(a, b)| f64::from(a - b).powi(2));
                let distance = f64::from(grid.scale) * squares.sum::<f64>().sqrt();
                let rounding = f64::from(queries.errors[i] + candidates.errors[j]);
                let difference = (f64::from(squared).sqrt() - distance).abs();
                assert!(
                    difference <= rounding + 0.01,
                    "{difference} of {distance}, not {rounding}"
                );
                longest = longest.max(length(bytes_a) * length(bytes_b));
            }
        }
        longest
    }

    #[test]
    fn distances_are_those_of_the_values_but_for_rounding() {
        if !has_avx2_and_fma() {
            return;
        }
        let mut rng = Seed(11).rng();
        for dim in [1, 7, 64, 128, 200, MAX_DIM] {
            let [a, b] = [20, 30].map(|rows| -> Vec<f32> {
                let value = |k: usize| rng.normal() as f32 + (k % dim) as f32;
                (0..rows * dim).map(value).collect()
            });
            let longest = check(&a, &b, dim);
            assert!(longest > 8_000.0 || dim < 64, "{longest} wastes digits");
            check(&a[..dim], &b, dim);
            check(&a, &a, dim);
            // Queries that lie outside of what candidates reach, and are longer.
            check(&a, &b[..2 * dim], dim);
            let far: Vec<f32> = a.iter().map(|value| 3.0 * value - 5.0).collect();
            check(&far, &b, dim);
        }
    }

    #[test]
    fn sums_of_products_fit_where_rows_are_all_in_few_values() {
        if !has_avx2_and_fma() {
            return;
        }
        for dim in [4, 16, 128, 512] {
            for ones in [1, 2, 3, dim / 2] {
                let row = |first: usize| {
                    (0..dim).map(move |k| f32::from(u8::from((k + first) % dim < ones)))
                };
                let rows: Vec<f32> = (0..dim.min(60)).flat_map(row).collect();
                check(&rows, &rows, dim);
                check(&rows, &rows[..2 * dim], dim);
                check(&rows[..dim], &rows, dim);
            }
        }
    }

    #[test]
    fn whole_numbers_lose_nothing_where_sums_are_wide() {
        if !has_avx2_and_fma() {
            return;
        }
        let mut rng = Seed(13).rng();
        for (dim, values) in [(128, 256), (70, 100), (16, 3)] {
            let rows: Vec<f32> = (0..40 * dim)
                .map(|_| rng.below(values) as f32 - 17.0)
                .collect();
            let order: Vec<u32> = (0..40).rev().collect();
            // SAFETY: AVX2 and FMA were detected on this processor.
            let grid = unsafe { Grid::of(&rows, dim, true) }.expect("a grid");
            let queries = grid.queries(&rows, &order).expect("bytes");
            for bytes in [queries, grid.candidates(&rows, &order)] {
                assert_eq!(bytes.errors, [0.0; 40], "{values} values");
            }
        }
    }
}
