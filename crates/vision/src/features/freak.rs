//! FREAK: comparisons of receptive fields that are arranged as in the human retina.
//!
//! A. Alahi, R. Ortiz, P. Vandergheynst: "FREAK: Fast Retina Keypoint", CVPR 2012.
//!
//! # How it works
//! 1. Forty-three fields about the keypoint, six on each of seven rings and one in the middle;
//!    fields grow with their distance, and those of neighbouring rings overlap (section 4.1,
//!    figure 4). The pattern grows with the size of the keypoint. A field's value is the mean over
//!    it.
//! 2. Orientation: the differences of 45 pairs of fields that lie across the pattern, each along
//!    the line between the two, sum to a gradient (section 4.4, eq. 3, figure 6).
//! 3. The pattern is turned to it. Each of 512 pairs of fields is one bit (section 4.2, eqs. 1 and
//!    2); they were chosen in the paper by a greedy search for pairs of high variance and low
//!    correlation among all 903.
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | - | [`FreakParams::pattern_scale`] | 22 | OpenCV |
//! | - | [`FreakParams::octaves`] | 4 | OpenCV |
//! | N | - | 512 bits | section 4.2 |
//! | M | - | 45 | section 4.4 |
//!
//! # Choices that the paper leaves open
//! All as OpenCV's `FREAK_create`: radii of the rings, fields as upright squares instead of
//! Gaussians, means as whole grey levels, 64 scales over the octaves, 256 angles, direction weights
//! in 4096ths. The 512 pairs are the ones of the authors, which the paper does not print; they were
//! measured (`tables/SOURCES.toml`).
//!
//! # Differences from OpenCV
//! None from 3.4; since then OpenCV finds angles of the smallest keypoints that differ by up to a
//! degree.

use std::f64::consts::TAU;

use super::{BinaryRows, Describer, DescriptorKind, Descriptors, Keypoint, memory_of};
use crate::image::{GrayImage, IntegralImage, Size};
use crate::params::ParamError;
use crate::simd::{Fields, compare_means, field_means};
use crate::tables::FREAK_PAIRS;

/// Bytes for each pixel of the image, measured: the integral image.
const BYTES_PER_PIXEL: usize = 5;

/// Number of bits of a descriptor.
const BITS: usize = 512;
/// Fields of the pattern, 43, in whole blocks of eight.
const FIELDS_IN_BLOCKS: usize = 48;
/// Rings of six fields.
const RINGS: usize = 7;
/// Rings of which all pairs across tell the orientation; of the others only the opposite ones.
const OUTER_RINGS: usize = 4;
/// Pairs of fields across a ring, the opposite ones first.
const ACROSS: [[usize; 2]; 9] = [
    [0, 3],
    [1, 4],
    [2, 5],
    [0, 2],
    [1, 3],
    [2, 4],
    [3, 5],
    [4, 0],
    [5, 1],
];
/// Radii of two rings at pattern scale 1.
const OUTERMOST: f64 = 2.0 / 3.0;
const INNERMOST: f64 = 2.0 / 24.0;
/// Number of scales.
const SCALES: usize = 64;
/// Number of angles.
const TURNS: i32 = 256;
/// What the largest pattern may reach, in pixels.
const MAX_PATTERN: f32 = 4096.0;
/// Keypoints up to this size get the smallest pattern.
const MIN_SIZE: f32 = 7.0;

/// Parameters of [`Freak`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FreakParams {
    /// Size of the smallest pattern: its fields reach as far from the keypoint, in pixels. 8 to
    /// 100, and at most 4096 in the last octave.
    pub pattern_scale: f32,
    /// Octaves over which the pattern grows with the keypoint, 1 to 6.
    pub octaves: usize,
}

impl Default for FreakParams {
    fn default() -> Self {
        Self {
            pattern_scale: 22.0,
            octaves: 4,
        }
    }
}

/// The FREAK descriptor. It sets the orientation of keypoints, and drops those whose pattern does
/// not lie within the image. Sizes of 7 pixels or less, and those that are no numbers, get the smallest pattern.
#[derive(Clone, Debug)]
pub struct Freak {
    params: FreakParams,
    scales: Vec<PatternScale>,
    /// For each angle cosine and sine of the twelve directions in which fields lie.
    turns: Vec<[[f64; 2]; 12]>,
    directions: Vec<DirectionPair>,
}

/// The pattern at one scale.
#[derive(Clone, Debug)]
struct PatternScale {
    /// Radius of each ring.
    rings: [f64; RINGS],
    /// Half the side of each field.
    fields: [f32; FIELDS_IN_BLOCKS],
    /// Distance to the border that its keypoints must keep.
    margin: f32,
}

