//! Gaussian blur from 8-bit images to 8-bit images.
//!
//! Weights and sums are in single precision, and only the result is rounded. Beyond the border the image is
//! mirrored about its outermost pixel centres (`dcb|abcd|cba`). The rounded results equal those of OpenCV's
//! `sepFilter2D` with the kernel of its `getGaussianKernel`.

use super::GrayImage;
use super::blur::mirror;
use crate::simd::{weigh_along_u8, weigh_both_u8, weigh_rows_u8};

/// Blurs `image` by a Gaussian of standard deviation `sigma` pixels. The kernel is cut off beyond `radius`
/// pixels and normalised.
///
/// # Panics
/// If `sigma` is below 0.001 or not finite.
pub fn gaussian_blur_u8(image: &GrayImage, radius: usize, sigma: f64) -> GrayImage {
    let mut blurred = Vec::new();
    gaussian_blur_u8_inside(image, radius, sigma, 0, &mut blurred);
    GrayImage::from_vec(image.size(), blurred)
}

/// [`gaussian_blur_u8`] of the pixels that are at least `margin` from the border. `blurred` becomes as long as the
/// image; its other pixels mean nothing. So it can be used for one image after the other without being cleared.
///
/// # Panics
/// If `sigma` is below 0.001 or not finite.
pub(crate) fn gaussian_blur_u8_inside(
    image: &GrayImage,
    radius: usize,
    sigma: f64,
    margin: usize,
    blurred: &mut Vec<u8>,
) {
    assert!(
        sigma >= 1e-3 && sigma.is_finite(),
        "a Gaussian of standard deviation {sigma}"
    );
    let half = half_kernel(radius, sigma);
    let (width, height) = (image.width(), image.height());
    blurred.resize(image.size().area(), 0);
    if width <= 2 * margin || height <= 2 * margin {
        return;
    }
    let mut padded = vec![0.0; width + 2 * radius];
    let mut rows = Vec::with_capacity(2 * radius + 1);
    // The columns that are read along rows; mirrored ones stand where there are none.
    let read = margin.saturating_sub(radius)..width.min(width - margin + radius);
    for y in margin..height - margin {
        rows.clear();
        rows.extend(
            (0..=2 * radius)
                .map(|i| image.row(mirror(y as isize + i as isize - radius as isize, height)))
                .map(|row| &row[read.clone()]),
        );
        let out = &mut blurred[y * width..][margin..width - margin];
        let inside = margin..width - margin + 2 * radius;
        if margin >= radius {
            weigh_both_u8(&rows, &half, &mut padded[inside], out);
            continue;
        }
        weigh_rows_u8(&rows, &half, &mut padded[radius..][read.clone()]);
        for i in 1..=radius - margin {
            padded[radius - i] = padded[radius + mirror(-(i as isize), width)];
            let right = mirror((width - 1 + i) as isize, width);
            padded[radius + width - 1 + i] = padded[radius + right];
        }
        weigh_along_u8(&padded[inside], &half, out);
    }
}

/// Weights of half of the normalised kernel, from its middle to one end. That of the middle is halved, since it
/// is added twice.
fn half_kernel(radius: usize, sigma: f64) -> Vec<f32> {
    let weights: Vec<f64> = (0..=radius)
        .map(|x| libm::exp(-((x * x) as f64) / (2.0 * sigma * sigma)))
        .collect();
    let sum = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
    let mut half: Vec<f32> = weights.iter().map(|weight| (weight / sum) as f32).collect();
    half[0] /= 2.0;
    half
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Size;

    #[test]
    fn an_impulse_becomes_the_rounded_kernel() {
        let mut image = GrayImage::filled(Size::new(71, 40), 0);
        image.set(35, 20, 255);
        let blurred = gaussian_blur_u8(&image, 3, 2.0);
        // 255 times the products of exp(-x^2 / 8) / 4.62736.
        let row: Vec<u8> = (31..40).map(|x| blurred.at(x, 20)).collect();
        assert_eq!(row, [0, 4, 7, 11, 12, 11, 7, 4, 0]);
        assert_eq!(blurred.at(32, 17), 1);
        assert_eq!(blurred.data().iter().filter(|&&v| v > 0).count(), 49);
    }

    #[test]
    fn constant_images_stay_constant_at_any_size() {
        for (width, height) in [(0, 0), (0, 3), (1, 1), (2, 1), (1, 40), (7, 3), (33, 35)] {
            for value in [0, 1, 255] {
                let image = GrayImage::filled(Size::new(width, height), value);
                assert_eq!(gaussian_blur_u8(&image, 3, 2.0), image);
            }
        }
    }
}
