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
