//! Maps of directions of a few columns of the image, smoothed downwards.
//!
//! Smoothing downwards does not look beyond a column, so that a block of a few columns and some
//! rows goes through all smoothing while it is in the cache.

use std::ops::Range;

use super::{BLOCK, FIRST_BLUR, MAPS};
use crate::image::{FloatImage, GaussianKernel, GrayImage, Size, gaussian_blur_within};
use crate::simd::{DaisyRow, ROWS_AT_ONCE, rectified_gradients, weigh_rows};

/// What the difference of two pixels two apart counts, for grey levels from 0 to 1.
const SCALE: f32 = 0.5 / 255.0;

/// Makes maps of directions and smooths them downwards, block by block.
pub(super) struct Columns<'a> {
    size: Size,
    /// The image with its outermost pixels again around it, in whole blocks.
    framed: FloatImage,
    kernels: &'a [GaussianKernel],
    directions: &'a [[f32; 2]; 4],
    /// The maps as they are, and after each kernel.
    levels: Vec<Level>,
}

/// Some rows of a block after the same smoothing.
#[derive(Clone, Default)]
struct Level {
    rows: Range<usize>,
    maps: Vec<DaisyRow>,
}

impl<'a> Columns<'a> {
    /// Maps of `image` with some directions, to be smoothed by one kernel after the other.
    pub(super) fn new(
        image: &GrayImage,
        directions: &'a [[f32; 2]; 4],
        kernels: &'a [GaussianKernel],
    ) -> Self {
        Self {
            size: image.size(),
            framed: frame(image),
            kernels,
            directions,
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
        let Level { rows, maps } = &mut self.levels[0];
        maps.resize(rows.len(), [[0.0; BLOCK]; MAPS]);
        for (y, maps) in rows.clone().zip(maps) {
            // Row y of the image is row y + 1 of the framed one.
            let around = [y, y + 1, y + 2].map(|y| {
                let pixels = self.framed.row(y)[left..].first_chunk();
                pixels.expect("the frame holds whole blocks")
            });
            rectified_gradients(around, SCALE, self.directions, maps);
        }
    }
}

/// The blurred image with its outermost pixels again around it, once to the left and so often to
/// the right that it holds whole blocks and one more pixel.
fn frame(image: &GrayImage) -> FloatImage {
    let size = image.size();
    let (sigma, reach) = FIRST_BLUR;
    let pixels = image.data().iter().copied().map(f32::from).collect();
    let blurred = gaussian_blur_within(&FloatImage::from_vec(size, pixels), sigma, reach);
    let framed = Size::new(size.width.next_multiple_of(BLOCK) + 2, size.height + 2);
    let mut pixels = Vec::with_capacity(framed.area());
    for y in 0..framed.height {
        let row = blurred.row(y.saturating_sub(1).min(size.height - 1));
        pixels.push(row[0]);
        pixels.extend_from_slice(row);
        pixels.resize(framed.width * (y + 1), row[size.width - 1]);
    }
    FloatImage::from_vec(framed, pixels)
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
    maps.resize(rows.len(), [[0.0; BLOCK]; MAPS]);
    let mut outputs: Vec<&mut [f32]> = (maps.iter_mut())
        .map(|row| row.as_flattened_mut())
        .collect();
    for (i, outputs) in outputs.chunks_mut(ROWS_AT_ONCE).enumerate() {
        let count = kernel.taps().len() + outputs.len() - 1;
        weigh_rows(&inputs[ROWS_AT_ONCE * i..][..count], kernel.taps(), outputs);
    }
}
