//! DLCO: gradients pooled in learned regions, projected by a learned matrix.
//!
//! K. Simonyan, A. Vedaldi, A. Zisserman: "Learning Local Feature Descriptors Using Convex
//! Optimisation", IEEE Transactions on Pattern Analysis and Machine Intelligence 36(8), 2014. The
//! paper's evaluation calls it DLCO, OpenCV calls it VGG.
//!
//! # How it works
//! 1. A patch of 64 x 64 pixels is taken around the keypoint, upright ([`PatchSource`]), and
//!    blurred.
//! 2. Each gradient is shared between the two nearest of 8 directions (section 2).
//! 3. These are pooled in Gaussian regions, which lie in rings about the centre; the pooled values
//!    are divided by the strength of the patch's gradients and cut off at 1 (section 2).
//! 4. The vector is projected to 120 values (section 4), compared by Euclidean distance.
//!
//! Two things are learned: which rings, out of hundreds, as a sparse weighting of them (section 3), and the
//! projection, as a metric of low rank, under the nuclear norm (section 4). `crates/learn` does both, and says
//! how.
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | - | [`DlcoParams::dimensions`] | 120 | MatchBench |
//! | - | [`DlcoParams::scale_factor`] | 6.75 | MatchBench, for keypoints of SIFT |
//! | - | [`DlcoParams::upright`] | false | MatchBench |
//! | - | - | blur of 1.4 pixels | MatchBench |
//!
//! # Choices that the paper leaves open
//! The strength of the gradients is a tenth of their root mean square. The tenth was chosen by false positives
//! on validation scenes; much less clipping is much worse. The projection's rows are ordered by importance, so
//! fewer dimensions are its first rows; the authors learned each size separately.
//!
//! # Differences from the authors' code
//! The table: it is learned again, on other scenes. The patch is taken from an octave of the image
//! that fits its size, where theirs is interpolated in the full image.

mod regions;
mod table;

pub use regions::{Pooling, Ring};
pub use table::DlcoTable;

use super::{Describer, DescriptorKind, Descriptors, FloatRows, Keypoint, PatchSource, memory_of};
use crate::image::{GrayImage, Size};
use crate::params::ParamError;
use crate::simd::{DIRECTIONS, VECTORS_AT_ONCE, project};
use crate::tables::DLCO;

/// Bytes for each pixel of the image, measured: the octaves that patches are taken from.
const BYTES_PER_PIXEL: usize = 5;

/// Width and height of the described patch.
pub const SIDE: usize = 64;
/// Pixels along a side that have a gradient.
const INNER: usize = SIDE - 2;

/// Parameters of [`Dlco`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct DlcoParams {
    /// Number of values, 1 to as many as the table has.
    pub dimensions: usize,
    /// Side of the patch, in sizes of the keypoint; above 0.
    pub scale_factor: f32,
    /// Whether the keypoint's orientation is not used.
    pub upright: bool,
}

impl Default for DlcoParams {
    fn default() -> Self {
        Self {
            dimensions: 120,
            scale_factor: 6.75,
            upright: false,
        }
    }
}

/// The DLCO describer.
#[derive(Clone, Debug)]
pub struct Dlco {
    params: DlcoParams,
    pooling: Pooling,
    /// Blocks of eight rows of the projection, each column after column.
    projection: Vec<[f32; 8]>,
}

