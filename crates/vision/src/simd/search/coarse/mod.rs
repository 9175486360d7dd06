//! The nearest by Euclidean distance, with products of bytes.
//!
//! *How it works.*
//! 1. Values become bytes (see [`Grid`]). By the triangle inequality the distance of two rows of
//!    bytes differs from the scaled distance of the rows by at most the lengths of what rounding
//!    took from either.
//! 2. With `|a - b|^2 = |a|^2 + |b|^2 - 2 a.b` each instruction multiplies and adds 32 pairs of
//!    bytes. The grid is such that no sum of products leaves 16 bits.
//! 3. A candidate is rejected if even the lower bound of its distance exceeds the second smallest distance so
//!    far. For the few others the distance is computed in full, which may lower that second smallest.
//! 4. The caller compares what is left, mostly the two nearest themselves, by the definition of the
//!    distance; so the results are those of the search by definition.

mod grid;

use std::arch::x86_64::{
    __m256i, _mm256_add_epi16, _mm256_add_epi32, _mm256_castsi256_ps, _mm256_cmpgt_epi32,
    _mm256_loadu_si256, _mm256_madd_epi16, _mm256_maddubs_epi16, _mm256_movemask_ps,
    _mm256_set1_epi16, _mm256_set1_epi32, _mm256_setzero_si256, _mm512_add_epi32,
    _mm512_cmple_epi32_mask, _mm512_dpbusd_epi32, _mm512_loadu_si512, _mm512_set1_epi32,
    _mm512_setzero_si512, _mm512_slli_epi32, _mm512_sub_epi32,
};

use self::grid::{Grid, MAX_DIM, squared_distance};
use super::pack;
use crate::simd::InstructionSet;

/// Candidates of a panel: two vectors of eight.
const LANES: usize = 16;

/// Queries of a block: with two vectors each, twelve of sixteen registers hold sums.
const ROWS: usize = 6;

/// Queries that see a panel one after the other: whole blocks, whose values fill half of a
/// second-level cache.
const QUERIES: usize = 85 * ROWS;

/// Measured candidates that a query may have on average, besides one in [`MEASURED_SHARE`] of all
/// that it has seen: with more of them the definition is as fast.
const MEASURED: usize = 80;

/// See [`MEASURED`].
const MEASURED_SHARE: usize = 16;

/// By how much two sums of the same squares in another order may differ, generously.
const ROUNDING: f32 = 1e-3;

/// Values of `b` from which on bytes are worth the work of making them: with fewer, too many of the
/// candidates are measured.
const WORTH: usize = 40_000;

/// For the first rows of `a`, as many as bytes help to find, the rows of `b` that may be nearest, in
/// ascending order. Among them are all that are, by the definition, at most as far as the farther of
/// any two that are `apart`: all that are no farther than the second nearest if `apart` says so of
/// any two rows.
///
/// There are no rows where `b` is small, some value is not finite or of extreme size, rows are very
/// long, or the processor lacks AVX2; and no more of them after rows whose candidates are too much
/// alike.
pub(super) fn near_rows(
    a: &[f32],
    b: &[f32],
    dim: usize,
    apart: impl Fn(u32, u32) -> bool,
) -> Vec<Vec<u32>> {
    if !((1..=MAX_DIM).contains(&dim) && b.len() >= WORTH && has_avx2_and_fma()) {
        return Vec::new();
    }
    // SAFETY: AVX2 and FMA were detected on this processor.
    unsafe { search(a, b, dim, apart) }
}

fn has_avx2_and_fma() -> bool {
    InstructionSet::in_use() >= InstructionSet::Avx2
}

/// [`near_rows`] without its tests.
#[target_feature(enable = "avx2,fma")]
fn search(a: &[f32], b: &[f32], dim: usize, apart: impl Fn(u32, u32) -> bool) -> Vec<Vec<u32>> {
    let Some(grid) = Grid::of(a, b, dim) else {
        return Vec::new();
    };
    let quads = dim.div_ceil(4);
    let mut queries = grid.queries(a);
    let blocks = (a.len() / dim).div_ceil(ROWS);
    queries.quads.resize(blocks * ROWS * quads, 0);
    let coarse = grid.candidates(b);
    let candidates = Candidates {
        rows: b,
        dim,
        panels: pack(&coarse.quads, quads),
        norms: pack(&coarse.norms, 1),
        error: coarse.errors.iter().copied().fold(0.0, f32::max),
        scale: grid.scale,
        apart,
        is_wide: InstructionSet::in_use() == InstructionSet::Avx512,
    };
    let mut near = Vec::with_capacity(a.len() / dim);
    let parts = queries.norms.iter().zip(&queries.errors);
    let mut parts = parts.map(|(&norm, &error)| Query::new(norm, error));
    let tiles = a.chunks(QUERIES * dim);
    for (rows, quads) in tiles.zip(queries.quads.chunks(QUERIES * quads)) {
        let mut tile = Tile {
            rows,
            quads,
            queries: parts.by_ref().take(rows.len() / dim).collect(),
            limits: vec![[i32::MAX; ROWS]; (rows.len() / dim).div_ceil(ROWS)],
        };
        if candidates.measure(&mut tile).is_none() {
            break;
        }
        near.extend(tile.queries.iter().map(Query::near_enough));
    }
    near
}

