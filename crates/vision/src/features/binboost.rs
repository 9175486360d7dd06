//! BinBoost: a binary descriptor whose bits are boosted combinations of weak learners, each a threshold of
//! gradients in a box.
//!
//! T. Trzcinski, M. Christoudias, P. Fua, V. Lepetit: "Boosting Binary Keypoint Descriptors",
//! CVPR 2013; "Learning Image Descriptors with Boosting", IEEE Transactions on Pattern Analysis
//! and Machine Intelligence 37(3), 2015.
//!
//! # How it works
//! 1. A patch of 32 x 32 pixels is taken around the keypoint, upright ([`PatchSource`]).
//! 2. A gradient is shared between the two nearest of 8 directions. The response of a box R and a
//!    direction e is the share of the gradients in R that has direction e (section 3.2).
//! 3. A weak learner asks whether a response is at most a threshold: h = 1 or -1 (eq. 8).
//! 4. Bit d is the sign of a weighted sum of weak learners, `C_d(x) = sgn(b_d^T h_d(x))` (eq. 4).
//! 5. Descriptors are compared by their Hamming distance.
//!
//! Boxes, directions, thresholds and weights are learned; `crates/learn` does it, and says how.
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | - | [`BinBoostParams::scale_factor`] | 6.75 | MatchBench, for keypoints of SIFT |
//! | - | [`BinBoostParams::upright`] | false | MatchBench |
//! | D | the table | 256 bits | MatchBench |
//! | K | the table | 4 weak learners for each bit | better than 8 and 32 on scenes left out, with so little to learn from; 128 in the paper |
//!
//! # Choices that the paper leaves open
//! Gradients are weighted by their magnitude. Responses are rounded to 8 bits and weights to 7 bits, in
//! learning as here, so that 32 patches are evaluated at once in bytes. All bits share one pool of boxes, and
//! each box is summed once. A bit has an offset besides its weak learners, as if one of them always said yes.
//!
//! # Differences from the authors' code
//! The table: it is learned again, on other scenes. The patch is taken from an octave of the image
//! that fits its size, where theirs is interpolated in the full image.

use super::{BinaryRows, Describer, DescriptorKind, Descriptors, Keypoint, PatchSource, memory_of};
use crate::image::{GrayImage, Size};
use crate::params::ParamError;
use crate::simd::{
    DIRECTIONS, PATCHES_AT_ONCE, box_responses, integrate_spread, spread_gradients, vote,
};
use crate::tables::BINBOOST;

/// Bytes for each pixel of the image, measured: the octaves that patches are taken from.
const BYTES_PER_PIXEL: usize = 5;

pub use crate::simd::WeakLearner;

/// Width and height of the described patch.
pub const SIDE: usize = 32;
/// Pixels along a side that have a gradient; boxes are counted in them.
pub const INNER: usize = SIDE - 2;
/// First bytes of a table.
const MAGIC: &[u8; 4] = b"BBT1";

/// Parameters of [`BinBoost`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct BinBoostParams {
    /// Side of the patch, in sizes of the keypoint; above 0.
    pub scale_factor: f32,
    /// Whether the keypoint's orientation is not used.
    pub upright: bool,
}

impl Default for BinBoostParams {
    fn default() -> Self {
        Self {
            scale_factor: 6.75,
            upright: false,
        }
    }
}

/// What was learned: boxes, and for each bit its weak learners.
#[derive(Clone, Debug, PartialEq)]
pub struct BinBoostTable {
    /// Left, top, right and bottom (the last two excluded), in pixels with a gradient.
    pub boxes: Vec<[u8; 4]>,
    /// Weak learners of each bit.
    pub learners_per_bit: usize,
    /// The weak learners, bit after bit.
    pub learners: Vec<WeakLearner>,
    /// What is added to the sum of each bit's weak learners.
    pub offsets: Vec<i16>,
}

impl BinBoostTable {
    /// Number of bits.
    pub fn bits(&self) -> usize {
        self.offsets.len()
    }

    /// The weak learners of each bit, and what is added to their sum.
    pub fn bit_by_bit(&self) -> impl Iterator<Item = (&[WeakLearner], &i16)> {
        self.learners
            .chunks_exact(self.learners_per_bit)
            .zip(&self.offsets)
    }

