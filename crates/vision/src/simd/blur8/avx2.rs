//! [Both passes](super) in registers, with vectors of 32 bytes, written by hand.

use std::arch::x86_64::{
    __m256, __m256i, _mm256_add_epi16, _mm256_add_ps, _mm256_and_si256, _mm256_castps_si256,
    _mm256_cvtepi32_ps, _mm256_fmadd_ps, _mm256_loadu_si256, _mm256_mul_ps, _mm256_or_si256,
    _mm256_set1_epi16, _mm256_set1_epi32, _mm256_set1_ps, _mm256_slli_epi32, _mm256_srli_epi16,
    _mm256_srli_epi32, _mm256_storeu_si256,
};

use super::{AROUND, HALF, ROUND, STRIDE, doubled_middle};
use crate::simd::eight::{LANES, from_byte, halves as across};

/// Columns that are looked at together.
pub(super) const COLUMNS: usize = STRIDE * LANES;

/// The last columns of each row, and room behind them.
///
/// What needs to be aligned makes the compiler align all that a function has on the stack, so that no vector which it
/// keeps there lies across two cache lines; that takes half the time.
#[repr(align(64))]
struct End([[u8; COLUMNS]; AROUND]);

/// As the function of that name, for at least [`COLUMNS`] pixels.
#[target_feature(enable = "avx2,fma")]
pub(super) fn weigh_both_u8(rows: &[&[u8]; AROUND], half: &[f32; HALF], out: &mut [u8]) {
    let (count, read) = (out.len(), out.len() + AROUND - 1);
    assert!(count >= COLUMNS, "a block of pixels");
    assert!(
        rows.iter().all(|row| row.len() >= read),
        "pixels for the weights"
    );
    let weights = doubled_middle(half).map(|weight| _mm256_set1_ps(weight));
    let rows = rows.map(<[u8]>::as_ptr);
    let out = out.as_mut_ptr();
    // SAFETY: of each row `read` pixels can be read, `AROUND - 1` more than `count`, which is a block at least; that
    // many can be written to `out`.
    unsafe {
        let mut here = weigh_columns(rows, &weights, 0);
        let mut x = 0;
        while x < count {
            if x + COLUMNS > count {
                // The last block again makes some of what is made.
                x = count - COLUMNS;
                here = weigh_columns(rows, &weights, x);
            }
            let mut end = End([[0; COLUMNS]; AROUND]);
            let (rows, from) = if x + 2 * COLUMNS <= read {
                (rows, x + COLUMNS)
            } else {
                // No more of the next block than this one needs.
                for (end, row) in end.0.iter_mut().zip(rows) {
                    row.add(x + COLUMNS)
                        .copy_to_nonoverlapping(end.as_mut_ptr(), AROUND - 1);
                }
                (end.0.each_ref().map(|end| end.as_ptr()), 0)
            };
            let next = weigh_columns(rows, &weights, from);
            weigh_along(here, next, &weights, out.add(x));
            here = next;
            x += COLUMNS;
        }
    }
}

/// The vertical pass: every fourth column from `x` on, from `x + 1`, `x + 2` and `x + 3`.
///
/// # Safety
/// Each row must have [`COLUMNS`] from `x` on.
#[inline]
#[target_feature(enable = "avx2,fma")]
unsafe fn weigh_columns(
    rows: [*const u8; AROUND],
    weights: &[__m256; HALF],
    x: usize,
) -> [__m256; STRIDE] {
    // SAFETY: the caller's.
    let load = |row: usize| unsafe { _mm256_loadu_si256(rows[row].add(x).cast()) };
    let middle = four_columns(halves(load(HALF - 1)));
    let mut sums = middle.map(|middle| _mm256_mul_ps(weights[0], middle));
    for (k, &weight) in weights.iter().enumerate().skip(1) {
        let [above, below] = [halves(load(HALF - 1 - k)), halves(load(HALF - 1 + k))];
        let both = [
            _mm256_add_epi16(above[0], below[0]),
            _mm256_add_epi16(above[1], below[1]),
        ];
        for (sum, both) in sums.iter_mut().zip(four_columns(both)) {
            *sum = _mm256_fmadd_ps(weight, both, *sum);
        }
    }
    sums
}

/// The even columns as numbers of 16 bits, and the odd ones.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn halves(pixels: __m256i) -> [__m256i; 2] {
    [
        _mm256_and_si256(pixels, _mm256_set1_epi16(0xff)),
        _mm256_srli_epi16::<8>(pixels),
    ]
}

/// Every fourth column, from the even and the odd ones.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn four_columns([even, odd]: [__m256i; 2]) -> [__m256; STRIDE] {
    let low = _mm256_set1_epi32(0xffff);
    [
        _mm256_cvtepi32_ps(_mm256_and_si256(even, low)),
        _mm256_cvtepi32_ps(_mm256_and_si256(odd, low)),
        _mm256_cvtepi32_ps(_mm256_srli_epi32::<16>(even)),
        _mm256_cvtepi32_ps(_mm256_srli_epi32::<16>(odd)),
    ]
}

/// The horizontal pass, from the columns of a block of pixels, the first of which is `HALF - 1` columns further, and
/// those of the next block.
///
/// # Safety
/// [`COLUMNS`] pixels can be written to `out`.
#[inline]
#[target_feature(enable = "avx2,fma")]
unsafe fn weigh_along(
    here: [__m256; STRIDE],
    next: [__m256; STRIDE],
    weights: &[__m256; HALF],
    out: *mut u8,
) {
    let across = [
        across(here[0], next[0]),
        across(here[1], next[1]),
        across(here[2], next[2]),
        across(here[3], next[3]),
    ];
    let columns = [
        here[0],
        here[1],
        here[2],
        here[3],
        from_byte::<4>(here[0], across[0]),
        from_byte::<4>(here[1], across[1]),
        from_byte::<4>(here[2], across[2]),
        from_byte::<4>(here[3], across[3]),
        from_byte::<8>(here[0], across[0]),
        from_byte::<8>(here[1], across[1]),
    ];
    let mut pixels = [_mm256_set1_epi32(0); STRIDE];
    for (j, pixels) in pixels.iter_mut().enumerate() {
        let mut sum = _mm256_mul_ps(weights[0], columns[j + HALF - 1]);
        for (k, &weight) in weights.iter().enumerate().skip(1) {
            let both = _mm256_add_ps(columns[j + HALF - 1 - k], columns[j + HALF - 1 + k]);
            sum = _mm256_fmadd_ps(weight, both, sum);
        }
        *pixels = _mm256_castps_si256(_mm256_add_ps(sum, _mm256_set1_ps(ROUND)));
    }
    let byte = |pixels: __m256i| _mm256_and_si256(pixels, _mm256_set1_epi32(0xff));
    let low = _mm256_or_si256(byte(pixels[0]), _mm256_slli_epi32::<8>(byte(pixels[1])));
    let high = _mm256_or_si256(
        _mm256_slli_epi32::<16>(byte(pixels[2])),
        _mm256_slli_epi32::<24>(pixels[3]),
    );
    // SAFETY: the caller's.
    unsafe { _mm256_storeu_si256(out.cast(), _mm256_or_si256(low, high)) };
}
