//! Orientation, and the 64 values that describe a patch (M-SURF, section 2.4).

use core::f32::consts::TAU;

use crate::image::FloatImage;
use crate::simd::{AROUND, longest_sum_of_windows, sum_gradients};

/// Values of a descriptor.
pub(super) const LENGTH: usize = 64;
/// Radius of the neighbourhood that gives the orientation, in scales.
const RADIUS: i32 = 6;
/// Standard deviation of its weights and of those within a cell, in scales.
const DEVIATION: f32 = 2.5;
/// Standard deviation of the weights of cells, in distances of cells.
const CELL_DEVIATION: f32 = 1.5;

/// Derivatives along x and y of the level in which a place is described.
#[derive(Clone, Copy)]
pub(super) struct Gradients<'a> {
    pub(super) dx: &'a FloatImage,
    pub(super) dy: &'a FloatImage,
}

impl Gradients<'_> {
    /// The dominant direction around a place, in `[0, 2 pi)` from x towards y. `step` is its
    /// scale in whole pixels.
    pub(super) fn orientation(&self, at: [f32; 2], step: f32) -> f32 {
        let size = self.dx.size();
        // Pixel and weight of each column, then of each row; none beyond the border.
        let places = [(at[0], size.width), (at[1], size.height)].map(|(at, length)| {
            [
                -6.0, -5.0, -4.0, -3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0_f32,
            ]
            .map(|i| {
                let pixel = (at + i * step).round_ties_even();
                let inside = pixel >= 0.0 && pixel < length as f32;
                let weight = gaussian(pixel - at, DEVIATION * step);
                inside.then_some((pixel as usize, weight))
            })
        });
        let mut gradients = [[0.0; AROUND]; 2];
        let mut count = 0;
        let steps = || -RADIUS..=RADIUS;
        for (i, column) in steps().zip(places[0]) {
            for (j, row) in steps().zip(places[1]) {
                if i * i + j * j >= RADIUS * RADIUS {
                    continue;
                }
                if let (Some((x, across)), Some((y, down))) = (column, row) {
                    gradients[0][count] = across * down * self.dx.at(x, y);
                    gradients[1][count] = across * down * self.dy.at(x, y);
                }
                count += 1;
            }
        }
        let angle = longest_sum_of_windows(&gradients[0], &gradients[1]) * TAU;
        if angle < TAU { angle } else { 0.0 }
    }

    /// The unit vector that describes the patch of 24 steps about a place, turned by `angle`.
    pub(super) fn describe(&self, at: [f32; 2], step: f32, angle: f32) -> [f32; LENGTH] {
        let (sin, cos) = libm::sincosf(angle);
        // The weights of a cell are centred on its sixth sample of nine.
        let weights = std::array::from_fn(|i| gaussian(i as f32 - 5.0, DEVIATION));
        let cells = sum_gradients(
            [self.dx, self.dy].map(FloatImage::data),
            self.dx.width(),
            at,
            [cos, sin],
            step,
            &weights,
        );
        let weight = |i: usize| gaussian(i as f32 - 1.5, CELL_DEVIATION);
        let mut values = [0.0; LENGTH];
        for (i, value) in values.iter_mut().enumerate() {
            let cell = i / 4;
            *value = cells[cell][i % 4] * (weight(cell / 4) * weight(cell % 4));
        }
        let squared: f32 = values.iter().map(|v| v * v).sum();
        let scale = if squared > 0.0 {
            1.0 / squared.sqrt()
        } else {
            0.0
        };
        values.map(|value| value * scale)
    }
}

fn gaussian(distance: f32, deviation: f32) -> f32 {
    libm::expf(-distance * distance / (2.0 * deviation * deviation))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Size;

    #[test]
    fn a_ramp_has_its_direction_and_all_gradients_along_it() {
        let size = Size::new(100, 90);
        let gradients = Gradients {
            dx: &FloatImage::filled(size, -2.0),
            dy: &FloatImage::filled(size, 1.0),
        };
        for at in [[50.0, 45.0], [0.0, 2.3]] {
            let angle = gradients.orientation(at, 2.0);
            assert!((angle - 2.677_945).abs() < 2e-4, "{angle}");
            let values = gradients.describe(at, 2.0, angle);
            assert!((values.iter().map(|v| v * v).sum::<f32>() - 1.0).abs() < 1e-5);
            for cell in values.as_chunks::<4>().0 {
                let [across, along, across_abs, along_abs] = *cell;
                assert!(across.abs() < 1e-4 && across_abs < 1e-4);
                assert!(along > 0.05 && (along - along_abs).abs() < 1e-5);
            }
        }
    }

    #[test]
    fn without_gradients_everything_is_zero() {
        let flat = FloatImage::filled(Size::new(30, 30), 0.0);
        let gradients = Gradients {
            dx: &flat,
            dy: &flat,
        };
        assert_eq!(gradients.orientation([10.0, 10.0], 3.0), 0.0);
        assert_eq!(gradients.describe([10.0, 10.0], 3.0, 1.0), [0.0; LENGTH]);
    }
}
