//! The step with vectors of 32 bytes, for two rows at once, written by hand.
//!
//! *Benefit*: what flows between the two rows stays in a register, and of six rows of pixels and conductivities that
//! one row after the other needs, two are read once less. Flows from the left are put together from two vectors of
//! flows by a permutation and a blend; the compiler takes three shuffles, which wait for each other. *Correctness*:
//! each lane does what the portable text does for its pixel, in the same order; a test compares all bits.

use std::arch::x86_64::{
    _mm256_add_ps, _mm256_blend_ps, _mm256_cvtss_f32, _mm256_fmadd_ps, _mm256_mul_ps,
    _mm256_permutevar8x32_ps, _mm256_set1_ps, _mm256_setr_epi32, _mm256_setzero_ps, _mm256_sub_ps,
};

use super::TwoRows;
use crate::simd::eight::{LANES, load, store};

/// Makes the first columns, as [`super::diffuse_rows`] of two rows with one below them, and returns their number, and
/// what flows in each row from the first pixel that is left into the last one made. At least one column is left, if
/// there is any, and at most as many as a vector has.
#[target_feature(enable = "avx2,fma")]
pub(super) fn diffuse_columns(rows: &mut TwoRows<'_>, half_time: f32) -> (usize, [f32; 2]) {
    let half_time = _mm256_set1_ps(half_time);
    let turn = _mm256_setr_epi32(7, 0, 1, 2, 3, 4, 5, 6);
    // Flows into the pixels to the left, of the vector before; the last of them comes first.
    let mut turned_before = [_mm256_setzero_ps(); 2];
    let mut x = 0;
    while x + LANES < rows.upwards.len() {
        let mut from_above = load(rows.upwards, x);
        let mut values = load(rows.values[0], x);
        let mut conductivity = load(rows.conductivity[0], x);
        for (row, before) in turned_before.iter_mut().enumerate() {
            let right = load(rows.values[row], x + 1);
            let factor = _mm256_add_ps(conductivity, load(rows.conductivity[row], x + 1));
            let from_right = _mm256_mul_ps(factor, _mm256_sub_ps(right, values));
            let turned = _mm256_permutevar8x32_ps(from_right, turn);
            let from_left = _mm256_blend_ps::<1>(turned, *before);
            let (values_below, conductivity_below) = if row == 0 {
                (&*rows.values[1], rows.conductivity[1])
            } else {
                (rows.below.values, rows.below.conductivity)
            };
            let (below, conductivity_below) = (load(values_below, x), load(conductivity_below, x));
            let factor = _mm256_add_ps(conductivity, conductivity_below);
            let from_below = _mm256_mul_ps(factor, _mm256_sub_ps(below, values));
            let sum = _mm256_add_ps(_mm256_sub_ps(from_right, from_left), from_below);
            let sum = _mm256_sub_ps(sum, from_above);
            let diffused = _mm256_fmadd_ps(sum, half_time, values);
            let out = rows.values[row][x..].first_chunk_mut();
            store(out.expect("a whole vector"), diffused);
            *before = turned;
            (from_above, values, conductivity) = (from_below, below, conductivity_below);
        }
        let out = rows.upwards[x..].first_chunk_mut();
        store(out.expect("a whole vector"), from_above);
        x += LANES;
    }
    (x, turned_before.map(|turned| _mm256_cvtss_f32(turned)))
}
