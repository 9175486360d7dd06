//! The sums of a patch with vectors of 64 bytes, written by hand.
//!
//! *How it works.* A vector holds the 16 cells of the grid for one direction, so that the sums of all
//! eight directions stay in registers. A pixel has 16 weights, of which a permutation puts the four that
//! are not zero into the cells around it, and eight shares, of which two are not zero; each sum gets the
//! product. Weights and shares are made for sixteen pixels at a time.
//!
//! *Benefit*: in the portable code each pixel adds to its own few bins, and a sum in memory waits 16 cycles for the
//! one before it. Here no sum waits, and there is no branch. Most of the products are zero, so a processor that
//! executes vectors of 64 bytes in halves is faster with those of 32 ([`super::avx2`]). *Correctness*: the portable
//! text adds the same products in the same order, except products with zero, which change no sum; a test compares
//! all bits.

use std::arch::x86_64::{
    __m512, _CMP_GT_OQ, _CMP_LT_OQ, _MM_FROUND_NO_EXC, _MM_FROUND_TO_NEG_INF, _mm512_add_ps,
    _mm512_and_si512, _mm512_castpd_ps, _mm512_castps_pd, _mm512_castps_si512, _mm512_cmp_ps_mask,
    _mm512_cmpeq_epi32_mask, _mm512_fmadd_ps, _mm512_loadu_ps, _mm512_loadu_si512,
    _mm512_mask_mov_ps, _mm512_maskz_mov_ps, _mm512_mul_ps, _mm512_permutex2var_ps,
    _mm512_roundscale_ps, _mm512_set1_epi32, _mm512_set1_ps, _mm512_setzero_ps, _mm512_storeu_ps,
    _mm512_storeu_si512, _mm512_sub_ps, _mm512_unpackhi_pd, _mm512_unpackhi_ps, _mm512_unpacklo_pd,
    _mm512_unpacklo_ps,
};

use super::{Eight, Measured, NO_FRACTION, PatchSums};
use crate::simd::sixteen::{LANES, load, load_or_zero};

/// Directions.
const BINS: usize = 8;

/// Steps that are prepared together.
const STEPS: usize = 8;

/// Which of a pixel's four weights (above left, above right, below left, below right) a cell gets, by the
/// place of the pixel: five places from the column before the first cell to the last, and as many rows of these.
/// Lane 16 stands for none. For each four of sixteen pixels in turn, whose weights are in one vector; to add the place
/// of the four to the lanes would cost a pixel one of ten instructions.
static WEIGHTS: [[Lanes<u32>; 32]; LANES / 4] = weights();

/// Sixteen numbers, in one cache line.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Lanes<T>([T; LANES]);

/// What sixteen pixels add. It goes through memory, since sums get it from there number by number.
#[derive(Clone, Copy)]
struct Step {
    places: Lanes<u32>,
    /// Vector `i` has the four weights of the pixels `i`, `4 + i`, `8 + i` and `12 + i`.
    weights: [Lanes<f32>; 4],
    /// What each direction gets of each pixel.
    shares: [Lanes<f32>; BINS],
}

/// Sums of the pixels at even and at odd places: for each direction those of the 16 cells.
type Sums = [[__m512; BINS]; 2];

/// The sums of gradients that are measured.
#[target_feature(enable = "avx512f")]
pub(super) fn sums(first_direction: f32, measured: Measured<'_>) -> PatchSums {
    let Measured {
        columns,
        lines,
        directions,
        values,
    } = measured;
    let numbers = [columns, lines, directions, values].map(<[Eight]>::as_flattened);
    let mut sums: Sums = [[_mm512_setzero_ps(); BINS]; 2];
    let mut steps = [Step {
        places: Lanes([0; LANES]),
        weights: [Lanes([0.0; LANES]); 4],
        shares: [Lanes([0.0; LANES]); BINS],
    }; STEPS];
    let count = numbers[0].len().div_ceil(LANES);
    for first in (0..count).step_by(STEPS) {
        let steps = &mut steps[..STEPS.min(count - first)];
        for (step, i) in steps.iter_mut().zip(first..) {
            let from = LANES * i;
            let [column, line, direction, value] = if from + LANES <= numbers[0].len() {
                numbers.map(|numbers| load::<1, true>(numbers, from)[0])
            } else {
                numbers.map(|numbers| load_or_zero(numbers, from))
            };
            prepare(first_direction, [column, line], value, direction, step);
        }
        for step in steps {
            add(step, &mut sums);
        }
    }
    let mut by_cell = [0.0; 128];
    for bin in 0..BINS {
        let mut both = Lanes([0.0; LANES]);
        store(&mut both, _mm512_add_ps(sums[0][bin], sums[1][bin]));
        for (cell, sum) in both.0.into_iter().enumerate() {
            by_cell[BINS * cell + bin] = sum;
        }
    }
    by_cell
}

