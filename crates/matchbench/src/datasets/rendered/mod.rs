//! The built-in dataset: scenes rendered by a small ray caster, with exact poses and depth.
//!
//! Eight sequences in the spirit of the paper's: an office, an object that is not planar, a
//! cabinet with little texture and a drive through a street for short baselines; a castle-like
//! facade and the first three places again, sub-sampled, for wide ones. They are a self-test and a
//! demonstration that needs no download; they do not replace photographs.
//!
//! How a frame comes about:
//!
//! ```text
//! scenes/*     shapes, textures, lights of a place; the camera's path
//!   mesh         everything becomes triangles, relief included
//!   paint        albedo as a function of place, detail on every scale (noise, texture)
//!   light        soft light per vertex
//! world        four or more rays per pixel, each at its own instant of the exposure (trace)
//! sensor       lens blur, exposure, photon and read noise, gamma, 8 bits
//! cache        all sequences as files, rendered on first use
//! ```
//!
//! The same bits come out on every machine and for any number of threads: no function whose last
//! bit differs between platforms is used, and the noise of a pixel depends on its frame and place
//! alone. A change that moves a bit must raise [`REVISION`]; a test with golden hashes reminds.

mod cache;
mod light;
mod mesh;
mod noise;
mod paint;
mod path;
mod scenes;
mod sensor;
mod texture;
mod trace;
mod world;

pub use cache::{Progress, RenderError, ensure};
pub use scenes::Place;
pub use world::World;

use matchbench_vision::geometry::Camera;
use matchbench_vision::image::Size;
use nalgebra::Isometry3;

use path::Path;
use sensor::Sensor;

use super::Pair;

/// Raised with every change that moves a bit of any picture or pose: older caches are rendered
/// again.
pub const REVISION: u32 = 1;

/// One sequence of the built-in dataset.
#[derive(Debug)]
pub struct RenderedScene {
    /// Its name in tables and its folder's name.
    pub name: &'static str,
    /// What it shows and what is hard about it.
    pub description: &'static str,
    /// Where the pictures are taken.
    pub place: Place,
    /// Size of the images.
    pub size: Size,
    /// Number of frames.
    pub frames: u32,
    /// Which frames are matched with which.
    pub pairing: Pairing,
    /// Focal length, in pixels.
    focal: f64,
    timing: Timing,
    sensor: Sensor,
}

/// Which frames of a sequence form pairs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pairing {
    /// Fragments of so many frames; the first of each is matched to each of its others.
    Fragments(u32),
    /// Each frame is matched to the next so many.
    Window(u32),
    /// Each frame is matched to each later one.
    All,
}

/// When the frames are taken, in seconds.
#[derive(Clone, Copy, Debug)]
enum Timing {
    /// Fragments of `length` frames at `rate` per second; a fragment starts every `every` seconds.
    Fragments { length: u32, rate: f64, every: f64 },
    /// One frame every so many seconds.
    Every(f64),
}

/// The sequences of the built-in dataset, in the order of the paper's eight.
pub fn sequences() -> &'static [RenderedScene] {
    &scenes::SEQUENCES
}

impl RenderedScene {
    /// The camera of all frames: a pinhole whose axis is not quite in the middle.
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

    /// The pairs to be matched, with their true poses.
    pub fn pairs(&self) -> Vec<Pair> {
        let mut pairs = Vec::new();
        for a in 0..self.frames {
            let to = match self.pairing {
                Pairing::Fragments(length) if a % length == 0 => a + length,
                Pairing::Fragments(_) => a,
                Pairing::Window(width) => a + 1 + width,
                Pairing::All => self.frames,
            };
            pairs.extend((a + 1..to.min(self.frames)).map(|b| Pair {
                a,
                b,
                b_from_a: self.world_from_camera(b).inverse() * self.world_from_camera(a),
            }));
        }
        pairs
    }

    fn path(&self) -> &'static Path {
        self.place.path()
    }

    /// Middle of the frame's exposure.
    fn time(&self, frame: u32) -> f64 {
        match self.timing {
            Timing::Fragments {
                length,
                rate,
                every,
            } => f64::from(frame / length) * every + f64::from(frame % length) / rate,
            Timing::Every(seconds) => f64::from(frame) * seconds,
        }
    }

    /// About how far the image moves while the shutter is open, for things as far away as the
    /// place is typically wide.
    fn blur_in_pixels(&self, time: f64) -> f64 {
        let half = 0.5 * self.sensor.shutter;
        let opens = self.path().world_from_camera(time - half);
        let closes = self.path().world_from_camera(time + half);
        let turned = opens.rotation.angle_to(&closes.rotation);
        let moved = (opens.translation.vector - closes.translation.vector).norm();
        (turned + moved / self.place.distance()) * self.focal
    }
}
