//! LATCH: comparisons of small patches, three at a time.
//!
//! G. Levi, T. Hassner: "LATCH: Learned Arrangements of Three Patch Codes", IEEE Winter Conference
//! on Applications of Computer Vision (WACV), 2016.
//!
//! # How it works
//! 1. The image is blurred a little, against noise.
//! 2. Each bit belongs to three patches of 7 x 7 pixels within a window of 48 x 48 about the keypoint, an
//!    anchor and two companions. It tells whether the anchor is more like the first companion than like the
//!    second, by the sum of squared differences. Patches make bits more robust than single pixels do, and three
//!    patches tell more than two.
//! 3. The centres of the patches are turned by the keypoint's orientation, the patches themselves
//!    are not.
//!
//! The triplets were chosen by the authors among random ones: those whose bit tells best, for labelled pairs of
//! image patches, whether the two are the same. Triplets that are correlated to one chosen before were left
//! out.
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | - | - | 256 bits | OpenCV; the authors' LATCH-32 |
//! | k | [`LatchParams::half_patch`] | 3, patches of 7 x 7 | OpenCV |
//! | - | [`LatchParams::sigma`] | 2 | OpenCV |
//! | - | [`LatchParams::upright`] | false | OpenCV |
//!
//! # Choices that the paper leaves open
//! All as OpenCV's `LATCH`: the blur reaches one pixel; turned centres are cut off, not rounded, to
//! whole pixels, and kept within the window of 49 x 49 pixels. The paper does not print the
//! triplets; they were measured (`tables/SOURCES.toml`).
//!
//! # Differences from OpenCV
//! OpenCV rounds the weights of the blur to 256ths, which turns 1 bit of 2000. Keypoints that lie exactly half a pixel within the border are dropped where OpenCV reads beyond
//! the image.

use super::{BinaryRows, Describer, DescriptorKind, Descriptors, Keypoint, memory_of};
use crate::image::{GrayImage, Size, gaussian_blur_u8};
use crate::params::ParamError;
use crate::simd::{WINDOW, compare_patches, turn_places};
use crate::tables::LATCH_TRIPLETS;

/// Bytes for each pixel of the image, measured: the blurred image.
const BYTES_PER_PIXEL: usize = 3;

/// Number of bits of a descriptor.
const BITS: usize = 256;
/// Pixels that the blur reaches to each side.
const BLUR_RADIUS: usize = 1;
/// Patches have their centres no further than this from the keypoint, in x and in y.
const REACH: usize = 24;

/// Parameters of [`Latch`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LatchParams {
    /// Pixels that a patch reaches from its centre to each side, 0 to 3.
    pub half_patch: usize,
    /// Standard deviation of the blur in pixels, 0 (none), or 0.01 to 10.
    pub sigma: f64,
    /// Whether the orientation of keypoints is ignored.
    pub upright: bool,
}

impl Default for LatchParams {
    fn default() -> Self {
        Self {
            half_patch: 3,
            sigma: 2.0,
            upright: false,
        }
    }
}

/// The LATCH descriptor. It drops keypoints whose patches may reach beyond the image; keypoints
/// without an orientation are described upright.
#[derive(Clone, Debug)]
pub struct Latch {
    params: LatchParams,
    /// Centres of all patches: an anchor, its first and its second companion for each bit.
    x: Vec<f32>,
    y: Vec<f32>,
}