/// Some rows of `a`.
struct Tile<'a> {
    rows: &'a [f32],
    /// Their bytes, and zeros after the last row up to a whole block.
    quads: &'a [i32],
    queries: Vec<Query>,
    /// Of each row, block by block: candidates with a larger squared distance in bytes, less the
    /// query's part of it, are out.
    limits: Vec<[i32; ROWS]>,
}

/// What is known of the nearest of a row of `a`.
struct Query {
    /// Its part of squared distances in bytes.
    norm: i32,
    /// Length of what rounding took from it.
    error: f32,
    /// Index of the nearest measured so far, and its squared distance.
    nearest: (u32, f32),
    /// Of two measured candidates that are apart the squared distance to the farther; the least of
    /// all such two.
    bound: f32,
    /// Measured candidates that were within the bound when they were, and their squared distances; in
    /// ascending order of the candidates.
    near: Vec<(u32, f32)>,
}

impl Query {
    fn new(norm: i32, error: f32) -> Self {
        Self {
            norm,
            error,
            nearest: (0, f32::INFINITY),
            bound: f32::INFINITY,
            near: Vec::with_capacity(16),
        }
    }

    /// Whether a measured candidate may be within the bound by the definition.
    fn admits(&self, distance: f32) -> bool {
        distance <= self.bound * (1.0 + ROUNDING) + f32::MIN_POSITIVE
    }

    /// The candidates that may be within the bound.
    fn near_enough(&self) -> Vec<u32> {
        let near = self.near.iter();
        near.filter(|(_, distance)| self.admits(*distance))
            .map(|&(index, _)| index)
            .collect()
    }
}

/// The rows of `b`.
struct Candidates<'a, Apart> {
    rows: &'a [f32],
    dim: usize,
    panels: Vec<[i32; LANES]>,
    norms: Vec<[i32; LANES]>,
    /// The largest of their errors.
    error: f32,
    scale: f32,
    apart: Apart,
    /// Whether AVX-512 with products of bytes is in use.
    is_wide: bool,
}

impl<Apart: Fn(u32, u32) -> bool> Candidates<'_, Apart> {
    /// Measures all that may be within the bounds of a tile of queries; `None` if these are too many.
    #[target_feature(enable = "avx2,fma")]
    fn measure(&self, tile: &mut Tile) -> Option<()> {
        let mut measured = 0;
        let panels = self.panels.chunks_exact(self.dim.div_ceil(4));
        for ((panel, norms), first) in panels.zip(&self.norms).zip((0..).step_by(LANES)) {
            measured += self.scan(panel, norms, first, tile);
            if measured > tile.queries.len() * (MEASURED + first / MEASURED_SHARE) {
                return None;
            }
        }
        Some(())
    }

    /// Measures those candidates of a panel, `first` and those that follow it, that may be within the
    /// bounds, and returns how many.
    #[target_feature(enable = "avx2,fma")]
    fn scan(
        &self,
        panel: &[[i32; LANES]],
        norms: &[i32; LANES],
        first: usize,
        tile: &mut Tile,
    ) -> usize {
        let mut measured = 0;
        let candidates = (1 << LANES.min(self.rows.len() / self.dim - first)) - 1;
        let blocks = tile.quads.chunks_exact(ROWS * panel.len());
        let blocks = blocks.zip(&mut tile.limits);
        let queries = tile.queries.chunks_mut(ROWS);
        let rows = tile.rows.chunks(ROWS * self.dim);
        for (((quads, limits), queries), rows) in blocks.zip(queries).zip(rows) {
            let within = if self.is_wide {
                // SAFETY: what is in use was detected on this processor.
                unsafe { within_avx512(quads, limits, panel, norms) }
            } else {
                within(quads, limits, panel, norms)
            };
            let rows = rows.chunks_exact(self.dim);
            for (((query, row), within), limit) in
                queries.iter_mut().zip(rows).zip(within).zip(limits)
            {
                let mut within = within & candidates;
                while within != 0 {
                    let index = first + within.trailing_zeros() as usize;
                    within &= within - 1;
                    let candidate = &self.rows[index * self.dim..][..self.dim];
                    let distance = squared_distance(row, candidate);
                    if query.admits(distance) {
                        *limit = self.offer(query, index as u32, distance);
                    }
                    measured += 1;
                }
            }
        }
        measured
    }

    /// Tells a query of a candidate and its squared distance; returns the query's limit.
    fn offer(&self, query: &mut Query, index: u32, distance: f32) -> i32 {
        query.near.push((index, distance));
        let (nearest, nearest_distance) = query.nearest;
        if distance < nearest_distance {
            query.nearest = (index, distance);
        }
        let farther = distance.max(nearest_distance);
        if farther < query.bound && (self.apart)(nearest, index) {
            query.bound = farther;
        }
        let bound = query.bound.sqrt() * self.scale;
        let reach = (bound + query.error + self.error) * (1.0 + ROUNDING) + 0.01;
        ((reach * reach) as i32).saturating_sub(query.norm)
    }
}

