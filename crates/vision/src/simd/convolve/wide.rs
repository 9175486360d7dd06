//! The two passes with vectors of 64 bytes, written by hand.
//!
//! *Benefit*: the vertical pass keeps eight sums at work, as many as
//! two units of four cycles need; compiled from the portable text it has four, or, asked for eight,
//! puts them into memory. In the horizontal pass every vector of 64 bytes that is not aligned lies across
//! two cache lines and costs two loads; those to the right are put together from registers instead.
//! *Correctness*: each lane does what the portable text does for its column, in the same order; a test
//! compares all bits. In front of each access stands why it is within its slice.

use std::arch::x86_64::{
    __m512, _mm512_add_epi32, _mm512_add_ps, _mm512_fmadd_ps, _mm512_loadu_ps,
    _mm512_mask_storeu_ps, _mm512_permutex2var_ps, _mm512_set1_epi32, _mm512_set1_ps,
    _mm512_setr_epi32, _mm512_setzero_ps, _mm512_storeu_ps,
};

use super::ROWS_AT_ONCE;
use crate::simd::masked::{LANES, first_lanes, load_or_zero};

/// Vectors of a block in the horizontal pass.
const BLOCK: usize = 4;

/// The largest radius for which [`weigh_symmetric`] works.
pub(super) const LARGEST_RADIUS: usize = LANES;

/// The first rows of `out`, as many as are made at once.
///
/// # Panics
/// As [`weigh_rows`](super::weigh_rows), and if there are fewer taps or outputs than rows at once.
#[target_feature(enable = "avx512f")]
pub(super) fn weigh_rows(rows: &[&[f32]], taps: &[f32], out: &mut [&mut [f32]]) {
    let rows = &rows[..taps.len() + ROWS_AT_ONCE - 1];
    let out = out.first_chunk_mut().expect("rows were counted");
    let width = out[0].len();
    for x in (0..width).step_by(2 * LANES) {
        if x + 2 * LANES <= width {
            rows_block::<true>(rows, taps, out, x);
        } else {
            rows_block::<false>(rows, taps, out, x);
        }
    }
}

/// Columns from `x` on, 32 if the block is `FULL`.
#[inline]
#[target_feature(enable = "avx512f")]
fn rows_block<const FULL: bool>(
    rows: &[&[f32]],
    taps: &[f32],
    out: &mut [&mut [f32]; ROWS_AT_ONCE],
    x: usize,
) {
    const R: usize = ROWS_AT_ONCE;
    let count = taps.len();
    let mut sums = [[_mm512_setzero_ps(); 2]; R];
    for (j, row) in rows[..R - 1].iter().enumerate() {
        let values = [load::<FULL>(row, x), load::<FULL>(row, x + LANES)];
        for r in 0..R {
            if r <= j {
                add_scaled(&mut sums[r], values, taps[j - r]);
            }
        }
    }
    for (row, taps) in rows[R - 1..count].iter().zip(taps.windows(R)) {
        let values = [load::<FULL>(row, x), load::<FULL>(row, x + LANES)];
        for r in 0..R {
            add_scaled(&mut sums[r], values, taps[R - 1 - r]);
        }
    }
    for (i, row) in rows[count..].iter().enumerate() {
        let values = [load::<FULL>(row, x), load::<FULL>(row, x + LANES)];
        for r in 0..R {
            if r > i {
                add_scaled(&mut sums[r], values, taps[count + i - r]);
            }
        }
    }
    for (out, sum) in out.iter_mut().zip(sums) {
        store::<FULL>(out, x, sum[0]);
        store::<FULL>(out, x + LANES, sum[1]);
    }
}

/// As the kernel of that name.
///
/// # Panics
/// Also if there are more than `2 LARGEST_RADIUS + 1` taps.
#[target_feature(enable = "avx512f")]
pub(super) fn weigh_symmetric(padded: &[f32], taps: &[f32], out: &mut [f32]) {
    assert!(
        taps.len() / 2 <= LARGEST_RADIUS,
        "a kernel that two vectors hold"
    );
    let width = out.len();
    for x in (0..width).step_by(BLOCK * LANES) {
        // Of a full block the vector after the last is read too.
        if x + (BLOCK + 1) * LANES <= width {
            symmetric_block::<true>(padded, taps, out, x);
        } else {
            symmetric_block::<false>(padded, taps, out, x);
        }
    }
}

#[inline]
#[target_feature(enable = "avx512f")]
fn symmetric_block<const FULL: bool>(padded: &[f32], taps: &[f32], out: &mut [f32], x: usize) {
    let radius = taps.len() / 2;
    let numbers = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    // The pixels from `x` on, which the middle tap meets, and a vector to the right.
    let mut middles = [_mm512_setzero_ps(); BLOCK + 1];
    for (j, middle) in middles.iter_mut().enumerate() {
        *middle = load::<FULL>(padded, x + radius + LANES * j);
    }
    let mut sums = [_mm512_setzero_ps(); BLOCK];
    for (k, &tap) in taps[..radius].iter().enumerate() {
        let shift = _mm512_add_epi32(numbers, _mm512_set1_epi32((radius - k) as i32));
        for j in 0..BLOCK {
            let left = load::<FULL>(padded, x + k + LANES * j);
            let right = _mm512_permutex2var_ps(middles[j], shift, middles[j + 1]);
            let both = _mm512_add_ps(left, right);
            sums[j] = _mm512_fmadd_ps(_mm512_set1_ps(tap), both, sums[j]);
        }
    }
    for j in 0..BLOCK {
        let sum = _mm512_fmadd_ps(middles[j], _mm512_set1_ps(taps[radius]), sums[j]);
        store::<FULL>(out, x + LANES * j, sum);
    }
}

/// A vector from place `x` on; what lies beyond the end is zero, and there is nothing if it is `FULL`.
#[inline]
#[target_feature(enable = "avx512f")]
fn load<const FULL: bool>(values: &[f32], x: usize) -> __m512 {
    if FULL {
        let values = values[x..].first_chunk::<LANES>().expect("a full block");
        // SAFETY: 16 values can be read from 16 values.
        return unsafe { _mm512_loadu_ps(values.as_ptr()) };
    }
    load_or_zero(values, x)
}

#[inline]
#[target_feature(enable = "avx512f")]
fn store<const FULL: bool>(values: &mut [f32], x: usize, vector: __m512) {
    if FULL {
        let values = values[x..]
            .first_chunk_mut::<LANES>()
            .expect("a full block");
        // SAFETY: 16 values can be written to 16 values.
        return unsafe { _mm512_storeu_ps(values.as_mut_ptr(), vector) };
    }
    let start = x.min(values.len());
    let values = &mut values[start..];
    // SAFETY: lanes beyond the slice are not written.
    unsafe { _mm512_mask_storeu_ps(values.as_mut_ptr(), first_lanes(values.len()), vector) };
}

#[inline]
#[target_feature(enable = "avx512f")]
fn add_scaled(sums: &mut [__m512; 2], values: [__m512; 2], scale: f32) {
    let scale = _mm512_set1_ps(scale);
    sums[0] = _mm512_fmadd_ps(values[0], scale, sums[0]);
    sums[1] = _mm512_fmadd_ps(values[1], scale, sums[1]);
}
