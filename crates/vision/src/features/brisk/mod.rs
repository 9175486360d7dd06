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
//!    3.2.1); each of the 512 pairs of near points is one bit (section 3.2.2).
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | t | [`BriskParams::threshold`] | 30 | OpenCV |
//! | n | [`BriskParams::octaves`] | 3 | OpenCV; 4 in the paper |
//! | delta_min, delta_max | - | 8.2, 5.85 | OpenCV; 13.67 and 9.75 in the paper, section 3.2 |
//!
//! # Choices that the paper leaves open
//! All as OpenCV's `BRISK_create`: radii of the rings, areas as upright squares instead of
//! Gaussians, scales in 64 steps over a range of 30, angles in 1024 steps, direction weights in
//! 2048ths. OpenCV detects corners by AGAST, which tests what FAST tests.
//!
//! # Differences from OpenCV
//! Of neighbours with equal scores the one whose surroundings score higher is kept, and of those
//! the first; OpenCV knows the scores around them only where it happens to have looked before.
//! In photographs that concerns less than 1 % of the keypoints; where many scores are equal, as in drawings and masks, a
//! sixth to a third of OpenCV's are missing here.
//!
//! Layers have whole numbers of pixels, and positions are multiplied by 1.5, 2, 3 ..., as there. Where the sides of the
//! image are no multiples of these, keypoints of coarse layers lie too far left and up, more so to the right and below:
//! by less than their scale in pixels (up to 5 on the layer of scale 6).

mod layers;
mod pattern;
mod refine;

use nalgebra::Point2;

use super::{BinaryRows, DescriptorKind, Descriptors, Extractor, Features, Keypoint, memory_of};
use crate::image::{GrayImage, IntegralImage, Size};
use crate::params::ParamError;
use layers::ScaleLayers;
use pattern::{BITS, Pattern, Sampler};

/// Bytes for each pixel of the image, measured: layers, their scores and the integral image.
const BYTES_PER_PIXEL: usize = 8;

/// Size of a keypoint at scale 1, in pixels.
const BASIC_SIZE: f32 = 12.0;

/// Parameters of [`Brisk`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
                // On the last layer only whole pixels must reach the threshold.
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
        let mut words = vec![0; keypoints.len() * BITS / 64];
        if !keypoints.is_empty() {
            let integral = IntegralImage::new(image);
            let sampler = Sampler::new(&self.pattern, &integral);
            let rows = words.as_chunks_mut().0;
            for i in near_each_other(&keypoints) {
                rows[i] = sampler.describe(&mut keypoints[i]);
            }
        }
        let descriptors = Descriptors::Binary(BinaryRows::from_vec(BITS, words));
        Features::new(image.size(), keypoints, descriptors)
    }

    fn memory(&self, size: Size) -> usize {
        memory_of(size, BYTES_PER_PIXEL, self.kind())
    }
}

