//! A sequence: frames, and pairs of frames with their true relative pose.

use std::path::PathBuf;

use matchbench_vision::geometry::Camera;
use nalgebra::Isometry3;

/// One dataset: frames and the pairs that a matcher is judged on.
#[derive(Clone, Debug, PartialEq)]
pub struct Sequence {
    /// Its name in tables: the name of its folder.
    pub name: String,
    /// The images, in the order that pairs count them.
    pub frames: Vec<Frame>,
    /// The pairs to be matched, in the order of the pairs file.
    pub pairs: Vec<Pair>,
}

/// An image and the camera that took it.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// The image file.
    pub image: PathBuf,
    /// Its camera.
    pub camera: Camera,
    /// Pose of the camera (camera-to-world), where the dataset gives it.
    pub world_from_camera: Option<Isometry3<f64>>,
}

/// Two frames and the truth about them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Index of the first frame.
    pub a: u32,
    /// Index of the second frame.
    pub b: u32,
    /// True pose: takes a point from camera `a` to camera `b`, in the dataset's unit of length.
    pub b_from_a: Isometry3<f64>,
}