/// For each query of a block one bit for each candidate of a panel, the first lowest: whether its
/// squared distance in bytes, less the query's part of it, is within the query's limit.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn within(
    quads: &[i32],
    limits: &[i32; ROWS],
    panel: &[[i32; LANES]],
    norms: &[i32; LANES],
) -> [u32; ROWS] {
    let mut rows = [quads; ROWS];
    for (number, row) in rows.iter_mut().enumerate() {
        *row = &quads[number * panel.len()..][..panel.len()];
    }
    // Of each candidate two sums of products that belong together.
    let mut sums = [[_mm256_setzero_si256(); 2]; ROWS];
    for (k, candidates) in panel.iter().enumerate() {
        let candidates = load(candidates);
        for row in 0..ROWS {
            let query = _mm256_set1_epi32(rows[row][k]);
            for half in 0..2 {
                let products = _mm256_maddubs_epi16(query, candidates[half]);
                sums[row][half] = _mm256_add_epi16(sums[row][half], products);
            }
        }
    }
    let norms = load(norms);
    let minus_two = _mm256_set1_epi16(-2);
    let mut within = [0; ROWS];
    for row in 0..ROWS {
        let limit = _mm256_set1_epi32(limits[row]);
        let mut beyond = 0;
        for half in 0..2 {
            let products = _mm256_madd_epi16(sums[row][half], minus_two);
            let distances = _mm256_add_epi32(norms[half], products);
            let far = _mm256_castsi256_ps(_mm256_cmpgt_epi32(distances, limit));
            beyond |= (_mm256_movemask_ps(far) as u32) << (8 * half);
        }
        within[row] = !beyond;
    }
    within
}

/// [`within`] with one instruction for the products of 64 bytes and their sums.
///
/// *Benefit*: a fifth of the instructions. *Correctness*: sums of 32 bits hold what those of 16 bits
/// hold, so all integers are the same.
#[inline]
#[target_feature(enable = "avx512f,avx512vnni")]
fn within_avx512(
    quads: &[i32],
    limits: &[i32; ROWS],
    panel: &[[i32; LANES]],
    norms: &[i32; LANES],
) -> [u32; ROWS] {
    let mut rows = [quads; ROWS];
    for (number, row) in rows.iter_mut().enumerate() {
        *row = &quads[number * panel.len()..][..panel.len()];
    }
    // Even and odd quads apart: twice as many sums, none of which waits for the one before.
    let mut sums = [[_mm512_setzero_si512(); 2]; ROWS];
    let (pairs, last) = panel.as_chunks::<2>();
    for (pair, k) in pairs.iter().zip((0..).step_by(2)) {
        for half in 0..2 {
            // SAFETY: 64 bytes can be read from 16 lanes of 4 bytes.
            let candidates = unsafe { _mm512_loadu_si512(pair[half].as_ptr().cast()) };
            for row in 0..ROWS {
                let query = _mm512_set1_epi32(rows[row][k + half]);
                sums[row][half] = _mm512_dpbusd_epi32(sums[row][half], query, candidates);
            }
        }
    }
    if let [lanes] = last {
        // SAFETY: as before.
        let candidates = unsafe { _mm512_loadu_si512(lanes.as_ptr().cast()) };
        for row in 0..ROWS {
            let query = _mm512_set1_epi32(rows[row][panel.len() - 1]);
            sums[row][0] = _mm512_dpbusd_epi32(sums[row][0], query, candidates);
        }
    }
    // SAFETY: as before.
    let norms = unsafe { _mm512_loadu_si512(norms.as_ptr().cast()) };
    let mut within = [0; ROWS];
    for row in 0..ROWS {
        let products = _mm512_add_epi32(sums[row][0], sums[row][1]);
        let distances = _mm512_sub_epi32(norms, _mm512_slli_epi32::<1>(products));
        let limit = _mm512_set1_epi32(limits[row]);
        within[row] = u32::from(_mm512_cmple_epi32_mask(distances, limit));
    }
    within
}

