//! Gradients of an image in a pyramid of resolutions, each smaller than the last by the square root of 2.

use nalgebra::Point2;

use crate::image::{GrayImage, Image, Size, shrink_u8};
use crate::simd::polar_gradients;

/// Levels whose width or height is smaller are not made.
const SMALLEST: usize = 16;
/// Units of [`Gradient::magnitude`] in one grey level of a central difference.
const UNITS: f32 = 128.0;

/// One gradient in polar form, quantised to four bytes per pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Gradient {
    /// Length of the central difference, in 128ths of a grey level.
    pub(super) magnitude: u16,
    /// Direction in 65536ths of a full circle, from the x axis upwards, so that integer differences wrap as
    /// directions do.
    pub(super) direction: u16,
}

/// The levels, from the image itself to the coarsest.
pub(super) struct GradientPyramid {
    size: Size,
    levels: Vec<Image<Gradient>>,
}

impl GradientPyramid {
    /// The pyramid of `image`, at most `levels` deep; none for an image that is too small.
    pub(super) fn new(image: &GrayImage, levels: usize) -> Self {
        let size = image.size();
        let mut pyramid = Self {
            size,
            levels: Vec::new(),
        };
        let mut coarse = None;
        for level in 0..levels {
            let shrunk = level_size(size, level);
            if shrunk.width.min(shrunk.height) < SMALLEST {
                break;
            }
            if level > 0 {
                coarse = Some(shrink_u8(coarse.as_ref().unwrap_or(image), shrunk));
            }
            pyramid
                .levels
                .push(gradients(coarse.as_ref().unwrap_or(image)));
        }
        pyramid
    }

    /// Number of levels.
    pub(super) fn depth(&self) -> usize {
        self.levels.len()
    }

    /// The gradients of a level.
    pub(super) fn level(&self, level: usize) -> &Image<Gradient> {
        &self.levels[level]
    }

    /// Converts a position in the image to pixels of a level.
    pub(super) fn place(&self, at: Point2<f32>, level: usize) -> Point2<f32> {
        let size = self.levels[level].size();
        let x = size.width as f32 / self.size.width as f32;
        let y = size.height as f32 / self.size.height as f32;
        Point2::new((at.x + 0.5) * x - 0.5, (at.y + 0.5) * y - 0.5)
    }
}

/// `size` divided by the square root of 2, `level` times.
fn level_size(size: Size, level: usize) -> Size {
    let shrunk = |length: usize| {
        let length = length >> (level / 2);
        if level.is_multiple_of(2) {
            length
        } else {
            (length as f64 * std::f64::consts::FRAC_1_SQRT_2) as usize
        }
    };
    Size::new(shrunk(size.width), shrunk(size.height))
}

/// Gradients of an image; 0 on its border.
fn gradients(image: &GrayImage) -> Image<Gradient> {
    let (width, height) = (image.width(), image.height());
    let mut gradients = Image::filled(image.size(), Gradient::default());
    let float = |y: usize| image.row(y).iter().map(|&v| f32::from(v));
    let mut rows: [Vec<f32>; 3] = std::array::from_fn(|y| float(y).collect());
    let (mut magnitudes, mut directions) = (vec![0.0; width - 2], vec![0.0; width - 2]);
    for y in 1..height - 1 {
        let [above, here, below] = &rows;
        polar_gradients(
            &above[1..width - 1],
            here,
            &below[1..width - 1],
            &mut magnitudes,
            &mut directions,
        );
        let out = &mut gradients.row_mut(y)[1..width - 1];
        for ((out, magnitude), direction) in out.iter_mut().zip(&magnitudes).zip(&directions) {
            *out = Gradient {
                magnitude: (magnitude * UNITS) as u16,
                direction: wrapped(*direction),
            };
        }
        if y + 2 < height {
            rows.rotate_left(1);
            for (out, value) in rows[2].iter_mut().zip(float(y + 2)) {
                *out = value;
            }
        }
    }
    gradients
}

/// An angle given in full circles, in 65536ths; a full circle is 0.
pub(super) fn wrapped(turns: f32) -> u16 {
    (turns * 65536.0) as u32 as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_has_its_gradient_at_every_level() {
        let image = GrayImage::from_fn(Size::new(120, 80), |x, _| 2 * x as u8);
        let pyramid = GradientPyramid::new(&image, 10);
        assert_eq!(pyramid.depth(), 5);
        for level in 0..pyramid.depth() {
            let scale = 120.0 / pyramid.level(level).width() as f32;
            let gradient = pyramid.level(level).at(7, 7);
            let slope = f32::from(gradient.magnitude) / UNITS / 2.0;
            assert!((slope - 2.0 * scale).abs() <= 1.0, "level {level}: {slope}");
            assert_eq!(gradient.direction, 0);
        }
        assert_eq!(pyramid.level(0).at(0, 7), Gradient::default());
    }

    #[test]
    fn places_keep_the_corners_of_the_image() {
        let pyramid = GradientPyramid::new(&GrayImage::filled(Size::new(101, 67), 9), 4);
        for level in 0..4 {
            let size = pyramid.level(level).size();
            let first = pyramid.place(Point2::new(-0.5, -0.5), level);
            let last = pyramid.place(Point2::new(100.5, 66.5), level);
            assert!((first - Point2::new(-0.5, -0.5)).norm() < 1e-4);
            let expected = Point2::new(size.width as f32 - 0.5, size.height as f32 - 0.5);
            assert!((last - expected).norm() < 1e-3);
        }
    }

    #[test]
    fn small_images_have_no_levels() {
        for (width, height) in [(0, 0), (1, 1), (15, 300)] {
            let image = GrayImage::filled(Size::new(width, height), 9);
            assert_eq!(GradientPyramid::new(&image, 4).depth(), 0);
        }
    }
}
