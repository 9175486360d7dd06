//! The gradients of the pixels about a keypoint, in blocks of eight.

use super::PatchGrid;
#[cfg(target_arch = "x86_64")]
use super::differences::{ALIKE, take_vectors};
use super::differences::{BEYOND, BLOCK, Eight, Places, Row, take_blocks, take_rest};
use crate::simd::gradient::turns;
#[cfg(target_arch = "x86_64")]
use crate::simd::{InstructionSet, sixteen::LANES};

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
    /// First differences and weights; then, in their places, directions in turns and magnitudes times weight.
    places: Places,
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

impl Gradients {
    /// What was measured last.
    #[inline(always)]
    pub(super) fn measured(&self) -> Measured<'_> {
        let blocks = |values| blocks(values, self.count);
        Measured {
            columns: blocks(&self.places.columns),
            lines: blocks(&self.places.lines),
            directions: blocks(&self.places.directions),
            values: blocks(&self.places.values),
        }
    }
}

#[inline(always)]
fn blocks(values: &[f32], count: usize) -> &[Eight] {
    &values.as_chunks().0[..count]
}

/// Magnitudes and directions of the central differences, all in one go, in which vectors are full; and where the
/// pixels lie in the grid, if there is one.
#[inline(always)]
pub(super) fn measure(window: &Window<'_>, grid: Option<&PatchGrid>, gradients: &mut Gradients) {
    take_differences(window, grid, gradients);
    let Places {
        directions,
        rises,
        values,
        ..
    } = &mut gradients.places;
    let directions = &mut directions[..BLOCK * gradients.count];
    for ((direction, &dy), value) in directions.iter_mut().zip(&*rises).zip(values) {
        let dx = *direction;
        *value *= dx.mul_add(dx, dy * dy).sqrt();
        *direction = turns(dy, dx);
    }
}

/// Differences and weights of the pixels, and their places in the grid.
#[inline(always)]
fn take_differences(window: &Window<'_>, grid: Option<&PatchGrid>, gradients: &mut Gradients) {
    #[cfg(target_arch = "x86_64")]
    if InstructionSet::in_use_unless_halved() >= InstructionSet::Avx512 {
        // SAFETY: what is in use was detected on this processor.
        return unsafe { take_differences_avx512(window, grid, gradients) };
    }
    take_differences_by(window, grid, gradients, take_blocks);
}

/// All rows in one function, in which the compiler keeps what they share.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn take_differences_avx512(
    window: &Window<'_>,
    grid: Option<&PatchGrid>,
    gradients: &mut Gradients,
) {
    let longest = window.spans.iter().map(|span| span.count).max();
    let vectors = longest.unwrap_or(0).div_ceil(LANES);
    // As many vectors for each row, since their number could not be predicted if it changed from row to row.
    let vectors = (vectors <= ALIKE).then_some(vectors);
    take_differences_by(
        window,
        grid,
        gradients,
        #[inline(always)]
        |row, blocks, grid, at, to| take_vectors(row, blocks, vectors, grid, at, to),
    );
}

/// As [`take_differences`], where `take` writes the first blocks of a row.
#[inline(always)]
fn take_differences_by(
    window: &Window<'_>,
    grid: Option<&PatchGrid>,
    gradients: &mut Gradients,
    take: impl Fn(&Row<'_>, usize, Option<&PatchGrid>, usize, &mut Places),
) {
    // The last block of a span is written whole, and the next span over what is not of it; what is left of a row takes
    // one or two blocks. Vectors reach beyond as far as those of the longest row.
    let spans = window.spans.iter();
    let most = spans.map(|span| span.count + 2 * BLOCK).sum::<usize>();
    let places = &mut gradients.places;
    places.make_room(most + BEYOND);
    let mut end = 0;
    for (i, (span, y)) in window.spans.iter().zip(window.top..).enumerate() {
        let count = span.count;
        if count == 0 {
            continue;
        }
        let x = (span.first - window.left) as usize;
        let [above, here, below] = [window.rows[i], window.rows[i + 1], window.rows[i + 2]];
        let row = Row {
            left: &here[x - 1..],
            right: &here[x + 1..],
            above: &above[x..],
            below: &below[x..],
            weights: &window.weights[(span.first + window.radius) as usize..],
            weight: window.weights[(y + window.radius) as usize],
            x: span.first as f32,
            y: y as f32,
        };
        let whole = row.whole_blocks().min(count.div_ceil(BLOCK));
        take(&row, whole, grid, end, places);
        // Of an odd span the next place is none of it; else the next span is written there.
        places.values[end + count] = 0.0;
        let mut from = BLOCK * whole;
        end += from.min(count.next_multiple_of(2));
        while from < count {
            take_rest(&row, from..count, grid, end, places);
            end += BLOCK;
            from += BLOCK / 2;
        }
    }
    places.values[end..end.next_multiple_of(BLOCK)].fill(0.0);
    gradients.count = end.div_ceil(BLOCK);
}
