//! Kernels in several instruction sets, and the only unsafe code of this package.
//!
//! **The portable code is the definition.** A kernel is written once, in portable Rust: fixed
//! lanes, a fixed tree of sums, `f32::mul_add` where a fused multiply-add is meant. The
//! `multiversioned!` macro compiles that one text for the baseline and again with the wider
//! instruction sets of the platform, and chooses at run time. Every version rounds the same
//! operations in the same order, so all agree bit for bit by construction; the compiler may
//! vectorise but never reorders floating-point arithmetic. Where that is not fast enough a kernel
//! is written by hand in intrinsics, and a test compares its bits with the portable code.
#![allow(unsafe_code)]
// The room is private; inside, kernels are marked as they would be in a crate of their own.
#![allow(unreachable_pub)]

/// Compiles functions for the baseline and again for AVX2 with fused multiply-add, and where
/// `#![avx512]` comes first for AVX-512, and calls the version that is [`InstructionSet::in_use`].
///
/// *Benefit*: the portable code runs with 8 or 16 lanes instead of 4 and with hardware `mul_add`
/// (without it each `mul_add` is a call into the C library). Vectors of 64 bytes are not for all:
/// kernels that look up, shuffle or end early are as fast or faster with those of 32.
/// *Correctness*: the only unsafe act is calling a wider version, which is done after the
/// processor said that it has all features; the body itself is safe Rust.
macro_rules! multiversioned {
    (#![avx512] $($(#[$meta:meta])* $vis:vis fn $name:ident($($arg:ident: $ty:ty),* $(,)?) $(-> $ret:ty)? $body:block)*) => {$(
        $(#[$meta])*
        $vis fn $name($($arg: $ty),*) $(-> $ret)? {
            #[inline(always)]
            fn portable($($arg: $ty),*) $(-> $ret)? $body

            #[cfg(target_arch = "x86_64")]
            {
                use $crate::simd::InstructionSet;

                #[target_feature(enable = "avx2,fma")]
                fn avx2($($arg: $ty),*) $(-> $ret)? {
                    portable($($arg),*)
                }
                #[target_feature(enable = "avx2,fma,avx512f,avx512bw,avx512cd,avx512dq,avx512vl")]
                #[target_feature(enable = "avx512vnni,avx512vpopcntdq")]
                fn avx512($($arg: $ty),*) $(-> $ret)? {
                    portable($($arg),*)
                }
                match InstructionSet::in_use() {
                    // SAFETY: no more is in use than was detected on this processor.
                    InstructionSet::Avx512 | InstructionSet::Amx => return unsafe { avx512($($arg),*) },
                    // SAFETY: as before.
                    InstructionSet::Avx2 => return unsafe { avx2($($arg),*) },
                    InstructionSet::Portable => {}
                }
            }
            portable($($arg),*)
        }
    )*};
    ($($(#[$meta:meta])* $vis:vis fn $name:ident($($arg:ident: $ty:ty),* $(,)?) $(-> $ret:ty)? $body:block)*) => {$(
        $(#[$meta])*
        $vis fn $name($($arg: $ty),*) $(-> $ret)? {
            #[inline(always)]
            fn portable($($arg: $ty),*) $(-> $ret)? $body

            #[cfg(target_arch = "x86_64")]
            {
                use $crate::simd::InstructionSet;

                #[target_feature(enable = "avx2,fma")]
                fn avx2($($arg: $ty),*) $(-> $ret)? {
                    portable($($arg),*)
                }
                if InstructionSet::in_use() >= InstructionSet::Avx2 {
                    // SAFETY: no more is in use than was detected on this processor.
                    return unsafe { avx2($($arg),*) };
                }
            }
            portable($($arg),*)
        }
    )*};
}

mod affine;
mod alignment;
mod area;
mod bilinear;
mod blur8;
mod brisk;
mod convolve;
mod daisy;
mod diffuse;
#[cfg(target_arch = "x86_64")]
mod eight;
mod extrema;
mod fast;
mod five_point;
mod freak;
mod gradient;
mod histogram;
mod instructions;
mod lanes;
mod latch;
mod moments;
mod normalize;
mod orb;
mod pooling;
mod prefetch;
mod processor;
mod rectify;
mod refine;
mod resample;
mod sampling;
mod sampson;
mod scharr;
mod search;
mod simulate;
#[cfg(target_arch = "x86_64")]
mod sixteen;
mod surf;
#[cfg(target_arch = "x86_64")]
mod tiles;
mod transfer;
mod triangulate;
mod truncated;

pub use affine::{
    CANDIDATE, CANDIDATES_AT_ONCE, Others, PairLimits, add_prediction_errors, costs_beside,
    nearest_place, pair_costs,
};
pub use alignment::{
    ALIGNED_REACH, ALIGNED_SIDE, STEP_PARAMETERS, Samples, StepEquations, normalize_window,
    product_of_windows, sample_window, sample_with_gradients, step_equations, step_sums,
};
pub use area::{Cover, cover_columns, cover_rows, halve_rows_u8, integrate_row};
pub use bilinear::{Between, BlendColumns, COLUMNS_AT_ONCE, blend_rows};
pub use blur8::{weigh_along_u8, weigh_both_u8, weigh_rows_u8};
pub use brisk::{DirectionWeights, Squares, direction, square_means};
pub use convolve::{ROWS_AT_ONCE, rows_together, weigh_rows, weigh_symmetric};
pub use daisy::{DAISY_COLUMNS, DAISY_MAPS, DaisyRow, add_between, rectified_gradients};
pub use diffuse::{Below, DIFFUSED_AT_ONCE, diffuse_rows};
pub use extrema::{ThreeRows, find_extrema, find_extrema_of_differences, find_maxima};
pub use fast::{segment_scores, strict_maxima, weak_maxima};
#[cfg(test)]
pub use five_point::roots_of_each;
pub use five_point::{COORDINATES, SAMPLES, five_point_of_eight};
pub use freak::{Fields, compare_means, field_means};
pub use gradient::{polar_gradients, turns};
pub use histogram::{
    Gradients, PatchGrid, PatchSums, Span, Window, add_directions, add_weighted, grid_columns,
    patch_sums,
};
pub use instructions::InstructionSet;
pub use latch::{WINDOW, compare_patches, turn_places};
pub use moments::{GradientProducts, add_gradient_products};
pub use normalize::normalize_to_bytes;
pub use orb::{
    PAIR_REACH, PairTable, Pixels, compare_pairs, directions, harris_strengths, intensity_moments,
};
pub use pooling::{
    PATCHES_AT_ONCE, POOLED_ROWS, PoolStep, PoolUse, VECTORS_AT_ONCE, WeakLearner, box_responses,
    integrate_spread, pool_rows, project, vote,
};
pub use processor::second_level_cache;
pub use rectify::{
    DIRECTIONS, Source, sample_line, sample_line_of_floats, spread_and_square, spread_gradients,
};
pub use refine::{sampson_normal_equations, tangent_sampson_normal_equations};
pub use resample::{double_row, halve_row};
pub use sampling::{
    AROUND, CellSums, Planes, longest_sum_of_slices, longest_sum_of_windows, sum_cells,
    sum_gradients,
};
pub use sampson::{
    THRESHOLDS, count_at_most, mean_gain, squared_sampson, squared_tangent_sampson, sum_below,
    sum_truncated,
};
pub use scharr::{
    Across, NORM_BINS, NORMS_AT_ONCE, Scharr, conductivities, count_norms, derivatives,
    determinants, difference_across, find_largest, gradient_norms, weigh_across,
};
pub use search::{
    Prepared, TwoNearest, complete, near_rows, nearest_bits_among, two_nearest_among,
    two_nearest_bits, two_nearest_floats,
};
pub use simulate::{Turn, turn_row, weigh_rows_to_u8};
pub use surf::{
    BoxRows, BoxWeights, PATCH_SIDE, PackedWindow, Shares, WAVELETS, WINDOW_SIDE, box_determinants,
    longest_sum_of_degrees, pack_window, sum_patch_gradients, turned_patch,
};
pub use transfer::{squared_transfer, transfer_normal_equations};
pub use triangulate::{ray_depths, triangulate_depths};
use truncated::truncated;
