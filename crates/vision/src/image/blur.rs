//! Gaussian blur, as two one-dimensional passes.
//!
//! Each output row is first a weighted sum of input rows (vertical pass, four or eight output rows at once), then a
//! weighted sum along that row. Unless an algorithm says otherwise, the kernel reaches four standard deviations
//! to each side, and the image is mirrored beyond its border ([`Border`]). Kernel size and border are those of
//! OpenCV's `GaussianBlur` on floats.

use std::ops::Range;

use super::{FloatImage, RowBuffer, Size};
use crate::simd::{ROWS_AT_ONCE, rows_together, weigh_rows, weigh_symmetric};

/// A sampled and normalised Gaussian.
#[derive(Clone, Debug, PartialEq)]
pub struct GaussianKernel {
    taps: Vec<f32>,
}

impl GaussianKernel {
    /// The kernel of standard deviation `sigma` in pixels. Its size is `8 sigma + 1` rounded, or the next number
    /// where that is even, as in OpenCV.
    ///
    /// # Panics
    /// If `sigma` is not between 0.001 and 10,000.
    pub fn new(sigma: f64) -> Self {
        assert!(
            (1e-3..=1e4).contains(&sigma),
            "a Gaussian of standard deviation {sigma}"
        );
        Self::with_radius(
            sigma,
            ((8.0 * sigma + 1.0).round_ties_even() as usize | 1) / 2,
        )
    }

    /// The kernel of standard deviation `sigma` in pixels that reaches `radius` pixels to each side.
    pub(crate) fn with_radius(sigma: f64, radius: usize) -> Self {
        let radius = radius as i32;
        let weights: Vec<f64> = (-radius..=radius)
            .map(|x| libm::exp(-f64::from(x * x) / (2.0 * sigma * sigma)))
            .collect();
        let sum: f64 = weights.iter().sum();
        Self {
            taps: weights.iter().map(|weight| (weight / sum) as f32).collect(),
        }
    }

    /// Weights, from one end to the other.
    pub fn taps(&self) -> &[f32] {
        &self.taps
    }

    /// Pixels that the kernel reaches to each side.
    pub fn radius(&self) -> usize {
        self.taps.len() / 2
    }
}

/// `image` blurred by a Gaussian of standard deviation `sigma` pixels.
///
/// # Panics
/// If `sigma` is not between 0.001 and 10,000.
pub fn gaussian_blur(image: &FloatImage, sigma: f64) -> FloatImage {
    blur_whole(
        image,
        RowBlur::new(GaussianKernel::new(sigma), image.width()),
    )
}

/// Blurs `image` by a Gaussian that reaches `radius` pixels. Beyond its border the image is replicated.
pub(crate) fn gaussian_blur_within(image: &FloatImage, sigma: f64, radius: usize) -> FloatImage {
    let kernel = GaussianKernel::with_radius(sigma, radius);
    blur_whole(
        image,
        RowBlur::with_border(kernel, image.width(), Border::Replicate),
    )
}

fn blur_whole(image: &FloatImage, mut blur: RowBlur) -> FloatImage {
    let mut blurred = RowBuffer::whole(image.size());
    while !blurred.is_complete() {
        blur.advance(0, |y| image.row(y), &mut blurred);
    }
    let mut pixels = Vec::with_capacity(image.size().area());
    for y in 0..image.height() {
        pixels.extend_from_slice(blurred.row(y));
    }
    FloatImage::from_vec(image.size(), pixels)
}

/// How an image continues beyond its border.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Border {
    /// The image mirrored about its outermost pixel centres (`dcb|abcd|cba`).
    Mirror,
    /// The outermost pixels again and again (`aaa|abcd|ddd`).
    Replicate,
}

impl Border {
    /// The pixel of `0..length` that stands at `index`.
    pub(crate) fn index(self, index: isize, length: usize) -> usize {
        match self {
            Self::Mirror => mirror(index, length),
            Self::Replicate => index.clamp(0, length as isize - 1) as usize,
        }
    }

