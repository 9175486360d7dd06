//! The two nearest of many candidates, where distances are whole numbers and are computed from products of bytes.
//!
//! *How it works.*
//! 1. The distance of a query and a candidate is a part of the query plus a part of the candidate, less some products
//!    of their bytes. [Tiles](crate::simd::tiles) sum these products for 32 candidates and 32 queries together.
//! 2. The part of the query is the same for all of its candidates, so it is left out. The rest, times 32, plus the
//!    number of the candidate in its panel, is a key: the least key is the nearest candidate, and of equally near
//!    ones the first.
//! 3. A lane holds the two least keys of a query. Three instructions update them for 16 queries.
//!
//! *Benefit*: every candidate is compared in full, in less time than the other searches take to rule most of them
//! out. *Correctness*: all numbers are whole, and tests of the callers compare with the definition.

use std::arch::x86_64::{
    __m512i, _mm512_add_epi32, _mm512_and_si512, _mm512_cmplt_epi32_mask, _mm512_loadu_si512,
    _mm512_mask_mov_epi32, _mm512_max_epi32, _mm512_min_epi32, _mm512_set1_epi32,
    _mm512_slli_epi32, _mm512_srai_epi32, _mm512_storeu_si512, _mm512_sub_epi32,
};

use super::TwoNearest;
use crate::simd::tiles::{Bytes, LANES, Products, ROWS, Tiles};

/// Queries that see a panel of candidates one after the other; their bytes lie in the second-level cache.
const QUERIES: usize = 32 * ROWS;

/// A key is a distance times this, and the number of a candidate in its panel.
pub(super) const UNIT: i32 = ROWS as i32;

/// Distances, less the part of the query, are below this, and above this with a minus; so keys fit.
pub(super) const FARTHEST: i32 = i32::MAX / UNIT;

/// The bytes of rows and the distances that follow from them.
pub(super) trait Comparison {
    /// A key is the part of the candidate times [`UNIT`], and its number, less the sum of products times two to this.
    const SHIFT: u32;

    /// Queries, and candidates.
    fn counts(&self) -> [usize; 2];

    /// How often 64 bytes a row has.
    fn steps(&self) -> usize;

    /// Writes the bytes of candidates, `first` and those that follow it, as rows, and their parts of the distance: as many
    /// as there is room for parts. Of the rows they are, what is not written stays zero.
    fn candidates(&self, first: usize, rows: &mut [Bytes], parts: &mut [i32]);

    /// Writes the bytes of so many queries, `first` and those that follow it, as columns; of these too, what is not written
    /// stays zero.
    fn queries(&self, first: usize, count: usize, columns: &mut [Bytes]);
}

/// What is known of 16 queries.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct State {
    nearest: [i32; LANES],
    second: [i32; LANES],
    index: [i32; LANES],
}

impl State {
    const NONE: Self = Self {
        nearest: [FARTHEST; LANES],
        second: [FARTHEST; LANES],
        index: [0; LANES],
    };
}

/// The two nearest candidates of each query: distances less the query's part, at least [`FARTHEST`] where there is no
/// candidate.
#[target_feature(enable = "avx512f,avx512bw")]
pub(super) fn two_nearest<C: Comparison>(
    comparison: &C,
    tiles: &mut Tiles,
) -> Vec<TwoNearest<i32>> {
    let ([queries, candidates], steps) = (comparison.counts(), comparison.steps());
    let mut best = Vec::with_capacity(queries);
    let mut columns = vec![Bytes::ZERO; queries.min(QUERIES).div_ceil(ROWS) * steps];
    let mut rows = vec![Bytes::ZERO; steps];
    for start in (0..queries).step_by(QUERIES) {
        let count = QUERIES.min(queries - start);
        let mut states = vec![[State::NONE; 2]; count.div_ceil(ROWS)];
        let columns = &mut columns[..states.len() * steps];
        for (columns, first) in columns.chunks_exact_mut(steps).zip((0..).step_by(ROWS)) {
            comparison.queries(start + first, ROWS.min(count - first), columns);
        }
        for first in (0..candidates).step_by(ROWS) {
            let mut parts = [FARTHEST; ROWS];
            let there = ROWS.min(candidates - first);
            comparison.candidates(first, &mut rows, &mut parts[..there]);
            for (part, number) in parts.iter_mut().zip(0..) {
                *part = *part * UNIT + number;
            }
            for row in rows.iter_mut().flat_map(|bytes| &mut bytes.0[there..]) {
                row.fill(0);
            }
            see_panel::<C>(&rows, columns, &parts, first as i32, &mut states, tiles);
        }
        let lanes = states.as_flattened().iter().flat_map(|state| {
            (0..LANES).map(|lane| TwoNearest {
                nearest: state.nearest[lane],
                second: state.second[lane],
                index: state.index[lane] as u32,
            })
        });
        best.extend(lanes.take(count));
    }
    best
}