    /// The table as bytes: magic, three counts, boxes, learners, offsets;
    /// little-endian.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        for count in [self.boxes.len(), self.bits(), self.learners_per_bit] {
            bytes.extend((count as u16).to_le_bytes());
        }
        bytes.extend(self.boxes.as_flattened());
        for learner in &self.learners {
            bytes.extend(learner.feature.to_le_bytes());
            bytes.extend([learner.threshold, learner.weight.cast_unsigned()]);
        }
        for offset in &self.offsets {
            bytes.extend(offset.to_le_bytes());
        }
        bytes
    }

    /// The table that was written as `bytes`.
    ///
    /// # Errors
    /// If they are not such a table.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, ParamError> {
        let table = Self::parse(bytes).ok_or_else(Self::refusal)?;
        table.check()?;
        Ok(table)
    }

    /// Whether patches can be described with it, and its counts can be written.
    ///
    /// # Errors
    /// If not.
    fn check(&self) -> Result<(), ParamError> {
        let inside = |&[left, top, right, bottom]: &[u8; 4]| {
            left < right && top < bottom && usize::from(right.max(bottom)) <= INNER
        };
        let features = DIRECTIONS * self.boxes.len();
        // More learners could overflow the sums of `vote`.
        ((1..=256).contains(&self.learners_per_bit)
            && (1..=usize::from(u16::MAX)).contains(&self.bits())
            && u16::try_from(self.boxes.len()).is_ok()
            && self.learners.len() == self.bits() * self.learners_per_bit
            && self.boxes.iter().all(inside)
            && (self.learners.iter()).all(|l| usize::from(l.feature) < features))
        .then_some(())
        .ok_or_else(Self::refusal)
    }

    fn refusal() -> ParamError {
        ParamError("not a BinBoost table".into())
    }

    fn parse(bytes: &[u8]) -> Option<Self> {
        let bytes = bytes.strip_prefix(MAGIC)?;
        let (counts, bytes) = bytes.split_at_checked(6)?;
        let count = |i: usize| usize::from(u16::from_le_bytes([counts[2 * i], counts[2 * i + 1]]));
        let (boxes, bytes) = bytes.split_at_checked(4 * count(0))?;
        let (learners, offsets) = bytes.split_at_checked(4 * count(1) * count(2))?;
        let boxes = boxes.as_chunks::<4>().0.to_vec();
        let learners: Vec<WeakLearner> = (learners.as_chunks::<4>().0.iter())
            .map(|&[low, high, threshold, weight]| WeakLearner {
                feature: u16::from_le_bytes([low, high]),
                threshold,
                weight: weight.cast_signed(),
            })
            .collect();
        let offsets: Vec<i16> = (offsets.as_chunks::<2>().0.iter())
            .map(|&offset| i16::from_le_bytes(offset))
            .collect();
        let whole = bytes.len() == 4 * learners.len() + 2 * count(1);
        whole.then_some(Self {
            boxes,
            learners_per_bit: count(2),
            learners,
            offsets,
        })
    }
}

/// The responses of a patch in boxes; its buffers are used again and again.
#[derive(Clone, Debug)]
pub struct BoxResponses {
    pixels: Vec<f32>,
    spread: [[f32; DIRECTIONS]; INNER],
    integral: Vec<[u32; DIRECTIONS]>,
}

impl Default for BoxResponses {
    fn default() -> Self {
        Self {
            pixels: Vec::with_capacity(SIDE * SIDE),
            spread: [[0.0; DIRECTIONS]; INNER],
            integral: vec![[0; DIRECTIONS]; (INNER + 1) * (INNER + 1)],
        }
    }
}

impl BoxResponses {
    /// Writes the responses of `patch` to each box in each direction, in 400ths, at most 255.
    ///
    /// # Panics
    /// If the patch does not have [`SIDE`] x [`SIDE`] pixels or a box reaches beyond [`INNER`].
    pub fn compute(&mut self, patch: &[u8], boxes: &[[u8; 4]], out: &mut [[u8; DIRECTIONS]]) {
        assert_eq!(patch.len(), SIDE * SIDE, "a patch of {SIDE} x {SIDE}");
        self.pixels.clear();
        self.pixels.extend(patch.iter().map(|&v| f32::from(v)));
        for y in 0..INNER {
            let row = |y: usize| &self.pixels[y * SIDE..][..SIDE];
            spread_gradients(
                &row(y)[1..=INNER],
                row(y + 1),
                &row(y + 2)[1..=INNER],
                &mut self.spread,
            );
            let (above, below) = self.integral.split_at_mut((y + 1) * (INNER + 1));
            integrate_spread(
                &self.spread,
                &above[y * (INNER + 1)..],
                &mut below[..=INNER],
            );
        }
        box_responses(&self.integral, INNER + 1, boxes, out);
    }
}

