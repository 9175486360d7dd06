//! Integral images: the sum over any upright rectangle from four values.
//!
//! P. Viola, M. Jones: "Rapid object detection using a boosted cascade of simple features", CVPR
//! 2001, section 2.1.

use super::GrayImage;
use crate::simd::integrate_row;

/// For each corner between pixels, the sum of all pixels above and to the left of it.
///
/// Sums are modulo 2^32. The sum over a rectangle of less than 2^24 pixels is exact nevertheless.
#[derive(Clone, Debug)]
pub struct IntegralImage {
    stride: usize,
    sums: Vec<u32>,
}

impl IntegralImage {
    /// The integral image of `image`.
    pub fn new(image: &GrayImage) -> Self {
        let stride = image.width() + 1;
        let mut sums = vec![0; stride * (image.height() + 1)];
        for y in 0..image.height() {
            let (above, below) = sums.split_at_mut((y + 1) * stride);
            integrate_row(image.row(y), &above[y * stride..], &mut below[..stride]);
        }
        Self { stride, sums }
    }

    /// All sums, row after row.
    pub(crate) fn sums(&self) -> &[u32] {
        &self.sums
    }

    /// Number of values in a row of [`IntegralImage::sums`].
    pub(crate) fn stride(&self) -> usize {
        self.stride
    }

    /// Sums of the pixels above row `y` and to the left of each column. There is one value more than there are
    /// columns.
    #[inline]
    pub fn row(&self, y: usize) -> &[u32] {
        &self.sums[y * self.stride..][..self.stride]
    }

    /// Sum of the pixels in columns `0..x` and rows `0..y`, modulo 2^32.
    #[inline]
    pub fn at(&self, x: usize, y: usize) -> u32 {
        debug_assert!(x < self.stride, "column {x} of {}", self.stride);
        self.sums[y * self.stride + x]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Size;

    #[test]
    fn rectangles_are_sums_of_pixels() {
        let image = GrayImage::from_fn(Size::new(7, 5), |x, y| (31 * x + 57 * y) as u8);
        let integral = IntegralImage::new(&image);
        for (x0, x1, y0, y1) in [(0, 7, 0, 5), (2, 3, 1, 5), (4, 4, 0, 5), (1, 6, 2, 3)] {
            let expected: u32 = (y0..y1)
                .flat_map(|y| image.row(y)[x0..x1].iter().map(|&v| u32::from(v)))
                .sum();
            let [a, b] = [integral.at(x1, y1), integral.at(x0, y0)];
            let found = a
                .wrapping_add(b)
                .wrapping_sub(integral.at(x0, y1) + integral.at(x1, y0));
            assert_eq!(found, expected);
        }
        assert_eq!(
            IntegralImage::new(&GrayImage::filled(Size::new(0, 0), 0)).at(0, 0),
            0
        );
    }
}
