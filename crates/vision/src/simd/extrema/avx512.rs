//! Extrema of differences with vectors of 64 bytes, written by hand.
//!
//! *How it works.* Along a row each column first gets the largest and the smallest of its three differences
//! in a layer; those of its neighbours, already there, make the extremum of all nine. A column
//! passes that is one of these, and beats the difference in either other layer at its place too. The few
//! that do are looked at by the portable code. Three scales are searched together, since the differences of one are the
//! other layers of the next.
//!
//! *Benefit*: 14 loads for sixteen columns of three scales where the portable code has 54, 36
//! of them across two cache lines; and all rows, which do not fit into the nearest cache, are read once.
//! *Correctness*: maxima and comparisons are exact in any order; a test
//! compares the columns found. Lanes beyond the rows are not read.

use std::arch::x86_64::{
    __m512, _CMP_GE_OQ, _CMP_GT_OQ, _CMP_LE_OQ, _CMP_LT_OQ, _mm512_cmp_ps_mask, _mm512_loadu_ps,
    _mm512_mask_cmp_ps_mask, _mm512_max_ps, _mm512_min_ps, _mm512_set1_ps, _mm512_setzero_ps,
    _mm512_sub_ps,
};
use std::ops::Range;

use super::{ThreeRows, Windows, beats_other_layers, windows};
use crate::simd::sixteen::{LANES, from_lane, load_or_zero};

/// Of each column the largest and the smallest of three differences, and the one in the middle.
#[derive(Clone, Copy)]
struct Columns {
    most: __m512,
    least: __m512,
    middle: __m512,
}

/// Scales that are searched together: as many as an octave of SIFT has, and as registers can hold.
const TOGETHER: usize = 3;

