//! Gradients around a keypoint, row by row, with Gaussian weights.

use std::ops::RangeInclusive;

use crate::image::RowBuffer;
use crate::simd::{PatchRow, polar_gradients};

/// Rows are lengthened to whole blocks of this many pixels where the image allows; the pixels
/// beyond the patch have weight 0.
const BLOCK: i32 = 8;

/// The square of `2 radius + 1` pixels about a pixel; its buffers are used again and again.
#[derive(Default)]
pub(super) struct Patch {
    radius: i32,
    /// Weight of offset `i - radius`.
    weights: Vec<f32>,
    magnitudes: Vec<f32>,
    directions: Vec<f32>,
}

impl Patch {
    /// Sets the size, and the weight at distance d to `exp(exponent * d^2)`. The weight of a pixel
    /// is the product of those of its row and its column.
    pub(super) fn reset(&mut self, radius: i32, exponent: f32) {
        self.radius = radius;
        let side = 2 * radius as usize + 1;
        let half: Vec<f32> = (0..=radius)
            .map(|i| libm::expf((i * i) as f32 * exponent))
            .collect();
        self.weights.clear();
        self.weights.extend(half[1..].iter().rev().chain(&half));
        self.weights.resize(side + BLOCK as usize, 0.0);
        self.magnitudes.resize(side + BLOCK as usize, 0.0);
        self.directions.resize(side + BLOCK as usize, 0.0);
    }

    /// Calls `each` with the gradients of each row about pixel (`x`, `y`), from the first to the
    /// last of the `columns` wanted of the row at that offset. Pixels on the border of the image
    /// have no gradient.
    pub(super) fn for_each_row(
        &mut self,
        layer: &RowBuffer,
        [x, y]: [i32; 2],
        columns: impl Fn(i32) -> RangeInclusive<i32>,
        mut each: impl FnMut(&PatchRow<'_>),
    ) {
        let (right, bottom) = (
            layer.size().width as i32 - 2,
            layer.size().height as i32 - 2,
        );
        for dy in (-self.radius).max(1 - y)..=self.radius.min(bottom - y) {
            let wanted = columns(dy);
            let first = (*wanted.start()).max(-self.radius).max(1 - x);
            let last = (*wanted.end()).min(self.radius).min(right - x);
            if last < first {
                continue;
            }
            let whole_blocks = (last - first + BLOCK) / BLOCK * BLOCK;
            let count = whole_blocks.min(right - x - first + 1) as usize;
            let row = (y + dy) as usize;
            let column = (x + first) as usize - layer.columns().start;
            let (magnitudes, directions) =
                (&mut self.magnitudes[..count], &mut self.directions[..count]);
            polar_gradients(
                &layer.row(row - 1)[column..][..count],
                &layer.row(row)[column - 1..][..count + 2],
                &layer.row(row + 1)[column..][..count],
                magnitudes,
                directions,
            );
            each(&PatchRow {
                x: first as f32,
                y: dy as f32,
                weight: self.weights[(dy + self.radius) as usize],
                weights: &self.weights[(first + self.radius) as usize..][..count],
                magnitudes,
                directions,
            });
        }
    }
}
