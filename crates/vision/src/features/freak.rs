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
//! None.

use std::f64::consts::TAU;

use super::{BinaryRows, Describer, DescriptorKind, Descriptors, Keypoint};
use crate::image::{GrayImage, IntegralImage, Size};
use crate::params::ParamError;
use crate::simd::{Fields, compare_means, field_means};
use crate::tables::FREAK_PAIRS;

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
/// Number of scales.
const SCALES: usize = 64;
/// Number of angles.
const TURNS: i32 = 256;
/// Keypoints up to this size get the smallest pattern.
const SMALLEST_SIZE: f32 = 7.0;

/// Parameters of [`Freak`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct FreakParams {
    /// Size of the smallest pattern: its fields reach as far from the keypoint, in pixels. 8 to
    /// 100.
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
/// not lie within the image.
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

    /// Number of the scale for keypoints of this size.
    fn scale(&self, size: f32) -> usize {
        let per_log = SCALES as f64 / (std::f64::consts::LN_2 * self.params.octaves as f64);
        let scale = libm::logf(size / SMALLEST_SIZE) * per_log as f32;
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
        // Radii of the rings for pattern scale 1, from the outermost inwards; the distances between
        // them shrink evenly.
        const LARGEST: f64 = 2.0 / 3.0;
        const SMALLEST: f64 = 2.0 / 24.0;
        const SPACE: f64 = (LARGEST - SMALLEST) / 21.0;
        let rings = [0, 6, 11, 15, 18, 20, 21].map(|spaces| {
            let radius = LARGEST - f64::from(spaces) * SPACE;
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
}