/// As [`find_extrema_of_differences`](super::find_extrema_of_differences), with the same demands.
#[target_feature(enable = "avx512f")]
pub(super) fn find(
    layers: &[ThreeRows<'_>],
    columns: Range<usize>,
    threshold: f32,
    found: &mut [Vec<u32>],
) {
    let (threes, rest) = found.as_chunks_mut::<TOGETHER>();
    let (ones, _) = rest.as_chunks_mut::<1>();
    let mut layers = layers;
    for found in threes {
        let six = layers.first_chunk().expect("three more layers than scales");
        find_at::<6, TOGETHER>(six, columns.clone(), threshold, found);
        layers = &layers[TOGETHER..];
    }
    for found in ones {
        let four = layers.first_chunk().expect("three more layers than scales");
        find_at::<4, 1>(four, columns.clone(), threshold, found);
        layers = &layers[1..];
    }
}

/// Finds extrema at `SCALES` scales in three more `LAYERS`.
#[inline]
#[target_feature(enable = "avx512f")]
fn find_at<const LAYERS: usize, const SCALES: usize>(
    layers: &[ThreeRows<'_>; LAYERS],
    columns: Range<usize>,
    threshold: f32,
    found: &mut [Vec<u32>; SCALES],
) {
    let length = layers.as_flattened().iter().map(|row| row.len()).min();
    let length = length.unwrap_or(0);
    // Blocks start where rows do, which may be aligned.
    let first = columns.start / LANES * LANES;
    let before = first.checked_sub(LANES).unwrap_or(usize::MAX);
    // SAFETY: nothing is asked of blocks that are not whole.
    let [mut before, mut here] = unsafe {
        [
            columns_of::<false, LAYERS, SCALES>(layers, before),
            columns_of::<false, LAYERS, SCALES>(layers, first),
        ]
    };
    let mut x = first;
    while x < columns.end && x + 2 * LANES <= length {
        // SAFETY: no row is shorter than two blocks from here.
        let after = unsafe { columns_of::<true, LAYERS, SCALES>(layers, x + LANES) };
        // SAFETY: as before.
        let ends = unsafe { ends::<true, LAYERS>(layers, x) };
        let passed = passed(&before, &here, &after, ends, threshold);
        if passed != [0; SCALES] {
            report(layers, &columns, x, passed, found);
        }
        (before, here) = (here, after);
        x += LANES;
    }
    while x < columns.end {
        // SAFETY: nothing is asked of these.
        let after = unsafe { columns_of::<false, LAYERS, SCALES>(layers, x + LANES) };
        // SAFETY: as before.
        let ends = unsafe { ends::<false, LAYERS>(layers, x) };
        let passed = passed(&before, &here, &after, ends, threshold);
        if passed != [0; SCALES] {
            report(layers, &columns, x, passed, found);
        }
        (before, here) = (here, after);
        x += LANES;
    }
}

/// For each scale the columns of a block that exceed the threshold and beat their neighbours in their own layer and
/// the differences in the other layers at their place. `ends` are the differences below the first scale and above the last.
#[inline]
#[target_feature(enable = "avx512f")]
fn passed<const SCALES: usize>(
    before: &[Columns; SCALES],
    here: &[Columns; SCALES],
    after: &[Columns; SCALES],
    ends: [__m512; 2],
    threshold: f32,
) -> [u16; SCALES] {
    let above = _mm512_set1_ps(threshold);
    let below = _mm512_set1_ps(-threshold);
    let mut passed = [0; SCALES];
    for scale in 0..SCALES {
        let finer = if scale == 0 {
            ends[0]
        } else {
            here[scale - 1].middle
        };
        let coarser = if scale + 1 == SCALES {
            ends[1]
        } else {
            here[scale + 1].middle
        };
        let (before, here, after) = (&before[scale], &here[scale], &after[scale]);
        let (mut most, mut least) = (here.most, here.least);
        most = _mm512_max_ps(most, from_lane::<15>(before.most, here.most));
        most = _mm512_max_ps(most, from_lane::<1>(here.most, after.most));
        least = _mm512_min_ps(least, from_lane::<15>(before.least, here.least));
        least = _mm512_min_ps(least, from_lane::<1>(here.least, after.least));
        let centre = here.middle;
        let top = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(centre, above);
        let top = _mm512_mask_cmp_ps_mask::<_CMP_GE_OQ>(top, centre, most);
        let top = _mm512_mask_cmp_ps_mask::<_CMP_GE_OQ>(top, centre, finer);
        let top = _mm512_mask_cmp_ps_mask::<_CMP_GE_OQ>(top, centre, coarser);
        let bottom = _mm512_cmp_ps_mask::<_CMP_LT_OQ>(centre, below);
        let bottom = _mm512_mask_cmp_ps_mask::<_CMP_LE_OQ>(bottom, centre, least);
        let bottom = _mm512_mask_cmp_ps_mask::<_CMP_LE_OQ>(bottom, centre, finer);
        let bottom = _mm512_mask_cmp_ps_mask::<_CMP_LE_OQ>(bottom, centre, coarser);
        passed[scale] = top | bottom;
    }
    passed
}

/// Of the columns of the block at `x` that passed, those beyond all their neighbours. Apart, since few blocks get here and
/// the others would lack registers.
#[cold]
#[inline(never)]
fn report<const LAYERS: usize, const SCALES: usize>(
    layers: &[ThreeRows<'_>; LAYERS],
    columns: &Range<usize>,
    x: usize,
    passed: [u16; SCALES],
    found: &mut [Vec<u32>; SCALES],
) {
    for ((layers, mut left), found) in layers.windows(4).zip(passed).zip(found) {
        let layers = layers.first_chunk().expect("a window");
        while left != 0 {
            let column = x + left.trailing_zeros() as usize;
            left &= left - 1;
            if columns.contains(&column) {
                let around: Windows<'_, 4, 3> = windows(layers, column - 1);
                if beats_other_layers(&around, 0) {
                    found.push(column as u32);
                }
            }
        }
    }
}

/// Of the rows of each scale's difference from column `x` on.
///
/// # Safety
/// If `FULL`, all rows have a block from there on.
#[inline]
#[target_feature(enable = "avx512f")]
unsafe fn columns_of<const FULL: bool, const LAYERS: usize, const SCALES: usize>(
    layers: &[ThreeRows<'_>; LAYERS],
    x: usize,
) -> [Columns; SCALES] {
    // SAFETY: the same is asked.
    let mut finer = unsafe { rows::<FULL>(&layers[1], x) };
    let zero = _mm512_setzero_ps();
    let mut scales = [Columns {
        most: zero,
        least: zero,
        middle: zero,
    }; SCALES];
    for scale in 0..SCALES {
        // SAFETY: as before.
        let coarser = unsafe { rows::<FULL>(&layers[scale + 2], x) };
        let above = _mm512_sub_ps(coarser[0], finer[0]);
        let middle = _mm512_sub_ps(coarser[1], finer[1]);
        let below = _mm512_sub_ps(coarser[2], finer[2]);
        scales[scale] = Columns {
            most: _mm512_max_ps(_mm512_max_ps(above, middle), below),
            least: _mm512_min_ps(_mm512_min_ps(above, middle), below),
            middle,
        };
        finer = coarser;
    }
    scales
}

/// The middle rows of the first difference and of the last.
///
/// # Safety
/// If `FULL`, all rows have a block from there on.
#[inline]
#[target_feature(enable = "avx512f")]
unsafe fn ends<const FULL: bool, const LAYERS: usize>(
    layers: &[ThreeRows<'_>; LAYERS],
    x: usize,
) -> [__m512; 2] {
    // SAFETY: the same is asked.
    unsafe {
        [
            _mm512_sub_ps(load::<FULL>(layers[1][1], x), load::<FULL>(layers[0][1], x)),
            _mm512_sub_ps(
                load::<FULL>(layers[LAYERS - 1][1], x),
                load::<FULL>(layers[LAYERS - 2][1], x),
            ),
        ]
    }
}

/// # Safety
/// If `FULL`, the rows have a block from there on.
#[inline]
#[target_feature(enable = "avx512f")]
unsafe fn rows<const FULL: bool>(rows: &ThreeRows<'_>, x: usize) -> [__m512; 3] {
    // SAFETY: the same is asked.
    unsafe {
        [
            load::<FULL>(rows[0], x),
            load::<FULL>(rows[1], x),
            load::<FULL>(rows[2], x),
        ]
    }
}

/// # Safety
/// If `FULL`, the row has a block from there on.
#[inline]
#[target_feature(enable = "avx512f")]
unsafe fn load<const FULL: bool>(row: &[f32], x: usize) -> __m512 {
    if FULL {
        // SAFETY: there are 16 values.
        return unsafe { _mm512_loadu_ps(row.as_ptr().add(x)) };
    }
    load_or_zero(row, x)
}