impl Latch {
    /// A describer with the given parameters.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn new(params: LatchParams) -> Result<Self, ParamError> {
        ParamError::unless(
            params.half_patch <= 3,
            "half_patch",
            params.half_patch,
            "0 to 3",
        )?;
        ParamError::unless(
            params.sigma == 0.0 || (0.01..=10.0).contains(&params.sigma),
            "sigma",
            params.sigma,
            "0, or 0.01 to 10",
        )?;
        let places = LATCH_TRIPLETS.as_chunks::<2>().0;
        let coordinate = |axis: usize| {
            let signed = |place: &[u8; 2]| f32::from(place[axis].cast_signed());
            places.iter().map(signed).collect()
        };
        Ok(Self {
            params,
            x: coordinate(0),
            y: coordinate(1),
        })
    }

    /// What the descriptor compares, for each of its 256 bits: x and y of the anchor and of its two
    /// companions, in pixels from the keypoint, upright.
    pub fn tests() -> impl ExactSizeIterator<Item = [i8; 6]> {
        let rows = LATCH_TRIPLETS.as_chunks::<6>().0;
        rows.iter().map(|row| row.map(u8::cast_signed))
    }

    /// The pixel that a keypoint lies on, if its patches lie within an image of `size`.
    fn centre(&self, keypoint: &Keypoint, size: Size) -> Option<[usize; 2]> {
        let margin = REACH + self.params.half_patch;
        let nearest = |v: f32, length: usize| {
            let v = (v + 0.5).floor();
            let inside = v >= margin as f32 && v < length as f32 - margin as f32;
            inside.then_some(v as usize)
        };
        Some([
            nearest(keypoint.at.x, size.width)?,
            nearest(keypoint.at.y, size.height)?,
        ])
    }

    fn describe_one(
        &self,
        image: &GrayImage,
        [x, y]: [usize; 2],
        angle: Option<f32>,
        scratch: &mut Scratch,
    ) -> [u64; BITS / 64] {
        let Scratch { window, indices } = scratch;
        let margin = REACH + self.params.half_patch;
        let side = 2 * margin + 1;
        for (row, y) in window.chunks_exact_mut(WINDOW).zip(y - margin..=y + margin) {
            let pixels = &image.row(y)[x - margin..][..side];
            for (wide, &pixel) in row.iter_mut().zip(pixels) {
                *wide = i16::from(pixel);
            }
        }
        let direction = match angle {
            Some(angle) if !self.params.upright && angle.is_finite() => {
                [libm::cosf(angle), libm::sinf(angle)]
            }
            _ => [1.0, 0.0],
        };
        // A patch at the centre has its first pixel at (24, 24) of the window.
        let origin = (REACH * WINDOW + REACH) as u16;
        turn_places(&self.x, &self.y, direction, REACH as u8, origin, indices);
        let mut words = [0; BITS / 64];
        let triplets = indices.as_chunks::<3>().0;
        compare_patches(window, triplets, 2 * self.params.half_patch + 1, &mut words);
        words
    }
}

/// What the description of a keypoint needs besides it, kept for the next one.
struct Scratch {
    /// The pixels about the keypoint, in the upper left corner.
    window: [i16; WINDOW * WINDOW],
    /// Where in it each patch begins.
    indices: [u32; 3 * BITS],
}

impl Describer for Latch {
    fn kind(&self) -> DescriptorKind {
        DescriptorKind::Binary { bits: BITS }
    }

    fn describe(&self, image: &GrayImage, keypoints: &mut Vec<Keypoint>) -> Descriptors {
        keypoints.retain(|keypoint| self.centre(keypoint, image.size()).is_some());
        let mut words = Vec::with_capacity(keypoints.len() * BITS / 64);
        if !keypoints.is_empty() {
            let blurred = (self.params.sigma > 0.0)
                .then(|| gaussian_blur_u8(image, BLUR_RADIUS, self.params.sigma));
            let image = blurred.as_ref().unwrap_or(image);
            let mut scratch = Scratch {
                window: [0; WINDOW * WINDOW],
                indices: [0; 3 * BITS],
            };
            for keypoint in keypoints {
                let centre = self
                    .centre(keypoint, image.size())
                    .expect("only such are kept");
                words.extend(self.describe_one(image, centre, keypoint.angle, &mut scratch));
            }
        }
        Descriptors::Binary(BinaryRows::from_vec(BITS, words))
    }

