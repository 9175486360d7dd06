//! Vectors of 64 bytes: sixteen values of a slice, or as many as it has, and sixteen that lie across two vectors.

use std::arch::asm;
use std::arch::x86_64::{
    __m512, __m512i, _mm512_loadu_ps, _mm512_mask_storeu_ps, _mm512_maskz_loadu_ps,
    _mm512_setzero_ps, _mm512_storeu_ps, _mm512_ternarylogic_epi32,
};

/// Values of a vector.
pub(super) const LANES: usize = 16;

/// The first `count` lanes, or all.
#[inline(always)]
pub(super) fn first_lanes(count: usize) -> u16 {
    if count < LANES {
        (1 << count) - 1
    } else {
        u16::MAX
    }
}

/// The values from place `x` on; lanes beyond the last are zero.
#[inline]
#[target_feature(enable = "avx512f")]
pub(super) fn load_or_zero(values: &[f32], x: usize) -> __m512 {
    let values = &values[x.min(values.len())..];
    // SAFETY: lanes beyond the slice are not read.
    unsafe { _mm512_maskz_loadu_ps(first_lanes(values.len()), values.as_ptr()) }
}

/// Vectors from place `x` on; what lies beyond the end is zero, and there is nothing if they are `FULL`.
///
/// # Panics
/// If they are `FULL` and there are fewer values.
#[inline]
#[target_feature(enable = "avx512f")]
pub(super) fn load<const V: usize, const FULL: bool>(values: &[f32], x: usize) -> [__m512; V] {
    let mut vectors = [_mm512_setzero_ps(); V];
    if FULL {
        let values = &values[x..][..V * LANES];
        for (vector, values) in vectors.iter_mut().zip(values.as_chunks::<LANES>().0) {
            // SAFETY: 16 values can be read from 16 values.
            *vector = unsafe { _mm512_loadu_ps(values.as_ptr()) };
        }
    } else {
        for (j, vector) in vectors.iter_mut().enumerate() {
            *vector = load_or_zero(values, x + LANES * j);
        }
    }
    vectors
}

/// Writes vectors from place `x` on, as far as there are places; all if they are `FULL`.
///
/// # Panics
/// As [`load`].
#[inline]
#[target_feature(enable = "avx512f")]
pub(super) fn store<const V: usize, const FULL: bool>(
    values: &mut [f32],
    x: usize,
    vectors: [__m512; V],
) {
    if FULL {
        let values = &mut values[x..][..V * LANES];
        for (values, vector) in values.as_chunks_mut::<LANES>().0.iter_mut().zip(vectors) {
            // SAFETY: 16 values can be written to 16 values.
            unsafe { _mm512_storeu_ps(values.as_mut_ptr(), vector) };
        }
    } else {
        for (j, vector) in vectors.into_iter().enumerate() {
            let start = (x + LANES * j).min(values.len());
            let values = &mut values[start..];
            // SAFETY: lanes beyond the slice are not written.
            unsafe {
                _mm512_mask_storeu_ps(values.as_mut_ptr(), first_lanes(values.len()), vector);
            }
        }
    }
}

/// The values from lane `N` of `first` on, with those of `then` behind them; all of `then` for 16.
///
/// From the intrinsic for this instruction the compiler makes a permutation, which needs a vector of places and a copy of
/// `first`.
#[inline]
#[target_feature(enable = "avx512f")]
pub(super) fn from_lane<const N: i32>(first: __m512, then: __m512) -> __m512 {
    if N == LANES as i32 {
        return then;
    }
    let shifted: __m512;
    // SAFETY: the instruction touches nothing but the registers that are named, and AVX-512 is there.
    unsafe {
        asm!(
            "valignd {shifted}, {then}, {first}, {n}",
            shifted = lateout(zmm_reg) shifted,
            then = in(zmm_reg) then,
            first = in(zmm_reg) first,
            n = const N,
            options(pure, nomem, nostack, preserves_flags)
        );
    }
    shifted
}

/// The bits of `there` where `mask` has ones, and those of `elsewhere` where it has zeros.
#[inline]
#[target_feature(enable = "avx512f")]
pub(super) fn select(mask: __m512i, there: __m512i, elsewhere: __m512i) -> __m512i {
    // For each of the eight combinations of three bits.
    _mm512_ternarylogic_epi32::<0b1100_1010>(mask, there, elsewhere)
}
