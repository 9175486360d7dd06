//! The histograms of a patch with vectors of 64 bytes, written by hand.
//!
//! *How it works.* Sixteen pixels at a time get their cell, their shares of four cells and of two
//! directions. Then each pixel adds to two vectors, one for the cells above it and one for those below:
//! the eight bins of two neighbouring cells lie side by side. What it adds is put together by
//! permutations: one repeats the shares of two cells eight times each, one puts those of the directions
//! into their bins and zeros into the other six.
//!
//! *Benefit*: two additions of whole vectors for a pixel, where the portable text adds to its bins piece by piece.
//! *Correctness*: products and sums are the same and in the same order, but for products with
//! zero, which are not taken; a test compares all bits. Places are limited to those of the histogram before they
//! are used.

use std::arch::x86_64::{
    __m512, __m512i, _CMP_GT_OQ, _CMP_LT_OQ, _MM_FROUND_NO_EXC, _MM_FROUND_TO_NEG_INF,
    _mm512_add_epi32, _mm512_add_ps, _mm512_and_si512, _mm512_castps_si512, _mm512_cmp_ps_mask,
    _mm512_fmadd_ps, _mm512_fmsub_ps, _mm512_loadu_ps, _mm512_loadu_si512, _mm512_maskz_mov_ps,
    _mm512_min_epu32, _mm512_mul_ps, _mm512_permutex2var_ps, _mm512_permutexvar_ps,
    _mm512_roundscale_ps, _mm512_set1_epi32, _mm512_set1_ps, _mm512_setr_epi32, _mm512_setr_ps,
    _mm512_setzero_ps, _mm512_shuffle_f32x4, _mm512_storeu_ps, _mm512_storeu_si512, _mm512_sub_ps,
};

use super::{MIDDLE, NO_FRACTION, PatchGrid, PatchHistogram, PatchRow, patch_block};
use crate::simd::masked::{LANES, load_or_zero};

/// Pixels whose shares are permuted together: a vector holds two of each.
const HALF: usize = 8;

/// The last place from which all four cells lie in the first of the two histograms.
const LAST_PLACE: i32 = 512 - 80;

/// Where the shares of two directions go that lie in the first 16 lanes of two vectors: from
/// lane 8 into the bin of the number, from lane 0 into the next; the other bins get lane 16. For two cells.
static PLACES: [Lanes; 8] = places();

/// Sixteen integers, in one cache line.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Lanes([u32; LANES]);

/// Adds the gradients of a row to the bins around each pixel.
#[target_feature(enable = "avx512f")]
pub(super) fn add_row(grid: &PatchGrid, row: &PatchRow<'_>, histogram: &mut PatchHistogram) {
    let (blocks, rest) = (row.values.len() / LANES, row.values.len() % LANES);
    for block in 0..blocks {
        add_block::<LANES>(grid, row, LANES * block, histogram);
    }
    let mut x = LANES * blocks;
    if rest >= HALF {
        add_block::<HALF>(grid, row, x, histogram);
        x += HALF;
    }
    while x < row.values.len() {
        patch_block::<1>(grid, row, x, histogram);
        x += 1;
    }
}

/// Pixels from `start` on, 16 or only the 8 that are `HALF`.
#[inline]
#[target_feature(enable = "avx512f")]
fn add_block<const N: usize>(
    grid: &PatchGrid,
    row: &PatchRow<'_>,
    start: usize,
    histogram: &mut PatchHistogram,
) {
    const FLOOR: i32 = _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC;
    // Eight lanes of either vector.
    const FIRST: i32 = 0b01_00_01_00;
    const SECOND: i32 = 0b11_10_11_10;
    let whole = |x: __m512| {
        let bits = _mm512_castps_si512(_mm512_add_ps(x, _mm512_set1_ps(NO_FRACTION)));
        _mm512_and_si512(bits, _mm512_set1_epi32(0x003f_ffff))
    };
    let (cos, sin) = (_mm512_set1_ps(grid.cos), _mm512_set1_ps(grid.sin));
    let y = _mm512_set1_ps(row.y);
    let x = _mm512_add_ps(_mm512_set1_ps(row.x + start as f32), numbers());
    let middle = _mm512_set1_ps(MIDDLE);
    let column = _mm512_fmadd_ps(x, cos, _mm512_mul_ps(y, sin));
    let column = _mm512_add_ps(column, middle);
    let line = _mm512_fmsub_ps(y, cos, _mm512_mul_ps(x, sin));
    let line = _mm512_add_ps(line, middle);
    let (least, most) = (_mm512_set1_ps(-1.0), _mm512_set1_ps(4.0));
    let inside = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(line, least)
        & _mm512_cmp_ps_mask::<_CMP_LT_OQ>(line, most)
        & _mm512_cmp_ps_mask::<_CMP_GT_OQ>(column, least)
        & _mm512_cmp_ps_mask::<_CMP_LT_OQ>(column, most);
    let value = _mm512_maskz_mov_ps(inside, load::<N>(row.values, start));
    let column = _mm512_maskz_mov_ps(inside, column);
    let line = _mm512_maskz_mov_ps(inside, line);
    let bin = _mm512_sub_ps(
        load::<N>(row.directions, start),
        _mm512_set1_ps(grid.direction),
    );
    let bin = _mm512_mul_ps(bin, _mm512_set1_ps(8.0));
    let column0 = _mm512_roundscale_ps::<FLOOR>(column);
    let line0 = _mm512_roundscale_ps::<FLOOR>(line);
    let bin0 = _mm512_roundscale_ps::<FLOOR>(bin);
    let (column1, line1) = (_mm512_sub_ps(column, column0), _mm512_sub_ps(line, line0));
    let next = _mm512_sub_ps(bin, bin0);
    let rest = _mm512_sub_ps(_mm512_set1_ps(1.0), next);
    let place = _mm512_fmadd_ps(column0, _mm512_set1_ps(8.0), _mm512_set1_ps(72.0));
    let place = whole(_mm512_fmadd_ps(line0, _mm512_set1_ps(64.0), place));
    let below = _mm512_mul_ps(value, line1);
    let above = _mm512_sub_ps(value, below);
    let (below_right, above_right) = (_mm512_mul_ps(below, column1), _mm512_mul_ps(above, column1));
    let (below_left, above_left) = (
        _mm512_sub_ps(below, below_right),
        _mm512_sub_ps(above, above_right),
    );

    let places = lanes(_mm512_min_epu32(place, _mm512_set1_epi32(LAST_PLACE)));
    let bins = lanes(_mm512_and_si512(whole(bin0), _mm512_set1_epi32(7)));
    let shares = Shares {
        above: _mm512_shuffle_f32x4::<FIRST>(above_left, above_right),
        below: _mm512_shuffle_f32x4::<FIRST>(below_left, below_right),
        bins: _mm512_shuffle_f32x4::<FIRST>(next, rest),
    };
    shares.add(&places.0[..HALF], &bins.0[..HALF], histogram);
    if N == LANES {
        let shares = Shares {
            above: _mm512_shuffle_f32x4::<SECOND>(above_left, above_right),
            below: _mm512_shuffle_f32x4::<SECOND>(below_left, below_right),
            bins: _mm512_shuffle_f32x4::<SECOND>(next, rest),
        };
        shares.add(&places.0[HALF..], &bins.0[HALF..], histogram);
    }
}

