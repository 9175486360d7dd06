//! Differences of the pixels of a row about a keypoint to their neighbours, with their weights and places in the grid.
//!
//! *How it works.* Eight pixels are taken at a time and written to any place, over what an earlier block left there.
//! With AVX2 and AVX-512 this is written by hand. *Benefit*: rows are short, and the compiler begins each of them with a
//! search for overlaps between ten slices, if it does not check every access to them. With AVX-512 all rows of a patch take
//! as many vectors, so that no branch has to be guessed. *Correctness*: the same operations in the same order; a test
//! compares all bits.

use std::ops::Range;

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::{
    _mm256_add_ps, _mm256_fmadd_ps, _mm256_fmsub_ps, _mm256_loadu_ps, _mm256_mul_ps,
    _mm256_set1_ps, _mm256_storeu_ps, _mm256_sub_ps, _mm512_add_ps, _mm512_fmadd_ps,
    _mm512_fmsub_ps, _mm512_loadu_ps, _mm512_maskz_loadu_ps, _mm512_mul_ps, _mm512_set1_ps,
    _mm512_storeu_ps, _mm512_sub_ps,
};

use super::{MIDDLE, PatchGrid};
#[cfg(target_arch = "x86_64")]
use crate::simd::InstructionSet;
#[cfg(target_arch = "x86_64")]
use crate::simd::sixteen::{LANES, first_lanes};

/// Vectors of 64 bytes up to which all rows take as many as the longest.
pub(super) const ALIKE: usize = 4;
/// Places that a row may write beyond its own.
pub(super) const BEYOND: usize = 16 * ALIKE;

/// Pixels that are taken together.
pub(super) const BLOCK: usize = 8;

pub(super) type Eight = [f32; BLOCK];

/// What is taken of the pixels, each at its place.
#[derive(Clone, Debug, Default)]
pub(super) struct Places {
    /// Where they lie in a grid, if there is one.
    pub(super) columns: Vec<f32>,
    pub(super) lines: Vec<f32>,
    /// Differences along x.
    pub(super) directions: Vec<f32>,
    /// Differences along y (upwards).
    pub(super) rises: Vec<f32>,
    /// Weights.
    pub(super) values: Vec<f32>,
}

impl Places {
    /// At least so many places.
    #[inline(always)]
    pub(super) fn make_room(&mut self, count: usize) {
        let Self {
            columns,
            lines,
            directions,
            rises,
            values,
        } = self;
        for numbers in [columns, lines, directions, rises, values] {
            numbers.resize(count.max(numbers.len()), 0.0);
        }
    }
}

/// Pixels of a row and their neighbours, each from that of the first pixel on.
pub(super) struct Row<'a> {
    pub(super) left: &'a [f32],
    pub(super) right: &'a [f32],
    pub(super) above: &'a [f32],
    pub(super) below: &'a [f32],
    /// Weights of the columns.
    pub(super) weights: &'a [f32],
    /// Weight of the row.
    pub(super) weight: f32,
    /// Offset of the first pixel.
    pub(super) x: f32,
    pub(super) y: f32,
}

impl Row<'_> {
    /// Blocks of which all neighbours and weights are there.
    #[inline(always)]
    pub(super) fn whole_blocks(&self) -> usize {
        let across = self.left.len().min(self.right.len());
        let along = self.above.len().min(self.below.len());
        across.min(along).min(self.weights.len()) / BLOCK
    }
}

