//! The sums of a patch with vectors of 32 bytes, written by hand.
//!
//! *How it works.* For each direction the four columns of a row of cells lie side by side, and the rows below
//! one another, so that the four cells about a pixel are within eight neighbouring sums. A permutation puts
//! the four weights of the pixel to their columns; the eight sums of each of its two directions get them times
//! its share. Places, weights and shares are made for eight pixels at a time and go through memory: from registers
//! each would have to be shuffled out. Places come first, since they are read first, and two blocks are made before
//! either is added. With more of them the processor would look at sums alone, which wait for one another.
//!
//! *Benefit*: two vectors are read and written for a pixel, where the portable code has four. *Correctness*: the same
//! products are added in the same order, except products with zero, which change no sum; a test compares all bits.

use std::arch::x86_64::{
    __m256, _CMP_GT_OQ, _CMP_LT_OQ, _mm256_add_epi32, _mm256_add_ps, _mm256_and_ps,
    _mm256_and_si256, _mm256_castpd_ps, _mm256_castps_pd, _mm256_cmp_ps, _mm256_cvtps_epi32,
    _mm256_floor_ps, _mm256_fmadd_ps, _mm256_loadu_si256, _mm256_mul_ps, _mm256_permute2f128_ps,
    _mm256_permutevar_ps, _mm256_set1_epi32, _mm256_set1_ps, _mm256_setzero_pd, _mm256_slli_epi32,
    _mm256_storeu_si256, _mm256_sub_ps, _mm256_unpackhi_pd, _mm256_unpackhi_ps, _mm256_unpacklo_pd,
    _mm256_unpacklo_ps,
};

use super::{Eight, Measured, PatchSums};
use crate::simd::eight::{LANES, load, store};

/// From the sums of one direction to those of the next: four rows of cells, and the rows above and below, of which
/// what falls there is lost.
const DIRECTION: usize = 32;

/// Place of the row above the first. From here the eight sums about a pixel lie in two cache lines in one of five rows.
const FIRST: usize = 8;

/// From the sums of pixels at even places to those at odd ones.
const HALF: usize = 8 * DIRECTION;

/// Blocks that are made before they are added.
const AHEAD: usize = 2;

/// Sums of `[place of the pixel modulo 2][direction][row][column]`, and room for eight from any place on.
#[repr(align(64))]
struct Sums([f32; 2 * HALF + LANES]);

/// What the pixels of a block add.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Shares {
    /// Weights of the cells above left, above right, below left and below right of each pixel, in lanes
    /// 0, 1, 4 and 5.
    weights: [Eight; LANES],
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
pub(super) fn sums(first_direction: f32, measured: Measured<'_>) -> PatchSums {
    let Measured {
        columns,
        lines,
        directions,
        values,
    } = measured;
    let mut sums = Sums([0.0; 2 * HALF + LANES]);
    let mut ahead = [Shares {
        weights: [[0.0; LANES]; LANES],
        before: [0; LANES],
        after: [0; LANES],
        columns: [0; LANES],
        rests: [0.0; LANES],
        nexts: [0.0; LANES],
    }; AHEAD];
    let mut first = 0;
    while first < values.len() {
        let ahead = &mut ahead[..AHEAD.min(values.len() - first)];
        for (shares, b) in ahead.iter_mut().zip(first..) {
            prepare(
                first_direction,
                [&columns[b], &lines[b]],
                &values[b],
                &directions[b],
                shares,
            );
        }
        for shares in &*ahead {
            add(shares, &mut sums);
        }
        first += AHEAD;
    }
    by_cell(&sums)
}

