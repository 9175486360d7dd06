//! Extrema of differences with vectors of 64 bytes, written by hand.
//!
//! *How it works.* Along a row each column first gets the largest and the smallest of its three differences
//! in the middle layer; those of its neighbours, already there, make the extremum of all nine. A column
//! passes that is one of these, and beats the difference in either other layer at its place too. The few
//! that do are looked at by the portable text.
//!
//! *Benefit*: six loads for sixteen columns where the portable text has 18, twelve
//! of them across two cache lines. *Correctness*: maxima and comparisons are exact in any order; a test
//! compares the columns found. Lanes beyond the rows are not read.

use std::arch::x86_64::{
    __m512, _CMP_GE_OQ, _CMP_GT_OQ, _CMP_LE_OQ, _CMP_LT_OQ, _mm512_cmp_ps_mask, _mm512_loadu_ps,
    _mm512_mask_cmp_ps_mask, _mm512_max_ps, _mm512_min_ps, _mm512_set1_ps, _mm512_sub_ps,
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

/// As [`find_extrema_of_differences`](super::find_extrema_of_differences).
#[target_feature(enable = "avx512f")]
pub(super) fn find(
    layers: &[ThreeRows<'_>; 4],
    columns: Range<usize>,
    threshold: f32,
    found: &mut Vec<u32>,
) {
    let above = _mm512_set1_ps(threshold);
    let below = _mm512_set1_ps(-threshold);
    let length = layers.as_flattened().iter().map(|row| row.len()).min();
    let length = length.unwrap_or(0);
    // Blocks start where rows do, which may be aligned.
    let first = columns.start / LANES * LANES;
    // SAFETY: nothing is asked of blocks that are not whole.
    let [mut before, mut here] = unsafe {
        let before = first.checked_sub(LANES).unwrap_or(usize::MAX);
        [
            columns_of::<false>(layers, before),
            columns_of::<false>(layers, first),
        ]
    };
    for x in (first..columns.end).step_by(LANES) {
        let (after, [finer, coarser]) = if x + 2 * LANES <= length {
            // SAFETY: no row is shorter than two blocks from here.
            unsafe {
                (
                    columns_of::<true>(layers, x + LANES),
                    others::<true>(layers, x),
                )
            }
        } else {
            // SAFETY: nothing is asked of these.
            unsafe {
                (
                    columns_of::<false>(layers, x + LANES),
                    others::<false>(layers, x),
                )
            }
        };
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
        let mut left = top | bottom;
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
        (before, here) = (here, after);
    }
}

/// Of the middle layer's rows from column `x` on.
///
/// # Safety
/// If `FULL`, all rows have a block from there on.
#[inline]
#[target_feature(enable = "avx512f")]
unsafe fn columns_of<const FULL: bool>(layers: &[ThreeRows<'_>; 4], x: usize) -> Columns {
    // SAFETY: the same is asked.
    let [above, middle, below] = unsafe {
        [
            difference::<FULL>(layers, 1, 0, x),
            difference::<FULL>(layers, 1, 1, x),
            difference::<FULL>(layers, 1, 2, x),
        ]
    };
    Columns {
        most: _mm512_max_ps(_mm512_max_ps(above, middle), below),
        least: _mm512_min_ps(_mm512_min_ps(above, middle), below),
        middle,
    }
}

/// The middle rows of the finer and the coarser difference.
///
/// # Safety
/// If `FULL`, all rows have a block from there on.
#[inline]
#[target_feature(enable = "avx512f")]
unsafe fn others<const FULL: bool>(layers: &[ThreeRows<'_>; 4], x: usize) -> [__m512; 2] {
    // SAFETY: the same is asked.
    unsafe {
        [
            difference::<FULL>(layers, 0, 1, x),
            difference::<FULL>(layers, 2, 1, x),
        ]
    }
}

/// A row of a difference from column `x` on; zeros beyond the rows.
///
/// # Safety
/// If `FULL`, both rows have a block from there on.
#[inline]
#[target_feature(enable = "avx512f")]
unsafe fn difference<const FULL: bool>(
    layers: &[ThreeRows<'_>; 4],
    layer: usize,
    row: usize,
    x: usize,
) -> __m512 {
    // SAFETY: the same is asked.
    unsafe {
        let (coarser, finer) = (layers[layer + 1][row], layers[layer][row]);
        _mm512_sub_ps(load::<FULL>(coarser, x), load::<FULL>(finer, x))
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
