//! The step with vectors of 32 bytes, written by hand.
//!
//! *Benefit*: flows from the left are put together from two vectors of flows by a permutation and a blend. The
//! compiler takes three shuffles, which wait for each other. *Correctness*: each lane does what the portable code does
//! for its column, in the same order; a test compares all bits.

use std::arch::x86_64::{
    __m256, _mm256_add_ps, _mm256_blend_ps, _mm256_cvtss_f32, _mm256_fmadd_ps, _mm256_mul_ps,
    _mm256_permutevar8x32_ps, _mm256_set1_ps, _mm256_setr_epi32, _mm256_setzero_ps, _mm256_sub_ps,
};

use super::Below;
use crate::simd::eight::{LANES, load, store};

/// Makes the first columns of a row, as [`super::diffuse_rows`], and returns their number, and what flows from the first
/// pixel that is left into the last one made. At least one pixel is left, and at most as many as a vector has.
///
/// # Panics
/// If the lengths differ.
#[target_feature(enable = "avx2,fma")]
pub(super) fn diffuse_columns(
    values: &mut [f32],
    conductivity: &[f32],
    below: Below<'_>,
    upwards: &mut [f32],
    half_time: f32,
) -> (usize, f32) {
    let n = values.len();
    let (c, upwards) = (&conductivity[..n], &mut upwards[..n]);
    let (v_below, c_below) = (&below.values[..n], &below.conductivity[..n]);
    let half_time = _mm256_set1_ps(half_time);
    let turn = _mm256_setr_epi32(7, 0, 1, 2, 3, 4, 5, 6);
    // Flows into the pixels to the left, of the vector before; the last of them comes first.
    let mut turned_before = _mm256_setzero_ps();
    let mut x = 0;
    while x + LANES < n {
        let (v_here, c_here) = (load(values, x), load(c, x));
        let flow = |v: __m256, c: __m256| {
            _mm256_mul_ps(_mm256_add_ps(c_here, c), _mm256_sub_ps(v, v_here))
        };
        let from_right = flow(load(values, x + 1), load(c, x + 1));
        let turned = _mm256_permutevar8x32_ps(from_right, turn);
        let from_left = _mm256_blend_ps::<1>(turned, turned_before);
        let from_below = flow(load(v_below, x), load(c_below, x));
        let sum = _mm256_add_ps(_mm256_sub_ps(from_right, from_left), from_below);
        let sum = _mm256_sub_ps(sum, load(upwards, x));
        let diffused = _mm256_fmadd_ps(sum, half_time, v_here);
        for (row, vector) in [(&mut *values, diffused), (&mut *upwards, from_below)] {
            store(row[x..].first_chunk_mut().expect("a whole vector"), vector);
        }
        turned_before = turned;
        x += LANES;
    }
    (x, _mm256_cvtss_f32(turned_before))
}
