//! Cameras and what two of them know about each other: relative pose, its error, epipolar
//! geometry, triangulation, minimal solvers.

mod camera;
mod pose;
pub mod solvers;

pub use camera::{Camera, CameraError, Distortion};
pub use pose::{PoseError, RelativePose};
