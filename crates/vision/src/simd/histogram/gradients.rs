//! The gradients of the pixels about a keypoint, in blocks of eight.

use super::{MIDDLE, PatchGrid};
use crate::simd::gradient::turns;

/// The pixels about a keypoint, which offsets are counted from.
#[derive(Clone, Copy, Debug)]
pub struct Window<'a> {
    /// Rows of the image, from the one before the first span to the one after the last, all from the
    /// same column on; at least one pixel longer than the spans. Longer ones are read in whole blocks of eight.
    pub rows: &'a [&'a [f32]],
    /// Offset of that column.
    pub left: i32,
    /// Offset of the row of the first span.
    pub top: i32,
    /// What counts of each row.
    pub spans: &'a [Span],
    /// Weights of the offsets from `-radius` on, of rows and of columns: a pixel has the product.
    pub weights: &'a [f32],
    /// See `weights`.
    pub radius: i32,
}

/// Neighbouring pixels of a row.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    /// Offset of the first.
    pub first: i32,
    /// How many.
    pub count: usize,
}

/// Gradients of the pixels of all spans, one span after another; used again and again.
///
/// A span begins at an even place. If its length is odd, a place of weight 0 follows, and where a row ends within a
/// block of eight, what is left of it stands at the even places alone.
#[derive(Clone, Debug, Default)]
pub struct Gradients {
    /// How many blocks of eight there are. What completes the last has weight 0.
    count: usize,
    /// Where the pixels lie in a grid, if there is one.
    columns: Vec<f32>,
    lines: Vec<f32>,
    /// First the differences along x, then the directions in turns.
    directions: Vec<f32>,
    /// Differences along y (upwards).
    rises: Vec<f32>,
    /// First the weights, then the magnitudes times weight.
    values: Vec<f32>,
    /// Of whoever measured them.
    pub(super) bins: Vec<u32>,
}

/// What is known of the pixels, each by its place.
#[derive(Clone, Copy)]
pub(super) struct Measured<'a> {
    /// In cells of the grid, 0 at the centre of the first, if there is a grid.
    pub(super) columns: &'a [Eight],
    pub(super) lines: &'a [Eight],
    /// In turns.
    pub(super) directions: &'a [Eight],
    /// Magnitudes times weight.
    pub(super) values: &'a [Eight],
}

pub(super) type Eight = [f32; BLOCK];

/// Pixels that are measured together.
const BLOCK: usize = 8;

impl Gradients {
    /// What was measured last.
    #[inline(always)]
    pub(super) fn measured(&self) -> Measured<'_> {
        let blocks = |values| blocks(values, self.count);
        Measured {
            columns: blocks(&self.columns),
            lines: blocks(&self.lines),
            directions: blocks(&self.directions),
            values: blocks(&self.values),
        }
    }
}

#[inline(always)]
fn blocks(values: &[f32], count: usize) -> &[Eight] {
    &values.as_chunks().0[..count]
}

#[inline(always)]
fn blocks_mut(values: &mut [f32], from: usize, count: usize) -> &mut [Eight] {
    &mut values[from..].as_chunks_mut().0[..count]
}

/// Magnitudes and directions of the central differences, all in one go, in which vectors are full; and where the
/// pixels lie in the grid, if there is one.
#[inline(always)]
pub(super) fn measure(window: &Window<'_>, grid: Option<&PatchGrid>, gradients: &mut Gradients) {
    take_differences(window, grid, gradients);
    let Gradients {
        count,
        directions,
        rises,
        values,
        ..
    } = gradients;
    let directions = &mut directions[..BLOCK * *count];
    for ((direction, &dy), value) in directions.iter_mut().zip(&*rises).zip(values) {
        let dx = *direction;
        *value *= dx.mul_add(dx, dy * dy).sqrt();
        *direction = turns(dy, dx);
    }
}

/// Differences and weights of the pixels, and their places in the grid.
#[inline(always)]
fn take_differences(window: &Window<'_>, grid: Option<&PatchGrid>, gradients: &mut Gradients) {
    let Gradients {
        columns,
        lines,
        directions,
        rises,
        values,
        ..
    } = gradients;
    // The last block of a span is written whole, and the next span over what is not of it; what is left of a row takes
    // one or two blocks.
    let spans = window.spans.iter();
    let most = spans.map(|span| span.count + 2 * BLOCK).sum::<usize>();
    for numbers in [&mut *columns, lines, directions, rises, values] {
        numbers.resize(most.max(numbers.len()), 0.0);
    }
    let mut end = 0;
    for (i, (span, y)) in window.spans.iter().zip(window.top..).enumerate() {
        let count = span.count;
        if count == 0 {
            continue;
        }
        let x = (span.first - window.left) as usize;
        let [above, here, below] = [window.rows[i], window.rows[i + 1], window.rows[i + 2]];
        let (left, right) = (&here[x - 1..], &here[x + 1..]);
        let (above, below) = (&above[x..], &below[x..]);
        let weights = &window.weights[(span.first + window.radius) as usize..];
        let weight = window.weights[(y + window.radius) as usize];
        let room = right.len().min(above.len()).min(below.len());
        let n = count.div_ceil(BLOCK).min(room.min(weights.len()) / BLOCK);
        let rows = [left, right, above, below, weights].map(|row| blocks(row, n));
        let (across, upwards) = (blocks_mut(directions, end, n), blocks_mut(rises, end, n));
        let weighted = blocks_mut(values, end, n);
        let (column, line) = (blocks_mut(columns, end, n), blocks_mut(lines, end, n));
        for b in 0..n {
            let [left, right, above, below, weights] = rows.map(|row| row[b]);
            across[b] = minus(right, left);
            upwards[b] = minus(above, below);
            weighted[b] = times(weight, weights);
            if let Some(grid) = grid {
                let x = span.first + (BLOCK * b) as i32;
                [column[b], line[b]] = grid.places(x as f32, 1.0, y as f32);
            }
        }
        // Of an odd span the next place is none of it; else the next span is written there.
        values[end + count] = 0.0;
        let mut from = BLOCK * n;
        end += from.min(count.next_multiple_of(2));
        while from < count {
            let rest = [right, left, above, below, weights]
                .map(|values| at_even_places(&values[..count], from));
            let [right, left, above, below, weights] = rest;
            put(directions, end, minus(right, left));
            put(rises, end, minus(above, below));
            put(values, end, times(weight, weights));
            if let Some(grid) = grid {
                let x = span.first + from as i32;
                let [column, line] = grid.places(x as f32, 0.5, y as f32);
                put(columns, end, column);
                put(lines, end, line);
            }
            end += BLOCK;
            from += BLOCK / 2;
        }
    }
    values[end..end.next_multiple_of(BLOCK)].fill(0.0);
    gradients.count = end.div_ceil(BLOCK);
}

impl PatchGrid {
    /// Columns and lines of eight pixels, of which the first is at an offset `x` and the others follow by `step`.
    #[inline(always)]
    fn places(&self, x: f32, step: f32, y: f32) -> [Eight; 2] {
        const NUMBERS: Eight = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
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

/// The next four of `values`, or as many as there are; zeros else.
#[inline(always)]
fn at_even_places(values: &[f32], from: usize) -> Eight {
    let mut eight = [0.0; 8];
    for i in 0..4.min(values.len() - from) {
        eight[2 * i] = values[from + i];
    }
    eight
}
