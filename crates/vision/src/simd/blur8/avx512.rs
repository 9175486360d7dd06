//! [Both passes](super) in registers, with vectors of 64 bytes, written by hand.

use std::arch::x86_64::{
    __m512, __m512i, __mmask64, _mm512_add_epi16, _mm512_add_ps, _mm512_and_si512,
    _mm512_castps_si512, _mm512_cvtepi32_ps, _mm512_fmadd_ps, _mm512_mask_storeu_epi8,
    _mm512_maskz_loadu_epi8, _mm512_mul_ps, _mm512_set1_epi16, _mm512_set1_epi32, _mm512_set1_ps,
    _mm512_slli_epi32, _mm512_srli_epi16, _mm512_srli_epi32,
};

use super::{AROUND, HALF, ROUND, STRIDE, doubled_middle};
use crate::simd::sixteen::{LANES, from_lane, select};

/// Columns that are looked at together.
const COLUMNS: usize = STRIDE * LANES;

/// As the function of that name.
#[target_feature(enable = "avx512f,avx512bw")]
pub(super) fn weigh_both_u8(rows: &[&[u8]; AROUND], half: &[f32; HALF], out: &mut [u8]) {
    let read = out.len() + AROUND - 1;
    let rows = rows.map(|row| &row[..read]);
    let weights = doubled_middle(half).map(|weight| _mm512_set1_ps(weight));
    // SAFETY: all rows are `read` pixels long.
    let mut here = unsafe { weigh_columns(rows, &weights, 0, first_bytes(read)) };
    let mut x = COLUMNS;
    for out in out.chunks_mut(COLUMNS) {
        let left = read.saturating_sub(x);
        // SAFETY: as before. Loads are faster where no mask is needed.
        let next = unsafe {
            if left >= COLUMNS {
                weigh_columns(rows, &weights, x, __mmask64::MAX)
            } else {
                weigh_columns(rows, &weights, x, first_bytes(left))
            }
        };
        weigh_along(here, next, &weights, out);
        here = next;
        x += COLUMNS;
    }
}

/// The first `count` bytes of a vector, or all.
#[inline(always)]
fn first_bytes(count: usize) -> __mmask64 {
    if count < COLUMNS {
        (1 << count) - 1
    } else {
        __mmask64::MAX
    }
}

/// The vertical pass: every fourth column from `x` on, from `x + 1`, `x + 2` and `x + 3`; 0 for columns that are not
/// `inside`.
///
/// # Safety
/// Columns that are `inside` must lie in each row.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
unsafe fn weigh_columns(
    rows: [&[u8]; AROUND],
    weights: &[__m512; HALF],
    x: usize,
    inside: __mmask64,
) -> [__m512; STRIDE] {
    let load = |row: usize| {
        // SAFETY: the caller's.
        unsafe { _mm512_maskz_loadu_epi8(inside, rows[row].as_ptr().wrapping_add(x).cast()) }
    };
    let middle = four_columns(halves(load(HALF - 1)));
    let mut sums = middle.map(|middle| _mm512_mul_ps(weights[0], middle));
    for (k, &weight) in weights.iter().enumerate().skip(1) {
        let [above, below] = [halves(load(HALF - 1 - k)), halves(load(HALF - 1 + k))];
        let both = [
            _mm512_add_epi16(above[0], below[0]),
            _mm512_add_epi16(above[1], below[1]),
        ];
        for (sum, both) in sums.iter_mut().zip(four_columns(both)) {
            *sum = _mm512_fmadd_ps(weight, both, *sum);
        }
    }
    sums
}

/// The even columns as numbers of 16 bits, and the odd ones.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
fn halves(pixels: __m512i) -> [__m512i; 2] {
    [
        _mm512_and_si512(pixels, _mm512_set1_epi16(0xff)),
        _mm512_srli_epi16::<8>(pixels),
    ]
}

/// Every fourth column, from the even and the odd ones.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
fn four_columns([even, odd]: [__m512i; 2]) -> [__m512; STRIDE] {
    let low = _mm512_set1_epi32(0xffff);
    [
        _mm512_cvtepi32_ps(_mm512_and_si512(even, low)),
        _mm512_cvtepi32_ps(_mm512_and_si512(odd, low)),
        _mm512_cvtepi32_ps(_mm512_srli_epi32::<16>(even)),
        _mm512_cvtepi32_ps(_mm512_srli_epi32::<16>(odd)),
    ]
}

/// The horizontal pass, from the columns of a block of pixels, the first of which is `HALF - 1` columns further, and
/// those of the next block. `out` has as many pixels as a block, or fewer.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
fn weigh_along(
    here: [__m512; STRIDE],
    next: [__m512; STRIDE],
    weights: &[__m512; HALF],
    out: &mut [u8],
) {
    let columns = [
        here[0],
        here[1],
        here[2],
        here[3],
        from_lane::<1>(here[0], next[0]),
        from_lane::<1>(here[1], next[1]),
        from_lane::<1>(here[2], next[2]),
        from_lane::<1>(here[3], next[3]),
        from_lane::<2>(here[0], next[0]),
        from_lane::<2>(here[1], next[1]),
    ];
    let mut pixels = [_mm512_set1_epi32(0); STRIDE];
    for (j, pixels) in pixels.iter_mut().enumerate() {
        let mut sum = _mm512_mul_ps(weights[0], columns[j + HALF - 1]);
        for (k, &weight) in weights.iter().enumerate().skip(1) {
            let both = _mm512_add_ps(columns[j + HALF - 1 - k], columns[j + HALF - 1 + k]);
            sum = _mm512_fmadd_ps(weight, both, sum);
        }
        *pixels = _mm512_castps_si512(_mm512_add_ps(sum, _mm512_set1_ps(ROUND)));
    }
    let byte = _mm512_set1_epi32(0xff);
    let [low, high] = [[0, 1], [2, 3]].map(|[even, odd]| {
        let odd = _mm512_slli_epi32::<8>(pixels[odd]);
        select(byte, pixels[even], odd)
    });
    let high = _mm512_slli_epi32::<16>(high);
    let all = select(_mm512_set1_epi32(0xffff), low, high);
    // SAFETY: no more bytes are written than there are.
    unsafe { _mm512_mask_storeu_epi8(out.as_mut_ptr().cast(), first_bytes(out.len()), all) };
}
