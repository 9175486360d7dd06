//! The sums of a patch with vectors of 32 bytes, written by hand.
//!
//! *How it works.* For each direction the four columns of a row of cells lie side by side, and the rows below
//! one another, so that the four cells about a pixel are within eight neighbouring sums. A permutation puts
//! the four weights of the pixel to their columns; the eight sums of each of its two directions get them times
//! its share.
//!
//! *Benefit*: two vectors are read and written for a pixel, where the portable text has four. *Correctness*: the same
//! products are added in the same order, except products with zero, which change no sum; a test compares all bits.

use std::arch::x86_64::{
    __m256, _CMP_GT_OQ, _CMP_LT_OQ, _mm256_add_epi32, _mm256_add_ps, _mm256_and_ps,
    _mm256_and_si256, _mm256_castpd_ps, _mm256_castps_pd, _mm256_castps_si256, _mm256_cmp_ps,
    _mm256_floor_ps, _mm256_fmadd_ps, _mm256_fmsub_ps, _mm256_loadu_si256, _mm256_mul_ps,
    _mm256_permute2f128_ps, _mm256_permutevar_ps, _mm256_set1_epi32, _mm256_set1_ps,
    _mm256_setr_ps, _mm256_setzero_pd, _mm256_slli_epi32, _mm256_storeu_si256, _mm256_sub_ps,
    _mm256_unpackhi_pd, _mm256_unpackhi_ps, _mm256_unpacklo_pd, _mm256_unpacklo_ps,
};

use super::{Block, Eight, Gradients, MIDDLE, NO_FRACTION, PatchGrid, PatchSums};
use crate::simd::eight::{LANES, load, store};

/// From the sums of one direction to those of the next: four rows of cells, which fill a cache line, and the
/// rows above and below, of which what falls there is lost.
const DIRECTION: usize = 32;

/// Place of the row above the first.
const FIRST: usize = 12;

/// From the sums of pixels at even places to those at odd ones.
const HALF: usize = 8 * DIRECTION;

/// Sums of `[place of the pixel modulo 2][direction][row][column]`; the row below the last direction has
/// room too.
#[repr(align(64))]
struct Sums([f32; 2 * HALF + LANES]);

/// What the pixels of a block add.
struct Shares {
    /// Weights of the cells above left, above right, below left and below right of each pixel, in lanes
    /// 0, 1, 4 and 5.
    weights: [__m256; LANES],
    /// Place of the first of the eight sums for the direction before that of each pixel.
    before: [u32; LANES],
    /// And for the direction after it.
    after: [u32; LANES],
    /// Column of the cells to the left, from the one before the first on.
    columns: [u32; LANES],
    /// What the direction before gets.
    rests: Eight,
    /// What the direction after gets.
    nexts: Eight,
}

/// The sums of gradients that are measured.
#[target_feature(enable = "avx2,fma")]
pub(super) fn sums(grid: &PatchGrid, gradients: &Gradients) -> PatchSums {
    let mut sums = Sums([0.0; 2 * HALF + LANES]);
    let Gradients {
        blocks,
        directions,
        values,
        ..
    } = gradients;
    for ((block, direction), value) in blocks.iter().zip(directions).zip(values) {
        add(&shares(grid, block, value, direction), &mut sums);
    }
    std::array::from_fn(|i| {
        let (cell, bin) = (i / 8, i % 8);
        let place = DIRECTION * bin + FIRST + 4 + cell;
        sums.0[place] + sums.0[HALF + place]
    })
}

