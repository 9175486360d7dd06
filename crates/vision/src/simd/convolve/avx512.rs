//! The two passes with vectors of 64 bytes, written by hand.
//!
//! *Benefit*: the vertical pass keeps at least eight sums at work, as many as two units of four cycles need, and for eight
//! rows at once loads a row for half as many sums again. Compiled from the portable code it has four sums, or, asked for
//! eight, puts them into memory. In the horizontal pass every vector of
//! 64 bytes that is not aligned lies across two cache lines and costs two loads. Those to the right are put together
//! from registers instead, one instruction each, since the compiler knows how far they are shifted.
//! *Correctness*: each lane does what the portable code does for its column, in the same order; a test
//! compares all bits. A comment in front of each access says why it is within its slice.

use std::arch::x86_64::{
    __m512, _mm512_add_ps, _mm512_fmadd_ps, _mm512_set1_ps, _mm512_setzero_ps,
};

use crate::simd::prefetch::prefetch;
use crate::simd::sixteen::{LANES, from_lane, load, load_or_zero, store};

/// Vectors of a block: with as many sums at work no unit waits for the sum before.
const BLOCK: usize = 4;

/// The largest radius for which [`weigh_symmetric`] works.
pub(super) const MAX_RADIUS: usize = LANES;

/// The first `R` rows of `out`, in blocks of `V` vectors; returns `R`. `AHEAD` prefetches the next columns.
///
/// # Panics
/// As [`weigh_rows`](super::weigh_rows), and if there are fewer than `R` taps or outputs.
#[target_feature(enable = "avx512f")]
pub(super) fn weigh_rows<const R: usize, const V: usize, const AHEAD: bool>(
    rows: &[&[f32]],
    taps: &[f32],
    out: &mut [&mut [f32]],
) -> usize {
    // If the compiler knew how many rows follow the last whole sum, it would write them out, with more sums than registers.
    let rows = std::hint::black_box(&rows[..taps.len() + R - 1]);
    let out = out.first_chunk_mut::<R>().expect("rows were counted");
    let width = out[0].len();
    assert!(
        rows.iter().all(|row| row.len() >= width),
        "rows as long as an output"
    );
    let mut x = 0;
    while x + V * LANES <= width {
        rows_block::<R, V, true, AHEAD>(rows, taps, out, x);
        x += V * LANES;
    }
    while x + LANES <= width {
        rows_block::<R, 1, true, AHEAD>(rows, taps, out, x);
        x += LANES;
    }
    if x < width {
        rows_block::<R, 1, false, AHEAD>(rows, taps, out, x);
    }
    R
}

/// `V` vectors of columns from `x` on, or what there is of them unless the block is `FULL`.
#[inline]
#[target_feature(enable = "avx512f")]
fn rows_block<const R: usize, const V: usize, const FULL: bool, const AHEAD: bool>(
    rows: &[&[f32]],
    taps: &[f32],
    out: &mut [&mut [f32]; R],
    x: usize,
) {
    let count = taps.len();
    let mut sums = [[_mm512_setzero_ps(); V]; R];
    // The rows lie in the second-level cache, too far apart for some processors to guess the next block.
    let prefetch_next = |row: &[f32]| {
        if AHEAD && let Some(next) = row[x..].get(V * LANES..2 * V * LANES) {
            prefetch(next);
        }
    };
    for (j, row) in rows[..R - 1].iter().enumerate() {
        let values = load::<V, FULL>(row, x);
        prefetch_next(row);
        for r in 0..R {
            if r <= j {
                add_scaled(&mut sums[r], values, taps[j - r]);
            }
        }
    }
    for (row, taps) in rows[R - 1..count].iter().zip(taps.windows(R)) {
        let values = load::<V, FULL>(row, x);
        prefetch_next(row);
        for r in 0..R {
            add_scaled(&mut sums[r], values, taps[R - 1 - r]);
        }
    }
    for (i, row) in rows[count..].iter().enumerate() {
        let values = load::<V, FULL>(row, x);
        prefetch_next(row);
        for r in 0..R {
            if r > i {
                add_scaled(&mut sums[r], values, taps[count + i - r]);
            }
        }
    }
    for (out, sums) in out.iter_mut().zip(sums) {
        store::<V, FULL>(out, x, sums);
    }
}

/// As the kernel of that name.
///
/// # Panics
/// Also if there are more than `2 MAX_RADIUS + 1` taps.
#[target_feature(enable = "avx512f")]
pub(super) fn weigh_symmetric(padded: &[f32], taps: &[f32], out: &mut [f32]) {
    assert!(
        taps.len() / 2 <= MAX_RADIUS,
        "a kernel that two vectors hold"
    );
    let width = out.len();
    let mut x = 0;
    while x + BLOCK * LANES <= width {
        symmetric_block::<BLOCK, true>(padded, taps, out, x);
        x += BLOCK * LANES;
    }
    while x + LANES <= width {
        symmetric_block::<1, true>(padded, taps, out, x);
        x += LANES;
    }
    if x < width {
        symmetric_block::<1, false>(padded, taps, out, x);
    }
}

#[inline]
#[target_feature(enable = "avx512f")]
fn symmetric_block<const V: usize, const FULL: bool>(
    padded: &[f32],
    taps: &[f32],
    out: &mut [f32],
    x: usize,
) {
    let radius = taps.len() / 2;
    // The pixels from `x` on, which the middle tap meets, and a vector to the right of them.
    let middles = load::<V, FULL>(padded, x + radius);
    let beyond = load_or_zero(padded, x + radius + V * LANES);
    let mut sums = [_mm512_setzero_ps(); V];
    // Up to MAX_RADIUS.
    macro_rules! add_pairs {
        ($($distance:literal)*) => {$(
            if $distance <= radius {
                let lefts = load::<V, FULL>(padded, x + radius - $distance);
                let tap = _mm512_set1_ps(taps[radius - $distance]);
                for j in 0..V {
                    let next = if j + 1 < V { middles[j + 1] } else { beyond };
                    let both = _mm512_add_ps(lefts[j], from_lane::<$distance>(middles[j], next));
                    sums[j] = _mm512_fmadd_ps(tap, both, sums[j]);
                }
            }
        )*};
    }
    add_pairs!(16 15 14 13 12 11 10 9 8 7 6 5 4 3 2 1);
    add_scaled(&mut sums, middles, taps[radius]);
    store::<V, FULL>(out, x, sums);
}

#[inline]
#[target_feature(enable = "avx512f")]
fn add_scaled<const V: usize>(sums: &mut [__m512; V], values: [__m512; V], scale: f32) {
    let scale = _mm512_set1_ps(scale);
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum = _mm512_fmadd_ps(value, scale, *sum);
    }
}