/// A pair of fields that tells the orientation.
#[derive(Clone, Debug)]
struct DirectionPair {
    fields: [usize; 2],
    /// Their offset over its squared length, in 4096ths.
    weights: [i32; 2],
}

impl Freak {
    /// A describer with the given parameters.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn new(params: FreakParams) -> Result<Self, ParamError> {
        let FreakParams {
            pattern_scale,
            octaves,
        } = params;
        ParamError::unless(
            (8.0..=100.0).contains(&pattern_scale),
            "pattern_scale",
            pattern_scale,
            "8 to 100",
        )?;
        ParamError::unless((1..=6).contains(&octaves), "octaves", octaves, "1 to 6")?;
        // Sums over the fields of larger patterns have more digits than 31 bits.
        let largest = pattern_scale * (1 << octaves) as f32;
        let range = format!("at most {MAX_PATTERN} in the last of {octaves} octaves");
        ParamError::unless(largest <= MAX_PATTERN, "pattern_scale", largest, &range)?;
        let turns = (0..TURNS)
            .map(|turn| {
                std::array::from_fn(|i| {
                    let turn = f64::from(turn) / f64::from(TURNS);
                    let angle = TAU * (i as f64 / 12.0 + turn);
                    [libm::cos(angle), libm::sin(angle)]
                })
            })
            .collect();
        let mut freak = Self {
            params,
            scales: (0..SCALES).map(|i| PatternScale::new(i, &params)).collect(),
            turns,
            directions: Vec::new(),
        };
        let [x, y] = freak.places(&freak.scales[0], 0);
        for ring in 0..RINGS {
            let pairs = if ring < OUTER_RINGS {
                &ACROSS[..]
            } else {
                &ACROSS[..3]
            };
            for pair in pairs {
                let [a, b] = pair.map(|i| 6 * ring + i);
                let (dx, dy) = (x[a] - x[b], y[a] - y[b]);
                let squared = dx * dx + dy * dy;
                let weights = [dx, dy].map(|d| (f64::from(d / squared) * 4096.0 + 0.5) as i32);
                let fields = [a, b];
                freak.directions.push(DirectionPair { fields, weights });
            }
        }
        Ok(freak)
    }

    /// What the descriptor compares, for each of its 512 bits: two of the 43 receptive fields,
    /// numbered from the outermost ring inwards.
    pub fn tests() -> impl ExactSizeIterator<Item = [u8; 2]> {
        FREAK_PAIRS.as_chunks::<2>().0.iter().copied()
    }

    /// Number of the scale for keypoints of this size.
    fn scale(&self, size: f32) -> usize {
        let per_log = SCALES as f64 / (std::f64::consts::LN_2 * self.params.octaves as f64);
        let scale = libm::logf(size / MIN_SIZE) * per_log as f32;
        ((f64::from(scale) + 0.5) as usize).min(SCALES - 1)
    }

    fn fits(&self, keypoint: &Keypoint, size: Size) -> bool {
        let margin = self.scales[self.scale(keypoint.size)].margin;
        let inside = |v: f32, length: usize| v > margin && v < length as f32 - margin;
        inside(keypoint.at.x, size.width) && inside(keypoint.at.y, size.height)
    }

    /// x, then y, of the centres of all fields relative to the keypoint.
    fn places(&self, scale: &PatternScale, turn: usize) -> [[f32; FIELDS_IN_BLOCKS]; 2] {
        let mut places = [[0.0; FIELDS_IN_BLOCKS]; 2];
        let directions = &self.turns[turn];
        for (ring, radius) in scale.rings.iter().enumerate() {
            for i in 0..6 {
                // Every other ring is turned by half the angle between two fields.
                let [cos, sin] = directions[2 * i + ring % 2];
                places[0][6 * ring + i] = (radius * cos) as f32;
                places[1][6 * ring + i] = (radius * sin) as f32;
            }
        }
        places
    }

    /// Sets the orientation of a keypoint that fits, and describes it.
    fn describe_one(&self, integral: &IntegralImage, keypoint: &mut Keypoint) -> [u64; BITS / 64] {
        let scale = &self.scales[self.scale(keypoint.size)];
        let centre = [keypoint.at.x, keypoint.at.y];
        let mut means = [0; 64];
        let mut read = |turn: usize, count: usize| {
            let [x, y] = self.places(scale, turn);
            let fields = Fields {
                x: &x[..count],
                y: &y[..count],
                radius: &scale.fields[..count],
            };
            let stride = integral.row(0).len();
            field_means(integral.sums(), stride, centre, fields, &mut means[..count]);
            means
        };

        let outer = read(0, FIELDS_IN_BLOCKS);
        let mut direction = [0; 2];
        for DirectionPair { fields, weights } in &self.directions {
            let [a, b] = fields.map(|i| i32::from(outer[i]));
            for (sum, weight) in direction.iter_mut().zip(weights) {
                *sum += (a - b) * weight / 2048;
            }
        }
        let angle = f64::from(libm::atan2f(direction[1] as f32, direction[0] as f32));
        let positive = if angle < 0.0 { angle + TAU } else { angle } as f32;
        keypoint.angle = Some(positive % TAU as f32);
        let turn = angle / TAU * f64::from(TURNS);
        let turn = (turn + 0.5f64.copysign(turn)) as i32;

        let means = read(turn.rem_euclid(TURNS) as usize, FIELDS_IN_BLOCKS);
        let pairs = FREAK_PAIRS.as_chunks::<2>().0.first_chunk();
        compare_means(&means, pairs.expect("a pair for each bit"))
    }
}