/// The keypoints in an order in which each reads pixels that the one before has brought into the
/// cache: bands of rows, each from left to right.
fn near_each_other(keypoints: &[Keypoint]) -> Vec<usize> {
    const BAND: f32 = 32.0;
    let mut order: Vec<usize> = (0..keypoints.len()).collect();
    order.sort_by_key(|&i| {
        let at = keypoints[i].at;
        ((at.y / BAND) as u32, at.x as u32)
    });
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::extractor_tests::uneven_blocks;
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
    fn bits_are_those_of_opencv() {
        // The first and the last keypoint of cv2.BRISK_create() of OpenCV 4.14.0 on these blocks
        // of 5 x 4 pixels: x, y, size, angle in degrees, response; layer; bits.
        let expected = [
            (
                [39.0, 19.0, 10.305_384, 329.277_65, 197.836_49],
                0,
                [
                    0x070fc7efffff3bb4,
                    0xe87c5f7ffffc0003,
                    0x4e300378ef184701,
                    0xfbfc6d33cce67bc7,
                    0x7f90e5f9ffffddef,
                    0xfe037efb251191dc,
                    0xff7d75ff80020dff,
                    0xffffffe10400005f,
                ],
            ),
            (
                [72.75, 77.25, 18.0, 119.562_65, 124.111_33],
                2,
                [
                    0xfcc320159f6ce44f,
                    0x120384c01002d9fc,
                    0x8108209417d7f588,
                    0x120d93c430180020,
                    0x018c6330460583d9,
                    0x00078004584f8a82,
                    0x5fddf3457ffffec0,
                    0x2908cfbffffdf080,
                ],
            ),
        ];
        let blocks = GrayImage::from_fn(Size::new(120, 110), |x, y| {
            let (x, y) = (x / 5, y / 4);
            ((37 * x + 101 * y) ^ (13 * x * y)) as u8
        });
        let features = brisk().extract(&blocks);
        let Descriptors::Binary(rows) = &features.descriptors else {
            panic!("BRISK describes by bits");
        };
        for (i, (numbers, octave, bits)) in [0, features.len() - 1].into_iter().zip(expected) {
            let k = features.keypoints[i];
            let angle = k.angle.expect("BRISK assigns orientations").to_degrees();
            let found = [k.at.x, k.at.y, k.size, angle, k.response];
            for (found, number) in found.iter().zip(numbers) {
                assert!((found / number - 1.0).abs() < 1e-6, "{found}, not {number}");
            }
            assert_eq!((k.octave, rows.row(i)), (octave, &bits[..]));
        }
    }

    /// Four keypoints of each layer, from the finest to the coarsest scale, by cv2.BRISK_create() of OpenCV 4.14.0: the layer,
    /// x, y, size and response.
    #[test]
    fn places_and_scales_on_all_layers_are_those_of_opencv() {
        let expected: [(i16, [f32; 4]); 20] = [
            (0, [50.409_748, 25.553_415, 8.4, 67.0]),
            (0, [287.720_76, 37.262_65, 11.318_182, 43.284_09]),
            (0, [205.177_7, 38.989_834, 12.944_733, 47.471_36]),
            (0, [289.607_6, 88.207, 18.0, 99.550_61]),
            (1, [255.382_42, 52.369_91, 12.0, 103.553_71]),
            (1, [289.005, 100.621_43, 18.342_857, 56.114_32]),
            (1, [133.608_61, 41.692_142, 19.884_289, 34.325_96]),
            (1, [205.136_08, 179.971_37, 24.0, 148.487_05]),
            (2, [66.185_54, 39.863_167, 18.0, 119.050_78]),
            (2, [115.722_885, 87.772_62, 25.040_817, 71.245_75]),
            (2, [223.579_51, 171.346_82, 27.131_945, 31.843_18]),
            (2, [284.026_28, 61.371_902, 30.944_304, 36.111_44]),
            (3, [115.240_98, 157.296_05, 24.0, 61.307_766]),
            (3, [98.716_866, 67.209_274, 32.471_56, 143.593_58]),
            (3, [72.720_28, 148.248_93, 36.497_87, 43.983_765]),
            (3, [80.131_22, 95.121, 48.0, 97.029_3]),
            (4, [124.373_795, 133.764_86, 37.692_432, 34.976_734]),
            (4, [243.935_96, 106.784_35, 43.777_78, 84.671_29]),
            (4, [93.093_346, 137.120_74, 47.638_557, 115.012_55]),
            (4, [138.904_19, 100.730_26, 58.5, 41.062_5]),
        ];
        let keypoints = brisk().extract(&uneven_blocks()).keypoints;
        for (layer, numbers) in expected {
            let found = keypoints.iter().any(|k| {
                let found = [k.at.x, k.at.y, k.size, k.response];
                let mut both = found.iter().zip(numbers);
                k.octave == layer && both.all(|(found, number)| (found / number - 1.0).abs() < 1e-5)
            });
            assert!(found, "{numbers:?} on layer {layer}");
        }
    }

    #[test]
    fn sizes_follow_the_scale_of_discs() {
        for (radius, size) in [(4.0_f32, 31.0), (8.0, 58.0)] {
            let image = GrayImage::from_fn(Size::new(201, 190), |x, y| {
                let (x, y) = (x as f32 - 100.0, y as f32 - 95.0);
                let inside = radius - (x * x + y * y).sqrt();
                (40.0 + 170.0 * (inside + 0.5).clamp(0.0, 1.0)) as u8
            });
            let keypoints = brisk().extract(&image).keypoints;
            let near = keypoints
                .iter()
                .filter(|k| (k.at - Point2::new(100.0, 95.0)).norm() < 2.5);
            let largest = near.map(|k| k.size).fold(0.0, f32::max);
            assert!((largest - size).abs() < 1.0, "{radius}: {largest}");
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
            // The last layer's maximum between pixels may be lower than the pixel.
            assert!(
                k.size > 8.0 && (k.response > 30.0 || k.octave == 5),
                "{k:?}"
            );
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