/// Writes the first `blocks` of a row to the places from `at` on.
///
/// # Panics
/// If there are not as many whole blocks, or if `to` lacks places.
#[inline(always)]
pub(super) fn take_blocks(
    row: &Row<'_>,
    blocks: usize,
    grid: Option<&PatchGrid>,
    at: usize,
    to: &mut Places,
) {
    #[cfg(target_arch = "x86_64")]
    if InstructionSet::in_use() >= InstructionSet::Avx2 {
        // SAFETY: what is in use was detected on this processor.
        return unsafe { take_blocks_avx2(row, blocks, grid, at, to) };
    }
    for from in (0..blocks).map(|block| BLOCK * block) {
        let next = |row: &[f32]| *row[from..].first_chunk().expect("a whole block");
        put(
            &mut to.directions,
            at + from,
            minus(next(row.right), next(row.left)),
        );
        put(
            &mut to.rises,
            at + from,
            minus(next(row.above), next(row.below)),
        );
        put(
            &mut to.values,
            at + from,
            times(row.weight, next(row.weights)),
        );
        if let Some(grid) = grid {
            let [columns, lines] = grid.places(row.x + from as f32, 1.0, row.y);
            put(&mut to.columns, at + from, columns);
            put(&mut to.lines, at + from, lines);
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn take_blocks_avx2(
    row: &Row<'_>,
    blocks: usize,
    grid: Option<&PatchGrid>,
    at: usize,
    to: &mut Places,
) {
    assert!(blocks <= row.whole_blocks());
    let Places {
        columns,
        lines,
        directions,
        rises,
        values,
    } = to;
    for numbers in [&*columns, lines, directions, rises, values] {
        assert!(at + BLOCK * blocks <= numbers.len());
    }
    let mut from = 0;
    while from < BLOCK * blocks {
        // SAFETY: all have a whole block from here on, as was checked.
        unsafe {
            let next = |row: &[f32]| _mm256_loadu_ps(row.as_ptr().add(from));
            let put =
                |to: &mut [f32], eight| _mm256_storeu_ps(to.as_mut_ptr().add(at + from), eight);
            put(directions, _mm256_sub_ps(next(row.right), next(row.left)));
            put(rises, _mm256_sub_ps(next(row.above), next(row.below)));
            put(
                values,
                _mm256_mul_ps(_mm256_set1_ps(row.weight), next(row.weights)),
            );
            if let Some(grid) = grid {
                let (cos, sin) = (_mm256_set1_ps(grid.cos), _mm256_set1_ps(grid.sin));
                let (middle, y) = (_mm256_set1_ps(MIDDLE), _mm256_set1_ps(row.y));
                let numbers = _mm256_loadu_ps(NUMBERS.as_ptr());
                let x = _mm256_add_ps(_mm256_set1_ps(row.x + from as f32), numbers);
                let column = _mm256_fmadd_ps(x, cos, _mm256_mul_ps(y, sin));
                let line = _mm256_fmsub_ps(y, cos, _mm256_mul_ps(x, sin));
                put(columns, _mm256_add_ps(column, middle));
                put(lines, _mm256_add_ps(line, middle));
            }
        }
        from += BLOCK;
    }
}

/// [`take_blocks`] with vectors of 64 bytes, in as many as are asked for or as the row needs. What they write beyond the
/// blocks is zero or written over later.
///
/// # Panics
/// Also if there are more than [`ALIKE`] beyond what the row needs and `to` has no room for them.
#[cfg(target_arch = "x86_64")]
#[inline]
#[target_feature(enable = "avx512f")]
pub(super) fn take_vectors(
    row: &Row<'_>,
    blocks: usize,
    vectors: Option<usize>,
    grid: Option<&PatchGrid>,
    at: usize,
    to: &mut Places,
) {
    let wanted = BLOCK * blocks;
    assert!(blocks <= row.whole_blocks());
    let vectors = vectors.unwrap_or(wanted.div_ceil(LANES));
    let Places {
        columns,
        lines,
        directions,
        rises,
        values,
    } = to;
    for numbers in [&*columns, lines, directions, rises, values] {
        assert!(at + LANES * vectors <= numbers.len());
    }
    let weight = _mm512_set1_ps(row.weight);
    // SAFETY: there are sixteen numbers.
    let numbers = unsafe { _mm512_loadu_ps(SIXTEEN_NUMBERS.as_ptr()) };
    let mut x = _mm512_add_ps(_mm512_set1_ps(row.x), numbers);
    for from in (0..vectors).map(|vector| LANES * vector) {
        let lanes = first_lanes(wanted.saturating_sub(from));
        // SAFETY: of the row only wanted pixels are read, which all have, and there is room for a vector; both were checked.
        unsafe {
            let next = |row: &[f32]| _mm512_maskz_loadu_ps(lanes, row.as_ptr().wrapping_add(from));
            let put =
                |to: &mut [f32], vector| _mm512_storeu_ps(to.as_mut_ptr().add(at + from), vector);
            put(directions, _mm512_sub_ps(next(row.right), next(row.left)));
            put(rises, _mm512_sub_ps(next(row.above), next(row.below)));
            put(values, _mm512_mul_ps(weight, next(row.weights)));
            if let Some(grid) = grid {
                let (cos, sin) = (_mm512_set1_ps(grid.cos), _mm512_set1_ps(grid.sin));
                let (middle, y) = (_mm512_set1_ps(MIDDLE), _mm512_set1_ps(row.y));
                let column = _mm512_fmadd_ps(x, cos, _mm512_mul_ps(y, sin));
                let line = _mm512_fmsub_ps(y, cos, _mm512_mul_ps(x, sin));
                put(columns, _mm512_add_ps(column, middle));
                put(lines, _mm512_add_ps(line, middle));
                x = _mm512_add_ps(x, _mm512_set1_ps(LANES as f32));
            }
        }
    }
}

/// Writes the first four of the pixels that are left of a row, or as many as there are, to the even places of a block.
#[inline(always)]
pub(super) fn take_rest(
    row: &Row<'_>,
    left: Range<usize>,
    grid: Option<&PatchGrid>,
    at: usize,
    to: &mut Places,
) {
    let next = |row: &[f32]| at_even_places(&row[left.clone()]);
    put(
        &mut to.directions,
        at,
        minus(next(row.right), next(row.left)),
    );
    put(&mut to.rises, at, minus(next(row.above), next(row.below)));
    put(&mut to.values, at, times(row.weight, next(row.weights)));
    if let Some(grid) = grid {
        let [columns, lines] = grid.places(row.x + left.start as f32, 0.5, row.y);
        put(&mut to.columns, at, columns);
        put(&mut to.lines, at, lines);
    }
}

const NUMBERS: Eight = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

#[cfg(target_arch = "x86_64")]
const SIXTEEN_NUMBERS: [f32; LANES] = [
    0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0,
];

impl PatchGrid {
    /// Columns and lines of eight pixels, of which the first is at an offset `x` and the others follow by `step`.
    #[inline(always)]
    fn places(&self, x: f32, step: f32, y: f32) -> [Eight; 2] {
        let (mut columns, mut lines) = (NUMBERS, NUMBERS);
        for i in 0..BLOCK {
            let x = x + step * NUMBERS[i];
            columns[i] = x.mul_add(self.cos, y * self.sin) + MIDDLE;
            lines[i] = y.mul_add(self.cos, -(x * self.sin)) + MIDDLE;
        }
        [columns, lines]
    }
}

#[inline(always)]
fn put(values: &mut [f32], at: usize, eight: Eight) {
    values[at..at + BLOCK].copy_from_slice(&eight);
}

#[inline(always)]
fn minus(a: Eight, b: Eight) -> Eight {
    let mut out = [0.0; 8];
    for i in 0..8 {
        out[i] = a[i] - b[i];
    }
    out
}

#[inline(always)]
fn times(a: f32, b: Eight) -> Eight {
    let mut out = [0.0; 8];
    for i in 0..8 {
        out[i] = a * b[i];
    }
    out
}

/// The first four of `values`, or as many as there are; zeros else.
#[inline(always)]
fn at_even_places(values: &[f32]) -> Eight {
    let mut eight = [0.0; 8];
    for (i, value) in values.iter().enumerate().take(BLOCK / 2) {
        eight[2 * i] = *value;
    }
    eight
}
