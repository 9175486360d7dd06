//! A smoothed piece of an image, which is sampled at any place.
//!
//! *How it works.* Pixels are copied as far as samples may reach, smoothed by a Gaussian filter of 0.6 times the distance
//! of samples, so that samples far apart do not miss what lies between them, and interpolated bilinearly.

use nalgebra::Point2;

use crate::image::{Border, GaussianKernel, GrayImage};
use crate::simd::{ROWS_AT_ONCE, rows_together, weigh_rows, weigh_symmetric};

/// Standard deviation of the filter, in distances of samples.
const SMOOTHING: f64 = 0.6;

/// Where the filter is cut, in standard deviations.
const CUT: f64 = 2.5;

/// How the image continues for the filter.
const BORDER: Border = Border::Mirror;

/// A smoothed piece of an image, of at least 2 x 2 pixels.
pub(super) struct Piece {
    /// Row by row, each followed by some values that are no pixels.
    pub(super) pixels: Vec<f32>,
    /// Values of a row.
    pub(super) stride: usize,
    width: usize,
    height: usize,
    /// Place of the first pixel in the image.
    first: [f64; 2],
}

impl Piece {
    /// The pixels within `reach` of a place, in pixels and in both directions, as far as the image has them, smoothed for
    /// samples that are so many pixels `apart`; `None` where there are none.
    pub(super) fn about(
        image: &GrayImage,
        at: Point2<f64>,
        reach: f64,
        apart: f64,
    ) -> Option<Self> {
        let sigma = SMOOTHING * apart;
        let kernel = GaussianKernel::with_radius(sigma, (CUT * sigma).ceil() as usize);
        let range = |at: f64, length: usize| {
            let first = (at - reach).floor().max(0.0);
            let last = ((at + reach).floor() + 1.0).min(length as f64 - 1.0);
            (at.is_finite() && first < last).then(|| first as usize..last as usize + 1)
        };
        let (columns, rows) = (range(at.x, image.width())?, range(at.y, image.height())?);
        let (width, height) = (columns.len(), rows.len());
        // What the sums need beside the piece. Rows are whole vectors.
        let beside = kernel.radius();
        let stride = width.next_multiple_of(8);
        let wide = (stride + 2 * beside).next_multiple_of(16);
        let (left, top) = (
            columns.start as isize - beside as isize,
            rows.start as isize - beside as isize,
        );
        let inside = left.max(0) as usize..image.width().min(columns.end + beside);
        let skipped = (-left).max(0) as usize;
        let mut source = vec![0.0; wide * (height + 2 * beside)];
        for (y, line) in (top..).zip(source.chunks_exact_mut(wide)) {
            let row = &image.row(BORDER.index(y, image.height()))[inside.clone()];
            for (value, &pixel) in line[skipped..].iter_mut().zip(row) {
                *value = f32::from(pixel);
            }
            BORDER.fill_ends(&mut line[..width + 2 * beside], left, image.width());
        }
        let source: Vec<&[f32]> = source.chunks_exact(wide).collect();
        let mut between = vec![0.0; wide * ROWS_AT_ONCE];
        let mut pixels = vec![0.0; stride * height];
        let together = rows_together();
        for (number, smoothed) in pixels.chunks_mut(stride * together).enumerate() {
            let count = smoothed.len() / stride;
            let rows = &source[number * together..][..count + 2 * beside];
            let mut lines: Vec<&mut [f32]> = between.chunks_exact_mut(wide).take(count).collect();
            weigh_rows(rows, kernel.taps(), &mut lines);
            for (line, smoothed) in lines.iter().zip(smoothed.chunks_exact_mut(stride)) {
                weigh_symmetric(&line[..stride + 2 * beside], kernel.taps(), smoothed);
            }
        }
        Some(Self {
            pixels,
            stride,
            width,
            height,
            first: [columns.start as f64, rows.start as f64],
        })
    }

    /// A place of the image, in pixels of the piece.
    pub(super) fn inside(&self, at: Point2<f64>) -> [f32; 2] {
        [(at.x - self.first[0]) as f32, (at.y - self.first[1]) as f32]
    }

    /// Whether this place of the piece lies between its pixels.
    pub(super) fn has(&self, [x, y]: [f32; 2]) -> bool {
        let within = |v: f32, length: usize| v >= 0.0 && v < (length - 1) as f32;
        within(x, self.width) && within(y, self.height)
    }
}
