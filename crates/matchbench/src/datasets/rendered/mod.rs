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

pub use cache::{Progress, ensure};
pub use scenes::Place;
pub use world::World;

use std::path::PathBuf;

use matchbench_vision::geometry::Camera;
use matchbench_vision::image::Size;
use nalgebra::Isometry3;

use path::Path;
use sensor::Sensor;

use super::{Frame, PairRule, Sequence};

/// Raised with every change that moves a bit of any picture or pose: older caches are rendered
/// again.
pub const REVISION: u32 = 1;

/// One sequence of the built-in dataset.
#[derive(Clone, Debug)]
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
    pub pair_rule: PairRule,
    /// Focal length, in pixels.
    focal: f64,
    timing: Timing,
    sensor: Sensor,
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

    /// Its frames and pairs with their true poses; the images are made by [`World::render`].
    pub fn sequence(&self) -> Sequence {
        let frames = (0..self.frames)
            .map(|frame| Frame {
                image: PathBuf::new(),
                camera: self.camera(),
                world_from_camera: Some(self.world_from_camera(frame)),
            })
            .collect();
        let (frames, pairs) = (self.pair_rule.apply(frames))
            .expect("all frames have poses, and no rule reads a file");
        Sequence {
            name: self.name.into(),
            frames,
            pairs,
        }
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

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use matchbench_vision::image::{FloatImage, Size};
    use nalgebra::{Matrix3, Point2, Point3};

    use super::*;

    static CABINET: LazyLock<World> = LazyLock::new(|| World::build(Place::Cabinet));

    fn scene(name: &str) -> RenderedScene {
        let found = sequences().iter().find(|scene| scene.name == name);
        found.expect("a sequence of that name").clone()
    }

    /// The same sequence in images of a quarter of the width.
    fn small(name: &str) -> RenderedScene {
        let scene = scene(name);
        RenderedScene {
            size: Size::new(scene.size.width / 4, scene.size.height / 4),
            focal: scene.focal / 4.0,
            ..scene
        }
    }

    #[test]
    fn pictures_are_those_of_this_revision() {
        // If this fails because pictures were meant to change, raise REVISION and copy the hashes.
        let golden = [
            ("office", "abc37e3229d609cd"),
            ("object", "1cf4a9519c618fdf"),
            ("cabinet", "0ebe0314de347c0a"),
            ("street", "baaeae39729b02b3"),
            ("facade", "533561c5f03652eb"),
        ];
        let rendered = golden.map(|(name, _)| {
            let scene = small(name);
            let picture = World::build(scene.place).render(&scene, 7);
            (name, blake3::hash(picture.data()).to_hex()[..16].to_owned())
        });
        let golden = golden.map(|(name, hash)| (name, hash.to_owned()));
        assert_eq!((REVISION, rendered), (1, golden));
    }

    #[test]
    fn one_thread_and_two_render_the_same_bits() {
        let scene = small("cabinet");
        let [one, two] = [1, 2].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads can be started").install(|| {
                let world = World::build(Place::Cabinet);
                (world.render(&scene, 3), world.depth(&scene, 3))
            })
        });
        assert_eq!(one, two);
    }

    #[test]
    fn points_seen_in_one_frame_lie_on_what_the_other_sees() {
        let scene = scene("cabinet-wide");
        let camera = scene.camera();
        let (a, b) = (2, 3);
        let b_from_a = scene.world_from_camera(b).inverse() * scene.world_from_camera(a);
        let [depth_a, depth_b] = [a, b].map(|frame| CABINET.depth(&scene, frame));
        let (mut seen, mut equal, mut floating) = (0, 0, 0);
        for y in (0..scene.size.height).step_by(3) {
            for x in (0..scene.size.width).step_by(3) {
                let ray = camera.normalize(Point2::new(x as f64, y as f64));
                let z = f64::from(depth_a.at(x, y));
                let in_b = b_from_a * Point3::new(ray.x * z, ray.y * z, z);
                let pixel = camera.project(Point2::new(in_b.x / in_b.z, in_b.y / in_b.z));
                let Some((nearest, furthest)) = range_around(&depth_b, pixel) else {
                    continue;
                };
                seen += 1;
                equal += i32::from(in_b.z > nearest * 0.999 && in_b.z < furthest * 1.001);
                // Before everything that b sees there: impossible, or b would see the point.
                floating += i32::from(in_b.z < nearest * 0.999);
            }
        }
        assert!(seen > 4000, "{seen} points in view");
        assert!(
            equal * 10 > seen * 8,
            "{equal} of {seen} at the right depth"
        );
        assert!(
            floating * 500 < seen,
            "{floating} of {seen} before the surface"
        );
    }

    /// Smallest and largest depth of the four pixels around a point; `None` outside the image.
    fn range_around(depth: &FloatImage, at: Point2<f64>) -> Option<(f64, f64)> {
        let (x, y) = (at.x.floor(), at.y.floor());
        let inside = x >= 0.0 && y >= 0.0;
        let (x, y) = (x as usize, y as usize);
        if !inside || x + 1 >= depth.width() || y + 1 >= depth.height() {
            return None;
        }
        let around = [(0, 0), (1, 0), (0, 1), (1, 1)];
        let depths = around.map(|(dx, dy)| f64::from(depth.at(x + dx, y + dy)));
        Some((
            depths.iter().fold(f64::INFINITY, |a, &b| a.min(b)),
            depths.iter().fold(0.0, |a, &b| a.max(b)),
        ))
    }

    #[test]
    fn poses_are_rigid_and_the_camera_moves() {
        for scene in sequences() {
            for frame in 0..scene.frames {
                let pose = scene.world_from_camera(frame);
                let r = pose.rotation.to_rotation_matrix();
                let off = (r.matrix() * r.matrix().transpose() - Matrix3::identity()).abs();
                assert!(off.max() < 1e-12 && (r.matrix().determinant() - 1.0).abs() < 1e-12);
            }
            for pair in scene.sequence().pairs {
                let baseline = pair.b_from_a.translation.vector.norm();
                assert!(baseline > 0.002, "{} {} {}", scene.name, pair.a, pair.b);
            }
        }
    }

    #[test]
    fn pairs_follow_their_rules() {
        let ends = |name: &str| -> Vec<(u32, u32)> {
            (scene(name).sequence().pairs.iter())
                .map(|pair| (pair.a, pair.b))
                .collect()
        };
        assert_eq!(ends("office").len(), 3 * 9);
        assert_eq!(ends("office")[8..10], [(0, 9), (10, 11)]);
        assert_eq!(ends("street").len(), 5 * 4);
        assert_eq!(ends("facade").len(), 12 * 11 / 2);
        assert_eq!(ends("office-wide").len(), 14 * 4 - 10);
        assert_eq!(ends("office-wide").last(), Some(&(12, 13)));
    }

    #[test]
    fn a_picture_uses_the_range_of_grey_values() {
        let scene = small("office");
        let picture = World::build(Place::Office).render(&scene, 0);
        let mut values = picture.data().to_vec();
        values.sort_unstable();
        let at = |share: f64| values[(share * (values.len() - 1) as f64) as usize];
        assert!(at(0.05) > 5 && at(0.95) < 250, "not cut off at either end");
        assert!(at(0.95) - at(0.05) > 60, "{} to {}", at(0.05), at(0.95));
    }
}
