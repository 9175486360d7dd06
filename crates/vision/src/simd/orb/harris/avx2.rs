//! Second moments about two centres at a time (AVX2), written by hand.
//!
//! *How it works.* Each half of a vector belongs to a centre, and holds eight columns of a row as numbers of 16 bits. A
//! product of such vectors that adds neighbours gives 32 bits (`vpmaddwd`); of one factor the eighth column is zero.
//!
//! *Benefit*: the compiler makes numbers of 32 bits first, with three products of eight for each row of a centre. *Correctness*:
//! sums of whole numbers, which no order changes; a test compares them with those of the definition.

use std::arch::x86_64::{
    __m256i, _mm_loadu_si128, _mm256_add_epi16, _mm256_add_epi32, _mm256_and_si256,
    _mm256_hadd_epi32, _mm256_madd_epi16, _mm256_set_m128i, _mm256_setr_epi16,
    _mm256_setzero_si256, _mm256_srli_si256, _mm256_storeu_si256, _mm256_sub_epi16,
    _mm256_unpacklo_epi8,
};

use super::strength;
use crate::simd::orb::Pixels;

/// Pixels to each side of a centre that can be read: rows are loaded from four columns before it, 16 pixels each.
const REACH: usize = 11;

/// Rows that the sums look at.
const ROWS: usize = 9;

/// Parts of Sobel's gradients from one row about each centre: differences along the row, and the row smoothed.
#[derive(Clone, Copy)]
struct Row {
    along: __m256i,
    smooth: __m256i,
}

/// As the kernel of that name.
#[target_feature(enable = "avx2")]
pub(super) fn harris_strengths(pixels: Pixels<'_>, centres: &[[u32; 2]]) -> Vec<f32> {
    let mut strengths = Vec::with_capacity(centres.len());
    for some in centres.chunks(2) {
        let both = [some[0], some[some.len() - 1]];
        let moments = second_moments(pixels, both);
        strengths.extend(moments[..some.len()].iter().copied().map(strength));
    }
    strengths
}

/// Sums of the products of x with x, y with y and x with y, about each centre.
#[inline]
#[target_feature(enable = "avx2")]
fn second_moments(pixels: Pixels<'_>, centres: [[u32; 2]; 2]) -> [[i32; 3]; 2] {
    let seven = _mm256_setr_epi16(-1, -1, -1, -1, -1, -1, -1, 0, -1, -1, -1, -1, -1, -1, -1, 0);
    let width = pixels.width;
    let corners = centres.map(|centre| {
        let square = pixels.square(centre, REACH).as_ptr();
        square.wrapping_add((REACH - ROWS / 2) * (width + 1))
    });
    let row = |y: usize| {
        // SAFETY: 16 pixels of each of these rows are in the square.
        let [first, second] =
            corners.map(|corner| unsafe { _mm_loadu_si128(corner.wrapping_add(y * width).cast()) });
        sobel_parts(_mm256_set_m128i(second, first))
    };
    let mut sums = [_mm256_setzero_si256(); 3];
    let [mut above, mut here] = [row(0), row(1)];
    let mut along_above = _mm256_add_epi16(above.along, here.along);
    for y in 2..ROWS {
        let below = row(y);
        // Half of the middle row belongs to each of these.
        let along_below = _mm256_add_epi16(here.along, below.along);
        let dx = _mm256_add_epi16(along_above, along_below);
        let dy = _mm256_sub_epi16(below.smooth, above.smooth);
        let [x, y] = [dx, dy].map(|d| _mm256_and_si256(d, seven));
        for (sum, [a, b]) in sums.iter_mut().zip([[x, dx], [y, dy], [x, dy]]) {
            *sum = _mm256_add_epi32(*sum, _mm256_madd_epi16(a, b));
        }
        (above, here, along_above) = (here, below, along_below);
    }
    let [xx, yy, xy] = sums;
    let sums = _mm256_hadd_epi32(_mm256_hadd_epi32(xx, yy), _mm256_hadd_epi32(xy, xy));
    let mut of_both = [[0; 4]; 2];
    // SAFETY: eight numbers can be written.
    unsafe { _mm256_storeu_si256(of_both.as_mut_ptr().cast(), sums) };
    of_both.map(|[xx, yy, xy, _]| [xx, yy, xy])
}

/// The parts at the second to the ninth pixel about each centre.
#[inline]
#[target_feature(enable = "avx2")]
fn sobel_parts(pixels: __m256i) -> Row {
    let zero = _mm256_setzero_si256();
    let left = _mm256_unpacklo_epi8(pixels, zero);
    let middle = _mm256_unpacklo_epi8(_mm256_srli_si256::<1>(pixels), zero);
    let right = _mm256_unpacklo_epi8(_mm256_srli_si256::<2>(pixels), zero);
    let sides = _mm256_add_epi16(left, right);
    Row {
        along: _mm256_sub_epi16(right, left),
        smooth: _mm256_add_epi16(sides, _mm256_add_epi16(middle, middle)),
    }
}
