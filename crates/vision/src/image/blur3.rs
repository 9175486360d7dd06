//! Gaussian blur of 3 x 3 pixels in fixed point.
//!
//! The weights are 256ths that sum to 256, and the image is mirrored about its outermost pixel
//! centres. The results are those of OpenCV's `GaussianBlur` on 8-bit images with a kernel of 3.

use super::GrayImage;
use super::blur::mirror;
use crate::simd::blur3_row;

/// `image` blurred by a Gaussian of standard deviation `sigma` pixels, cut off beyond the nearest
/// pixels.
///
/// # Panics
/// If `sigma` is not positive and finite.
pub fn gaussian_blur_3x3(image: &GrayImage, sigma: f64) -> GrayImage {
    assert!(
        sigma > 0.0 && sigma.is_finite(),
        "a Gaussian of standard deviation {sigma}"
    );
    let outer = libm::exp(-1.0 / (2.0 * sigma * sigma));
    let side = libm::rint(256.0 * outer / (1.0 + 2.0 * outer)) as u16;
    let (width, height) = (image.width(), image.height());
    let mut blurred = GrayImage::filled(image.size(), 0);
    let mut sums = vec![0; width + 2];
    for y in 0..height {
        let row = |offset: isize| image.row(mirror(y as isize + offset, height));
        blur3_row(
            [row(-1), row(0), row(1)],
            side,
            &mut sums,
            blurred.row_mut(y),
        );
    }
    blurred
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Size;

    #[test]
    fn pixels_are_those_of_opencv() {
        let image = GrayImage::from_fn(Size::new(5, 3), |x, y| (53 * x + 91 * y + x * x * y) as u8);
        // cv2.GaussianBlur(image, (3, 3), 2)
        let expected = [
            [93, 112, 115, 112, 80],
            [126, 119, 116, 115, 107],
            [159, 149, 121, 92, 61],
        ];
        let blurred = gaussian_blur_3x3(&image, 2.0);
        assert_eq!(blurred.data(), expected.as_flattened());
    }

    #[test]
    fn constant_images_stay_constant_at_any_size() {
        for (width, height) in [(0, 0), (0, 3), (1, 1), (2, 1), (1, 40), (35, 2), (67, 5)] {
            for value in [0, 1, 255] {
                let image = GrayImage::filled(Size::new(width, height), value);
                assert_eq!(gaussian_blur_3x3(&image, 2.0), image);
            }
        }
    }
}
