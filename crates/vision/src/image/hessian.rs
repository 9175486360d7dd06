//! All that a detector on a nonlinear scale space computes from one level, in one pass from top to bottom.
//!
//! Four filters run over the image, each some rows behind the one before. So each filter finds its input still
//! in the cache:
//!
//! 1. the image smoothed by a Gaussian of one pixel (5 x 5), of which only a few rows are kept,
//! 2. the conductivities of the smoothed image ([`super::diffusion`]), for the next level,
//! 3. its derivatives along x and y by Scharr's operator, widened to the scale of the level,
//! 4. the determinant of the Hessian, from the derivatives of the derivatives.
//!
//! Beyond the border, the Gaussian replicates the image and the derivatives mirror it.

use super::blur::{Border, GaussianKernel, RowBlur};
use super::{FloatImage, RowBuffer, Size};
use crate::simd::{
    Across, NORM_BINS, NORMS_AT_ONCE, ROWS_AT_ONCE, Scharr, conductivities, count_norms,
    derivatives, determinants, difference_across, find_largest, gradient_norms, rows_together,
    weigh_across,
};

/// Scharr's 3 x 3 operator without normalisation, as it is used to measure the contrast.
const CONTRAST: Scharr = Scharr {
    step: 1,
    side: 3.0,
    middle: 10.0,
};

impl Scharr {
    /// The operator of step `step`, scaled to the derivative per pixel.
    pub(crate) fn widened(step: usize) -> Self {
        let middle = 10.0_f32 / 3.0;
        let side = 1.0 / (2.0 * step as f32 * (middle + 2.0));
        Self {
            step,
            side,
            middle: middle * side,
        }
    }
}

/// Which pixels are left out when the contrast of an image is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Flat {
    /// Those without any gradient.
    NoGradient,
    /// Those in the lowest bin of the histogram.
    LowestBin,
}

/// The contrast: the given share of the gradients of `image`, smoothed by a Gaussian of one pixel, is shorter
/// than this. It is read from a histogram of 300 bins. Pixels on the border do not count.
pub(crate) fn contrast(image: &FloatImage, share: f32, flat: Flat) -> f32 {
    let (width, height) = (image.width(), image.height());
    if width < 3 || height < 3 {
        return DEFAULT_CONTRAST;
    }
    let mut smooth = Smoothed::new(image, true, 3);
    let mut pass = Pass::new(CONTRAST, width);
    let mut norms = FloatImage::filled(Size::new(width, height - 2), 0.0);
    let mut largest = 0.0_f32;
    for y in 1..height - 1 {
        smooth.make(y + 2);
        let across = pass.across([y - 1, y, y + 1].map(|y| smooth.rows.row(y)));
        let norms = norms.row_mut(y - 1);
        gradient_norms(across, CONTRAST, norms);
        largest = largest.max(find_largest(&norms[1..width - 1]));
    }
    if largest == 0.0 {
        return DEFAULT_CONTRAST;
    }
    let scale = match flat {
        Flat::NoGradient => NORM_BINS as f32 / largest,
        Flat::LowestBin => (NORM_BINS - 1) as f32 / largest,
    };
    let mut counts = [[0; NORM_BINS]; NORMS_AT_ONCE];
    let mut without = 0;
    for norms in norms.data().chunks_exact(width) {
        without += count_norms(&norms[1..width - 1], scale, &mut counts);
    }
    let mut histogram: [u32; NORM_BINS] =
        std::array::from_fn(|bin| counts.iter().map(|counts| counts[bin]).sum());
    match flat {
        Flat::NoGradient => histogram[0] -= without,
        Flat::LowestBin => histogram[0] = 0,
    }
    let wanted = (histogram.iter().sum::<u32>() as f32 * share) as u32;
    let mut below = 0;
    for (bin, count) in histogram.iter().enumerate() {
        if bin > 0 && below >= wanted {
            return largest * bin as f32 / NORM_BINS as f32;
        }
        below += count;
    }
    match flat {
        Flat::NoGradient => largest,
        Flat::LowestBin => DEFAULT_CONTRAST,
    }
}

/// Contrast of an image without gradients, in grey values of 0..=1.
const DEFAULT_CONTRAST: f32 = 0.03;

/// What a pass over one level computes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LevelPass {
    /// Whether to smooth the image first.
    pub(crate) smooth: bool,
    /// Step of the derivatives.
    pub(crate) step: usize,
    /// Contrast k, where conductivities are wanted.
    pub(crate) contrast: Option<f32>,
}