/// The BinBoost describer.
#[derive(Clone, Debug)]
pub struct BinBoost {
    params: BinBoostParams,
    table: BinBoostTable,
}

impl BinBoost {
    /// A describer with the table of this library.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn new(params: BinBoostParams) -> Result<Self, ParamError> {
        let table = BinBoostTable::from_bytes(BINBOOST)?;
        Self::with_table(params, table)
    }

    /// A describer with a table of one's own.
    ///
    /// # Errors
    /// If a parameter is out of its range, or if the table has no bits, not as many learners as its bits need, more than
    /// 256 for a bit, or boxes that do not lie within the patch.
    pub fn with_table(params: BinBoostParams, table: BinBoostTable) -> Result<Self, ParamError> {
        table.check()?;
        ParamError::unless(
            params.scale_factor > 0.0 && params.scale_factor.is_finite(),
            "scale_factor",
            params.scale_factor,
            "above 0",
        )?;
        Ok(Self { params, table })
    }

    /// The descriptors of patches of [`SIDE`] x [`SIDE`] pixels, one after the other; `fill` writes
    /// patch number `i`.
    pub fn describe_patches(
        &self,
        count: usize,
        mut fill: impl FnMut(usize, &mut [u8]),
    ) -> BinaryRows {
        let bits = self.table.bits();
        let words = bits.div_ceil(64);
        let mut data = vec![0_u64; count * words];
        let mut patch = [0; SIDE * SIDE];
        let mut computer = BoxResponses::default();
        let mut responses = vec![[0; DIRECTIONS]; self.table.boxes.len()];
        let mut columns = vec![[0; PATCHES_AT_ONCE]; DIRECTIONS * self.table.boxes.len()];
        for (block, rows) in data.chunks_mut(words * PATCHES_AT_ONCE).enumerate() {
            for lane in 0..rows.len() / words {
                fill(block * PATCHES_AT_ONCE + lane, &mut patch);
                computer.compute(&patch, &self.table.boxes, &mut responses);
                for (column, &response) in columns.iter_mut().zip(responses.as_flattened()) {
                    column[lane] = response;
                }
            }
            for (bit, (learners, &offset)) in self.table.bit_by_bit().enumerate() {
                let votes = vote(&columns, learners, offset);
                for (lane, row) in rows.chunks_exact_mut(words).enumerate() {
                    row[bit / 64] |= u64::from(votes >> lane & 1) << (bit % 64);
                }
            }
        }
        BinaryRows::from_vec(bits, data)
    }
}

impl Describer for BinBoost {
    fn kind(&self) -> DescriptorKind {
        DescriptorKind::Binary {
            bits: self.table.bits(),
        }
    }

    fn describe(&self, image: &GrayImage, keypoints: &mut Vec<Keypoint>) -> Descriptors {
        let source = PatchSource::new(image);
        keypoints.retain(|keypoint| source.holds(keypoint));
        let rows = self.describe_patches(keypoints.len(), |i, patch| {
            let angle = keypoints[i].angle.filter(|_| !self.params.upright);
            let keypoint = Keypoint {
                angle,
                ..keypoints[i]
            };
            source.rectify(&keypoint, self.params.scale_factor, SIDE, patch);
        });
        Descriptors::Binary(rows)
    }