/// What eight pixels share out, those of the first in lanes 0 and 8, and so on.
struct Shares {
    /// To the cells above, left and right.
    above: __m512,
    /// To the cells below.
    below: __m512,
    /// To the next bin and to the bin itself.
    bins: __m512,
}

impl Shares {
    /// Adds them at places of the two histograms by turns.
    #[inline]
    #[target_feature(enable = "avx512f")]
    fn add(&self, places: &[u32], bins: &[u32], histogram: &mut PatchHistogram) {
        let pairs = _mm512_setr_epi32(0, 0, 0, 0, 0, 0, 0, 0, 8, 8, 8, 8, 8, 8, 8, 8);
        for (i, (&place, &bin)) in places.iter().zip(bins).enumerate() {
            let number = _mm512_set1_epi32(i as i32);
            let pair = _mm512_add_epi32(pairs, number);
            let chosen = &PLACES[(bin & 7) as usize];
            // SAFETY: 64 bytes can be read from 16 integers.
            let chosen = unsafe { _mm512_loadu_si512(chosen.0.as_ptr().cast()) };
            let chosen = _mm512_add_epi32(chosen, number);
            let share = _mm512_permutex2var_ps(self.bins, chosen, _mm512_setzero_ps());
            let around = &mut histogram[(i & 1) * 512..][..512];
            let around = around[place.min(LAST_PLACE as u32) as usize..].as_mut_ptr();
            // SAFETY: 16 values can be read and written at a place and 64 after it: the place is at most
            // 432 of 512.
            unsafe {
                let above = _mm512_permutexvar_ps(pair, self.above);
                let sum = _mm512_fmadd_ps(above, share, _mm512_loadu_ps(around));
                _mm512_storeu_ps(around, sum);
                let around = around.add(64);
                let below = _mm512_permutexvar_ps(pair, self.below);
                let sum = _mm512_fmadd_ps(below, share, _mm512_loadu_ps(around));
                _mm512_storeu_ps(around, sum);
            }
        }
    }
}

/// 0 to 15.
#[inline]
#[target_feature(enable = "avx512f")]
fn numbers() -> __m512 {
    _mm512_setr_ps(
        0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0,
    )
}

/// The first `N` lanes from values `start..start + N`; the others are zero.
#[inline]
#[target_feature(enable = "avx512f")]
fn load<const N: usize>(values: &[f32], start: usize) -> __m512 {
    let values = values[start..].first_chunk::<N>().expect("a block");
    if N == LANES {
        // SAFETY: 16 values can be read from 16 values.
        unsafe { _mm512_loadu_ps(values.as_ptr()) }
    } else {
        load_or_zero(values, 0)
    }
}

#[inline]
#[target_feature(enable = "avx512f")]
fn lanes(vector: __m512i) -> Lanes {
    let mut lanes = Lanes([0; LANES]);
    // SAFETY: 64 bytes can be written to 16 integers.
    unsafe { _mm512_storeu_si512(lanes.0.as_mut_ptr().cast(), vector) };
    lanes
}

const fn places() -> [Lanes; 8] {
    let mut places = [Lanes([16; LANES]); 8];
    let mut bin = 0;
    while bin < 8 {
        let next = (bin + 1) % 8;
        [places[bin].0[bin], places[bin].0[bin + 8]] = [8, 8];
        [places[bin].0[next], places[bin].0[next + 8]] = [0, 0];
        bin += 1;
    }
    places
}
