//! The step with vectors of 64 bytes, for two rows at once, written by hand.
//!
//! *Benefit*: what flows between the two rows stays in a register, and of six rows of pixels and conductivities that
//! one row after the other needs, two are read once less. Pixels to the right and flows from the left are put together
//! from two vectors by one shift each, and the last columns of a row are a vector with a mask. The compiler takes
//! permutations with copies, and makes the last columns, up to fifteen of them, one by one. *Correctness*: each lane
//! does what the portable code does for its pixel, in the same order; a test compares all bits.

use std::arch::x86_64::{
    __m512, _mm512_add_ps, _mm512_fmadd_ps, _mm512_maskz_mul_ps, _mm512_mul_ps, _mm512_set1_ps,
    _mm512_setzero_ps, _mm512_sub_ps,
};

use super::{Below, TwoRows};
use crate::simd::sixteen::{LANES, first_lanes, from_lane, load, store};

/// A vector of pixels of each row, their conductivities, and what flows into the pixels to the left of them from the
/// right.
struct Here {
    values: [__m512; 2],
    conductivity: [__m512; 2],
    flows_before: [__m512; 2],
}

/// As [`super::diffuse_rows`], for two rows with one below them.
#[target_feature(enable = "avx512f")]
pub(super) fn diffuse_two_rows(mut rows: TwoRows<'_>, half_time: f32) {
    let width = rows.upwards.len();
    let half_time = _mm512_set1_ps(half_time);
    let mut here = Here {
        values: [0, 1].map(|row| load::<1, false>(rows.values[row], 0)[0]),
        conductivity: rows.conductivity.map(|row| load::<1, false>(row, 0)[0]),
        flows_before: [_mm512_setzero_ps(); 2],
    };
    let mut x = 0;
    while x + 2 * LANES <= width {
        diffuse_columns::<true>(&mut rows, half_time, x, &mut here);
        x += LANES;
    }
    while x < width {
        diffuse_columns::<false>(&mut rows, half_time, x, &mut here);
        x += LANES;
    }
}

/// Diffuses the pixels that are `here`, from column `x` on, and goes on to the next ones. If they are `FULL`, they and
/// the next ones are whole vectors.
#[inline]
#[target_feature(enable = "avx512f")]
fn diffuse_columns<const FULL: bool>(
    rows: &mut TwoRows<'_>,
    half_time: __m512,
    x: usize,
    here: &mut Here,
) {
    let Below {
        values: values_below,
        conductivity: conductivity_below,
    } = rows.below;
    let [values_below] = load::<1, FULL>(values_below, x);
    let [conductivity_below] = load::<1, FULL>(conductivity_below, x);
    let [mut from_above] = load::<1, FULL>(rows.upwards, x);
    let (values, conductivity) = (here.values, here.conductivity);
    for row in 0..2 {
        [here.values[row]] = load::<1, FULL>(rows.values[row], x + LANES);
        [here.conductivity[row]] = load::<1, FULL>(rows.conductivity[row], x + LANES);
        let right = from_lane::<1>(values[row], here.values[row]);
        let factor = from_lane::<1>(conductivity[row], here.conductivity[row]);
        let factor = _mm512_add_ps(conductivity[row], factor);
        let difference = _mm512_sub_ps(right, values[row]);
        let from_right = if FULL {
            _mm512_mul_ps(factor, difference)
        } else {
            // Nothing flows into the last pixel from the right.
            let inner = first_lanes(rows.upwards.len() - x - 1);
            _mm512_maskz_mul_ps(inner, factor, difference)
        };
        let from_left = from_lane::<15>(here.flows_before[row], from_right);
        let (below, factor) = if row == 0 {
            (values[1], conductivity[1])
        } else {
            (values_below, conductivity_below)
        };
        let factor = _mm512_add_ps(conductivity[row], factor);
        let from_below = _mm512_mul_ps(factor, _mm512_sub_ps(below, values[row]));
        let sum = _mm512_add_ps(_mm512_sub_ps(from_right, from_left), from_below);
        let sum = _mm512_sub_ps(sum, from_above);
        let diffused = _mm512_fmadd_ps(sum, half_time, values[row]);
        store::<1, FULL>(rows.values[row], x, [diffused]);
        here.flows_before[row] = from_right;
        from_above = from_below;
    }
    store::<1, FULL>(rows.upwards, x, [from_above]);
}
