//! Moments with products of bytes (AVX2), written by hand: see [`super::avx512`].
//!
//! Two products are added as numbers of 16 bits, and those of two rows too: four products are below 15,301.

use std::arch::x86_64::{
    __m256i, _mm_add_epi32, _mm_cvtsi128_si32, _mm_shuffle_epi32, _mm256_add_epi16,
    _mm256_add_epi32, _mm256_castsi256_si128, _mm256_extracti128_si256, _mm256_load_si256,
    _mm256_loadu_si256, _mm256_madd_epi16, _mm256_maddubs_epi16, _mm256_set1_epi16,
    _mm256_setzero_si256,
};

use super::{OFFSETS, middle_row};
use crate::simd::orb::Pixels;

/// As the kernel of that name.
#[target_feature(enable = "avx2")]
pub(super) fn intensity_moments(pixels: Pixels<'_>, centres: &[[u32; 2]]) -> Vec<[i32; 2]> {
    let mut moments = Vec::with_capacity(centres.len());
    let width = pixels.width;
    for &centre in centres {
        let middle = middle_row(pixels, centre);
        let (mut x, mut y) = (_mm256_setzero_si256(), _mm256_setzero_si256());
        let mut down = 0;
        for [along, across] in &OFFSETS.0 {
            // SAFETY: all rows of the circle can be read.
            let rows = unsafe {
                [
                    _mm256_loadu_si256(middle.wrapping_sub(down).cast()),
                    _mm256_loadu_si256(middle.wrapping_add(down).cast()),
                ]
            };
            x = add_products(x, rows, along);
            y = add_products(y, rows, across);
            down += width;
        }
        moments.push([sum(x), sum(y)]);
    }
    moments
}

/// Adds the products of two rows with their offsets.
#[inline]
#[target_feature(enable = "avx2")]
fn add_products(to: __m256i, [above, below]: [__m256i; 2], offsets: &[i8; 64]) -> __m256i {
    // SAFETY: offsets are two whole vectors, and aligned.
    let [of_above, of_below] =
        [0, 32].map(|first| unsafe { _mm256_load_si256(offsets.as_ptr().add(first).cast()) });
    let both = _mm256_add_epi16(
        _mm256_maddubs_epi16(above, of_above),
        _mm256_maddubs_epi16(below, of_below),
    );
    _mm256_add_epi32(to, _mm256_madd_epi16(both, _mm256_set1_epi16(1)))
}

/// The sum of all lanes.
#[inline]
#[target_feature(enable = "avx2")]
fn sum(lanes: __m256i) -> i32 {
    let [low, high] = [
        _mm256_castsi256_si128(lanes),
        _mm256_extracti128_si256::<1>(lanes),
    ];
    let four = _mm_add_epi32(low, high);
    let two = _mm_add_epi32(four, _mm_shuffle_epi32::<0b0100_1110>(four));
    _mm_cvtsi128_si32(_mm_add_epi32(two, _mm_shuffle_epi32::<0b1011_0001>(two)))
}
