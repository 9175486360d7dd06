//! SURF: blobs found and described by sums over boxes.
//!
//! H. Bay, A. Ess, T. Tuytelaars, L. Van Gool: "Speeded-Up Robust Features (SURF)", Computer Vision
//! and Image Understanding 110(3), 2008.
//!
//! # How it works
//! 1. Second derivatives of Gaussians are approximated by two to four boxes each, whose sums take
//!    a few values of an integral image at any size (section 3.1, figure 2). The smallest filter,
//!    9 x 9, stands for a Gaussian of standard deviation 1.2.
//! 2. Each octave is a series of filters that grow by 6 times its step, `2^octave` pixels; the
//!    image keeps its size (section 3.3, figure 4).
//! 3. Keypoints: maxima of `Dxx Dyy - (0.9 Dxy)^2` (eq. 3) above a threshold among their 26
//!    neighbours in place and scale, refined by a quadratic fit (section 3.4).
//! 4. Orientation: Haar wavelets of side 4s in a circle of radius 6s, weighted by a Gaussian; the
//!    longest sum within a window of 60 degrees (section 4.1, figure 10).
//! 5. Descriptor: derivatives at 20 x 20 places of a turned square of side 20s, weighted by a
//!    Gaussian; for each of 4 x 4 cells their sums and those of their absolute values (section
//!    4.2, figure 12), normalised to unit length. SURF-128 sums them apart by the sign of the
//!    other derivative (section 4.3).
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | - | [`SurfParams::threshold`] | 100 | OpenCV |
//! | - | [`SurfParams::octaves`] | 4 | OpenCV; figure 8 |
//! | - | [`SurfParams::layers`] | 3 | OpenCV: 5 filters, 3 of which have neighbours |
//! | - | [`SurfParams::extended`] | no | OpenCV |
//! | U-SURF | [`SurfParams::upright`] | no | section 4 |
//! | w | - | 0.9 | eq. 4 |
//!
//! # Choices that the paper leaves open
//! As OpenCV 3.4's `SURF_create`: filters of 9 pixels in the first octave already at half the
//! paper's steps (places 1, 2, 4, 8 pixels apart, sizes 9 + 6 i times that), sizes rounded to whole
//! pixels, windows that move by 5 degrees, Gaussians of 2.5s for the orientation and 3.3s for the
//! descriptor, and derivatives between neighbouring means over s x s pixels of the turned square
//! instead of wavelets of the integral image, which are not turned.
//!
//! # Differences from OpenCV
//! The turned square of a keypoint of more than 31 pixels is read from an image halved as often as
//! needed, so that the cost of a descriptor does not grow with its size; that moves descriptors by 3
//! to 5 % of their norm (median), all others by 0.05 %.
//! Keypoints are in the order of octaves and rows instead of strength. Upright keypoints have angle
//! 0 instead of 270 degrees.

mod blobs;
mod descriptor;
mod orientation;

use nalgebra::Point2;

use super::{
    DescriptorKind, Descriptors, Detections, Detector, Extractor, Features, FloatRows, Keypoint,
    Unshared, memory_of,
};
use crate::image::{GrayImage, IntegralImage, Size};
use crate::params::ParamError;
use blobs::{Blob, find_blobs};
use descriptor::Describer;
use orientation::Orientation;

/// Bytes for each pixel of the image, measured: the integral image and an octave.
const BYTES_PER_PIXEL: usize = 7;

/// Standard deviation of the Gaussian that a filter of side 1 stands for: 1.2 for side 9.
const SCALE: f32 = 1.2 / 9.0;

/// Parameters of [`Surf`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SurfParams {
    /// Least determinant of the Hessian, for grey values of 0 to 255; at least 0.
    pub threshold: f32,
    /// Number of octaves, 1 to 6.
    pub octaves: usize,
    /// Layers of an octave in which keypoints are found, 1 to 8.
    pub layers: usize,
    /// Whether descriptors have 128 values instead of 64.
    pub extended: bool,
    /// Whether all keypoints keep angle 0.
    pub upright: bool,
}

impl Default for SurfParams {
    fn default() -> Self {
        Self {
            threshold: 100.0,
            octaves: 4,
            layers: 3,
            extended: false,
            upright: false,
        }
    }
}

/// The SURF detector and descriptor. The size of a keypoint is the side of its filter, 7.5 times
/// its scale s.
#[derive(Clone, Debug)]
pub struct Surf {
    params: SurfParams,
}

