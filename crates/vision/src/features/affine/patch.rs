//! Patches of ellipses, blurred and sampled as if the image had been warped so that the ellipse is a circle.
//!
//! T. Lindeberg, J. Garding: "Shape-adapted smoothing in estimation of 3-D shape cues from affine deformations of local
//! 2-D brightness structure", Image and Vision Computing 15(6), 415-434, 1997; K. Mikolajczyk, C. Schmid: "Scale &
//! Affine Invariant Interest Point Detectors", International Journal of Computer Vision 60(1), 63-86, 2004, section 3.
//!
//! SIFT looks at a keypoint in a layer whose blur equals its scale. For an ellipse the blur has to be an
//! ellipse of the same shape, half an axis along each axis. No layer of a scale space has such a blur, so it is
//! completed in the patch:
//!
//! 1. Take the first layer of an octave of the image; the blur of each is `sigma` of its pixels. It is the coarsest
//!    one whose blur is not more than the shorter half axis. Where there is no such, it is the finest of all.
//! 2. Sample it (bilinear) along the axes of the ellipse, so that either half axis is [`SCALE`] pixels of the
//!    patch. Where that would skip detail of the layer, sample more densely, by a whole factor.
//! 3. Blur the patch along either axis by what is missing, `sqrt(axis^2 - blur^2)`, and drop the samples in
//!    between.
//!
//! So the patch costs the same whatever its size in the image, and no image is warped. The axes of the patch
//! are those of the ellipse; angles in the patch are measured from them. Beyond its border the image is
//! continued by its outermost pixels.

use nalgebra::Point2;

use super::Ellipse;
use crate::image::{
    FloatImage, GaussianKernel, GrayImage, LayerVisitor, Octave, Reach, RowBuffer, ScaleSpaceShape,
    Size, Strip,
};
use crate::simd::{ROWS_AT_ONCE, Source, sample_line_of_floats, weigh_rows, weigh_symmetric};

/// Pixels of a patch that are half an axis of the ellipse.
pub(in crate::features) const SCALE: f32 = 2.0;
/// Column and row of the pixel in the middle: SIFT's descriptor reaches 21 pixels to each side at this scale, and
/// differences one more.
pub(in crate::features) const MIDDLE: usize = 22;
/// Pixels of a side.
const SIDE: usize = 2 * MIDDLE + 1;
/// Samples for a pixel of the patch along an axis are no more than this.
const MAX_SAMPLES: f32 = 64.0;
/// What bilinear interpolation adds to the square of the blur, in squared pixels: the mean of `t (1 - t)` over all
/// places between two pixels.
const INTERPOLATION: f32 = 1.0 / 6.0;

/// The first layer of each octave of a scale space.
pub(in crate::features) struct BlurredOctaves {
    /// Blur of each layer, in its pixels.
    sigma: f32,
    /// How far pixel centres moved when the image was doubled, in pixels of the image.
    shift: f32,
    layers: Vec<(Octave, FloatImage)>,
}

impl BlurredOctaves {
    /// The octaves of the scale space of this `shape`.
    pub(in crate::features) fn new(image: &GrayImage, shape: ScaleSpaceShape) -> Self {
        let mut octaves = Self {
            sigma: shape.sigma as f32,
            shift: if shape.double { 0.25 } else { 0.0 },
            layers: Vec::new(),
        };
        // First layers do not depend on how many others there are.
        let shape = ScaleSpaceShape {
            intervals: 1,
            ..shape
        };
        shape.visit(image, &mut octaves);
        octaves
    }

    /// The coarsest layer whose blur, in pixels of the image, is not more than `blur`, or the finest of all.
    fn blurred_at_most(&self, blur: f32) -> Option<&(Octave, FloatImage)> {
        let fits =
            |(octave, _): &&(Octave, FloatImage)| libm::scalbnf(self.sigma, octave.number) <= blur;
        self.layers.iter().rev().find(fits).or(self.layers.first())
    }
}

impl LayerVisitor for BlurredOctaves {
    fn reach(&self, _: Octave) -> Option<Reach> {
        Some(Reach {
            described: 0,
            all: None,
        })
    }

    fn visit(&mut self, strip: &Strip, y: usize) {
        let (octave, columns) = (strip.octave(), strip.columns());
        if self.layers.last().is_none_or(|(last, _)| *last != octave) {
            self.layers
                .push((octave, FloatImage::filled(octave.size, 0.0)));
        }
        let (_, image) = self.layers.last_mut().expect("pushed above");
        let layer = strip.layer(0);
        let row = &layer.row(y)[columns.start - layer.columns().start..];
        image.row_mut(y)[columns.clone()].copy_from_slice(&row[..columns.len()]);
    }
}

