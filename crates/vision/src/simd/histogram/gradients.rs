//! The gradients of the pixels about a keypoint, in blocks of eight.

use crate::simd::gradient::turns;

/// The pixels about a keypoint, which offsets are counted from.
#[derive(Clone, Copy, Debug)]
pub struct Window<'a> {
    /// Rows of the image, from the one before the first span to the one after the last, all from the
    /// same column on.
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

/// Gradients of the pixels of all spans, in blocks of eight; used again and again.
#[derive(Clone, Debug, Default)]
pub struct Gradients {
    pub(super) blocks: Vec<Block>,
    /// First the differences along x, then the directions in turns.
    pub(super) directions: Vec<Eight>,
    /// Differences along y (upwards).
    rises: Vec<Eight>,
    /// First the weights, then the magnitudes times weight.
    pub(super) values: Vec<Eight>,
    /// Of whoever measured them.
    pub(super) bins: Vec<u32>,
}

/// Where eight pixels lie.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    /// Offset of the first.
    pub(super) x: f32,
    pub(super) y: f32,
    /// From one to the next: 1. What is left of a row stands at the even places of blocks, where this is a
    /// half; the others are no pixels and have weight 0.
    pub(super) step: f32,
}

pub(super) type Eight = [f32; 8];

/// Magnitudes and directions of the central differences: all in one go, in which vectors are full.
#[inline(always)]
pub(super) fn measure(window: &Window<'_>, gradients: &mut Gradients) {
    let Gradients {
        blocks,
        directions,
        rises,
        values,
        ..
    } = gradients;
    let mut count = 0;
    for span in window.spans {
        count += span.count / 8 + (span.count % 8).div_ceil(4);
    }
    blocks.clear();
    blocks.reserve(count);
    for eights in [&mut *directions, &mut *rises, &mut *values] {
        eights.resize(count.max(eights.len()), [0.0; 8]);
    }
    let (directions, rises) = (&mut directions[..count], &mut rises[..count]);
    let values = &mut values[..count];
    for (i, (span, y)) in window.spans.iter().zip(window.top..).enumerate() {
        let count = span.count;
        if count == 0 {
            continue;
        }
        let x = (span.first - window.left) as usize;
        let [above, here, below] = [window.rows[i], window.rows[i + 1], window.rows[i + 2]];
        let (left, right) = (&here[x - 1..][..count], &here[x + 1..][..count]);
        let (above, below) = (&above[x..][..count], &below[x..][..count]);
        let weights = &window.weights[(span.first + window.radius) as usize..][..count];
        let weight = window.weights[(y + window.radius) as usize];
        let first = Block {
            x: span.first as f32,
            y: y as f32,
            step: 1.0,
        };
        let mut from = 0;
        while from + 8 <= count {
            let block = blocks.len();
            directions[block] = minus(eight(right, from), eight(left, from));
            rises[block] = minus(eight(above, from), eight(below, from));
            values[block] = times(weight, eight(weights, from));
            blocks.push(Block {
                x: first.x + from as f32,
                ..first
            });
            from += 8;
        }
        while from < count {
            let block = blocks.len();
            directions[block] = minus(at_even_places(right, from), at_even_places(left, from));
            rises[block] = minus(at_even_places(above, from), at_even_places(below, from));
            values[block] = times(weight, at_even_places(weights, from));
            blocks.push(Block {
                x: first.x + from as f32,
                step: 0.5,
                ..first
            });
            from += 4;
        }
    }
    let (directions, rises) = (directions.as_flattened_mut(), rises.as_flattened());
    let all = directions
        .iter_mut()
        .zip(rises)
        .zip(values.as_flattened_mut());
    for ((direction, &dy), value) in all {
        let dx = *direction;
        *value *= dx.mul_add(dx, dy * dy).sqrt();
        *direction = turns(dy, dx);
    }
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

#[inline(always)]
fn eight(values: &[f32], from: usize) -> Eight {
    *values[from..].first_chunk().expect("a whole block")
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