#[inline]
#[target_feature(enable = "avx2,fma")]
fn shares(grid: &PatchGrid, block: &Block, values: &Eight, directions: &Eight) -> Shares {
    let all = |x| _mm256_set1_ps(x);
    let whole = |x: __m256| {
        let bits = _mm256_castps_si256(_mm256_add_ps(x, _mm256_set1_ps(NO_FRACTION)));
        _mm256_and_si256(bits, _mm256_set1_epi32(0x003f_ffff))
    };
    let (cos, sin) = (all(grid.cos), all(grid.sin));
    let numbers = _mm256_setr_ps(0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0);
    let x = _mm256_fmadd_ps(all(block.step), numbers, all(block.x));
    let y = all(block.y);
    let middle = all(MIDDLE);
    let column = _mm256_add_ps(_mm256_fmadd_ps(x, cos, _mm256_mul_ps(y, sin)), middle);
    let line = _mm256_add_ps(_mm256_fmsub_ps(y, cos, _mm256_mul_ps(x, sin)), middle);
    let within = |x| {
        let above = _mm256_cmp_ps::<_CMP_GT_OQ>(x, _mm256_set1_ps(-1.0));
        _mm256_and_ps(above, _mm256_cmp_ps::<_CMP_LT_OQ>(x, _mm256_set1_ps(4.0)))
    };
    let inside = _mm256_and_ps(within(line), within(column));
    let value = _mm256_and_ps(inside, load(values, 0));
    let (column, line) = (_mm256_and_ps(inside, column), _mm256_and_ps(inside, line));
    let turns = _mm256_sub_ps(load(directions, 0), all(grid.direction));
    let bin = _mm256_mul_ps(turns, all(8.0));
    let (column0, line0) = (_mm256_floor_ps(column), _mm256_floor_ps(line));
    let bin0 = _mm256_floor_ps(bin);
    let (column1, line1) = (_mm256_sub_ps(column, column0), _mm256_sub_ps(line, line0));
    let next = _mm256_sub_ps(bin, bin0);

    let below = _mm256_mul_ps(value, line1);
    let above = _mm256_sub_ps(value, below);
    let below_right = _mm256_mul_ps(below, column1);
    let above_right = _mm256_mul_ps(above, column1);
    let below_left = _mm256_sub_ps(below, below_right);
    let above_left = _mm256_sub_ps(above, above_right);

    let row = whole(_mm256_fmadd_ps(line0, all(4.0), all((FIRST + 4) as f32)));
    let of_bin = |bin| {
        let bin = _mm256_and_si256(bin, _mm256_set1_epi32(7));
        _mm256_add_epi32(
            _mm256_slli_epi32::<{ DIRECTION.trailing_zeros() as i32 }>(bin),
            row,
        )
    };
    let bin = whole(bin0);
    let mut shares = Shares {
        weights: by_pixel([above_left, above_right, below_left, below_right]),
        before: [0; LANES],
        after: [0; LANES],
        columns: [0; LANES],
        rests: [0.0; LANES],
        nexts: [0.0; LANES],
    };
    let Shares {
        before,
        after,
        columns,
        rests,
        nexts,
        ..
    } = &mut shares;
    let places = [
        (before, of_bin(bin)),
        (after, of_bin(_mm256_add_epi32(bin, _mm256_set1_epi32(1)))),
        (columns, whole(_mm256_add_ps(column0, all(1.0)))),
    ];
    for (places, vector) in places {
        // SAFETY: 32 bytes can be written to 8 integers.
        unsafe { _mm256_storeu_si256(places.as_mut_ptr().cast(), vector) };
    }
    for (parts, vector) in [(rests, _mm256_sub_ps(all(1.0), next)), (nexts, next)] {
        store(parts, vector);
    }
    shares
}

#[inline]
#[target_feature(enable = "avx2,fma")]
fn add(shares: &Shares, sums: &mut Sums) {
    for (i, &weights) in shares.weights.iter().enumerate() {
        let column = &COLUMNS[(shares.columns[i] & 7) as usize];
        // SAFETY: 32 bytes can be read from 8 integers.
        let column = unsafe { _mm256_loadu_si256(column.0.as_ptr().cast()) };
        let weights = _mm256_permutevar_ps(weights, column);
        for (place, share) in [
            (shares.before[i], shares.rests[i]),
            (shares.after[i], shares.nexts[i]),
        ] {
            let place = i % 2 * HALF + place as usize % HALF;
            let sums: &mut Eight = (&mut sums.0[place..place + LANES]).try_into().expect("8");
            let sum = _mm256_fmadd_ps(weights, _mm256_set1_ps(share), load(sums, 0));
            store(sums, sum);
        }
    }
}

/// Of four vectors lane `i` in lanes 0, 1, 4 and 5 of vector `i`; the others are zero.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn by_pixel([a, b, c, d]: [__m256; 4]) -> [__m256; LANES] {
    let pairs = [
        (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d)),
        (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d)),
    ];
    let [(ab0, cd0), (ab2, cd2)] = pairs;
    let zero = _mm256_setzero_pd();
    let two = |abcd| {
        let abcd = _mm256_castps_pd(abcd);
        [
            _mm256_unpacklo_pd(abcd, zero),
            _mm256_unpackhi_pd(abcd, zero),
        ]
        .map(|x| _mm256_castpd_ps(x))
    };
    let [p0, p1] = two(_mm256_permute2f128_ps::<0x20>(ab0, cd0));
    let [p2, p3] = two(_mm256_permute2f128_ps::<0x20>(ab2, cd2));
    let [p4, p5] = two(_mm256_permute2f128_ps::<0x31>(ab0, cd0));
    let [p6, p7] = two(_mm256_permute2f128_ps::<0x31>(ab2, cd2));
    [p0, p1, p2, p3, p4, p5, p6, p7]
}

/// Which of the weights to the left (0), to the right (1) and zero (2) each of four columns gets, twice, by
/// the column of the cells to the left.
static COLUMNS: [Columns; 8] = columns();

/// A whole vector, so that none lies in two cache lines.
#[derive(Clone, Copy)]
#[repr(align(32))]
struct Columns([u32; LANES]);

const fn columns() -> [Columns; 8] {
    let mut columns = [Columns([2; LANES]); 8];
    let mut i = 0;
    while i < LANES {
        columns[i % 4 + 1].0[i] = 0;
        columns[i % 4].0[i] = 1;
        i += 1;
    }
    columns
}