#[inline]
#[target_feature(enable = "avx2,fma")]
fn prepare(
    first_direction: f32,
    at: [&Eight; 2],
    values: &Eight,
    directions: &Eight,
    shares: &mut Shares,
) {
    let all = |x| _mm256_set1_ps(x);
    let [column, line] = at.map(|numbers| load(numbers, 0));
    let within = |x| {
        let above = _mm256_cmp_ps::<_CMP_GT_OQ>(x, _mm256_set1_ps(-1.0));
        _mm256_and_ps(above, _mm256_cmp_ps::<_CMP_LT_OQ>(x, _mm256_set1_ps(4.0)))
    };
    let inside = _mm256_and_ps(within(line), within(column));
    let value = _mm256_and_ps(inside, load(values, 0));
    let (column, line) = (_mm256_and_ps(inside, column), _mm256_and_ps(inside, line));
    let turns = _mm256_sub_ps(load(directions, 0), all(first_direction));
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
    store(&mut shares.rests, _mm256_sub_ps(all(1.0), next));
    store(&mut shares.nexts, next);

    let number = |n: usize| _mm256_set1_epi32(n as i32);
    let row = _mm256_slli_epi32::<2>(_mm256_cvtps_epi32(line0));
    let row = _mm256_add_epi32(row, number(FIRST + 4));
    let bin = _mm256_slli_epi32::<{ DIRECTION.trailing_zeros() as i32 }>(_mm256_cvtps_epi32(bin0));
    let of_bin = |bin| _mm256_add_epi32(_mm256_and_si256(bin, number(HALF - DIRECTION)), row);
    let columns = _mm256_add_epi32(_mm256_cvtps_epi32(column0), number(1));
    let columns = _mm256_slli_epi32::<3>(columns);
    for (places, vector) in [
        (&mut shares.before, of_bin(bin)),
        (
            &mut shares.after,
            of_bin(_mm256_add_epi32(bin, number(DIRECTION))),
        ),
        (&mut shares.columns, columns),
    ] {
        // SAFETY: 32 bytes can be written to 8 integers.
        unsafe { _mm256_storeu_si256(places.as_mut_ptr().cast(), vector) };
    }
    let weights = by_pixel([above_left, above_right, below_left, below_right]);
    for (eight, vector) in shares.weights.iter_mut().zip(weights) {
        store(eight, vector);
    }
}

#[inline]
#[target_feature(enable = "avx2,fma")]
fn add(shares: &Shares, sums: &mut Sums) {
    for (i, weights) in shares.weights.iter().enumerate() {
        let first = shares.columns[i] as usize % COLUMNS.0.len();
        let chosen: &[u32; LANES] = COLUMNS.0[first / 8 * 8..].first_chunk().expect("8");
        // SAFETY: 32 bytes can be read from 8 integers.
        let chosen = unsafe { _mm256_loadu_si256(chosen.as_ptr().cast()) };
        let weights = _mm256_permutevar_ps(load(weights, 0), chosen);
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

/// The sums of both halves, those of a cell side by side.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn by_cell(sums: &Sums) -> PatchSums {
    let mut by_cell = [0.0; 128];
    for (half, cells) in by_cell.as_chunks_mut().0.chunks_mut(LANES).enumerate() {
        let directions: [__m256; 8] = std::array::from_fn(|bin| {
            let place = DIRECTION * bin + FIRST + 4 + LANES * half;
            _mm256_add_ps(load(&sums.0, place), load(&sums.0, HALF + place))
        });
        for (cell, vector) in cells.iter_mut().zip(transposed(directions)) {
            store(cell, vector);
        }
    }
    by_cell
}

/// Of eight vectors lane `i` in vector `i`.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn transposed(rows: [__m256; 8]) -> [__m256; 8] {
    let fours = |[a, b, c, d]: [__m256; 4]| {
        let pairs = |a, b| {
            [
                _mm256_castps_pd(_mm256_unpacklo_ps(a, b)),
                _mm256_castps_pd(_mm256_unpackhi_ps(a, b)),
            ]
        };
        let ([ab0, ab2], [cd0, cd2]) = (pairs(a, b), pairs(c, d));
        [
            _mm256_unpacklo_pd(ab0, cd0),
            _mm256_unpackhi_pd(ab0, cd0),
            _mm256_unpacklo_pd(ab2, cd2),
            _mm256_unpackhi_pd(ab2, cd2),
        ]
        .map(|x| _mm256_castpd_ps(x))
    };
    let [a, b, c, d, e, f, g, h] = rows;
    let (first, last) = (fours([a, b, c, d]), fours([e, f, g, h]));
    std::array::from_fn(|i| {
        let (first, last) = (first[i % 4], last[i % 4]);
        if i < 4 {
            _mm256_permute2f128_ps::<0x20>(first, last)
        } else {
            _mm256_permute2f128_ps::<0x31>(first, last)
        }
    })
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
static COLUMNS: Columns = columns();

/// Whole vectors, so that none lies in two cache lines.
#[derive(Clone, Copy)]
#[repr(align(32))]
struct Columns([u32; 8 * LANES]);

const fn columns() -> Columns {
    let mut columns = [2; 8 * LANES];
    let mut i = 0;
    while i < LANES {
        columns[LANES * (i % 4 + 1) + i] = 0;
        columns[LANES * (i % 4) + i] = 1;
        i += 1;
    }
    Columns(columns)
}