/// The patch of an ellipse; its buffers are used again and again.
pub(in crate::features) struct AffinePatch {
    /// Samples of the layer, row after row.
    samples: Vec<f32>,
    /// Rows of samples after the vertical pass.
    rows: Vec<f32>,
    /// A row of samples after both passes.
    row: Vec<f32>,
    pixels: RowBuffer,
}

/// How one axis of an ellipse is sampled.
struct Axis {
    /// Samples for each pixel of the patch.
    samples: usize,
    /// Distance of samples, in pixels of the layer.
    step: f32,
    /// Blur that is missing.
    kernel: GaussianKernel,
}

impl Axis {
    /// Half an axis of this `length` in a layer of blur `sigma`, both in pixels of the layer.
    fn new(length: f32, sigma: f32) -> Self {
        let pixel = length / SCALE;
        // At a distance of its own blur a layer is sampled without loss.
        let samples = (pixel / sigma).ceil().clamp(1.0, MAX_SAMPLES);
        let squared = (sigma * sigma + INTERPOLATION) / (length * length);
        let missing = samples * SCALE * (1.0 - squared).max(0.0).sqrt();
        let kernel = GaussianKernel::with_radius(
            f64::from(missing).max(0.1),
            (3.0 * missing).ceil() as usize,
        );
        Self {
            samples: samples as usize,
            step: pixel / samples,
            kernel,
        }
    }

    /// Samples before the middle of the patch.
    fn before(&self) -> usize {
        MIDDLE * self.samples + self.kernel.radius()
    }

    /// All samples.
    fn count(&self) -> usize {
        2 * self.before() + 1
    }
}

impl Default for AffinePatch {
    fn default() -> Self {
        Self {
            samples: Vec::new(),
            rows: Vec::new(),
            row: Vec::new(),
            pixels: RowBuffer::whole(Size::new(SIDE, SIDE)),
        }
    }
}

impl AffinePatch {
    /// The patch of an `ellipse` about `at`, in pixels of the image: its half axes are [`SCALE`] pixels, the shorter along
    /// x, about the pixel in column and row [`MIDDLE`]. `None` if the image has no octave.
    pub(in crate::features) fn take(
        &mut self,
        octaves: &BlurredOctaves,
        at: Point2<f32>,
        ellipse: &Ellipse,
    ) -> Option<&RowBuffer> {
        let (octave, image) = octaves.blurred_at_most(ellipse.axes[0])?;
        let spacing = libm::scalbnf(1.0, octave.number);
        let axes = ellipse
            .axes
            .map(|axis| Axis::new(axis / spacing, octaves.sigma));
        let centre = [at.x, at.y].map(|v| (v + octaves.shift) / spacing);
        self.sample(image, centre, ellipse.direction, &axes);
        self.blur(&axes);
        Some(&self.pixels)
    }

    fn sample(
        &mut self,
        image: &FloatImage,
        centre: [f32; 2],
        direction: [f32; 2],
        axes: &[Axis; 2],
    ) {
        let source = Source {
            data: image.data(),
            width: image.width(),
            height: image.height(),
        };
        let [across, down] = axes;
        let right = direction.map(|v| v * across.step);
        let below = [-direction[1] * down.step, direction[0] * down.step];
        let columns = across.count();
        self.samples.resize(columns * down.count(), 0.0);
        for (y, row) in self.samples.chunks_exact_mut(columns).enumerate() {
            let (x, y) = (across.before() as f32, y as f32 - down.before() as f32);
            let start = [0, 1].map(|i| centre[i] + y * below[i] - x * right[i]);
            sample_line_of_floats(source, start, right, row);
        }
    }

