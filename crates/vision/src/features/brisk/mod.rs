//! BRISK: corners in a scale space, described by comparisons on rings of sampling points.
//!
//! S. Leutenegger, M. Chli, R. Y. Siegwart: "BRISK: Binary Robust Invariant Scalable Keypoints",
//! ICCV 2011.
//!
//! # How it works
//! 1. Octaves, each half the size of the one before, and intra-octaves between them, the first at
//!    two thirds of the image (section 3.1).
//! 2. The FAST score of every pixel of each layer. A keypoint scores at least the threshold, at
//!    least as high as its eight neighbours, and not lower than the layers above and below around
//!    the same place; its place and scale are refined by quadratic fits (section 3.1, figure 2).
//! 3. Sixty points on five rings sample the image at that scale, each a mean over an area that
//!    grows with the ring (section 3.2, figure 3).
//! 4. Pairs of points far apart sum to a gradient, whose direction turns the pattern (section
//!    3.2.1, equations 3 to 6); each of the 512 pairs of near points is one bit (section 3.2.2).
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | t | [`BriskParams::threshold`] | 30 | OpenCV |
//! | n | [`BriskParams::octaves`] | 3 | OpenCV; 4 in the paper |
//! | delta_min, delta_max | - | 8.2, 5.85 | OpenCV; 13.67 t and 9.75 t in the paper, for a larger pattern |
//!
//! # Choices that the paper leaves open
//! All as OpenCV's `BRISK_create`: radii of the rings, areas as upright squares instead of Gaussians,
//! scales in 64 steps over a range of 30, angles in 1024 steps, direction weights in 2048ths.
//! OpenCV detects corners by AGAST, which tests what FAST tests.
//!
//! # Differences from OpenCV
//! Of neighbours with equal scores the one whose surroundings score higher is kept; OpenCV knows the
//! scores around it only where it happens to have looked before.

mod layers;
mod pattern;
mod refine;

use nalgebra::Point2;

use super::{BinaryRows, DescriptorKind, Descriptors, Extractor, Features, Keypoint};
use crate::ParamError;
use crate::image::{GrayImage, IntegralImage};
use layers::ScaleLayers;
use pattern::{BITS, Pattern, Sampler};

/// Size of a keypoint at scale 1, in pixels.
const BASIC_SIZE: f32 = 12.0;

/// Parameters of [`Brisk`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct BriskParams {
    /// Least FAST score, in grey levels; above 0.
    pub threshold: u8,
    /// Number of octaves, each with its intra-octave; 1 to 8.
    pub octaves: usize,
}

impl Default for BriskParams {
    fn default() -> Self {
        Self {
            threshold: 30,
            octaves: 3,
        }
    }
}

/// The BRISK detector and descriptor. [`Keypoint::octave`] is the layer: twice the octave, plus one
/// for an intra-octave.
#[derive(Clone, Debug)]
pub struct Brisk {
    params: BriskParams,
    pattern: Pattern,
}

impl Brisk {
    /// An extractor with the given parameters.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn new(params: BriskParams) -> Result<Self, ParamError> {
        let BriskParams { threshold, octaves } = params;
        ParamError::unless(threshold > 0, "threshold", threshold, "1 to 255")?;
        ParamError::unless((1..=8).contains(&octaves), "octaves", octaves, "1 to 8")?;
        Ok(Self {
            params,
            pattern: Pattern::new(),
        })
    }

    /// Keypoints without orientation.
    fn detect(&self, image: &GrayImage) -> Vec<Keypoint> {
        let layers = ScaleLayers::new(image, self.params.octaves);
        let mut keypoints = Vec::new();
        for index in 0..layers.len() {
            for [x, y] in layers.corners(index, self.params.threshold) {
                let Some(found) = layers.refine(index, x, y) else {
                    continue;
                };
                // Above the last layer nothing can be compared, and nothing is asked again.
                let is_last = index + 1 == layers.len();
                if is_last || found.score > f32::from(self.params.threshold) {
                    keypoints.push(Keypoint {
                        at: Point2::new(found.x, found.y),
                        size: BASIC_SIZE * found.scale,
                        angle: None,
                        response: found.score,
                        octave: index as i16,
                    });
                }
            }
        }
        keypoints
    }
}

impl Extractor for Brisk {
    fn kind(&self) -> DescriptorKind {
        DescriptorKind::Binary { bits: BITS }
    }

    fn extract(&self, image: &GrayImage) -> Features {
        let mut keypoints = self.detect(image);
        keypoints.retain(|keypoint| self.pattern.fits(keypoint, image.size()));
        let mut words = Vec::with_capacity(keypoints.len() * BITS / 64);
        if !keypoints.is_empty() {
            let integral = IntegralImage::new(image);
            let sampler = Sampler::new(&self.pattern, image, &integral);
            for keypoint in &mut keypoints {
                words.extend(sampler.describe(keypoint));
            }
        }
        let descriptors = Descriptors::Binary(BinaryRows::from_vec(BITS, words));
        Features::new(image.size(), keypoints, descriptors)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Size;
    use crate::seed::Seed;

    fn brisk() -> Brisk {
        Brisk::new(BriskParams::default()).expect("parameters in their ranges")
    }

    #[test]
    fn images_too_small_or_flat_have_no_features() {
        for (width, height) in [
            (0, 0),
            (0, 70),
            (1, 1),
            (2, 9),
            (6, 500),
            (40, 40),
            (64, 80),
        ] {
            for value in [0, 255] {
                let image = GrayImage::filled(Size::new(width, height), value);
                assert!(brisk().extract(&image).is_empty());
            }
        }
    }

    #[test]
    fn a_blob_is_found_at_its_place_and_scale() {
        for (radius, octave) in [(3.0_f32, 0), (6.0, 2), (12.0, 4)] {
            let image = GrayImage::from_fn(Size::new(201, 190), |x, y| {
                let (x, y) = (x as f32 - 100.0, y as f32 - 95.0);
                let inside = radius - (x * x + y * y).sqrt();
                (40.0 + 170.0 * (inside + 0.5).clamp(0.0, 1.0)) as u8
            });
            let features = brisk().extract(&image);
            let nearest = (features.keypoints.iter())
                .find(|k| (k.at - Point2::new(100.0, 95.0)).norm() < 1.0)
                .unwrap_or_else(|| panic!("no keypoint for radius {radius}"));
            assert!(
                (nearest.octave - octave).abs() <= 1,
                "{radius}: {nearest:?}"
            );
        }
    }

    #[test]
    fn noise_yields_many_features_and_always_the_same() {
        let mut rng = Seed(1).rng();
        let noise = GrayImage::from_fn(Size::new(700, 600), |_, _| rng.below(256) as u8);
        let features = brisk().extract(&noise);
        assert!(features.len() > 5_000, "{}", features.len());
        assert_eq!(features, brisk().extract(&noise));
        for k in &features.keypoints {
            let angle = k.angle.expect("BRISK assigns orientations");
            assert!((0.0..std::f32::consts::TAU).contains(&angle));
            assert!(k.response >= 30.0 && k.size > 8.0, "{k:?}");
        }
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        let params = BriskParams {
            threshold: 0,
            ..BriskParams::default()
        };
        let refused = Brisk::new(params).expect_err("refused").to_string();
        assert_eq!(refused, "`threshold` is 0, but must be 1 to 255");
        let params = BriskParams {
            octaves: 9,
            ..BriskParams::default()
        };
        assert!(Brisk::new(params).is_err());
    }
}
