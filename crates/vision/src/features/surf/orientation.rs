//! The dominant direction of the wavelet responses around a keypoint (section 4.1).

use core::f32::consts::TAU;

use super::SCALE;
use super::blobs::Blob;
use crate::image::{IntegralImage, Size};
use crate::simd::{WAVELETS, longest_sum_of_degrees};

/// Radius of the circle of samples, in scales.
const RADIUS: i32 = 6;
/// Samples across it.
const ACROSS: usize = 2 * RADIUS as usize + 1;
/// Standard deviation of their weights, in scales.
const DEVIATION: f32 = 2.5;

pub(super) struct Orientation<'a> {
    integral: &'a IntegralImage,
    size: Size,
    /// Column and row among the samples, and weight.
    samples: Vec<([usize; 2], f32)>,
}

impl<'a> Orientation<'a> {
    pub(super) fn new(integral: &'a IntegralImage, size: Size) -> Self {
        let mut samples = Vec::with_capacity(WAVELETS);
        for i in -RADIUS..=RADIUS {
            for j in -RADIUS..=RADIUS {
                let squared = i * i + j * j;
                if squared <= RADIUS * RADIUS {
                    let weight = libm::expf(-(squared as f32) / (2.0 * DEVIATION * DEVIATION));
                    samples.push(([i, j].map(|v| (v + RADIUS) as usize), weight));
                }
            }
        }
        Self {
            integral,
            size,
            samples,
        }
    }

    /// The angle of a blob in `[0, 2 pi)`, from x towards y; none if no wavelet fits into the
    /// image.
    pub(super) fn of(&self, blob: &Blob) -> Option<f32> {
        let scale = blob.size * SCALE;
        let half = (2.0 * scale).round_ties_even() as usize;
        let length = 2 * half;
        // Where the wavelets of each column and row begin.
        let starts = |centre: f32, length_of_image: usize| -> [Option<usize>; ACROSS] {
            std::array::from_fn(|i| {
                let offset = (i as i32 - RADIUS) as f32 * scale;
                let start = centre + offset - (length as f32 - 1.0) * 0.5;
                let start = start.round_ties_even();
                let fits = start >= 0.0 && start + (length as f32) <= length_of_image as f32;
                fits.then_some(start as usize)
            })
        };
        let columns = starts(blob.at[0], self.size.width);
        let rows = starts(blob.at[1], self.size.height);
        let mut responses = [[0.0; WAVELETS]; 2];
        let mut count = 0;
        for &([column, row], weight) in &self.samples {
            let (Some(x), Some(y)) = (columns[column], rows[row]) else {
                continue;
            };
            let [dx, dy] = self.wavelets(x, y, half);
            responses[0][count] = weight * dx;
            responses[1][count] = weight * dy;
            count += 1;
        }
        if count == 0 {
            return None;
        }
        let angle = longest_sum_of_degrees(&responses[0], &responses[1]) * TAU;
        Some(if angle < TAU { angle } else { 0.0 })
    }

    /// Right minus left half and lower minus upper half of a square, in means.
    #[inline]
    fn wavelets(&self, x: usize, y: usize, half: usize) -> [f32; 2] {
        let rows = [0, 1, 2].map(|i| &self.integral.row(y + i * half)[x..=x + 2 * half]);
        let [upper, middle, lower] = rows.map(|row| [row[0], row[half], row[2 * half]]);
        let box_sum = |columns: [usize; 2], a: [u32; 3], b: [u32; 3]| {
            let [i, j] = columns;
            (b[j].wrapping_sub(b[i])).wrapping_sub(a[j].wrapping_sub(a[i])) as i32
        };
        let across = box_sum([1, 2], upper, lower) - box_sum([0, 1], upper, lower);
        let down = box_sum([0, 2], middle, lower) - box_sum([0, 2], upper, middle);
        let weight = 1.0 / (2 * half * half) as f32;
        [across as f32 * weight, down as f32 * weight]
    }
}