impl Surf {
    /// An extractor with the given parameters.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn new(params: SurfParams) -> Result<Self, ParamError> {
        let SurfParams {
            threshold,
            octaves,
            layers,
            ..
        } = params;
        ParamError::unless(
            threshold >= 0.0 && threshold.is_finite(),
            "threshold",
            threshold,
            "at least 0",
        )?;
        ParamError::unless((1..=6).contains(&octaves), "octaves", octaves, "1 to 6")?;
        ParamError::unless((1..=8).contains(&layers), "layers", layers, "1 to 8")?;
        Ok(Self { params })
    }

    /// Keypoints, oriented as they will be described.
    fn keypoints(&self, integral: &IntegralImage, image: &GrayImage) -> Vec<Keypoint> {
        let blobs = find_blobs(integral, image.size(), &self.params);
        let orientation = Orientation::new(integral, image.size());
        let oriented = |blob: &Blob| {
            let angle = if self.params.upright {
                Some(0.0)
            } else {
                orientation.of(blob)
            };
            angle.map(|angle| Keypoint {
                at: Point2::from(blob.at),
                size: blob.size,
                angle: Some(angle),
                response: blob.response,
                octave: blob.octave,
            })
        };
        blobs.iter().filter_map(oriented).collect()
    }
}

impl Detector for Surf {
    fn detect(&self, image: &GrayImage) -> Vec<Keypoint> {
        self.keypoints(&IntegralImage::new(image), image)
    }

    fn memory(&self, size: Size) -> usize {
        memory_of(size, BYTES_PER_PIXEL, Extractor::kind(self))
    }
}

impl Extractor for Surf {
    fn kind(&self) -> DescriptorKind {
        let dim = if self.params.extended { 128 } else { 64 };
        DescriptorKind::Float { dim }
    }

    fn extract(&self, image: &GrayImage) -> Features {
        self.extract_sharing(image, &mut Unshared)
    }

    fn extract_sharing(&self, image: &GrayImage, detections: &mut dyn Detections) -> Features {
        let keypoints = detections.recall_or_detect(self, image);
        let mut values = Vec::new();
        let mut describer = Describer::new(image);
        for keypoint in &keypoints {
            describer.describe(keypoint, self.params.extended, &mut values);
        }
        let dim = if self.params.extended { 128 } else { 64 };
        let descriptors = Descriptors::Float(FloatRows::from_vec(dim, values));
        Features::new(image.size(), keypoints, descriptors)
    }

