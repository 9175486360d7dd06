//! Sums of derivatives over a turned square (sections 4.2 and 4.3).

use super::SCALE;
use crate::features::Keypoint;
use crate::image::{GrayImage, Size};
use crate::simd::{
    PATCH_SIDE, PackedWindow, Pixels, Shares, WINDOW_SIDE, halve_rows_u8, pack_window,
    sum_patch_gradients, turned_patch,
};

/// Standard deviation of the weights of derivatives, in scales.
const DEVIATION: f32 = 3.3;
/// Most samples along a side of the turned square; larger ones are read from a halved image.
const MAX_SAMPLES: usize = 88;
const _: () = assert!(MAX_SAMPLES <= WINDOW_SIDE);

/// Describes the keypoints of one image.
pub(super) struct Describer<'a> {
    image: &'a GrayImage,
    /// The image halved once, twice, ... as far as needed.
    halved: Vec<GrayImage>,
    window: PackedWindow,
    weights: [f32; 24],
    /// For each number of samples.
    shares: Vec<Option<Shares>>,
}

impl<'a> Describer<'a> {
    pub(super) fn new(image: &'a GrayImage) -> Self {
        let middle = (PATCH_SIDE - 2) as f32 / 2.0;
        let weights = std::array::from_fn(|i| {
            let d = i as f32 - middle;
            libm::expf(-d * d / (2.0 * DEVIATION * DEVIATION))
        });
        Self {
            image,
            halved: Vec::new(),
            window: PackedWindow::new(),
            weights,
            shares: vec![None; MAX_SAMPLES + 1],
        }
    }

    /// Appends the descriptor of a keypoint that has an angle.
    pub(super) fn describe(&mut self, keypoint: &Keypoint, extended: bool, values: &mut Vec<f32>) {
        let side = (PATCH_SIDE as f32 * (keypoint.size * SCALE)) as usize;
        let mut level = 0;
        while side >> level > MAX_SAMPLES {
            level += 1;
        }
        while self.halved.len() < level {
            let last = self.halved.last().unwrap_or(self.image);
            self.halved.push(halve(last));
        }
        let image = match level.checked_sub(1) {
            Some(index) => &self.halved[index],
            None => self.image,
        };
        let samples = (side >> level).max(PATCH_SIDE);
        let shares = self.shares[samples].get_or_insert_with(|| shares(samples));

        // In pixels of the level.
        let pixels = (1 << level) as f32;
        let step = side as f32 / (samples as f32 * pixels);
        let centre = [keypoint.at.x, keypoint.at.y].map(|v| (v + 0.5) / pixels - 0.5);
        let (sin, cos) = libm::sincosf(keypoint.angle.unwrap_or(0.0));
        let axis = [cos * step, sin * step];
        let half = (samples - 1) as f32 * 0.5;
        let start = [
            centre[0] - half * (axis[0] - axis[1]),
            centre[1] - half * (axis[1] + axis[0]),
        ];
        let reach = half * (axis[0].abs() + axis[1].abs());
        let first = centre.map(|v| (v - reach).floor() as i32 - 1);
        let length = (2.0 * reach) as usize + 4;
        let pixels = Pixels {
            data: image.data(),
            width: image.width(),
        };
        pack_window(pixels, first, [length, length], &mut self.window);
        let start = [start[0] - first[0] as f32, start[1] - first[1] as f32];
        let patch = turned_patch(&self.window, start, axis, shares);
        let cells = sum_patch_gradients(&patch, &self.weights);
        let from = values.len();
        for [negative, rest] in cells {
            if extended {
                values.extend([rest[0], rest[2], negative[0], negative[2]]);
                values.extend([rest[1], rest[3], negative[1], negative[3]]);
            } else {
                values.extend(std::array::from_fn::<f32, 4, _>(|i| negative[i] + rest[i]));
            }
        }
        let values = &mut values[from..];
        let squared: f32 = values.iter().map(|v| v * v).sum();
        let scale = 1.0 / (squared.sqrt() + f32::EPSILON);
        for value in values {
            *value *= scale;
        }
    }
}

/// Half the image in each direction.
fn halve(image: &GrayImage) -> GrayImage {
    let size = Size::new((image.width() / 2).max(1), (image.height() / 2).max(1));
    let mut half = GrayImage::filled(size, 0);
    for y in 0..size.height {
        let [first, second] = [2 * y, 2 * y + 1].map(|y| image.row(y.min(image.height() - 1)));
        halve_rows_u8(first, second, half.row_mut(y));
    }
    half
}

/// How `samples` samples are shared out to the cells along one side of the patch.
fn shares(samples: usize) -> Shares {
    let length = samples as f64 / PATCH_SIDE as f64;
    let (cell, share) = (0..samples)
        .map(|i| {
            // The end of the cell that the sample begins in, in whole numbers.
            let cell = i * PATCH_SIDE / samples;
            let end = (cell + 1) as f64 * length;
            let here = (end - i as f64).min(1.0) / length;
            let here = if (end - i as f64) > 1.0 - 1e-9 {
                1.0 / length
            } else {
                here
            };
            (cell as u8, [here as f32, (1.0 / length - here) as f32])
        })
        .unzip();
    Shares { cell, share }
}