/// The results of the pass.
pub(crate) struct LevelRows<'a> {
    /// Conductivities, if wanted.
    pub(crate) conductivity: &'a mut FloatImage,
    /// Derivative along x, per pixel.
    pub(crate) dx: &'a mut FloatImage,
    /// Derivative along y, per pixel.
    pub(crate) dy: &'a mut FloatImage,
    /// Determinant of the Hessian times the fourth power of the step.
    pub(crate) determinant: &'a mut RowBuffer,
}

impl LevelPass {
    /// Passes over `image`; calls `visit` after each row of determinants.
    ///
    /// # Panics
    /// If the sizes differ.
    pub(crate) fn run(
        &self,
        image: &FloatImage,
        out: &mut LevelRows<'_>,
        mut visit: impl FnMut(&RowBuffer),
    ) {
        let (width, height) = (image.width(), image.height());
        if image.size().area() == 0 {
            return;
        }
        let operator = Scharr::widened(self.step);
        let scale = (self.step * self.step * self.step * self.step) as f32;
        let mut smooth = Smoothed::new(image, self.smooth, 2 * self.step + 2);
        let mut contrast = Pass::new(CONTRAST, width);
        let mut first = Pass::new(operator, width);
        let mut second = [Pass::new(operator, width), Pass::new(operator, width)];
        let neighbours = |y: usize, step: usize| {
            [-1, 0, 1].map(|side| Border::Mirror.index(y as isize + side * step as isize, height))
        };
        let mut derived = 0;
        for y in 0..height {
            while derived < height.min(y + self.step + 1) {
                smooth.make(derived + self.step + 1);
                let rows = neighbours(derived, self.step).map(|y| smooth.rows.row(y));
                let across = first.across(rows);
                derivatives(
                    across,
                    operator,
                    out.dx.row_mut(derived),
                    out.dy.row_mut(derived),
                );
                if let Some(k) = self.contrast {
                    let rows = neighbours(derived, 1).map(|y| smooth.rows.row(y));
                    let across = contrast.across(rows);
                    let out = out.conductivity.row_mut(derived);
                    conductivities(across, CONTRAST, 1.0 / (k * k), out);
                }
                derived += 1;
            }
            let rows = neighbours(y, self.step);
            let [of_x, of_y] = &mut second;
            let of_x = of_x.across(rows.map(|y| out.dx.row(y)));
            let [above, _, below] = rows;
            let of_y = of_y.difference(out.dy.row(above), out.dy.row(below));
            for row in out.determinant.append(1) {
                determinants(of_x, of_y, operator, scale, row);
            }
            visit(out.determinant);
        }
    }
}

/// The last rows of the image, smoothed or as they are.
struct Smoothed<'a> {
    image: &'a FloatImage,
    blur: Option<RowBlur>,
    rows: RowBuffer,
}

impl<'a> Smoothed<'a> {
    fn new(image: &'a FloatImage, smooth: bool, keep: usize) -> Self {
        let kernel = GaussianKernel::with_radius(1.0, 2);
        Self {
            blur: smooth.then(|| RowBlur::with_border(kernel, image.width(), Border::Replicate)),
            rows: RowBuffer::new(image.size(), keep + ROWS_AT_ONCE),
            image,
        }
    }

    /// Makes rows until there are `count`, or all.
    fn make(&mut self, count: usize) {
        while self.rows.made() < count.min(self.image.height()) {
            if let Some(blur) = &mut self.blur {
                blur.advance(0, |y| self.image.row(y), &mut self.rows);
            } else {
                let first = self.rows.made();
                for (i, out) in self.rows.append(rows_together()).enumerate() {
                    out.copy_from_slice(self.image.row(first + i));
                }
            }
        }
    }
}

/// The pass of an operator from row to row, with mirrored ends.
struct Pass {
    operator: Scharr,
    mean: Vec<f32>,
    difference: Vec<f32>,
}

impl Pass {
    fn new(operator: Scharr, width: usize) -> Self {
        let padded = vec![0.0; width + 2 * operator.step];
        Self {
            operator,
            mean: padded.clone(),
            difference: padded,
        }
    }

    fn across(&mut self, rows: [&[f32]; 3]) -> Across<'_> {
        let step = self.operator.step;
        let inner = step..self.mean.len() - step;
        weigh_across(
            rows,
            self.operator,
            &mut self.mean[inner.clone()],
            &mut self.difference[inner],
        );
        for padded in [&mut self.mean, &mut self.difference] {
            mirror_ends(padded, step);
        }
        Across {
            mean: &self.mean,
            difference: &self.difference,
        }
    }

    /// Of [`Self::across`] the difference alone.
    fn difference(&mut self, above: &[f32], below: &[f32]) -> &[f32] {
        let step = self.operator.step;
        let inner = step..self.difference.len() - step;
        difference_across(above, below, &mut self.difference[inner]);
        mirror_ends(&mut self.difference, step);
        &self.difference
    }
}