    fn blur(&mut self, [across, down]: &[Axis; 2]) {
        let columns = across.count();
        let rows: Vec<&[f32]> = self.samples.chunks_exact(columns).collect();
        let taps = down.kernel.taps();
        self.rows.resize(ROWS_AT_ONCE * columns, 0.0);
        self.row.resize(columns - 2 * across.kernel.radius(), 0.0);
        self.pixels.restart();
        for first in (0..SIDE).step_by(ROWS_AT_ONCE) {
            let count = ROWS_AT_ONCE.min(SIDE - first);
            let mut blurred: Vec<&mut [f32]> =
                self.rows.chunks_exact_mut(columns).take(count).collect();
            if down.samples == 1 {
                weigh_rows(&rows[first..][..taps.len() + count - 1], taps, &mut blurred);
            } else {
                for (y, blurred) in (first..).zip(&mut blurred) {
                    let rows = &rows[y * down.samples..][..taps.len()];
                    weigh_rows(rows, taps, &mut [&mut **blurred]);
                }
            }
            for (blurred, pixels) in blurred.iter().zip(self.pixels.append(ROWS_AT_ONCE)) {
                weigh_symmetric(blurred, across.kernel.taps(), &mut self.row);
                let kept = self.row.iter().step_by(across.samples);
                for (pixel, value) in pixels.iter_mut().zip(kept) {
                    *pixel = *value;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::SHAPE;
    use super::*;

    /// A Gaussian blob on grey whose half axes are those of an ellipse, with as much blur as a camera gives.
    fn blob(size: Size, at: Point2<f32>, ellipse: &Ellipse) -> GrayImage {
        let inverse = ellipse.map().try_inverse().expect("half axes");
        GrayImage::from_fn(size, |x, y| {
            let offset = Point2::new(x as f32, y as f32) - at;
            (40.0 + 200.0 * libm::expf(-0.5 * (inverse * offset).norm_squared())) as u8
        })
    }

    #[test]
    fn the_patch_of_a_blob_is_the_same_round_blob_whatever_its_ellipse() {
        let at = Point2::new(80.3, 70.6);
        for (axes, angle) in [
            ([4.0, 4.0], 0.0),
            ([3.0, 6.0], 0.4),
            ([2.5, 10.0], 2.0),
            ([9.0, 10.0], 5.0),
        ] {
            let (sin, cos) = libm::sincosf(angle);
            let ellipse = Ellipse {
                axes,
                direction: [cos, sin],
            };
            let octaves = BlurredOctaves::new(&blob(Size::new(160, 150), at, &ellipse), SHAPE);
            let mut patch = AffinePatch::default();
            let pixels = patch.take(&octaves, at, &ellipse).expect("octaves");
            // Of variance one half axis squared and, by the blur, another: a Gaussian of half the height.
            for (dx, dy) in [(0_i32, 0_i32), (3, 0), (0, -3), (2, 4), (-7, 1)] {
                let squared = (dx * dx + dy * dy) as f32 / (SCALE * SCALE);
                let expected = 40.0 + 100.0 * libm::expf(-0.25 * squared);
                let [x, y] = [dx, dy].map(|d| (MIDDLE as i32 + d) as usize);
                let value = pixels.row(y)[x];
                assert!(
                    (value - expected).abs() < 3.0,
                    "{axes:?}: {value} for {expected}"
                );
            }
        }
    }

    #[test]
    fn octaves_are_those_of_the_scale_space() {
        let image = GrayImage::from_fn(Size::new(90, 70), |x, y| ((x * x + 3 * y * x) % 251) as u8);
        let octaves = BlurredOctaves::new(&image, SHAPE);
        assert_eq!(
            octaves
                .layers
                .iter()
                .map(|(octave, _)| *octave)
                .collect::<Vec<_>>(),
            SHAPE.octaves(image.size())
        );
        // What a layer of the finer octave would be, blurred twice as far and halved.
        let finer = &octaves.layers[0].1;
        let blurred = crate::image::gaussian_blur(finer, 1.6 * 3.0_f64.sqrt());
        for (x, y) in [(0, 0), (40, 30), (89, 69)] {
            let [coarse, expected] = [octaves.layers[1].1.at(x, y), blurred.at(2 * x, 2 * y)];
            assert!((coarse - expected).abs() < 1e-3, "{coarse} for {expected}");
        }
    }

    #[test]
    fn patches_beyond_every_border_and_of_any_size_are_taken() {
        let image = GrayImage::filled(Size::new(30, 20), 7);
        let octaves = BlurredOctaves::new(&image, SHAPE);
        let mut patch = AffinePatch::default();
        for (x, y, axes) in [
            (-50.0, 3.0, [0.01, 0.02]),
            (1e6, -1e6, [1.0, 6.0]),
            (15.0, 10.0, [300.0, 4000.0]),
        ] {
            let ellipse = Ellipse {
                axes,
                direction: [0.6, -0.8],
            };
            let pixels = patch
                .take(&octaves, Point2::new(x, y), &ellipse)
                .expect("octaves");
            let grey = |y: usize| pixels.row(y).iter().all(|v| (v - 7.0).abs() < 1e-3);
            assert!((0..SIDE).all(grey));
        }
        let empty = BlurredOctaves::new(&GrayImage::filled(Size::new(3, 9), 7), SHAPE);
        let circle = Ellipse::circle(2.0);
        assert!(patch.take(&empty, Point2::origin(), &circle).is_none());
    }
}
