//! LATCH: comparisons of small patches, three at a time.
//!
//! G. Levi, T. Hassner: "LATCH: Learned Arrangements of Three Patch Codes", IEEE Winter Conference
//! on Applications of Computer Vision (WACV), 2016.
//!
//! # How it works
//! 1. The image is blurred a little, against noise.
//! 2. Each bit belongs to three patches of 7 x 7 pixels within a window of 48 x 48 about the
//!    keypoint, an anchor and two companions: it tells whether the anchor is more like the first
//!    than like the second, by the sum of squared differences. Patches instead of single pixels
//!    make bits robust, and three instead of two make them tell more.
//! 3. The centres of the patches are turned by the keypoint's orientation, the patches themselves
//!    are not.
//!
//! The triplets were chosen by the authors among random ones, by how many labelled pairs of image
//! patches each bit tells rightly to be the same or not, passing over those correlated to one
//! chosen before.
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

use super::{BinaryRows, Describer, DescriptorKind, Descriptors, Keypoint};
use crate::image::{GrayImage, Size, gaussian_blur_u8};
use crate::params::ParamError;
use crate::simd::{WINDOW, compare_patches, turn_places};
use crate::tables::LATCH_TRIPLETS;

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
pub struct LatchParams {
    /// Pixels that a patch reaches from its centre to each side, 0 to 3.
    pub half_patch: usize,
    /// Standard deviation of the blur in pixels, 0 (none) to 10.
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
            (0.0..=10.0).contains(&params.sigma),
            "sigma",
            params.sigma,
            "0 to 10",
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
}
