//! A scene: one sequence of pictures of a place, with its cameras, their poses and the times of exposure.

use matchbench_vision::geometry::Camera;
use matchbench_vision::image::Size;
use nalgebra::{Isometry3, Matrix3, Vector3};

use crate::path::Path;
use crate::places::Place;
use crate::sensor::Sensor;

/// A sequence of pictures: where, how many, how large, and when each is taken.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Its name in tables, and the name of its folder.
    pub name: &'static str,
    /// What it shows, and what is difficult about it.
    pub description: &'static str,
    /// Where the pictures are taken.
    pub place: Place,
    /// Size of the images.
    pub size: Size,
    /// Number of frames.
    pub frames: u32,
    /// Which frames are meant to be matched with which.
    pub pairing: Pairing,
    /// Focal length, in pixels.
    pub(crate) focal: f64,
    pub(crate) timing: Timing,
    pub(crate) sensor: Sensor,
}

/// Which frames of a scene are meant to be matched with which.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pairing {
    /// The first frame of each fragment of `length` frames with each of its others.
    Fragments {
        /// Frames of a fragment.
        length: usize,
    },
    /// Every frame with every later one.
    All,
    /// Every frame with each of the next `size` frames.
    Window {
        /// Number of following frames.
        size: usize,
    },
}

/// When the frames are taken, in seconds.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Timing {
    /// Fragments of `length` frames at `rate` per second; a fragment starts every `every` seconds.
    Fragments { length: u32, rate: f64, every: f64 },
    /// One frame per this many seconds.
    Every(f64),
}

impl Scene {
    /// The camera of all frames: a pinhole whose principal point is not quite in the middle of the image.
    pub fn camera(&self) -> Camera {
        Camera::pinhole(
            self.focal,
            self.focal,
            0.5 * (self.size.width - 1) as f64 + 2.75,
            0.5 * (self.size.height - 1) as f64 - 1.5,
        )
    }

    /// Pose of the camera (camera-to-world, metres) in the middle of the frame's exposure.
    pub fn world_from_camera(&self, frame: u32) -> Isometry3<f64> {
        self.path().world_from_camera(self.time(frame))
    }

    /// Maps the pixels of frame `a`, as `(x, y, 1)`, to those of frame `b`, if all that is seen is a plane; of
    /// Frobenius norm 1.
    ///
    /// A point X of the plane `n . X = d` in camera a is at `(R + t n^T / d) X` in camera b (Hartley, Zisserman,
    /// "Multiple View Geometry in Computer Vision", 2nd edition, 2004, sec. 13.1).
    pub fn homography(&self, a: u32, b: u32) -> Option<Matrix3<f64>> {
        if !self.place.is_plane() {
            return None;
        }
        let [world_from_a, world_from_b] = [a, b].map(|frame| self.world_from_camera(frame));
        let b_from_a = world_from_b.inverse() * world_from_a;
        let normal = world_from_a.rotation.inverse() * Vector3::y();
        let distance = -world_from_a.translation.vector.y;
        let turned = b_from_a.rotation.to_rotation_matrix().into_inner();
        let moved = b_from_a.translation.vector * normal.transpose() / distance;
        let k = self.camera().matrix();
        let back = k
            .try_inverse()
            .expect("the matrix of a camera has an inverse");
        Some((k * (turned + moved) * back).normalize())
    }

    pub(crate) fn path(&self) -> &'static Path {
        self.place.path()
    }

    /// Middle of the frame's exposure.
    pub(crate) fn time(&self, frame: u32) -> f64 {
        match self.timing {
            Timing::Fragments {
                length,
                rate,
                every,
            } => f64::from(frame / length) * every + f64::from(frame % length) / rate,
            Timing::Every(seconds) => f64::from(frame) * seconds,
        }
    }

    /// About how many pixels the image moves while the shutter is open, for things at the typical distance in
    /// this place.
    pub(crate) fn blur_in_pixels(&self, time: f64) -> f64 {
        let half = 0.5 * self.sensor.shutter;
        let opens = self.path().world_from_camera(time - half);
        let closes = self.path().world_from_camera(time + half);
        let turned = opens.rotation.angle_to(&closes.rotation);
        let moved = (opens.translation.vector - closes.translation.vector).norm();
        (turned + moved / self.place.distance()) * self.focal
    }
}