    fn memory(&self, size: Size) -> usize {
        memory_of(size, BYTES_PER_PIXEL, self.kind())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;
    use crate::seed::Seed;

    fn latch(params: LatchParams) -> Latch {
        Latch::new(params).expect("the parameters are valid")
    }

    fn keypoint(x: f32, y: f32, degrees: f32) -> Keypoint {
        Keypoint {
            at: Point2::new(x, y),
            size: 9.0,
            angle: Some(degrees.to_radians()),
            response: 1.0,
            octave: 0,
        }
    }

    /// Blocks of 5 x 4 pixels in many shades.
    fn blocks() -> GrayImage {
        GrayImage::from_fn(Size::new(120, 110), |x, y| {
            let (x, y) = (x / 5, y / 4);
            ((37 * x + 101 * y) ^ (13 * x * y)) as u8
        })
    }

    fn bits(params: LatchParams, image: &GrayImage, keypoints: &mut Vec<Keypoint>) -> BinaryRows {
        match latch(params).describe(image, keypoints) {
            Descriptors::Binary(rows) => rows,
            Descriptors::Float(_) => panic!("LATCH describes by bits"),
        }
    }

    /// Of `cv2.xfeatures2d.LATCH_create(32, turned, 3, sigma)` in OpenCV 4.14.0 for three places;
    /// the fourth is too near the border.
    const UPRIGHT_SHARP: [[u64; 4]; 3] = [
        [
            0xa327_0128_9185_6e76,
            0x4e17_ba6d_30d2_8d31,
            0x701c_b7af_26ec_9c8a,
            0x1cb5_05fb_2c75_161d,
        ],
        [
            0xa327_0128_9185_6e76,
            0x4e17_ba6d_30d2_8d31,
            0x701c_b7af_26ec_9c8a,
            0x1cb5_05fb_2c75_161d,
        ],
        [
            0x6cf9_1bed_0c3e_2abb,
            0xaac3_c173_18a2_0957,
            0x74c5_3ed4_01d4_6e3f,
            0xee67_655d_4be9_c759,
        ],
    ];
    const TURNED_SHARP: [[u64; 4]; 3] = [
        UPRIGHT_SHARP[0],
        [
            0x692e_58db_a886_ce3e,
            0xa7e3_ebe8_db83_6579,
            0x836c_4643_475d_c608,
            0xa8b7_34c7_0109_50f9,
        ],
        [
            0x1ca1_7abd_d57c_d12d,
            0xb8aa_9208_1168_eb50,
            0x7cb9_1b5f_e6a5_64c0,
            0x0a95_1308_e601_0b51,
        ],
    ];
    const TURNED_BLURRED: [[u64; 4]; 3] = [
        [
            0xa327_1128_9185_6e7a,
            0x4e1d_ba6d_70d3_8d31,
            0x501c_77bb_27cc_9c8a,
            0x1cb5_05fb_2c15_161f,
        ],
        [
            0x69af_70db_8886_ce3e,
            0xa7e3_ebfc_dbc3_6578,
            0x836f_4647_475d_c60a,
            0xa8b7_34c7_0189_50da,
        ],
        [
            0x1ca1_b2b5_d55c_d8ed,
            0xb8a5_9a08_1168_ea50,
            0x3cf8_1b57_c6a5_6640,
            0x0a95_2b88_e600_9b51,
        ],
    ];

    #[test]
    fn bits_are_those_of_opencv() {
        let sharp = LatchParams {
            sigma: 0.0,
            ..LatchParams::default()
        };
        let upright = LatchParams {
            upright: true,
            ..sharp
        };
        // Blurred grey levels are sometimes one apart: OpenCV rounds the weights.
        for (params, expected, most) in [
            (sharp, TURNED_SHARP, 0),
            (upright, UPRIGHT_SHARP, 0),
            (LatchParams::default(), TURNED_BLURRED, 2),
        ] {
            let mut keypoints = vec![
                keypoint(60.3, 50.75, 0.0),
                keypoint(60.3, 50.75, 173.5),
                keypoint(27.0, 81.7, 301.0),
                keypoint(26.4, 50.0, 0.0),
            ];
            let rows = bits(params, &blocks(), &mut keypoints);
            assert_eq!((keypoints.len(), rows.len()), (3, 3));
            for (i, expected) in expected.iter().enumerate() {
                let pairs = rows.row(i).iter().zip(expected);
                let differing: u32 = pairs.map(|(a, b)| (a ^ b).count_ones()).sum();
                assert!(differing <= most, "{differing} bits of row {i}, {params:?}");
            }
        }
    }

    #[test]
    fn a_turned_image_has_turned_descriptors() {
        // Smooth, since the patches are not turned with their places.
        let at = |x: f64, y: f64| {
            let wave = libm::sin(x / 6.0 + 0.5 * libm::sin(y / 9.0)) * libm::cos(y / 7.0);
            (127.0 + 100.0 * wave) as u8
        };
        let size = Size::new(140, 140);
        let image = GrayImage::from_fn(size, |x, y| at(x as f64, y as f64));
        let turned = GrayImage::from_fn(size, |x, y| image.at(y, 139 - x));
        let mut upright = Vec::new();
        for x in (40..100).step_by(7) {
            for y in (40..100).step_by(6) {
                upright.push(keypoint(x as f32, y as f32, 20.0));
            }
        }
        let turn = |k: &Keypoint| keypoint(139.0 - k.at.y, k.at.x, 110.0);
        let mut other: Vec<Keypoint> = upright.iter().map(turn).collect();
        let a = bits(LatchParams::default(), &image, &mut upright);
        let b = bits(LatchParams::default(), &turned, &mut other);
        assert_eq!((a.len(), b.len()), (90, 90));
        let mut differing = 0;
        for i in 0..a.len() {
            let pairs = a.row(i).iter().zip(b.row(i));
            differing += pairs.map(|(a, b)| (a ^ b).count_ones()).sum::<u32>();
        }
        let share = f64::from(differing) / (BITS * a.len()) as f64;
        assert!(share < 0.1, "{share} of the bits differ");
    }

    #[test]
    fn what_cannot_be_described_is_dropped() {
        for (width, height) in [(0, 0), (1, 1), (54, 200), (200, 54), (3, 500)] {
            let image = GrayImage::filled(Size::new(width, height), 7);
            let (x, y) = (width as f32 / 2.0, height as f32 / 2.0);
            let mut keypoints = vec![keypoint(x, y, 0.0)];
            assert_eq!(
                bits(LatchParams::default(), &image, &mut keypoints).len(),
                0
            );
            assert!(keypoints.is_empty(), "{width} x {height}");
        }
        let mut keypoints = vec![
            keypoint(f32::NAN, 50.0, 0.0),
            keypoint(50.0, f32::INFINITY, 0.0),
            keypoint(-1e30, 50.0, 0.0),
            keypoint(60.0, 1e30, 0.0),
        ];
        assert_eq!(
            bits(LatchParams::default(), &blocks(), &mut keypoints).len(),
            0
        );
        assert!(keypoints.is_empty());
        let mut none = Vec::new();
        assert_eq!(bits(LatchParams::default(), &blocks(), &mut none).len(), 0);
    }

    #[test]
    fn without_an_orientation_it_is_upright() {
        let mut keypoints = vec![keypoint(60.0, 50.0, 0.0); 4];
        keypoints[1].angle = None;
        keypoints[2].angle = Some(f32::NAN);
        keypoints[3].angle = Some(f32::INFINITY);
        let rows = bits(LatchParams::default(), &blocks(), &mut keypoints);
        for i in 1..4 {
            assert_eq!(rows.row(i), rows.row(0), "{i}");
        }
    }

    #[test]
    fn many_keypoints_fit_in_the_smallest_image() {
        let mut rng = Seed(3).rng();
        let image = GrayImage::from_fn(Size::new(55, 55), |_, _| rng.below(256) as u8);
        let mut keypoints: Vec<Keypoint> = (0..20_000)
            .map(|i| keypoint(27.0, 27.0, (i % 720) as f32 - 360.0))
            .collect();
        let rows = bits(LatchParams::default(), &image, &mut keypoints);
        assert_eq!(rows.len(), 20_000);
        assert_eq!(rows.row(0), rows.row(720));
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        let default = LatchParams::default();
        for (params, name) in [
            (
                LatchParams {
                    half_patch: 4,
                    ..default
                },
                "half_patch",
            ),
            (
                LatchParams {
                    sigma: -1.0,
                    ..default
                },
                "sigma",
            ),
            (
                LatchParams {
                    sigma: f64::NAN,
                    ..default
                },
                "sigma",
            ),
        ] {
            let error = Latch::new(params).expect_err("out of range");
            assert!(error.to_string().contains(name), "{error}");
        }
    }
}
