//! Bilinear resampling of 8-bit images, exact except for weights that are rounded to 8 bits.
//!
//! Pixel `x` of the output lies at `(x + 1/2) s - 1/2` of the input, where `s` is the ratio of the sizes.
//! Beyond the outermost pixel centres the image continues with their values. Weights are rounded to 256ths and
//! everything else is exact, so the result does not depend on the order of the two passes. The rule is that of
//! OpenCV's `INTER_LINEAR_EXACT`. The image is not smoothed before, so this is meant for ratios near 1, as
//! between the levels of a pyramid.

use super::{GrayImage, Size};
use crate::simd::{Between, BlendColumns, COLUMNS_AT_ONCE, blend_rows};

/// `image` resampled to `size`. An image without pixels gives black.
pub fn resize(image: &GrayImage, size: Size) -> GrayImage {
    let mut resized = GrayImage::filled(size, 0);
    if image.size().area() == 0 {
        return resized;
    }
    let columns = BlendColumns::new(positions(image.width(), size.width));
    // Beyond its end the row may hold anything: it is read with weight 0.
    let mut between = vec![0; image.width() + COLUMNS_AT_ONCE];
    for (y, at) in positions(image.height(), size.height)
        .into_iter()
        .enumerate()
    {
        let first = at.first as usize;
        let second = (first + 1).min(image.height() - 1);
        let row = &mut between[..image.width()];
        blend_rows(image.row(first), image.row(second), at.weight, row);
        columns.apply(&between, resized.row_mut(y));
    }
    resized
}

/// Where each of `count` output pixels lies among `length` input pixels.
fn positions(length: usize, count: usize) -> Vec<Between> {
    let scale = 1.0 / (count as f64 / length as f64);
    (0..count)
        .map(|i| {
            let at = (i as f64 + 0.5) * scale - 0.5;
            if at < 0.0 || at >= (length - 1) as f64 {
                let first = if at < 0.0 { 0 } else { length - 1 };
                return Between {
                    first: first as u32,
                    weight: 0,
                };
            }
            let weight = ((at - at.floor()) * 256.0).round_ties_even();
            Between {
                first: at as u32,
                weight: weight as u16,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_stays_a_ramp() {
        let ramp = GrayImage::from_fn(Size::new(60, 40), |x, y| (3 * x + y) as u8);
        let resized = resize(&ramp, Size::new(50, 50));
        for y in 0..50 {
            for x in 0..50 {
                let at_x = ((x as f64 + 0.5) * 1.2 - 0.5).clamp(0.0, 59.0);
                let at_y = ((y as f64 + 0.5) * 0.8 - 0.5).clamp(0.0, 39.0);
                let expected = 3.0 * at_x + at_y;
                let error = (f64::from(resized.at(x, y)) - expected).abs();
                assert!(error <= 0.51, "{x}, {y}: {error}");
            }
        }
    }

    #[test]
    fn weights_are_rounded_to_256ths() {
        // Output 1 of 3 lies at 4/3 * 1.5 - 0.5 = 1.5, output 0 at 1/6 of the way: 43 of 256.
        let image = GrayImage::from_vec(Size::new(4, 1), vec![0, 255, 100, 201]);
        let resized = resize(&image, Size::new(3, 1));
        assert_eq!(resized.data(), [43, 178, 184]);
    }

    #[test]
    fn any_size_can_be_resampled() {
        for (from, to) in [
            ((0, 0), (3, 2)),
            ((1, 1), (4, 3)),
            ((5, 4), (1, 1)),
            ((3, 9), (0, 7)),
        ] {
            let image = GrayImage::filled(Size::new(from.0, from.1), 200);
            let resized = resize(&image, Size::new(to.0, to.1));
            assert_eq!(resized.size(), Size::new(to.0, to.1));
            let expected = if from == (0, 0) { 0 } else { 200 };
            assert!(resized.data().iter().all(|&v| v == expected));
        }
    }
}