impl Dlco {
    /// A describer with the table of this library.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn new(params: DlcoParams) -> Result<Self, ParamError> {
        Self::with_table(params, &DlcoTable::from_bytes(DLCO)?)
    }

    /// A describer with a table of one's own.
    ///
    /// # Errors
    /// If a parameter is out of its range, or if the table has no rings or rows, rows that are not as long as what is
    /// pooled, or numbers that are not finite or make no region.
    pub fn with_table(params: DlcoParams, table: &DlcoTable) -> Result<Self, ParamError> {
        table.check()?;
        let DlcoParams {
            dimensions,
            scale_factor,
            ..
        } = params;
        let most = table.projection.len();
        ParamError::unless(
            (1..=most).contains(&dimensions),
            "dimensions",
            dimensions,
            &format!("1 to {most}"),
        )?;
        ParamError::unless(
            scale_factor > 0.0 && scale_factor.is_finite(),
            "scale_factor",
            scale_factor,
            "above 0",
        )?;
        let mut projection = Vec::new();
        for rows in table.projection[..dimensions].chunks(8) {
            for column in 0..table.pooled() {
                let value = |i: usize| rows.get(i).map_or(0.0, |row: &Vec<f32>| row[column]);
                projection.push(std::array::from_fn(value));
            }
        }
        Ok(Self {
            params,
            pooling: Pooling::new(&table.rings),
            projection,
        })
    }

    /// The descriptors of patches of [`SIDE`] x [`SIDE`] pixels, one after the other; `fill` writes
    /// patch number `i`.
    pub fn describe_patches(
        &self,
        count: usize,
        mut fill: impl FnMut(usize, &mut [u8]),
    ) -> FloatRows {
        let dimensions = self.params.dimensions;
        let mut pooling = self.pooling.clone();
        let mut patch = vec![0; SIDE * SIDE];
        let mut pooled = vec![[0.0; DIRECTIONS]; VECTORS_AT_ONCE * pooling.len()];
        let mut products = vec![[[0.0; 8]; VECTORS_AT_ONCE]; dimensions.div_ceil(8)];
        let mut data = Vec::with_capacity(count * dimensions);
        for first in (0..count).step_by(VECTORS_AT_ONCE) {
            let wanted = VECTORS_AT_ONCE.min(count - first);
            for (v, pooled) in pooled
                .chunks_exact_mut(pooling.len())
                .take(wanted)
                .enumerate()
            {
                fill(first + v, &mut patch);
                pooling.compute(&patch, pooled);
            }
            let mut vectors = pooled.chunks_exact(pooling.len()).map(<[_]>::as_flattened);
            let vectors = std::array::from_fn(|_| vectors.next().expect("so many were made"));
            project(vectors, &self.projection, &mut products);
            for v in 0..wanted {
                let values = products.iter().flat_map(|block| block[v]);
                data.extend(values.take(dimensions));
            }
        }
        FloatRows::from_vec(dimensions, data)
    }
}

impl Describer for Dlco {
    fn kind(&self) -> DescriptorKind {
        DescriptorKind::Float {
            dim: self.params.dimensions,
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
        Descriptors::Float(rows)
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

    fn pattern(x: usize, y: usize, seed: u64) -> u8 {
        let cell = (x / 7 + 11 * (y / 6)) as u64;
        Seed(seed).number(cell).rng().below(100) as u8
    }

    fn describe(patches: &[Vec<u8>], params: DlcoParams) -> FloatRows {
        let describer = Dlco::new(params).unwrap();
        describer.describe_patches(patches.len(), |i, patch| patch.copy_from_slice(&patches[i]))
    }

    fn distance(a: &[f32], b: &[f32]) -> f32 {
        a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
    }

    #[test]
    fn contrast_and_brightness_hardly_matter_and_the_picture_does() {
        let patch = |seed, gain: u8, offset| -> Vec<u8> {
            let value = |i: usize| offset + gain * pattern(i % SIDE, i / SIDE, seed);
            (0..SIDE * SIDE).map(value).collect()
        };
        let patches = [patch(1, 1, 0), patch(1, 2, 30), patch(2, 1, 0)];
        let rows = describe(&patches, DlcoParams::default());
        let (same, other) = (
            distance(rows.row(0), rows.row(1)),
            distance(rows.row(0), rows.row(2)),
        );
        assert!(100.0 * same < other, "{same} {other}");
    }

    #[test]
    fn blocks_and_dimensions_do_not_change_the_values() {
        let patches: Vec<Vec<u8>> = (0..6)
            .map(|n| {
                (0..SIDE * SIDE)
                    .map(|i| pattern(i % SIDE, i / SIDE, n))
                    .collect()
            })
            .collect();
        let rows = describe(&patches, DlcoParams::default());
        let few = DlcoParams {
            dimensions: 13,
            ..DlcoParams::default()
        };
        for (i, patch) in patches.iter().enumerate() {
            let alone = describe(std::slice::from_ref(patch), few);
            assert_eq!(alone.row(0), &rows.row(i)[..13]);
        }
    }

    #[test]
    fn keypoints_without_a_patch_are_removed() {
        let describer = Dlco::new(DlcoParams::default()).unwrap();
        let keypoint = |x: f32| Keypoint {
            at: Point2::new(x, 5.0),
            size: 4.0,
            angle: None,
            response: 1.0,
            octave: 0,
        };
        let mut keypoints = vec![keypoint(5.0), keypoint(-3.0), keypoint(9.0)];
        let image = GrayImage::filled(Size::new(20, 20), 7);
        assert_eq!(describer.describe(&image, &mut keypoints).len(), 2);
        let empty = GrayImage::filled(Size::new(0, 0), 0);
        assert!(describer.describe(&empty, &mut keypoints).is_empty());
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        for dimensions in [0, 121] {
            let refused = Dlco::new(DlcoParams {
                dimensions,
                ..DlcoParams::default()
            });
            assert!(refused.unwrap_err().to_string().contains("dimensions"));
        }
    }
}
