//! Gradients around a keypoint, with Gaussian weights.

use crate::image::RowBuffer;
use crate::simd::{Gradients, Span, Window};

/// Rows are read in whole blocks of this many pixels where the image allows.
const BLOCK: i32 = 8;

/// Pixels beyond its radius that a patch reads: neighbours, and what completes a block.
pub(super) const BEYOND: usize = BLOCK as usize;

/// The square of `2 radius + 1` pixels about a pixel; its buffers are used again and again.
#[derive(Default)]
pub(super) struct Patch {
    radius: i32,
    /// Weight of offset `i - radius`.
    weights: Vec<f32>,
    /// The first and the last column that is wanted of each row.
    columns: Vec<[i32; 2]>,
    spans: Vec<Span>,
    gradients: Gradients,
}

impl Patch {
    /// Sets the size, and the weight at distance d to `exp(exponent * d^2)`. The weight of a pixel
    /// is the product of those of its row and its column.
    pub(super) fn reset(&mut self, radius: i32, exponent: f32) {
        self.radius = radius;
        self.weights.clear();
        let half = (0..=radius).map(|i| libm::expf(i as f32 * i as f32 * exponent));
        self.weights.extend(half);
        self.weights.reverse();
        self.weights.extend_from_within(..radius as usize);
        self.weights[radius as usize + 1..].reverse();
        let side = 2 * radius as usize + 1;
        self.weights.resize(side + BLOCK as usize, 0.0);
    }

    /// Calls `each` with the pixels about pixel (`x`, `y`): of each row from the first to the last
    /// column that is wanted, as `columns` says of the rows from an offset on. Pixels on the border of the
    /// image have no gradient.
    pub(super) fn look(
        &mut self,
        layer: &RowBuffer,
        [x, y]: [i32; 2],
        columns: impl FnOnce(i32, &mut [[i32; 2]]),
        each: impl FnOnce(&Window<'_>, &mut Gradients),
    ) {
        let size = layer.size();
        let (right, bottom) = (size.width as i32 - 2, size.height as i32 - 2);
        let (top, last_row) = ((-self.radius).max(1 - y), self.radius.min(bottom - y));
        if last_row < top {
            return;
        }
        self.columns.clear();
        self.columns.resize((last_row - top + 1) as usize, [0; 2]);
        columns(top, &mut self.columns);
        self.spans.clear();
        self.spans.extend(self.columns.iter().map(|&[first, last]| {
            let first = first.max(-self.radius).max(1 - x);
            let last = last.min(self.radius).min(right - x);
            if last < first {
                return Span { first, count: 0 };
            }
            let count = (last - first + 1) as usize;
            Span { first, count }
        }));
        let start = layer.columns().start as i32;
        let left = (-self.radius - 1).max(start - x);
        let (first, last) = ((y + top - 1) as usize, (y + last_row + 1) as usize);
        let rows: Vec<&[f32]> = (layer.rows(first..last + 1))
            .map(|row| &row[(x + left - start) as usize..])
            .collect();
        let window = Window {
            rows: &rows,
            left,
            top,
            spans: &self.spans,
            weights: &self.weights,
            radius: self.radius,
        };
        each(&window, &mut self.gradients);
    }
}

/// Gradients as the paper has them, which kernels are compared with.
#[cfg(test)]
pub(super) mod plain {
    use core::f64::consts::TAU;

    use crate::image::{RowBuffer, Size};
    use crate::seed::Seed;

    /// The gradient of a pixel.
    pub(in super::super) struct Gradient {
        /// Where it is from the middle.
        pub(in super::super) offset: [f64; 2],
        /// Its direction upwards from x, in turns from 0 to 1.
        pub(in super::super) turns: f64,
        /// Its magnitude times its weight.
        pub(in super::super) value: f64,
    }

    /// A layer of noise.
    pub(in super::super) fn noise() -> RowBuffer {
        let mut rng = Seed(3).rng();
        let mut layer = RowBuffer::whole(Size::new(60, 50));
        while !layer.is_complete() {
            for row in layer.append(1) {
                row.fill_with(|| 255.0 * rng.uniform() as f32);
            }
        }
        layer
    }

    /// All gradients of a square about a pixel, weighted by a Gaussian; pixels on the border have none.
    pub(in super::super) fn gradients(
        layer: &RowBuffer,
        [x, y]: [i32; 2],
        radius: i32,
        deviation: f64,
    ) -> Vec<Gradient> {
        let Size { width, height } = layer.size();
        let at = |x: i32, y: i32| f64::from(layer.row(y as usize)[x as usize]);
        let gradient = |dx: i32, dy: i32| {
            let (x, y) = (x + dx, y + dy);
            let is_inside = x > 0 && y > 0 && x < width as i32 - 1 && y < height as i32 - 1;
            is_inside.then(|| {
                let (right, up) = (at(x + 1, y) - at(x - 1, y), at(x, y - 1) - at(x, y + 1));
                let squared = f64::from(dx * dx + dy * dy);
                let weight = libm::exp(-squared / (2.0 * deviation * deviation));
                Gradient {
                    offset: [dx, dy].map(f64::from),
                    turns: (libm::atan2(up, right) / TAU).rem_euclid(1.0),
                    value: weight * libm::hypot(right, up),
                }
            })
        };
        let offsets = || -radius..=radius;
        let square = offsets().flat_map(|dy| offsets().map(move |dx| (dx, dy)));
        square.filter_map(|(dx, dy)| gradient(dx, dy)).collect()
    }
}
