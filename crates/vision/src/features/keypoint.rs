//! A keypoint, and the features of one image.

use nalgebra::Point2;

use super::Descriptors;
use crate::image::Size;

/// A place in an image that a detector expects to find again in another image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Keypoint {
    /// Position in pixels of the original image; pixel centres are at integers, y points down.
    pub at: Point2<f32>,
    /// Diameter of the described neighbourhood, in pixels of the original image.
    pub size: f32,
    /// Dominant orientation in radians, in `[0, 2 pi)`, from the x axis towards the y axis (so
    /// clockwise on the screen); `None` before one is assigned.
    pub angle: Option<f32>,
    /// Strength of the detector's response; only comparable within one detector.
    pub response: f32,
    /// Pyramid level where it was found; the detector says how levels are numbered.
    pub octave: i16,
}

/// The keypoints of one image and their descriptors: row `i` describes keypoint `i`.
#[derive(Clone, Debug, PartialEq)]
pub struct Features {
    /// Size of the image they come from.
    pub size: Size,
    /// Where the features are.
    pub keypoints: Vec<Keypoint>,
    /// What they look like.
    pub descriptors: Descriptors,
}

impl Features {
    /// Features of an image of `size`.
    ///
    /// # Panics
    /// If there are not as many descriptors as keypoints.
    pub fn new(size: Size, keypoints: Vec<Keypoint>, descriptors: Descriptors) -> Self {
        assert_eq!(
            keypoints.len(),
            descriptors.len(),
            "one descriptor for each keypoint"
        );
        Self {
            size,
            keypoints,
            descriptors,
        }
    }

    /// Number of features.
    pub fn len(&self) -> usize {
        self.keypoints.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.keypoints.is_empty()
    }
}
