//! Images as plain row-major pixels, and operations on whole images: blur, gradients, pyramids.
//!
//! Coordinates everywhere: x to the right, y down, the centre of the first pixel at (0, 0).

mod blur;
mod blur8;
mod blur_at;
pub(crate) mod diffusion;
pub(crate) mod hessian;
mod integral;
mod resize;
mod rows;
mod scale_space;
mod shrink;
mod shrink8;

use std::fmt;

pub(crate) use blur::{Border, RowBlur, gaussian_blur_within};
pub use blur::{GaussianKernel, gaussian_blur};
pub use blur8::gaussian_blur_u8;
pub(crate) use blur8::gaussian_blur_u8_inside;
pub use integral::IntegralImage;
pub use resize::resize;
pub use rows::RowBuffer;
pub(crate) use scale_space::columns_of_strips;
pub use scale_space::{LayerVisitor, Octave, Reach, ScaleSpaceShape, Strip};
pub(crate) use shrink::shrink;
pub use shrink8::shrink_u8;

/// Width and height of an image, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Size {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
}

impl Size {
    /// A size of `width` x `height` pixels.
    pub const fn new(width: usize, height: usize) -> Self {
        Self { width, height }
    }

    /// Number of pixels; the largest number where it is more.
    pub const fn area(self) -> usize {
        self.width.saturating_mul(self.height)
    }
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// An image with one value of type `T` per pixel, rows stored one after the other without gaps.
#[derive(Clone, Debug, PartialEq)]
pub struct Image<T> {
    size: Size,
    data: Vec<T>,
}

/// An 8-bit grey image, the input of every extractor.
pub type GrayImage = Image<u8>;
/// A single-precision image, for intermediate results.
pub type FloatImage = Image<f32>;

impl<T> Image<T> {
    /// An image of `size` over `data` in row-major order.
    ///
    /// # Panics
    /// If `data` does not hold exactly `size.area()` values.
    pub fn from_vec(size: Size, data: Vec<T>) -> Self {
        assert_eq!(
            data.len(),
            size.area(),
            "an image of {size} needs {} values",
            size.area()
        );
        Self { size, data }
    }

    /// The image whose pixel at (x, y) is `pixel(x, y)`.
    pub fn from_fn(size: Size, mut pixel: impl FnMut(usize, usize) -> T) -> Self {
        let mut data = Vec::with_capacity(size.area());
        for y in 0..size.height {
            data.extend((0..size.width).map(|x| pixel(x, y)));
        }
        Self { size, data }
    }

    /// Width and height.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Number of columns.
    pub fn width(&self) -> usize {
        self.size.width
    }

    /// Number of rows.
    pub fn height(&self) -> usize {
        self.size.height
    }

    /// All pixels, row after row.
    pub fn data(&self) -> &[T] {
        &self.data
    }

    /// All pixels, row after row, to be written.
    pub fn data_mut(&mut self) -> &mut [T] {
        &mut self.data
    }

    /// Row `y`, from left to right.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn row(&self, y: usize) -> &[T] {
        &self.data[y * self.size.width..][..self.size.width]
    }

    /// Row `y`, to be written.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn row_mut(&mut self, y: usize) -> &mut [T] {
        &mut self.data[y * self.size.width..][..self.size.width]
    }

    /// The same image with `f` applied to each pixel.
    pub fn map<U>(&self, f: impl FnMut(&T) -> U) -> Image<U> {
        Image {
            size: self.size,
            data: self.data.iter().map(f).collect(),
        }
    }
}

impl<T: Copy> Image<T> {
    /// An image of `size` with every pixel equal to `value`.
    pub fn filled(size: Size, value: T) -> Self {
        Self {
            size,
            data: vec![value; size.area()],
        }
    }

    /// The pixel in column `x` and row `y`.
    ///
    /// # Panics
    /// If there is no such row. If there is no such column it panics with debug assertions; without them this is a pixel
    /// of a later row, if there is one.
    #[inline]
    pub fn at(&self, x: usize, y: usize) -> T {
        debug_assert!(x < self.size.width, "column {x} of {}", self.size);
        self.data[y * self.size.width + x]
    }

    /// Writes the pixel in column `x` and row `y`.
    ///
    /// # Panics
    /// As [`Self::at`] does.
    #[inline]
    pub fn set(&mut self, x: usize, y: usize, value: T) {
        debug_assert!(x < self.size.width, "column {x} of {}", self.size);
        self.data[y * self.size.width + x] = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_row_major() {
        let image = Image::from_fn(Size::new(3, 2), |x, y| 10 * y + x);
        assert_eq!(image.data(), [0, 1, 2, 10, 11, 12]);
        assert_eq!(image.at(2, 1), 12);
        assert_eq!(image.row(1), [10, 11, 12]);
    }
}