impl PatternScale {
    fn new(index: usize, params: &FreakParams) -> Self {
        let exponent = (params.octaves * index) as f64 / SCALES as f64;
        let scale = libm::exp2(exponent) * f64::from(params.pattern_scale);
        // The distances between rings shrink evenly.
        let rings = [0, 6, 11, 15, 18, 20, 21].map(|spaces| {
            let radius = OUTERMOST - f64::from(spaces) * (OUTERMOST - INNERMOST) / 21.0;
            radius * scale
        });
        // Fields reach half way to the middle; the one in the middle is as large as those of the
        // innermost ring. Those beyond the last are never compared.
        let field = |i: usize| (rings[(i / 6).min(RINGS - 1)] / 2.0) as f32;
        Self {
            rings,
            fields: std::array::from_fn(field),
            margin: (rings[0] * 1.5).ceil() as f32 + 1.0,
        }
    }
}

impl Describer for Freak {
    fn kind(&self) -> DescriptorKind {
        DescriptorKind::Binary { bits: BITS }
    }

    fn describe(&self, image: &GrayImage, keypoints: &mut Vec<Keypoint>) -> Descriptors {
        keypoints.retain(|keypoint| self.fits(keypoint, image.size()));
        let mut words = Vec::with_capacity(keypoints.len() * BITS / 64);
        if !keypoints.is_empty() {
            let integral = IntegralImage::new(image);
            for keypoint in keypoints {
                words.extend(self.describe_one(&integral, keypoint));
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

    fn freak() -> Freak {
        Freak::new(FreakParams::default()).expect("the default is valid")
    }

    fn keypoint(x: f32, y: f32, size: f32) -> Keypoint {
        Keypoint {
            at: Point2::new(x, y),
            size,
            angle: None,
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

    #[test]
    fn bits_are_those_of_opencv() {
        // cv2.xfeatures2d.FREAK_create() of OpenCV 3.4.2; 4.14.0 computes the same bits. The third
        // and fourth keypoint are too near the border.
        let mut keypoints = vec![
            keypoint(60.3, 50.75, 7.0),
            keypoint(60.3, 50.75, 12.0),
            keypoint(60.3, 50.75, 30.0),
            keypoint(20.0, 50.0, 9.0),
            keypoint(71.0, 48.5, 10.0),
        ];
        let expected = [
            (
                173.552_57,
                [
                    0xce3e_4260_3493_05c1,
                    0x0a02_8542_c381_a900,
                    0x0a66_8d0a_4734_09ad,
                    0x6e22_26c1_eebb_df44,
                    0x64e8_2c10_fb35_35d3,
                    0x6cb5_19ff_ab39_4870,
                    0x4b1c_5ed1_1778_aa19,
                    0xea11_571c_b931_fbd1,
                ],
            ),
            (
                169.128_54,
                [
                    0xb6dc_526c_598a_d8d0,
                    0xaa13_c442_8e7c_bb12,
                    0x9aef_854c_8b38_ca4d,
                    0x7ab2_07c1_eabf_47ab,
                    0xf2ee_255e_6191_12e5,
                    0xedb7_36d6_3ea1_5c72,
                    0x4394_5fd4_c71e_c89b,
                    0xec40_705c_7829_f1d7,
                ],
            ),
            (
                360.0 - 56.752_933,
                [
                    0x0482_8ccd_2780_0683,
                    0x1502_6b8a_4b02_1d38,
                    0x787b_07e8_e525_6b6c,
                    0x0523_00d2_273c_8a42,
                    0xac2d_0073_3148_ad17,
                    0x55fb_40c1_8b18_54c1,
                    0xe99c_06e4_0018_8499,
                    0xfa30_5740_b533_f212,
                ],
            ),
        ];
        let Descriptors::Binary(rows) = freak().describe(&blocks(), &mut keypoints) else {
            panic!("FREAK describes by bits");
        };
        assert_eq!((keypoints.len(), rows.len()), (3, 3));
        for (i, (degrees, bits)) in expected.iter().enumerate() {
            let angle = keypoints[i].angle.expect("FREAK assigns orientations");
            assert!((angle.to_degrees() - degrees).abs() < 1e-3, "{angle}");
            assert_eq!(rows.row(i), bits, "{i}");
        }
    }

    #[test]
    fn a_turned_image_has_turned_descriptors() {
        let image = blocks();
        let (w, h) = (image.width(), image.height());
        let turned = GrayImage::from_fn(Size::new(h, w), |x, y| image.at(y, h - 1 - x));
        let mut upright = Vec::new();
        for x in (40..80).step_by(7) {
            for y in (40..70).step_by(6) {
                upright.push(keypoint(x as f32, y as f32, 9.0));
            }
        }
        let mut other: Vec<Keypoint> = upright
            .iter()
            .map(|k| keypoint((h - 1) as f32 - k.at.y, k.at.x, k.size))
            .collect();
        let (a, b) = (
            freak().describe(&image, &mut upright),
            freak().describe(&turned, &mut other),
        );
        let (Descriptors::Binary(a), Descriptors::Binary(b)) = (a, b) else {
            panic!("FREAK describes by bits");
        };
        assert_eq!(a.len(), 30);
        let mut differing = 0;
        for i in 0..a.len() {
            let pairs = a.row(i).iter().zip(b.row(i));
            differing += pairs.map(|(a, b)| (a ^ b).count_ones()).sum::<u32>();
        }
        let share = f64::from(differing) / (BITS * a.len()) as f64;
        assert!(share < 0.05, "{share} of the bits differ");
    }

    #[test]
    fn odd_keypoints_and_images_are_fine() {
        let mut keypoints = vec![
            keypoint(f32::NAN, 50.0, 9.0),
            keypoint(60.0, f32::INFINITY, 9.0),
            keypoint(60.0, 50.0, f32::INFINITY),
            keypoint(-60.0, 50.0, 9.0),
            keypoint(60.0, 50.0, f32::NAN),
            keypoint(60.0, 50.0, 0.0),
            keypoint(60.0, 50.0, -3.0),
        ];
        let descriptors = freak().describe(&blocks(), &mut keypoints);
        // Sizes that are none get the smallest pattern.
        assert_eq!((keypoints.len(), descriptors.len()), (3, 3));
        for (width, height) in [(0, 0), (1, 1), (47, 200)] {
            let image = GrayImage::filled(Size::new(width, height), 9);
            let mut keypoints = vec![keypoint(23.0, 23.0, 9.0)];
            assert_eq!(freak().describe(&image, &mut keypoints).len(), 0);
            assert!(keypoints.is_empty());
            assert_eq!(freak().describe(&image, &mut Vec::new()).len(), 0);
        }
    }

    #[test]
    fn flat_images_have_no_orientation_and_all_bits() {
        let image = GrayImage::filled(Size::new(400, 400), 255);
        let mut keypoints = vec![keypoint(200.0, 200.0, 40.0); 2000];
        let Descriptors::Binary(rows) = freak().describe(&image, &mut keypoints) else {
            panic!("FREAK describes by bits");
        };
        assert_eq!(rows.len(), 2000);
        assert_eq!(rows.row(1999), [u64::MAX; 8]);
        assert_eq!(keypoints[0].angle, Some(0.0));
    }

    #[test]
    fn every_pair_of_fields_is_compared_once() {
        let mut pairs = FREAK_PAIRS.as_chunks::<2>().0.to_vec();
        for pair in &mut pairs {
            pair.sort_unstable();
            assert!(pair[0] < pair[1] && usize::from(pair[1]) < 43, "{pair:?}");
        }
        pairs.sort_unstable();
        pairs.dedup();
        assert_eq!(pairs.len(), BITS);
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        let params = FreakParams {
            pattern_scale: f32::NAN,
            ..FreakParams::default()
        };
        assert!(Freak::new(params).is_err());
        let params = FreakParams {
            octaves: 0,
            ..FreakParams::default()
        };
        let refused = Freak::new(params).expect_err("refused").to_string();
        assert_eq!(refused, "`octaves` is 0, but must be 1 to 6");
    }
}
