//! Vectors of 64 bytes at the end of a slice: only the lanes that it has are touched.

use std::arch::x86_64::{__m512, _mm512_maskz_loadu_ps};

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