    fn memory(&self, size: Size) -> usize {
        memory_of(size, BYTES_PER_PIXEL, self.kind())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::extractor_tests::{assert_odd_images_are_fine, blobs};
    use crate::image::Size;

    fn surf(params: SurfParams) -> Surf {
        Surf::new(params).expect("within the ranges")
    }

    /// Blocks of 5 x 4 pixels in many shades.
    fn blocks() -> GrayImage {
        GrayImage::from_fn(Size::new(120, 110), |x, y| {
            let (x, y) = (x / 5, y / 4);
            ((37 * x + 101 * y) ^ (13 * x * y)) as u8
        })
    }

    fn values(features: &Features) -> &FloatRows {
        let Descriptors::Float(rows) = &features.descriptors else {
            panic!("SURF describes by real numbers");
        };
        rows
    }

    #[test]
    fn features_are_those_of_opencv() {
        // The two strongest keypoints of cv2.xfeatures2d.SURF_create() of OpenCV 3.4.2 on the same
        // pixels: x, y, size, angle in degrees, response; the first values.
        let expected = [
            (
                [22.102_741, 52.007_687, 15.0, 196.406_92, 36_390.312],
                [
                    -0.010_607, 0.003_481, 0.011_035, 0.003_529, 0.018_949, -0.013_728,
                ],
            ),
            (
                [26.901_823, 39.945_751, 15.0, 3.833_804, 33_855.16],
                [
                    -0.003_535, 0.000_627, 0.003_653, 0.006_503, 0.025_772, -0.028_190,
                ],
            ),
        ];
        let features = surf(SurfParams::default()).extract(&blocks());
        assert_eq!(features.len(), 129);
        let mut order: Vec<usize> = (0..features.len()).collect();
        order.sort_by(|&a, &b| {
            let response = |i: usize| features.keypoints[i].response;
            response(b).total_cmp(&response(a))
        });
        for (&i, (numbers, first)) in order.iter().zip(expected) {
            let k = features.keypoints[i];
            let angle = k.angle.expect("SURF assigns orientations").to_degrees();
            let found = [k.at.x, k.at.y, k.size, angle, k.response];
            for (found, number) in found.iter().zip(numbers) {
                assert!((found / number - 1.0).abs() < 1e-5, "{found}, not {number}");
            }
            for (found, value) in values(&features).row(i).iter().zip(first) {
                assert!((found - value).abs() < 1e-3, "{found}, not {value}");
            }
        }
    }

    #[test]
    fn a_turned_image_has_turned_features() {
        let image = blobs(0.0);
        let side = image.width();
        let turned = GrayImage::from_fn(image.size(), |x, y| image.at(y, side - 1 - x));
        let surf = surf(SurfParams::default());
        let (a, b) = (surf.extract(&image), surf.extract(&turned));
        assert!(a.len() > 100, "{} features", a.len());
        let mut twins = 0;
        for (i, k) in a.keypoints.iter().enumerate() {
            let at = Point2::new((side - 1) as f32 - k.at.y, k.at.x);
            let is_twin = |other: &Keypoint| {
                let angles = [other, k].map(|k| k.angle.expect("SURF assigns orientations"));
                let turn = (angles[0] - angles[1]).to_degrees().rem_euclid(360.0);
                (other.at - at).norm() < 0.1 && other.size == k.size && (turn - 90.0).abs() < 3.0
            };
            if let Some(j) = b.keypoints.iter().position(is_twin) {
                let pairs = values(&a).row(i).iter().zip(values(&b).row(j));
                let squared: f32 = pairs.map(|(a, b)| (a - b) * (a - b)).sum();
                assert!(squared.sqrt() < 0.2, "{k:?}: {squared}");
                twins += 1;
            }
        }
        assert!(
            100 * twins > 80 * a.len(),
            "{twins} of {} have twins",
            a.len()
        );
    }

    /// Where a keypoint is so large that a halved image is read, the same number of samples is too.
    #[test]
    fn a_patch_that_is_enlarged_has_the_same_descriptor() {
        let image = blocks();
        let features = surf(SurfParams::default()).extract(&image);
        let Size { width, height } = image.size();
        for factor in [4, 16] {
            let size = Size::new(factor * width, factor * height);
            let enlarged = GrayImage::from_fn(size, |x, y| image.at(x / factor, y / factor));
            let mut describer = Describer::new(&enlarged);
            for (i, keypoint) in features.keypoints.iter().enumerate() {
                let factor = factor as f32;
                let larger = Keypoint {
                    at: keypoint.at.map(|v| (v + 0.5) * factor - 0.5),
                    size: factor * keypoint.size,
                    ..*keypoint
                };
                let mut found = Vec::new();
                describer.describe(&larger, false, &mut found);
                let pairs = found.iter().zip(values(&features).row(i));
                let squared: f32 = pairs.map(|(a, b)| (a - b) * (a - b)).sum();
                assert!(squared.sqrt() < 0.2, "{keypoint:?} x {factor}: {squared}");
            }
        }
    }

    #[test]
    fn odd_images_are_fine() {
        for (octaves, layers, extended, upright) in [
            (4, 3, false, false),
            (1, 1, true, false),
            (6, 8, false, true),
        ] {
            assert_odd_images_are_fine(&surf(SurfParams {
                threshold: 0.0,
                octaves,
                layers,
                extended,
                upright,
            }));
        }
    }

    #[test]
    fn extended_values_split_the_others_by_sign() {
        let image = blocks();
        let short = surf(SurfParams::default()).extract(&image);
        let extended = SurfParams {
            extended: true,
            ..SurfParams::default()
        };
        let long = surf(extended).extract(&image);
        assert_eq!(short.keypoints, long.keypoints);
        let (short, long) = (values(&short).row(0), values(&long).row(0));
        // Both have length 1, of other sums.
        let sums = |cell: &[f32; 8]| [0, 4, 1, 5].map(|i| cell[i] + cell[i + 2]);
        let merged = long.as_chunks::<8>().0.iter().flat_map(sums);
        let ratios = merged.zip(short).map(|(merged, value)| merged / value);
        let (least, most) = ratios.fold((f32::MAX, f32::MIN), |(a, b), r| (a.min(r), b.max(r)));
        assert!((most - least).abs() < 1e-2 * most, "{least} to {most}");
    }

    #[test]
    fn upright_keypoints_have_angle_zero() {
        let params = SurfParams {
            upright: true,
            ..SurfParams::default()
        };
        let keypoints = surf(params).detect(&blobs(0.0));
        assert!(!keypoints.is_empty() && keypoints.iter().all(|k| k.angle == Some(0.0)));
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        let default = SurfParams::default();
        for params in [
            SurfParams {
                threshold: f32::NAN,
                ..default
            },
            SurfParams {
                octaves: 7,
                ..default
            },
            SurfParams {
                layers: 0,
                ..default
            },
        ] {
            assert!(Surf::new(params).is_err(), "{params:?}");
        }
    }
}
