//! Moments with products of bytes (VNNI), written by hand.
//!
//! Two rows of a patch fill a vector, and one instruction multiplies its pixels by their offsets and sums the products.
//! *Correctness*: moments are whole numbers, which no order of sums changes; a test compares them with those of the
//! portable code.

use std::arch::x86_64::{
    __m512i, _mm256_loadu_si256, _mm512_add_epi32, _mm512_castsi256_si512, _mm512_dpbusd_epi32,
    _mm512_inserti64x4, _mm512_load_si512, _mm512_reduce_add_epi32, _mm512_setzero_si512,
};

use super::{OFFSETS, middle_row};
use crate::simd::orb::Pixels;

/// As the kernel of that name.
#[target_feature(enable = "avx512f,avx512vnni")]
pub(super) fn intensity_moments(pixels: Pixels<'_>, centres: &[[u32; 2]]) -> Vec<[i32; 2]> {
    let mut moments = Vec::with_capacity(centres.len());
    let width = pixels.width;
    for &centre in centres {
        let middle = middle_row(pixels, centre);
        // A sum waits for the one before it, so there are two for the even rows and two for the odd ones.
        let zero = _mm512_setzero_si512();
        let (mut even, mut odd) = ([zero, zero], [zero, zero]);
        let mut down = 0;
        for [next, after] in OFFSETS.0.as_chunks::<2>().0 {
            // SAFETY: all rows of the circle can be read.
            even = unsafe { add_rows(even, middle, down, next) };
            // SAFETY: as before.
            odd = unsafe { add_rows(odd, middle, down + width, after) };
            down += 2 * width;
        }
        moments.push([
            _mm512_reduce_add_epi32(_mm512_add_epi32(even[0], odd[0])),
            _mm512_reduce_add_epi32(_mm512_add_epi32(even[1], odd[1])),
        ]);
    }
    moments
}

/// Adds the moments of two rows, `down` bytes before and behind the `middle` one.
///
/// # Safety
/// Both must have 32 pixels.
#[inline]
#[target_feature(enable = "avx512f,avx512vnni")]
unsafe fn add_rows(
    [x, y]: [__m512i; 2],
    middle: *const u8,
    down: usize,
    offsets: &[[i8; 64]; 2],
) -> [__m512i; 2] {
    // SAFETY: the caller's; offsets are whole vectors, and aligned.
    unsafe {
        let above = _mm256_loadu_si256(middle.wrapping_sub(down).cast());
        let below = _mm256_loadu_si256(middle.wrapping_add(down).cast());
        let rows = _mm512_inserti64x4::<1>(_mm512_castsi256_si512(above), below);
        [
            _mm512_dpbusd_epi32(x, rows, _mm512_load_si512(offsets[0].as_ptr().cast())),
            _mm512_dpbusd_epi32(y, rows, _mm512_load_si512(offsets[1].as_ptr().cast())),
        ]
    }
}
