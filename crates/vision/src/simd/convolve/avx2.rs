//! The horizontal pass with vectors of 32 bytes, written by hand.
//!
//! *Benefit*: nearly half of the vectors that are not aligned lie across two cache lines and cost two loads, and the
//! pass is limited by loads. The vectors to the right are put together from registers instead, one shuffle each.
//! *Correctness*: each lane does what the portable code does for its column, in the same order; a test
//! compares all bits.

use std::arch::x86_64::{
    __m256, _mm256_add_ps, _mm256_fmadd_ps, _mm256_set1_ps, _mm256_setzero_ps,
};

use crate::simd::eight::{self, LANES, from_byte, load, store};

/// Vectors of a block.
const BLOCK: usize = 4;

/// Columns of a block.
const COLUMNS: usize = BLOCK * LANES;

/// Makes the first columns of `out`, as the kernel of that name, and returns their number: all whole
/// blocks, but for one that ends where `padded` does.
///
/// # Panics
/// If `padded` is not `taps.len() - 1` longer than `out`.
#[target_feature(enable = "avx2,fma")]
pub(super) fn weigh_symmetric(padded: &[f32], taps: &[f32], out: &mut [f32]) -> usize {
    let radius = taps.len() / 2;
    let reach = radius + radius / LANES * LANES + COLUMNS + LANES;
    let mut x = 0;
    while x + COLUMNS <= out.len() && x + reach <= padded.len() {
        let sums = symmetric_block(&padded[x..], taps);
        let (block, _) = out[x..][..COLUMNS].as_chunks_mut();
        for (out, sum) in block.iter_mut().zip(sums) {
            store(out, sum);
        }
        x += COLUMNS;
    }
    x
}

/// The first columns of what `padded` gives.
#[inline]
#[target_feature(enable = "avx2,fma")]
#[expect(
    clippy::needless_range_loop,
    reason = "with iterators it is 2 % slower"
)]
fn symmetric_block(padded: &[f32], taps: &[f32]) -> [__m256; BLOCK] {
    let radius = taps.len() / 2;
    let mut sums = [_mm256_setzero_ps(); BLOCK];
    // Distances from the middle, from the largest on, eight with the same vectors to the right.
    for far in (0..=radius / LANES).rev() {
        let right = Right::load(padded, radius + LANES * far);
        let nearest = LANES * far;
        macro_rules! add_pairs {
            ($($shift:literal)*) => {$(
                let distance = nearest + $shift;
                if distance > 0 && distance <= radius {
                    let left = vectors::<BLOCK>(padded, radius - distance);
                    let tap = _mm256_set1_ps(taps[radius - distance]);
                    for j in 0..BLOCK {
                        let both = _mm256_add_ps(left[j], right.shifted::<$shift>(j));
                        sums[j] = _mm256_fmadd_ps(tap, both, sums[j]);
                    }
                }
            )*};
        }
        add_pairs!(7 6 5 4 3 2 1 0);
        if far == 0 {
            let tap = _mm256_set1_ps(taps[radius]);
            for j in 0..BLOCK {
                sums[j] = _mm256_fmadd_ps(right.whole[j], tap, sums[j]);
            }
        }
    }
    sums
}

/// Neighbouring vectors, from which any eight neighbouring values are put together.
struct Right {
    whole: [__m256; BLOCK + 1],
    /// The upper half of a vector and the lower half of the next.
    halves: [__m256; BLOCK],
}

impl Right {
    #[inline]
    #[target_feature(enable = "avx2,fma")]
    fn load(values: &[f32], x: usize) -> Self {
        let whole = vectors::<{ BLOCK + 1 }>(values, x);
        let mut halves = [_mm256_setzero_ps(); BLOCK];
        for j in 0..BLOCK {
            halves[j] = eight::halves(whole[j], whole[j + 1]);
        }
        Self { whole, halves }
    }

    /// Vector `j`, but `N` values to the right.
    #[inline]
    #[target_feature(enable = "avx2,fma")]
    fn shifted<const N: usize>(&self, j: usize) -> __m256 {
        let (here, next, halves) = (self.whole[j], self.whole[j + 1], self.halves[j]);
        match N {
            0 => here,
            1 => from_byte::<4>(here, halves),
            2 => from_byte::<8>(here, halves),
            3 => from_byte::<12>(here, halves),
            4 => halves,
            5 => from_byte::<4>(halves, next),
            6 => from_byte::<8>(halves, next),
            7 => from_byte::<12>(halves, next),
            _ => next,
        }
    }
}

/// Vectors from place `x` on.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn vectors<const V: usize>(values: &[f32], x: usize) -> [__m256; V] {
    let values = &values[x..][..V * LANES];
    let mut vectors = [_mm256_setzero_ps(); V];
    for (j, vector) in vectors.iter_mut().enumerate() {
        *vector = load(values, j * LANES);
    }
    vectors
}
