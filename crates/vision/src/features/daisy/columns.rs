//! Maps of directions of a few columns of the image, smoothed downwards.
//!
//! Smoothing downwards does not look beyond a column, so that a block of a few columns and some
//! rows goes through all smoothing while it is in the cache.

use std::ops::Range;

use super::{BLOCK, DIRECTIONS};
use crate::image::{FloatImage, GaussianKernel, Size};
use crate::simd::{DaisyRow, ROWS_AT_ONCE, rectified_gradients, weigh_rows};

/// Makes maps of directions and smooths them downwards, block by block.
pub(super) struct Columns<'a> {
    size: Size,
    /// The image with its outermost pixels again around it.
    framed: FloatImage,
    kernels: &'a [GaussianKernel],
    directions: [[f32; DIRECTIONS]; 2],
    /// The maps as they are, and after each kernel.
    levels: Vec<Level>,
}

/// Some rows of a block after the same smoothing. Columns beyond the image hold anything finite.
#[derive(Clone, Default)]
struct Level {
    rows: Range<usize>,
    maps: Vec<DaisyRow>,
}

impl<'a> Columns<'a> {
    /// Maps of `image` with grey levels up to 255, to be smoothed by one kernel after the other.
    pub(super) fn new(image: &FloatImage, kernels: &'a [GaussianKernel]) -> Self {
        let direction = |i: usize| {
            let angle = std::f64::consts::TAU * i as f64 / DIRECTIONS as f64;
            [libm::cos(angle), libm::sin(angle)].map(|v| (v / 255.0) as f32)
        };
        Self {
            size: image.size(),
            framed: frame(image),
            kernels,
            directions: [0, 1].map(|axis| std::array::from_fn(|i| direction(i)[axis])),
            levels: vec![Level::default(); kernels.len() + 1],
        }
    }

    /// Makes the columns from `left` on in these rows, of all levels.
    pub(super) fn make(&mut self, left: usize, rows: Range<usize>) {
        // Each smoothing needs more rows than it makes, so the first makes most.
        let mut reach = 0;
        for (level, kernel) in self.levels[1..].iter_mut().zip(self.kernels).rev() {
            level.rows = grown(&rows, reach, self.size.height);
            reach += kernel.radius();
        }
        self.levels[0].rows = grown(&rows, reach, self.size.height);
        self.gradients(left);
        for (i, kernel) in self.kernels.iter().enumerate() {
            if let [before, after] = &mut self.levels[i..i + 2] {
                smooth(kernel, self.size.height, before, after);
            }
        }
    }

    /// A row and the next of those made last, smoothed by the first `count` kernels.
    pub(super) fn rows(&self, count: usize, row: usize) -> &[DaisyRow; 2] {
        let Level { rows, maps } = &self.levels[count];
        let pair = maps[row - rows.start..].first_chunk();
        pair.expect("rows were made with the next one")
    }

    /// Makes the first level.
    fn gradients(&mut self, left: usize) {
        let count = BLOCK.min(self.size.width - left);
        let Level { rows, maps } = &mut self.levels[0];
        maps.resize(rows.len(), [[0.0; DIRECTIONS]; BLOCK]);
        for (y, maps) in rows.clone().zip(maps) {
            // Row y of the image is row y + 1 of the framed one.
            let around = [y, y + 1, y + 2].map(|y| &self.framed.row(y)[left..left + count + 2]);
            rectified_gradients(around, &self.directions, &mut maps[..count]);
        }
    }
}

/// An image with its outermost pixels again around it.
fn frame(image: &FloatImage) -> FloatImage {
    let Size { width, height } = image.size();
    let mut pixels = Vec::with_capacity((width + 2) * (height + 2));
    for y in 0..height + 2 {
        let row = image.row(y.saturating_sub(1).min(height - 1));
        pixels.push(row[0]);
        pixels.extend_from_slice(row);
        pixels.push(row[width - 1]);
    }
    FloatImage::from_vec(Size::new(width + 2, height + 2), pixels)
}

/// Up to `reach` more rows at each end, as far as the image goes.
fn grown(rows: &Range<usize>, reach: usize, height: usize) -> Range<usize> {
    rows.start.saturating_sub(reach)..(rows.end + reach).min(height)
}

/// Makes the rows of `after` from those of `before`; the image of `height` rows is continued by its
/// outermost ones.
fn smooth(kernel: &GaussianKernel, height: usize, before: &Level, after: &mut Level) {
    let row = |y: usize| {
        let y = y.saturating_sub(kernel.radius()).min(height - 1);
        before.maps[y - before.rows.start].as_flattened()
    };
    let Level { rows, maps } = after;
    let inputs: Vec<&[f32]> = (rows.start..rows.end + 2 * kernel.radius())
        .map(row)
        .collect();
    maps.resize(rows.len(), [[0.0; DIRECTIONS]; BLOCK]);
    let mut outputs: Vec<&mut [f32]> = (maps.iter_mut())
        .map(|row| row.as_flattened_mut())
        .collect();
    for (i, outputs) in outputs.chunks_mut(ROWS_AT_ONCE).enumerate() {
        let count = kernel.taps().len() + outputs.len() - 1;
        weigh_rows(&inputs[ROWS_AT_ONCE * i..][..count], kernel.taps(), outputs);
    }
}
