//! Local features: keypoints ([`Keypoint`]: position, size, orientation) and their descriptors
//! ([`Descriptors`]).
//!
//! Each algorithm is a file or folder of this module and implements [`Extractor`], or
//! [`Detector`] and [`Describer`] where the two halves are separate papers. None of them can fail:
//! an empty, a one-pixel or a black image has no features, and that is a result.

mod affine;
pub mod akaze;
pub mod asift;
pub mod binboost;
pub mod brisk;
pub mod daisy;
mod descriptors;
pub mod dlco;
pub mod dsp_sift;
#[cfg(test)]
mod extractor_tests;
pub mod fast;
pub mod freak;
mod image_and_views;
pub mod kaze;
mod keypoint;
pub mod latch;
pub mod orb;
mod patch;
mod peak;
pub mod rootsift;
pub mod sheared;
pub mod sift;
mod simulation;
mod strongest;
pub mod surf;

pub use akaze::{Akaze, AkazeParams};
pub use asift::{Asift, AsiftParams};
pub use binboost::{BinBoost, BinBoostParams};
pub use brisk::{Brisk, BriskParams};
pub use daisy::{Daisy, DaisyParams};
pub use descriptors::{BinaryRows, DescriptorKind, Descriptors, FloatRows};
pub use dlco::{Dlco, DlcoParams};
pub use dsp_sift::{DspSift, DspSiftParams};
pub use fast::{Fast, FastParams};
pub use freak::{Freak, FreakParams};
pub use image_and_views::{ImageAndViews, features_of_image};
pub use kaze::{Kaze, KazeParams};
pub use keypoint::{Features, Keypoint};
pub use latch::{Latch, LatchParams};
pub use orb::{Orb, OrbParams};
pub use patch::PatchSource;
pub use rootsift::RootSift;
pub use sheared::{Sheared, ShearedParams};
pub use sift::{Sift, SiftParams};
pub(crate) use strongest::strongest;
pub use surf::{Surf, SurfParams};

use std::fmt;

use crate::image::{GrayImage, Size};

/// Finds keypoints.
pub trait Detector: Send + Sync {
    /// The keypoints of `image`, in an order that depends on the image alone.
    fn detect(&self, image: &GrayImage) -> Vec<Keypoint>;

    /// As [`Extractor::memory`], for [`Detector::detect`].
    fn memory(&self, _size: Size) -> usize {
        0
    }
}

/// Describes given keypoints.
pub trait Describer: Send + Sync {
    /// Type and length of the descriptors that [`Describer::describe`] returns.
    fn kind(&self) -> DescriptorKind;

    /// One descriptor for each keypoint. Keypoints that cannot be described (too near the border)
    /// are removed, and an orientation may be written into the others.
    fn describe(&self, image: &GrayImage, keypoints: &mut Vec<Keypoint>) -> Descriptors;

    /// As [`Extractor::memory`], for [`Describer::describe`].
    fn memory(&self, _size: Size) -> usize {
        0
    }
}

/// Finds and describes keypoints at once, in one shared scale space.
pub trait Extractor: Send + Sync {
    /// Type and length of the descriptors.
    fn kind(&self) -> DescriptorKind;

    /// The features of `image`, in an order that depends on the image alone.
    fn extract(&self, image: &GrayImage) -> Features;

    /// The same features; keypoints that another extractor with the same detector found before come from
    /// `detections`.
    fn extract_sharing(&self, image: &GrayImage, _detections: &mut dyn Detections) -> Features {
        self.extract(image)
    }

    /// About how many bytes [`Extractor::extract`] takes for an image of this `size`, its features among
    /// them and the image not: as measured on a wall of small patches, which has more features than most
    /// photographs; with twice as many it still holds. SIFT and ORB know which of their parameters find more;
    /// with settings of others that do it may not hold. What does not depend on the size, less than a
    /// megabyte, is left out. Where several views of the image are worked on at a time (ASIFT), as many as
    /// the surrounding rayon pool has threads count. 0 where nobody has said.
    fn memory(&self, _size: Size) -> usize {
        0
    }
}

/// Pixels for each feature of a wall of small patches.
const PIXELS_PER_FEATURE: usize = 80;