/// Two vectors of eight lanes.
#[inline]
#[target_feature(enable = "avx2")]
fn load(lanes: &[i32; LANES]) -> [__m256i; 2] {
    let start = lanes.as_ptr();
    // SAFETY: 32 bytes can be read from lane 0 and from lane 8 of 16 lanes of 4 bytes.
    unsafe {
        [
            _mm256_loadu_si256(start.cast()),
            _mm256_loadu_si256(start.add(8).cast()),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::super::{TwoNearest, two_nearest_among, two_nearest_floats};
    use super::*;
    use crate::seed::{Rng, Seed};

    /// The definition.
    fn defined(a: &[f32], b: &[f32], dim: usize) -> Vec<TwoNearest> {
        let all: Vec<u32> = (0..(b.len() / dim) as u32).collect();
        a.chunks_exact(dim)
            .map(|row| two_nearest_among(row, b, &all))
            .collect()
    }

    /// Rows more or less near to one of a few: like descriptors, much nearer to some than to most.
    fn clustered(rng: &mut Rng, rows: usize, dim: usize, centres: &[f32]) -> Vec<f32> {
        let mut clustered = Vec::new();
        for _ in 0..rows {
            let centre = rng.below((centres.len() / dim) as u32) as usize;
            let width = 0.5 * rng.uniform() as f32;
            let centre = &centres[centre * dim..][..dim];
            clustered.extend(
                centre
                    .iter()
                    .map(|value| value + width * rng.normal() as f32),
            );
        }
        clustered
    }

    /// Checks rows drawn around 60 places, with all values changed by `change(value, column)`; returns
    /// for how many rows bytes were enough.
    fn check(rows: usize, dim: usize, change: impl Fn(f32, usize) -> f32) -> usize {
        let mut rng = Seed(3).rng();
        let centres: Vec<f32> = (0..60 * dim).map(|_| rng.normal() as f32).collect();
        let [a, b] = [rows, WORTH.div_ceil(dim).max(900)].map(|rows| -> Vec<f32> {
            let values = clustered(&mut rng, rows, dim, &centres);
            values
                .iter()
                .zip((0..dim).cycle())
                .map(|(&v, k)| change(v, k))
                .collect()
        });
        let expected = defined(&a, &b, dim);
        let near = near_rows(&a, &b, dim, |_, _| true);
        let found = near.iter().zip(a.chunks_exact(dim));
        let found: Vec<TwoNearest> = found
            .map(|(near, row)| two_nearest_among(row, &b, near))
            .collect();
        assert_eq!(found, expected[..found.len()], "{dim} values");
        assert_eq!(two_nearest_floats(&a, &b, dim), expected, "{dim} values");
        found.len()
    }

    #[test]
    fn bytes_are_enough_for_rows_like_descriptors() {
        let rows = QUERIES + 40;
        for dim in [63, 64, 128, 200] {
            InstructionSet::for_each(|set| {
                let found = check(rows, dim, |value, _| value);
                assert!(
                    found == rows || !has_avx2_and_fma(),
                    "{found} of {rows} rows of {dim} with {set:?}"
                );
            });
        }
    }

    #[test]
    fn offsets_and_sizes_of_columns_change_no_result() {
        check(200, 65, |value, column| value + 1e4 * column as f32);
        check(
            200,
            65,
            |value, column| if column == 7 { 1e5 * value } else { value },
        );
        check(
            200,
            65,
            |value, column| if column == 7 { value } else { 1e-6 * value },
        );
        check(200, 3, |value, _| (8.0 * value).round());
    }

    #[test]
    fn rows_too_much_alike_are_left_to_the_definition() {
        // A few values far out make the grid too coarse for the others.
        let alike = |value: f32, _| if value > 4.0 { 1e3 * value } else { value };
        assert_eq!(check(QUERIES + 40, 128, alike), 0);
    }

    #[test]
    fn what_bytes_cannot_hold_is_left_to_the_definition() {
        for factor in [0.0, 1e-18, 1e15] {
            assert_eq!(
                check(30, 16, |value, _| factor * value),
                0,
                "times {factor}"
            );
        }
        for other in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let change = |value: f32, column: usize| {
                if column == 3 && value > 2.0 {
                    other
                } else {
                    value
                }
            };
            assert_eq!(check(30, 16, change), 0, "{other}");
        }
        assert_eq!(check(7, MAX_DIM + 1, |value, _| value), 0);
    }
}