/// Shows a panel of candidates, `first` and those that follow it, to all queries. The products of a block are looked at
/// while those of the next are made.
#[target_feature(enable = "avx512f,avx512bw")]
fn see_panel<C: Comparison>(
    rows: &[Bytes],
    columns: &[Bytes],
    parts: &[i32; ROWS],
    first: i32,
    states: &mut [[State; 2]],
    tiles: &mut Tiles,
) {
    let mut products = [Products::ZERO; 2];
    for (block, columns) in columns.chunks_exact(rows.len()).enumerate() {
        tiles.multiply(rows, columns, &mut products[block % 2]);
        if let Some(before) = block.checked_sub(1) {
            look::<C>(&products[before % 2], parts, first, &mut states[before]);
        }
    }
    if let Some(last) = states.len().checked_sub(1) {
        look::<C>(&products[last % 2], parts, first, &mut states[last]);
    }
}

/// Takes a panel of candidates, `first` and those that follow it.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
fn look<C: Comparison>(
    products: &Products,
    parts: &[i32; ROWS],
    first: i32,
    states: &mut [State; 2],
) {
    const BITS: u32 = UNIT.trailing_zeros();
    for (products, state) in products.0.iter().zip(states) {
        let mut nearest = _mm512_set1_epi32(i32::MAX);
        let mut second = nearest;
        for (products, &part) in products.iter().zip(parts) {
            let products = match C::SHIFT {
                0 => load(products),
                6 => _mm512_slli_epi32::<6>(load(products)),
                _ => unreachable!("nobody needs others"),
            };
            let key = _mm512_sub_epi32(_mm512_set1_epi32(part), products);
            second = _mm512_min_epi32(second, _mm512_max_epi32(nearest, key));
            nearest = _mm512_min_epi32(nearest, key);
        }
        let number = _mm512_and_si512(nearest, _mm512_set1_epi32(UNIT - 1));
        let index = _mm512_add_epi32(number, _mm512_set1_epi32(first));
        let nearest = _mm512_srai_epi32::<BITS>(nearest);
        let second = _mm512_srai_epi32::<BITS>(second);
        let [before, before_second, before_index] =
            [&state.nearest, &state.second, &state.index].map(|lanes| load(lanes));
        // The first of equals stays.
        let wins = _mm512_cmplt_epi32_mask(nearest, before);
        let loser = _mm512_min_epi32(_mm512_max_epi32(nearest, before), second);
        store(&mut state.second, _mm512_min_epi32(before_second, loser));
        store(&mut state.nearest, _mm512_min_epi32(nearest, before));
        let index = _mm512_mask_mov_epi32(before_index, wins, index);
        store(&mut state.index, index);
    }
}

#[inline]
#[target_feature(enable = "avx512f")]
fn load(lanes: &[i32; LANES]) -> __m512i {
    // SAFETY: 64 bytes can be read from 16 numbers.
    unsafe { _mm512_loadu_si512(lanes.as_ptr().cast()) }
}

#[inline]
#[target_feature(enable = "avx512f")]
fn store(lanes: &mut [i32; LANES], vector: __m512i) {
    // SAFETY: 64 bytes can be written to 16 numbers.
    unsafe { _mm512_storeu_si512(lanes.as_mut_ptr().cast(), vector) };
}