/// Bytes for each pixel of the upper and of the left border of an image, measured: rows and columns that an algorithm
/// keeps beyond the borders. Only strips have so many pixels there that this is much.
const BYTES_PER_PIXEL_OF_BORDERS: usize = 64;

/// The memory of an algorithm that takes so many bytes `a_pixel`, and of the features of a wall of small patches with
/// descriptors of this `kind`.
fn memory_of(size: Size, a_pixel: usize, kind: DescriptorKind) -> usize {
    let features = size.area() / PIXELS_PER_FEATURE;
    memory_of_pixels(size, a_pixel) + memory_of_features(features, kind)
}

/// The memory of an algorithm that takes so many bytes `a_pixel`, without that of its features.
fn memory_of_pixels(size: Size, a_pixel: usize) -> usize {
    size.area() * a_pixel + (size.width + size.height) * BYTES_PER_PIXEL_OF_BORDERS
}

/// The memory of so many features with descriptors of this `kind`, whose vectors may be twice as long as they must be.
fn memory_of_features(features: usize, kind: DescriptorKind) -> usize {
    let descriptor = match kind {
        DescriptorKind::Float { dim } => dim * size_of::<f32>(),
        DescriptorKind::Binary { bits } => bits.div_ceil(8),
    };
    2 * features * (size_of::<Keypoint>() + descriptor)
}

/// The keypoints of one image and one detector, kept by a caller that runs several extractors on it.
pub trait Detections {
    /// Those of an earlier extraction, if there was one.
    fn recall(&mut self) -> Option<Vec<Keypoint>>;

    /// Keeps the keypoints; called when they are known and before the first is described.
    fn remember(&mut self, keypoints: &[Keypoint]);

    /// The keypoints of an earlier extraction, or else those that `detector` finds.
    fn recall_or_detect(&mut self, detector: &dyn Detector, image: &GrayImage) -> Vec<Keypoint> {
        self.recall().unwrap_or_else(|| {
            let keypoints = detector.detect(image);
            self.remember(&keypoints);
            keypoints
        })
    }
}

/// Keeps no keypoints.
struct Unshared;

impl Detections for Unshared {
    fn recall(&mut self) -> Option<Vec<Keypoint>> {
        None
    }

    fn remember(&mut self, _: &[Keypoint]) {}
}

/// What holds an extractor can be printed, whatever that is.
impl fmt::Debug for dyn Extractor + '_ {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "dyn Extractor of {}", self.kind())
    }
}

impl<E: Extractor + ?Sized> Extractor for Box<E> {
    fn kind(&self) -> DescriptorKind {
        (**self).kind()
    }

    fn extract(&self, image: &GrayImage) -> Features {
        (**self).extract(image)
    }

    fn extract_sharing(&self, image: &GrayImage, detections: &mut dyn Detections) -> Features {
        (**self).extract_sharing(image, detections)
    }

    fn memory(&self, size: Size) -> usize {
        (**self).memory(size)
    }
}

/// A [`Detector`] followed by a [`Describer`]: the usual way to combine two papers.
#[derive(Clone, Copy, Debug)]
pub struct DetectThenDescribe<K, D> {
    /// Finds the keypoints.
    pub detector: K,
    /// Describes them.
    pub describer: D,
}

impl<K: Detector, D: Describer> Extractor for DetectThenDescribe<K, D> {
    fn kind(&self) -> DescriptorKind {
        self.describer.kind()
    }

    fn extract(&self, image: &GrayImage) -> Features {
        self.extract_sharing(image, &mut Unshared)
    }

    fn extract_sharing(&self, image: &GrayImage, detections: &mut dyn Detections) -> Features {
        let mut keypoints = detections.recall_or_detect(&self.detector, image);
        let descriptors = self.describer.describe(image, &mut keypoints);
        Features::new(image.size(), keypoints, descriptors)
    }

