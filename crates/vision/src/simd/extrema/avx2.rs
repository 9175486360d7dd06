//! Extrema of differences among their neighbours in one layer, with vectors of 32 bytes, written by hand.
//!
//! *How it works.* Along a row each column first gets the largest and the smallest of its three differences;
//! those of its neighbours, already there, make the extremum of all nine.
//!
//! *Benefit*: eight loads for eight columns where the portable code has 18, most of them not aligned.
//! *Correctness*: maxima and comparisons are exact in any order; a test compares the columns found.

use std::arch::x86_64::{
    __m256, _CMP_GE_OQ, _CMP_GT_OQ, _CMP_LE_OQ, _CMP_LT_OQ, _mm256_and_ps, _mm256_cmp_ps,
    _mm256_max_ps, _mm256_min_ps, _mm256_movemask_ps, _mm256_or_ps, _mm256_set1_ps, _mm256_sub_ps,
};

use crate::simd::eight::{LANES, from_byte, halves, load};

/// Of each column the largest and the smallest of three differences, and the one in the middle.
#[derive(Clone, Copy)]
struct Columns {
    most: __m256,
    least: __m256,
    middle: __m256,
}

/// A bit for each column of a block, without the first and the last of its windows, that beats `threshold` and
/// its neighbours in the middle difference.
#[inline]
#[target_feature(enable = "avx2,fma")]
pub(super) fn candidates<const WIDTH: usize>(
    finer: &[&[f32; WIDTH]; 3],
    coarser: &[&[f32; WIDTH]; 3],
    threshold: f32,
) -> u64 {
    let (top, bottom) = (_mm256_set1_ps(threshold), _mm256_set1_ps(-threshold));
    let (mut found, mut x) = (0, 1);
    let before = columns(finer, coarser, 0);
    let mut left = [before.most, before.least];
    let mut here = columns(finer, coarser, x);
    while x + LANES < WIDTH {
        let is_last = x + 2 * LANES >= WIDTH;
        let next = columns(finer, coarser, if is_last { x + 1 } else { x + LANES });
        let most = halves(here.most, next.most);
        let least = halves(here.least, next.least);
        let right = if is_last {
            [next.most, next.least]
        } else {
            [
                from_byte::<4>(here.most, most),
                from_byte::<4>(here.least, least),
            ]
        };
        let left_of_next = [
            from_byte::<12>(most, next.most),
            from_byte::<12>(least, next.least),
        ];
        let most = _mm256_max_ps(_mm256_max_ps(left[0], right[0]), here.most);
        let least = _mm256_min_ps(_mm256_min_ps(left[1], right[1]), here.least);
        let top = _mm256_and_ps(
            _mm256_cmp_ps::<_CMP_GT_OQ>(here.middle, top),
            _mm256_cmp_ps::<_CMP_GE_OQ>(here.middle, most),
        );
        let bottom = _mm256_and_ps(
            _mm256_cmp_ps::<_CMP_LT_OQ>(here.middle, bottom),
            _mm256_cmp_ps::<_CMP_LE_OQ>(here.middle, least),
        );
        let bits = _mm256_movemask_ps(_mm256_or_ps(top, bottom));
        found |= u64::from(bits.cast_unsigned()) << (x - 1);
        (left, here) = (left_of_next, next);
        x += LANES;
    }
    found
}

/// Of the middle difference from column `x` of the windows on.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn columns<const WIDTH: usize>(
    finer: &[&[f32; WIDTH]; 3],
    coarser: &[&[f32; WIDTH]; 3],
    x: usize,
) -> Columns {
    let [above, middle, below] =
        [0, 1, 2].map(|row| _mm256_sub_ps(load(coarser[row], x), load(finer[row], x)));
    Columns {
        most: _mm256_max_ps(_mm256_max_ps(above, middle), below),
        least: _mm256_min_ps(_mm256_min_ps(above, middle), below),
        middle,
    }
}
