//! The 128 values that describe a patch (section 6).

use core::f32::consts::{SQRT_2, TAU};

use nalgebra::Point2;

use super::patch::Patch;
use crate::image::{RowBuffer, Size};
use crate::simd::{PatchGrid, PatchSums, grid_columns, normalize_to_bytes, patch_sums};

/// Cells of the grid along a side.
const CELLS: usize = 4;
/// Directions in a cell.
const BINS: usize = 8;
/// Values of a descriptor.
pub(in crate::features) const LENGTH: usize = CELLS * CELLS * BINS;
/// Width of a cell, in scales of the keypoint.
const CELL_WIDTH: f32 = 3.0;
/// No value may exceed this share of the norm before the second normalisation.
const CLIP: f32 = 0.2;
/// What a unit vector is scaled to before its values are rounded and limited to 255.
const NORM: f32 = 512.0;

/// Describes patches; its buffers are used again and again.
#[derive(Default)]
pub(in crate::features) struct PatchDescriber {
    patch: Patch,
}

impl PatchDescriber {
    /// The descriptor of the patch of a keypoint at `at` in pixels of `layer`, with a `scale` in
    /// those pixels and an `angle` in radians from x towards y.
    pub(in crate::features) fn describe(
        &mut self,
        layer: &RowBuffer,
        at: Point2<f32>,
        scale: f32,
        angle: f32,
    ) -> [u8; LENGTH] {
        normalized(&self.sums(layer, at, scale, angle))
    }

    /// The same before it is normalised: sums of differences of grey values over the pixels of the
    /// layer.
    pub(in crate::features) fn sums(
        &mut self,
        layer: &RowBuffer,
        at: Point2<f32>,
        scale: f32,
        angle: f32,
    ) -> PatchSums {
        let cell = CELL_WIDTH * scale;
        let radius = patch_radius(layer.size(), scale) as i32;
        let (sin, cos) = libm::sincosf(angle);
        let grid = PatchGrid {
            cos: cos / cell,
            sin: sin / cell,
            direction: 1.0 - angle / TAU,
        };
        // A Gaussian of half the width of the grid.
        let deviation = 0.5 * CELLS as f32 * cell;
        self.patch.reset(radius, -0.5 / (deviation * deviation));
        let mut sums = [0.0; LENGTH];
        self.patch.look(
            layer,
            [at.x, at.y].map(|v| v.round_ties_even() as i32),
            |top, columns| grid_columns(&grid, top, columns),
            |window, gradients| sums = patch_sums(window, &grid, gradients),
        );
        sums
    }
}

/// Sums as a descriptor: normalised, clipped, normalised again and rounded.
pub(in crate::features) fn normalized(sums: &[f32; LENGTH]) -> [u8; LENGTH] {
    normalize_to_bytes(sums, CLIP, NORM)
}

/// Pixels that a patch reaches to each side about the pixel of a keypoint of this `scale`, in an image
/// of this size.
pub(super) fn patch_radius(size: Size, scale: f32) -> usize {
    // Half a diagonal of the grid and one half cell of interpolation on each side.
    let reach = (CELL_WIDTH * scale * SQRT_2 * (CELLS as f32 + 1.0) * 0.5).round_ties_even();
    reach.min((size.width + size.height) as f32) as usize
}

#[cfg(test)]
mod tests {
    use super::super::patch::plain;
    use super::*;

    /// Section 6: gradients turned with the keypoint, by a Gaussian of half the width of the grid, each shared out to the
    /// nearest cells and directions.
    #[test]
    fn sums_are_those_of_the_turned_grid() {
        let layer = plain::noise();
        for (x, y, scale, angle) in [
            (30.2, 24.6, 1.7, 0.0_f32),
            (29.7, 25.1, 1.3, 0.7),
            (8.0, 41.9, 2.1, 4.0),
        ] {
            let sums = PatchDescriber::default().sums(&layer, Point2::new(x, y), scale, angle);
            let cell = f64::from(CELL_WIDTH * scale);
            let (sin, cos) = libm::sincos(f64::from(angle));
            let pixel = [x, y].map(|v: f32| v.round() as i32);
            let mut expected = [0.0; LENGTH];
            for gradient in plain::gradients(&layer, pixel, 30, 2.0 * cell) {
                let [dx, dy] = gradient.offset;
                let column = (dx * cos + dy * sin) / cell + 1.5;
                let row = (dy * cos - dx * sin) / cell + 1.5;
                // From x towards y is downwards.
                let direction = 8.0 * (gradient.turns + f64::from(angle / TAU));
                for (i, sum) in expected.iter_mut().enumerate() {
                    let [i, j, bin] = [i / 32, i / 8 % 4, i % 8].map(|v| v as f64);
                    let apart = (direction - bin).rem_euclid(8.0);
                    let shares = [row - i, column - j, apart.min(8.0 - apart)];
                    let share = shares.map(|apart| (1.0 - apart.abs()).max(0.0));
                    *sum += gradient.value * share.iter().product::<f64>();
                }
            }
            let most = expected.iter().copied().fold(0.0, f64::max);
            for (found, expected) in sums.iter().zip(expected) {
                let difference = (f64::from(*found) - expected).abs();
                assert!(difference < 1e-3 * most, "{found}, not {expected}");
            }
        }
    }

    /// Section 6.1: no value is more than 0.2 of the norm. Sixteen of 1 and one of 3 have the norm 5.
    #[test]
    fn one_strong_gradient_counts_no_more_than_a_fifth_of_all() {
        let mut sums = [0.0; LENGTH];
        sums[..16].fill(1.0);
        sums[100] = 3.0;
        let bytes = normalized(&sums);
        let each = (512.0 / libm::sqrt(17.0)).round() as u8;
        assert!(
            bytes[..16]
                .iter()
                .chain(&bytes[100..=100])
                .all(|&byte| byte == each)
        );
    }
}