fn mirror_ends(padded: &mut [f32], step: usize) {
    let width = padded.len() - 2 * step;
    Border::Mirror.fill_ends(padded, -(step as isize), width);
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEPS: [usize; 4] = [1, 2, 3, 9];

    fn run(image: &FloatImage, pass: LevelPass) -> [FloatImage; 4] {
        let size = image.size();
        let [mut conductivity, mut dx, mut dy, mut all] =
            std::array::from_fn(|_| FloatImage::filled(size, 0.0));
        let mut determinant = RowBuffer::new(size, 1);
        let mut rows = LevelRows {
            conductivity: &mut conductivity,
            dx: &mut dx,
            dy: &mut dy,
            determinant: &mut determinant,
        };
        pass.run(image, &mut rows, |determinant| {
            let y = determinant.made() - 1;
            all.row_mut(y).copy_from_slice(determinant.row(y));
        });
        [conductivity, dx, dy, all]
    }

    #[test]
    fn derivatives_of_a_quadratic_are_exact_at_every_step() {
        let size = Size::new(70, 50);
        let image = FloatImage::from_fn(size, |x, y| {
            let (x, y) = (x as f32 - 30.0, y as f32 - 20.0);
            0.5 * x * x + 0.25 * y * y + 0.125 * x * y + x
        });
        for step in STEPS {
            let pass = LevelPass {
                smooth: false,
                step,
                contrast: Some(10.0),
            };
            let [conductivity, dx, dy, determinant] = run(&image, pass);
            let scale = (step * step * step * step) as f32;
            for y in 2 * step..50 - 2 * step {
                for x in 2 * step..70 - 2 * step {
                    let (u, v) = (x as f32 - 30.0, y as f32 - 20.0);
                    let gradient = [u + 0.125 * v + 1.0, 0.5 * v + 0.125 * u];
                    assert!((dx.at(x, y) - gradient[0]).abs() < 1e-3);
                    assert!((dy.at(x, y) - gradient[1]).abs() < 1e-3);
                    let expected = scale * (1.0 * 0.5 - 0.125 * 0.125);
                    assert!((determinant.at(x, y) / expected - 1.0).abs() < 1e-2);
                    // Contrast is measured by the sum of 32 differences.
                    let squared = gradient.iter().map(|g| 32.0 * g * 32.0 * g).sum::<f32>();
                    let expected = 1.0 / (1.0 + squared / 100.0);
                    assert!((conductivity.at(x, y) / expected - 1.0).abs() < 1e-2);
                }
            }
        }
    }

    #[test]
    fn any_size_can_be_passed_over() {
        for (width, height) in [(0, 0), (0, 4), (1, 1), (2, 1), (1, 30), (5, 3), (40, 2)] {
            let image = FloatImage::filled(Size::new(width, height), 0.5);
            for (step, smooth) in STEPS.into_iter().zip([true, false, true, false]) {
                let pass = LevelPass {
                    smooth,
                    step,
                    contrast: Some(0.03),
                };
                let [conductivity, dx, dy, determinant] = run(&image, pass);
                let is_flat = |image: &FloatImage| image.data().iter().all(|v| v.abs() < 1e-5);
                assert!(is_flat(&dx) && is_flat(&dy) && is_flat(&determinant));
                assert!(conductivity.data().iter().all(|c| (c - 1.0).abs() < 1e-5));
            }
        }
    }

    #[test]
    fn contrast_is_the_percentile_of_gradients() {
        // The left third is flat; then slopes of 1, 2 ... 60 per pixel, each as often.
        let slope = |x: usize| x.saturating_sub(30) as f32;
        let height = |x: usize| (0..=x).map(slope).sum::<f32>();
        let image = FloatImage::from_fn(Size::new(90, 40), |x, _| height(x));
        let largest = 32.0 * 58.0;
        for flat in [Flat::NoGradient, Flat::LowestBin] {
            let k = contrast(&image, 0.7, flat);
            assert!((k / largest - 0.7).abs() < 0.03, "{}", k / largest);
        }
        for size in [Size::new(2, 50), Size::new(20, 20)] {
            let flat = FloatImage::filled(size, 0.3);
            assert_eq!(contrast(&flat, 0.7, Flat::LowestBin), DEFAULT_CONTRAST);
        }
    }
}