    fn memory(&self, size: Size) -> usize {
        (self.detector.memory(size)).max(self.describer.memory(size))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;
    use crate::simd::InstructionSet;

    /// Boxes of all sizes over each other, and noise.
    fn boxes(size: Size) -> GrayImage {
        let mut rng = Seed(31).rng();
        let mut image = GrayImage::filled(size, 100);
        for _ in 0..150 {
            let side = (2.0 / (0.02 + rng.uniform())) as usize;
            let (x, y) = (rng.below(size.width as u32), rng.below(size.height as u32));
            let grey = rng.below(240) as u8;
            for y in (y as usize..size.height).take(side) {
                for x in (x as usize..size.width).take(side) {
                    image.set(x, y, grey);
                }
            }
        }
        image.map(|&grey| grey + rng.below(9) as u8)
    }

    /// The describers that can leave out the orientation.
    fn describers(upright: bool) -> [Box<dyn Describer>; 3] {
        let latch = LatchParams {
            upright,
            ..LatchParams::default()
        };
        let dlco = DlcoParams {
            upright,
            ..DlcoParams::default()
        };
        let boost = BinBoostParams {
            upright,
            ..BinBoostParams::default()
        };
        [
            Box::new(Latch::new(latch).expect("in range")),
            Box::new(Dlco::new(dlco).expect("in range")),
            Box::new(BinBoost::new(boost).expect("in range")),
        ]
    }

    #[test]
    fn upright_descriptors_do_not_depend_on_the_angle() {
        let image = boxes(Size::new(203, 149));
        for (turned, upright) in describers(false).iter().zip(&describers(true)) {
            let described = |describer: &dyn Describer, angle| {
                let mut keypoints = vec![Keypoint {
                    at: nalgebra::Point2::new(101.0, 74.0),
                    size: 9.0,
                    angle,
                    response: 1.0,
                    octave: 0,
                }];
                let descriptors = describer.describe(&image, &mut keypoints);
                assert_eq!(keypoints.len(), 1);
                descriptors
            };
            let without = described(&**turned, None);
            for angle in [Some(1.0), Some(2.5)] {
                assert_eq!(described(&**upright, angle), without);
                assert_ne!(described(&**turned, angle), without);
            }
        }
    }

    #[test]
    fn every_set_of_instructions_gives_the_same_bits() {
        fn on<K, D>(detector: K, describer: D) -> DetectThenDescribe<K, D> {
            DetectThenDescribe {
                detector,
                describer,
            }
        }
        let sift = || Sift::new(SiftParams::default()).expect("in range");
        let surf = || Surf::new(SurfParams::default()).expect("in range");
        let pooled = |affine_shape| {
            let params = DspSiftParams {
                affine_shape,
                ..DspSiftParams::default()
            };
            DspSift::new(params).expect("in range")
        };
        let extractors: [(&str, Box<dyn Extractor>); 13] = [
            ("SIFT", Box::new(sift())),
            ("DSP-SIFT", Box::new(pooled(false))),
            ("DSP-SIFT on ellipses", Box::new(pooled(true))),
            ("SURF", Box::new(surf())),
            (
                "ORB",
                Box::new(Orb::new(OrbParams::default()).expect("in range")),
            ),
            (
                "BRISK",
                Box::new(Brisk::new(BriskParams::default()).expect("in range")),
            ),
            (
                "KAZE",
                Box::new(Kaze::new(KazeParams::default()).expect("in range")),
            ),
            (
                "AKAZE",
                Box::new(Akaze::new(AkazeParams::default()).expect("in range")),
            ),
            (
                "FREAK",
                Box::new(on(
                    surf(),
                    Freak::new(FreakParams::default()).expect("in range"),
                )),
            ),
            (
                "LATCH",
                Box::new(on(
                    sift(),
                    Latch::new(LatchParams::default()).expect("in range"),
                )),
            ),
            (
                "DAISY",
                Box::new(on(
                    sift(),
                    Daisy::new(DaisyParams::default()).expect("in range"),
                )),
            ),
            (
                "DLCO",
                Box::new(on(
                    sift(),
                    Dlco::new(DlcoParams::default()).expect("in range"),
                )),
            ),
            (
                "BinBoost",
                Box::new(on(
                    sift(),
                    BinBoost::new(BinBoostParams::default()).expect("in range"),
                )),
            ),
        ];
        // No multiple of a vector's length.
        let image = boxes(Size::new(203, 149));
        for (name, extractor) in extractors {
            let mut first = None;
            InstructionSet::for_each(|set| {
                let features = extractor.extract(&image);
                let first = first.get_or_insert_with(|| features.clone());
                assert!(*first == features, "{name} with {set:?}");
            });
            let count = first.map_or(0, |features| features.len());
            assert!(count > 20, "{name} finds {count} features");
        }
    }
}
