//! Both passes of a symmetric filter of seven weights in one, in registers (AVX-512), written by hand.
//!
//! *Benefit*: the sums between the passes need not be written and read again, at seven places of which most cross
//! cache lines; this takes less than half the time. *Correctness*: each pixel is computed by the operations of the
//! portable text in its order; a test compares both.

use std::arch::x86_64::{
    __m512, _mm_loadu_si128, _mm_storeu_si128, _mm512_add_epi32, _mm512_add_ps,
    _mm512_castps_si512, _mm512_cvtepi32_epi8, _mm512_cvtepi32_ps, _mm512_cvtepu8_epi32,
    _mm512_fmadd_ps, _mm512_set1_ps, _mm512_setzero_ps,
};

use super::ROUND;
use crate::simd::sixteen::{LANES, from_lane};

/// Weights of one half, with the middle one.
pub(super) const HALF: usize = 4;
/// Rows, and columns, that a pixel is made of.
pub(super) const AROUND: usize = 2 * HALF - 1;

/// As the function of that name, for at least 16 pixels.
#[target_feature(enable = "avx512f,avx512bw,avx512vl")]
pub(super) fn weigh_both_u8(rows: &[&[u8]; AROUND], half: &[f32; HALF], out: &mut [u8]) {
    let (count, read) = (out.len(), out.len() + AROUND - 1);
    assert!(count >= LANES, "a block of pixels");
    assert!(
        rows.iter().all(|row| row.len() >= read),
        "pixels for the weights"
    );
    let rows = rows.map(<[u8]>::as_ptr);
    let weights = half.map(|weight| _mm512_set1_ps(weight));
    // SAFETY: of each row `read` pixels can be read, at least 22, and `out` has `count`, at least 16.
    unsafe {
        let mut here = weigh_columns(rows, &weights, 0);
        let mut x = 0;
        while x + 2 * LANES <= read {
            let next = weigh_columns(rows, &weights, x + LANES);
            weigh_along(here, next, &weights, out.as_mut_ptr().add(x));
            here = next;
            x += LANES;
        }
        // The last blocks again make some of what is made, and read no column beyond the six that they need.
        let last = count - LANES;
        for x in [x.min(last), last] {
            let here = weigh_columns(rows, &weights, x);
            let next = weigh_columns(rows, &weights, x + AROUND - 1);
            let next = from_lane::<{ (LANES + 1 - AROUND) as i32 }>(next, next);
            weigh_along(here, next, &weights, out.as_mut_ptr().add(x));
        }
    }
}

/// The vertical pass of 16 columns.
///
/// # Safety
/// Each row must have them.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl")]
unsafe fn weigh_columns(rows: [*const u8; AROUND], weights: &[__m512; HALF], x: usize) -> __m512 {
    let mut sum = _mm512_setzero_ps();
    for (k, &weight) in weights.iter().enumerate() {
        // SAFETY: the caller's.
        let [above, below] = [HALF - 1 - k, HALF - 1 + k]
            .map(|row| unsafe { _mm512_cvtepu8_epi32(_mm_loadu_si128(rows[row].add(x).cast())) });
        let both = _mm512_cvtepi32_ps(_mm512_add_epi32(above, below));
        sum = _mm512_fmadd_ps(weight, both, sum);
    }
    sum
}

/// The horizontal pass, from the columns of 16 pixels, the first of which is `HALF - 1` columns further, and the next 16.
///
/// # Safety
/// 16 pixels can be written to `out`.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl")]
unsafe fn weigh_along(here: __m512, next: __m512, weights: &[__m512; HALF], out: *mut u8) {
    let columns = [
        here,
        from_lane::<1>(here, next),
        from_lane::<2>(here, next),
        from_lane::<3>(here, next),
        from_lane::<4>(here, next),
        from_lane::<5>(here, next),
        from_lane::<6>(here, next),
    ];
    let mut sum = _mm512_setzero_ps();
    for (k, &weight) in weights.iter().enumerate() {
        let both = _mm512_add_ps(columns[HALF - 1 - k], columns[HALF - 1 + k]);
        sum = _mm512_fmadd_ps(weight, both, sum);
    }
    let rounded = _mm512_castps_si512(_mm512_add_ps(sum, _mm512_set1_ps(ROUND)));
    // SAFETY: the caller's.
    unsafe { _mm_storeu_si128(out.cast(), _mm512_cvtepi32_epi8(rounded)) };
}