/// Weights and shares of sixteen pixels.
#[inline]
#[target_feature(enable = "avx512f")]
fn prepare(
    first_direction: f32,
    [column, line]: [__m512; 2],
    value: __m512,
    direction: __m512,
    step: &mut Step,
) {
    const FLOOR: i32 = _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC;
    let whole = |x: __m512| {
        let bits = _mm512_castps_si512(_mm512_add_ps(x, _mm512_set1_ps(NO_FRACTION)));
        _mm512_and_si512(bits, _mm512_set1_epi32(0x003f_ffff))
    };
    let (least, most) = (_mm512_set1_ps(-1.0), _mm512_set1_ps(4.0));
    let inside = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(line, least)
        & _mm512_cmp_ps_mask::<_CMP_LT_OQ>(line, most)
        & _mm512_cmp_ps_mask::<_CMP_GT_OQ>(column, least)
        & _mm512_cmp_ps_mask::<_CMP_LT_OQ>(column, most);
    let value = _mm512_maskz_mov_ps(inside, value);
    let column = _mm512_maskz_mov_ps(inside, column);
    let line = _mm512_maskz_mov_ps(inside, line);
    let bin = _mm512_sub_ps(direction, _mm512_set1_ps(first_direction));
    let bin = _mm512_mul_ps(bin, _mm512_set1_ps(8.0));
    let column0 = _mm512_roundscale_ps::<FLOOR>(column);
    let line0 = _mm512_roundscale_ps::<FLOOR>(line);
    let bin0 = _mm512_roundscale_ps::<FLOOR>(bin);
    let (column1, line1) = (_mm512_sub_ps(column, column0), _mm512_sub_ps(line, line0));
    let place = _mm512_add_ps(column0, _mm512_set1_ps(6.0));
    let place = whole(_mm512_fmadd_ps(line0, _mm512_set1_ps(5.0), place));
    // SAFETY: 64 bytes can be written to 16 integers.
    unsafe { _mm512_storeu_si512(step.places.0.as_mut_ptr().cast(), place) };

    let below = _mm512_mul_ps(value, line1);
    let above = _mm512_sub_ps(value, below);
    let (below_right, above_right) = (_mm512_mul_ps(below, column1), _mm512_mul_ps(above, column1));
    let (below_left, above_left) = (
        _mm512_sub_ps(below, below_right),
        _mm512_sub_ps(above, above_right),
    );
    let fours = transposed([above_left, above_right, below_left, below_right]);
    for (weights, fours) in step.weights.iter_mut().zip(fours) {
        store(weights, fours);
    }

    let bins = _mm512_and_si512(whole(bin0), _mm512_set1_epi32(7));
    let next = _mm512_sub_ps(bin, bin0);
    let rest = _mm512_sub_ps(_mm512_set1_ps(1.0), next);
    let mut before = _mm512_cmpeq_epi32_mask(bins, _mm512_set1_epi32(BINS as i32 - 1));
    for (bin, shares) in step.shares.iter_mut().enumerate() {
        let here = _mm512_cmpeq_epi32_mask(bins, _mm512_set1_epi32(bin as i32));
        let share = _mm512_mask_mov_ps(_mm512_maskz_mov_ps(here, rest), before, next);
        store(shares, share);
        before = here;
    }
}

#[inline]
#[target_feature(enable = "avx512f")]
fn add(step: &Step, sums: &mut Sums) {
    for (four, table) in WEIGHTS.iter().enumerate() {
        for (i, weights) in step.weights.iter().enumerate() {
            let pixel = 4 * four + i;
            let chosen = &table[(step.places.0[pixel] & 31) as usize];
            // SAFETY: 64 bytes can be read from 16 numbers, here and there.
            let (chosen, weights) = unsafe {
                (
                    _mm512_loadu_si512(chosen.0.as_ptr().cast()),
                    _mm512_loadu_ps(weights.0.as_ptr()),
                )
            };
            let weights = _mm512_permutex2var_ps(weights, chosen, _mm512_setzero_ps());
            for (sum, shares) in sums[i % 2].iter_mut().zip(&step.shares) {
                *sum = _mm512_fmadd_ps(weights, _mm512_set1_ps(shares.0[pixel]), *sum);
            }
        }
    }
}

/// Of four vectors the lanes `i`, `4 + i`, `8 + i` and `12 + i` in vector `i`.
#[inline]
#[target_feature(enable = "avx512f")]
fn transposed([a, b, c, d]: [__m512; 4]) -> [__m512; 4] {
    let pairs = |first, second| {
        [
            _mm512_castps_pd(_mm512_unpacklo_ps(first, second)),
            _mm512_castps_pd(_mm512_unpackhi_ps(first, second)),
        ]
    };
    let ([ab0, ab2], [cd0, cd2]) = (pairs(a, b), pairs(c, d));
    [
        _mm512_unpacklo_pd(ab0, cd0),
        _mm512_unpackhi_pd(ab0, cd0),
        _mm512_unpacklo_pd(ab2, cd2),
        _mm512_unpackhi_pd(ab2, cd2),
    ]
    .map(|fours| _mm512_castpd_ps(fours))
}

#[inline]
#[target_feature(enable = "avx512f")]
fn store(lanes: &mut Lanes<f32>, vector: __m512) {
    // SAFETY: 64 bytes can be written to 16 numbers.
    unsafe { _mm512_storeu_ps(lanes.0.as_mut_ptr(), vector) };
}

const fn weights() -> [[Lanes<u32>; 32]; LANES / 4] {
    let mut weights = [[Lanes([16; LANES]); 32]; LANES / 4];
    let mut i = 0;
    while i < LANES / 4 * LANES {
        let (four, cell) = (i / LANES, i % LANES);
        let first = 4 * four as u32;
        // Places where the cell is below right, below left, above right and above left of the pixel.
        let place = cell / 4 * 5 + cell % 4;
        weights[four][place].0[cell] = first + 3;
        weights[four][place + 1].0[cell] = first + 2;
        weights[four][place + 5].0[cell] = first + 1;
        weights[four][place + 6].0[cell] = first;
        i += 1;
    }
    weights
}