    /// Fills the pixels of a row that lie beyond the border of an image from those within. The first pixel of
    /// `padded` is column `first` of an image of `width` columns.
    pub(crate) fn fill_ends(self, padded: &mut [f32], first: isize, width: usize) {
        if width == 0 {
            return;
        }
        let end = first + padded.len() as isize;
        let reach = (end - width as isize).max(-first);
        if self == Self::Mirror && reach < width as isize {
            // One reflection is enough.
            let start = (-first).max(0) as usize;
            for i in 0..start {
                padded[i] = padded[2 * start - i];
            }
            let last = (width as isize - 1 - first) as usize;
            for i in last + 1..padded.len() {
                padded[i] = padded[2 * last - i];
            }
            return;
        }
        for column in (first..0).chain(width as isize..end) {
            let inside = self.index(column, width) as isize;
            padded[(column - first) as usize] = padded[(inside - first) as usize];
        }
    }
}

/// A Gaussian blur that makes its rows as soon as the rows of its input, an image or a strip of its columns,
/// are there.
#[derive(Clone, Debug)]
pub(crate) struct RowBlur {
    kernel: GaussianKernel,
    border: Border,
    /// Results of the vertical pass with what lies beyond the border.
    padded: RowBuffer,
    /// The column of the image where `padded` starts, a multiple of a cache line.
    first: isize,
}

impl RowBlur {
    /// A blur of complete rows.
    pub(crate) fn new(kernel: GaussianKernel, width: usize) -> Self {
        Self::with_border(kernel, width, Border::Mirror)
    }

    pub(crate) fn with_border(kernel: GaussianKernel, width: usize, border: Border) -> Self {
        Self::of_columns(kernel, &(0..width), border)
    }

    /// A blur whose output is the given `columns` of the image.
    pub(crate) fn of_columns(
        kernel: GaussianKernel,
        columns: &Range<usize>,
        border: Border,
    ) -> Self {
        let radius = kernel.radius();
        let first = (columns.start as isize - radius as isize) & -ALIGNED;
        let width = ((columns.end + radius) as isize - first) as usize;
        Self {
            kernel,
            border,
            padded: RowBuffer::new(Size::new(width, ROWS_AT_ONCE), ROWS_AT_ONCE),
            first,
        }
    }

    /// The number of input rows that must exist before the output rows after `made` can be made.
    pub(crate) fn needs(&self, made: usize, height: usize) -> usize {
        height.min(made + rows_together() + self.kernel.radius())
    }

    /// Makes the next rows of `output`. The rows of the input start at column `start` of the image and hold all
    /// columns that the output depends on.
    pub(crate) fn advance<'a>(
        &mut self,
        start: usize,
        input: impl Fn(usize) -> &'a [f32],
        output: &mut RowBuffer,
    ) {
        let radius = self.kernel.radius();
        let (size, columns) = (output.size(), output.columns());
        let (made, taps) = (output.made(), self.kernel.taps());
        let together = rows_together();
        let count = together.min(size.height - made);
        // The columns where the kernel's support lies, as far as there are any.
        let place = start as isize - self.first;
        let (before, place) = ((-place).max(0) as usize, place.max(0) as usize);
        let rows: Vec<&[f32]> = (0..taps.len() + count - 1)
            .map(|i| (made + i) as isize - radius as isize)
            .map(|y| &input(self.border.index(y, size.height))[before..])
            .collect();
        let end = (size.width.min(columns.end + radius) as isize - self.first) as usize;
        self.padded.restart();
        let mut padded: Vec<&mut [f32]> = self.padded.append(ROWS_AT_ONCE).take(count).collect();
        let mut middles: Vec<&mut [f32]> = padded
            .iter_mut()
            .map(|padded| &mut padded[place..end])
            .collect();
        weigh_rows(&rows, taps, &mut middles);
        let skipped = (columns.start as isize - radius as isize - self.first) as usize;
        for (padded, out) in padded.iter_mut().zip(output.append(together)) {
            self.border.fill_ends(padded, self.first, size.width);
            weigh_symmetric(&padded[skipped..], taps, out);
        }
    }
}

