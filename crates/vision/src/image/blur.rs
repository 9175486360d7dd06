//! Gaussian blur, as two one-dimensional passes.
//!
//! Each output row is a weighted sum of input rows (vertical pass, four output rows at once),
//! then a weighted sum along that row. The kernel reaches four standard deviations to each side;
//! beyond the border the image is mirrored about its outermost pixel centres (`dcb|abcd|cba`).
//! Size of the kernel and border are those of OpenCV's `GaussianBlur` on floats.

use super::{FloatImage, RowBuffer, Size};
use crate::simd::{ROWS_AT_ONCE, weigh_rows, weigh_symmetric};

/// A sampled and normalised Gaussian.
#[derive(Clone, Debug, PartialEq)]
pub struct GaussianKernel {
    taps: Vec<f32>,
}

impl GaussianKernel {
    /// The kernel of standard deviation `sigma` in pixels, of the odd size nearest to
    /// `8 sigma + 1` that is not smaller.
    ///
    /// # Panics
    /// If `sigma` is not positive and finite.
    pub fn new(sigma: f64) -> Self {
        assert!(
            sigma > 0.0 && sigma.is_finite(),
            "a Gaussian of standard deviation {sigma}"
        );
        let radius = ((8.0 * sigma + 1.0).round_ties_even() as i32 | 1) / 2;
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
/// If `sigma` is not positive and finite.
pub fn gaussian_blur(image: &FloatImage, sigma: f64) -> FloatImage {
    let mut blur = RowBlur::new(GaussianKernel::new(sigma), image.width());
    let mut blurred = RowBuffer::whole(image.size());
    while !blurred.is_complete() {
        blur.advance(image.size(), |y| image.row(y), &mut blurred);
    }
    let rows = (0..image.height()).flat_map(|y| blurred.row(y));
    FloatImage::from_vec(image.size(), rows.copied().collect())
}

/// A Gaussian blur that follows an image while its rows are made.
#[derive(Clone, Debug)]
pub(crate) struct RowBlur {
    kernel: GaussianKernel,
    /// Results of the vertical pass with the mirrored border on both sides.
    padded: Vec<f32>,
    padded_width: usize,
}

impl RowBlur {
    pub(crate) fn new(kernel: GaussianKernel, width: usize) -> Self {
        let padded_width = width + 2 * kernel.radius();
        Self {
            padded: vec![0.0; ROWS_AT_ONCE * padded_width],
            padded_width,
            kernel,
        }
    }

    pub(crate) fn radius(&self) -> usize {
        self.kernel.radius()
    }

    /// Rows of the input that must exist before the rows of the output after `made` are made.
    pub(crate) fn needs(&self, made: usize, height: usize) -> usize {
        height.min(made + ROWS_AT_ONCE + self.kernel.radius())
    }

    /// Makes the next rows of `output` from an input of the given `size`.
    pub(crate) fn advance<'a>(
        &mut self,
        size: Size,
        input: impl Fn(usize) -> &'a [f32],
        output: &mut RowBuffer,
    ) {
        let radius = self.kernel.radius();
        let (first, taps) = (output.made(), self.kernel.taps());
        let count = ROWS_AT_ONCE.min(size.height - first);
        let rows: Vec<&[f32]> = (0..taps.len() + count - 1)
            .map(|i| input(mirror((first + i) as isize - radius as isize, size.height)))
            .collect();
        let mut middles: Vec<&mut [f32]> = self
            .padded
            .chunks_exact_mut(self.padded_width)
            .take(count)
            .map(|padded| &mut padded[radius..][..size.width])
            .collect();
        weigh_rows(&rows, taps, &mut middles);
        for (padded, out) in self
            .padded
            .chunks_exact_mut(self.padded_width)
            .zip(output.append(ROWS_AT_ONCE))
        {
            mirror_ends(padded, radius);
            weigh_symmetric(padded, taps, out);
        }
    }
}

/// Fills `radius` pixels at each end with the mirror image of the middle.
fn mirror_ends(padded: &mut [f32], radius: usize) {
    let width = padded.len() - 2 * radius;
    if width == 0 {
        return;
    }
    for i in 1..=radius {
        let (left, right) = (-(i as isize), (width - 1 + i) as isize);
        padded[radius - i] = padded[radius + mirror(left, width)];
        padded[radius + width - 1 + i] = padded[radius + mirror(right, width)];
    }
}

/// The index in `0..length` where `index` falls when the sequence is mirrored about its first and
/// last element, again and again if need be.
pub(super) fn mirror(index: isize, length: usize) -> usize {
    if length == 1 {
        return 0;
    }
    let period = 2 * (length as isize - 1);
    let within = index.rem_euclid(period);
    within.min(period - within) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mirrored_indices() {
        let of_four: Vec<usize> = (-4..8).map(|i| mirror(i, 4)).collect();
        assert_eq!(of_four, [2, 3, 2, 1, 0, 1, 2, 3, 2, 1, 0, 1]);
        assert_eq!((mirror(-3, 1), mirror(5, 1), mirror(-1, 2)), (0, 0, 1));
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
