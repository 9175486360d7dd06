//! Vectors of 32 bytes: eight values of a slice, and eight that lie across two vectors.

use std::arch::x86_64::{
    __m256, _mm256_alignr_epi8, _mm256_castps_si256, _mm256_castsi256_ps, _mm256_loadu_ps,
    _mm256_permute2f128_ps, _mm256_storeu_ps,
};

/// Values of a vector.
pub(super) const LANES: usize = 8;

/// The values from place `x` on.
///
/// # Panics
/// If there are not eight.
#[inline]
#[target_feature(enable = "avx2,fma")]
pub(super) fn load(values: &[f32], x: usize) -> __m256 {
    let values: &[f32; LANES] = values[x..].first_chunk().expect("a whole vector");
    // SAFETY: 8 values can be read from 8 values.
    unsafe { _mm256_loadu_ps(values.as_ptr()) }
}

#[inline]
#[target_feature(enable = "avx2,fma")]
pub(super) fn store(values: &mut [f32; LANES], vector: __m256) {
    // SAFETY: 8 values can be written to 8 values.
    unsafe { _mm256_storeu_ps(values.as_mut_ptr(), vector) };
}

/// The upper half of a vector and the lower half of the `next`: eight values from lane 4 of the first on.
#[inline]
#[target_feature(enable = "avx2,fma")]
pub(super) fn halves(first: __m256, next: __m256) -> __m256 {
    _mm256_permute2f128_ps::<0x21>(first, next)
}

/// In each half of 16 bytes those of `first` from byte `N` on, with those of `then` behind them. With the
/// [`halves`] of a vector and the next as `then` these are eight values from lane `N / 4` of the vector on; with them
/// as `first` and the next vector as `then`, from lane `4 + N / 4` on.
#[inline]
#[target_feature(enable = "avx2,fma")]
pub(super) fn from_byte<const N: i32>(first: __m256, then: __m256) -> __m256 {
    _mm256_castsi256_ps(_mm256_alignr_epi8::<N>(
        _mm256_castps_si256(then),
        _mm256_castps_si256(first),
    ))
}