    fn memory(&self, size: Size) -> usize {
        memory_of(size, BYTES_PER_PIXEL, self.kind())
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;
    use crate::image::Size;
    use crate::seed::Seed;

    /// One box over the whole patch; bit 0 asks for gradients to the right, bit 1 for the opposite.
    fn table() -> BinBoostTable {
        let learner = |feature, weight| WeakLearner {
            feature,
            threshold: 200,
            weight,
        };
        BinBoostTable {
            boxes: vec![[0, 0, 30, 30]],
            learners_per_bit: 1,
            learners: vec![learner(0, -1), learner(4, -1)],
            offsets: vec![0, 0],
        }
    }

    #[test]
    fn a_table_survives_being_written_and_damage_is_seen() {
        let bytes = table().to_bytes();
        assert_eq!(BinBoostTable::from_bytes(&bytes), Ok(table()));
        for end in 0..bytes.len() {
            assert!(
                BinBoostTable::from_bytes(&bytes[..end]).is_err(),
                "{end} bytes"
            );
        }
        for (at, value) in [(0, 0), (4, 2), (12, 31), (10, 31), (14, 8)] {
            let mut damaged = bytes.clone();
            damaged[at] = value;
            assert!(BinBoostTable::from_bytes(&damaged).is_err(), "byte {at}");
        }
    }

    #[test]
    fn the_table_of_this_library_can_be_read() {
        let describer = BinBoost::new(BinBoostParams::default()).unwrap();
        assert_eq!(describer.kind(), DescriptorKind::Binary { bits: 256 });
        let refused = BinBoost::new(BinBoostParams {
            scale_factor: f32::NAN,
            ..BinBoostParams::default()
        });
        assert!(refused.unwrap_err().to_string().contains("scale_factor"));
    }

    #[test]
    fn bits_say_where_the_gradients_point() {
        let describer = BinBoost::with_table(BinBoostParams::default(), table()).unwrap();
        let ramp = |i: usize, patch: &mut [u8]| {
            for (at, pixel) in patch.iter_mut().enumerate() {
                let x = (at % SIDE) as u8;
                *pixel = if i.is_multiple_of(2) {
                    4 * x
                } else {
                    200 - 4 * x
                };
            }
        };
        let rows = describer.describe_patches(70, ramp);
        assert_eq!(rows.len(), 70);
        for i in 0..70 {
            assert_eq!(rows.row(i), [1 + i as u64 % 2]);
        }
    }

    #[test]
    fn contrast_and_brightness_hardly_matter_and_noise_does() {
        let describer = BinBoost::new(BinBoostParams::default()).unwrap();
        let blob = |x: usize, y: usize, seed: usize| {
            Seed(1)
                .number((x / 5 + 7 * (y / 4) + 100 * seed) as u64)
                .rng()
                .below(100) as u8
        };
        let rows = describer.describe_patches(3, |i, patch| {
            for (at, pixel) in patch.iter_mut().enumerate() {
                let (x, y) = (at % SIDE, at / SIDE);
                *pixel = match i {
                    0 => blob(x, y, 0),
                    1 => 20 + 2 * blob(x, y, 0),
                    _ => blob(x, y, 1),
                };
            }
        });
        let distance = |i: usize, j: usize| -> u32 {
            let words = rows.row(i).iter().zip(rows.row(j));
            words.map(|(a, b)| (a ^ b).count_ones()).sum()
        };
        assert!(distance(0, 1) < 10, "{}", distance(0, 1));
        assert!(distance(0, 2) > 60, "{}", distance(0, 2));
    }

    #[test]
    fn keypoints_without_a_patch_are_removed() {
        let describer = BinBoost::new(BinBoostParams::default()).unwrap();
        let keypoint = |x: f32, size: f32| Keypoint {
            at: Point2::new(x, 5.0),
            size,
            angle: None,
            response: 1.0,
            octave: 0,
        };
        let mut keypoints = vec![
            keypoint(5.0, 3.0),
            keypoint(f32::NAN, 3.0),
            keypoint(5.0, 0.0),
        ];
        let image = GrayImage::filled(Size::new(20, 20), 7);
        assert_eq!(describer.describe(&image, &mut keypoints).len(), 1);
        assert_eq!(keypoints.len(), 1);
        let empty = GrayImage::filled(Size::new(0, 0), 0);
        assert!(describer.describe(&empty, &mut keypoints).is_empty());
    }

    #[test]
    fn tables_of_ones_own_are_looked_at() {
        let table = BinBoostTable::from_bytes(BINBOOST).expect("its own table");
        let refuses = |change: &dyn Fn(&mut BinBoostTable)| {
            let mut table = table.clone();
            change(&mut table);
            BinBoost::with_table(BinBoostParams::default(), table).is_err()
        };
        assert!(!refuses(&|_| ()));
        assert!(refuses(
            &|table| (table.learners, table.offsets) = (vec![], vec![])
        ));
        assert!(refuses(&|table| table.learners_per_bit = 0));
        assert!(refuses(&|table| table.offsets.push(0)));
        assert!(refuses(&|table| table.learners[0].feature = u16::MAX));
        assert!(refuses(&|table| table.boxes[0] = [0, 0, 200, 3]));
    }
}