/// Rows of a buffer are well aligned in memory at multiples of this many pixels.
pub(super) const ALIGNED: isize = 16;

/// The index in `0..length` where `index` falls when the sequence is mirrored about its first and
/// last element, again and again if need be.
pub(super) fn mirror(index: isize, length: usize) -> usize {
    if length == 1 {
        return 0;
    }
    let mut index = index.unsigned_abs();
    let period = 2 * (length - 1);
    // One reflection after the other, unless there would be many: divisions are slower.
    if index > 4 * period {
        index %= period;
    }
    while index >= length {
        index = index.abs_diff(period);
    }
    index
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mirrored_indices() {
        let of_four: Vec<usize> = (-4..8).map(|i| mirror(i, 4)).collect();
        assert_eq!(of_four, [2, 3, 2, 1, 0, 1, 2, 3, 2, 1, 0, 1]);
        assert_eq!((mirror(-3, 1), mirror(5, 1), mirror(-1, 2)), (0, 0, 1));
        assert_eq!(
            (
                mirror(-6_000_004, 4),
                mirror(6_000_005, 4),
                mirror(1_000_001, 2)
            ),
            (2, 1, 1)
        );
    }

    #[test]
    fn ends_are_filled_by_the_border() {
        let mut row = [0.0, 0.0, 1.0, 2.0, 3.0, 0.0, 0.0];
        Border::Mirror.fill_ends(&mut row, -2, 3);
        assert_eq!(row, [3.0, 2.0, 1.0, 2.0, 3.0, 2.0, 1.0]);
        Border::Replicate.fill_ends(&mut row, -2, 3);
        assert_eq!(row, [1.0, 1.0, 1.0, 2.0, 3.0, 3.0, 3.0]);
        // A strip that starts in column 2 of 6.
        let mut row = [2.0, 3.0, 4.0, 5.0, 0.0, 0.0];
        Border::Mirror.fill_ends(&mut row, 2, 6);
        assert_eq!(row, [2.0, 3.0, 4.0, 5.0, 4.0, 3.0]);
    }

    #[test]
    fn kernel_has_the_size_and_sum_of_the_rule() {
        for (sigma, size) in [(0.3, 3), (1.249, 11), (1.545, 13), (1.946, 17), (3.09, 27)] {
            let kernel = GaussianKernel::new(sigma);
            assert_eq!(kernel.taps().len(), size, "{sigma}");
            assert!((kernel.taps().iter().sum::<f32>() - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn constant_images_stay_constant_and_any_size_is_blurred() {
        for size in [
            (0, 0),
            (0, 3),
            (3, 0),
            (1, 1),
            (2, 1),
            (1, 40),
            (7, 3),
            (50, 2),
            (35, 37),
        ] {
            let size = Size::new(size.0, size.1);
            let blurred = gaussian_blur(&FloatImage::filled(size, 100.0), 2.0);
            assert_eq!(blurred.size(), size);
            assert!(
                blurred.data().iter().all(|v| (v - 100.0).abs() < 1e-4),
                "{size}"
            );
        }
    }

    #[test]
    fn an_impulse_becomes_the_kernel() {
        let mut image = FloatImage::filled(Size::new(31, 30), 0.0);
        image.set(15, 14, 1.0);
        let blurred = gaussian_blur(&image, 1.6);
        let taps = GaussianKernel::new(1.6).taps;
        let radius = taps.len() / 2;
        for (i, a) in taps.iter().enumerate() {
            for (j, b) in taps.iter().enumerate() {
                let value = blurred.at(15 + i - radius, 14 + j - radius);
                assert!((value - a * b).abs() < 1e-7);
            }
        }
        assert_eq!(blurred.at(0, 0), 0.0);
    }
}
