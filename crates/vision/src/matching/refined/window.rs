//! A smoothed piece of an image, which is sampled at any place.
//!
//! *How it works.* Pixels are copied as far as samples may reach, smoothed by a Gaussian filter of 0.6 times the distance
//! of samples, so that samples far apart do not miss what lies between them, and interpolated bilinearly.

use nalgebra::Point2;

use crate::image::{Border, GaussianKernel, GrayImage};

/// Samples of a window's side.
pub(super) const SIDE: usize = 15;

/// Distance of the outermost samples from the middle, in samples.
pub(super) const REACH: usize = SIDE / 2;

/// Standard deviation of the filter, in distances of samples.
const SMOOTHING: f64 = 0.6;

/// Where the filter is cut, in standard deviations.
const CUT: f64 = 2.5;

/// How the image continues for the filter.
const BORDER: Border = Border::Mirror;

/// A smoothed piece of an image.
pub(super) struct Piece {
    /// Row by row.
    pixels: Vec<f32>,
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
            // Not NaN either.
            (first < last).then(|| first as usize..last as usize + 1)
        };
        let (columns, rows) = (range(at.x, image.width())?, range(at.y, image.height())?);
        let (width, height) = (columns.len(), rows.len());
        // The columns that the sums along rows need.
        let beside = kernel.radius() as isize;
        let wide = columns.start as isize - beside..columns.end as isize + beside;
        let wide: Vec<usize> = wide.map(|x| BORDER.index(x, image.width())).collect();
        let mut line = vec![0.0_f32; wide.len()];
        let mut pixels = vec![0.0; width * height];
        for (y, smoothed) in rows.clone().zip(pixels.chunks_exact_mut(width)) {
            line.fill(0.0);
            for (tap, y) in kernel.taps().iter().zip(y as isize - beside..) {
                let row = image.row(BORDER.index(y, image.height()));
                for (sum, &x) in line.iter_mut().zip(&wide) {
                    *sum += tap * f32::from(row[x]);
                }
            }
            for (k, tap) in kernel.taps().iter().enumerate() {
                for (sum, value) in smoothed.iter_mut().zip(&line[k..]) {
                    *sum += tap * value;
                }
            }
        }
        Some(Self {
            pixels,
            width,
            height,
            first: [columns.start as f64, rows.start as f64],
        })
    }

    /// A place of the image, in pixels of the piece.
    pub(super) fn inside(&self, at: Point2<f64>) -> [f32; 2] {
        [(at.x - self.first[0]) as f32, (at.y - self.first[1]) as f32]
    }

    /// Whether there is a sample at this place of the piece.
    pub(super) fn has(&self, [x, y]: [f32; 2]) -> bool {
        let within = |v: f32, length: usize| v >= 0.0 && v < (length - 1) as f32;
        within(x, self.width) && within(y, self.height)
    }

    /// The value at a place of the piece that it [`has`](Self::has).
    #[inline]
    pub(super) fn sample(&self, [x, y]: [f32; 2]) -> f32 {
        let (column, row) = (x as usize, y as usize);
        let (right, down) = (x - column as f32, y - row as f32);
        let pixels = &self.pixels[row * self.width + column..];
        let (above, below) = (&pixels[..2], &pixels[self.width..][..2]);
        let above = above[0] + right * (above[1] - above[0]);
        let below = below[0] + right * (below[1] - below[0]);
        above + down * (below - above)
    }
}
