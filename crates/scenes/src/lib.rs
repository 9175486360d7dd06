//! Rendered scenes with exact poses and depth: a small ray caster and ten sequences taken with it.
//!
//! For short baselines there are an office, an object that is not planar, a cabinet with little texture, and a
//! drive through a street. For wide baselines there are a castle-like facade, and the first three places again,
//! sub-sampled. For homographies there are a painted wall and a tiled one, which are planes. The scenes are a
//! self-test and a demonstration that needs no download; they do not replace photographs.
//!
//! ```
//! use matchbench_scenes::{World, scenes};
//!
//! let scene = &scenes()[2];
//! assert_eq!(scene.name, "cabinet");
//! let (a, b) = (0, 9);
//! let b_from_a = scene.world_from_camera(b).inverse() * scene.world_from_camera(a);
//! assert!(b_from_a.translation.vector.norm() > 0.01, "metres");
//!
//! let world = World::build(scene.place);
//! let (image, depth) = (world.render(scene, a), world.depth(scene, a));
//! assert_eq!((image.size(), depth.size()), (scene.size, scene.size));
//! ```
//!
//! How a frame is made:
//!
//! ```text
//! table        the scenes: which place, which frames, through which lens
//! places/*     shapes, textures, lights of a place; the camera's path
//!   mesh         everything becomes triangles, relief included
//!   paint        albedo as a function of place, detail on every scale (noise, texture)
//!   light        soft light per vertex
//! world        four or more rays per pixel, each at its own instant of the exposure (trace)
//! sensor       lens blur, exposure, photon and read noise, gamma, 8 bits
//! ```
//!
//! The bits are the same on every machine and for any number of threads. No function is used whose last bit
//! differs between platforms, and the noise of a pixel depends only on its frame and its position. A change
//! that alters a bit must increase [`REVISION`]; a test with golden hashes fails otherwise.

mod light;
mod mesh;
mod model;
mod noise;
mod paint;
mod path;
mod places;
mod scene;
mod sensor;
mod table;
mod texture;
mod trace;
mod world;

pub use places::Place;
pub use scene::{Pairing, Scene};
pub use world::World;

/// The examples of the README are tested.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

/// Increased with every change that alters a bit of any picture or pose. Pictures that were kept are then
/// rendered again.
pub const REVISION: u32 = 2;

/// The scenes: eight in the order of the paper's sequences, then two that are planes.
pub fn scenes() -> &'static [Scene] {
    &table::SCENES
}

#[cfg(test)]
mod tests {
    use std::sync::OnceLock;

    use matchbench_vision::geometry::{Camera, transfer};
    use matchbench_vision::image::{FloatImage, Size};
    use nalgebra::{Isometry3, Matrix3, Matrix4, Point2, Point3, Vector2, Vector4};

    use super::*;

    /// The place, built once for all tests.
    fn world(place: Place) -> &'static World {
        static WORLDS: [OnceLock<World>; Place::ALL.len()] =
            [const { OnceLock::new() }; Place::ALL.len()];
        let mut worlds = Place::ALL.iter().zip(&WORLDS);
        let (_, built) = worlds.find(|(of, _)| **of == place).expect("all places");
        built.get_or_init(|| World::build(place))
    }

    fn named(name: &str) -> Scene {
        let found = scenes().iter().find(|scene| scene.name == name);
        found.expect("a scene of that name").clone()
    }

    /// The same scene in images of a quarter of the width.
    fn small(name: &str) -> Scene {
        let scene = named(name);
        Scene {
            size: Size::new(scene.size.width / 4, scene.size.height / 4),
            focal: scene.focal / 4.0,
            ..scene
        }
    }

    #[test]
    fn pictures_are_those_of_this_revision() {
        // If this fails because pictures were changed on purpose, increase REVISION and copy the hashes.
        let golden = [
            ("office", "b2e8452b7faf68de"),
            ("object", "355323ee303015a3"),
            ("cabinet", "e493ced498315808"),
            ("street", "ddf6977559359338"),
            ("facade", "8df3cc37eb3b90f6"),
            ("mural", "a3f4d57246777353"),
            ("tiling", "0545b2f4263318e9"),
        ];
        let rendered = golden.map(|(name, _)| {
            let scene = small(name);
            let picture = world(scene.place).render(&scene, 7);
            (name, blake3::hash(picture.data()).to_hex()[..16].to_owned())
        });
        let golden = golden.map(|(name, hash)| (name, hash.to_owned()));
        assert_eq!((REVISION, rendered), (2, golden));
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

    /// What pixel (`x`, `y`) of `a` sees at this depth: its place before camera `b`, and in the image of `b`.
    fn taken(
        camera: &Camera,
        b_from_a: &Isometry3<f64>,
        [x, y]: [usize; 2],
        depth: f32,
    ) -> (Point3<f64>, Point2<f64>) {
        let (ray, z) = (
            camera.normalize(Point2::new(x as f64, y as f64)),
            f64::from(depth),
        );
        let in_b = b_from_a * Point3::new(ray.x * z, ray.y * z, z);
        let pixel = camera.project(Point2::new(in_b.x / in_b.z, in_b.y / in_b.z));
        (in_b, pixel)
    }

    #[test]
    fn points_seen_in_one_frame_lie_on_what_the_other_sees() {
        let scene = named("cabinet-wide");
        let camera = scene.camera();
        let (a, b) = (2, 3);
        let b_from_a = scene.world_from_camera(b).inverse() * scene.world_from_camera(a);
        let [depth_a, depth_b] = [a, b].map(|frame| world(scene.place).depth(&scene, frame));
        let (mut seen, mut equal, mut floating) = (0, 0, 0);
        for y in (0..scene.size.height).step_by(3) {
            for x in (0..scene.size.width).step_by(3) {
                let (in_b, pixel) = taken(&camera, &b_from_a, [x, y], depth_a.at(x, y));
                let Some((nearest, furthest)) = range_around(&depth_b, pixel) else {
                    continue;
                };
                seen += 1;
                equal += i32::from(in_b.z > nearest * 0.999 && in_b.z < furthest * 1.001);
                // A point in front of everything that b sees there is impossible, since b would see the point.
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

    /// By how many pixels the picture of frame `b` is shifted against that of frame `a`, taken to `b` by its depth and the
    /// poses: the step of Lucas and Kanade, "An Iterative Image Registration Technique", 1981, with a gain and an offset.
    fn shift_of_the_picture(scene: &Scene, a: u32, b: u32) -> Vector2<f64> {
        let (world, camera) = (world(scene.place), scene.camera());
        let [picture_a, picture_b] = [a, b].map(|frame| world.render(scene, frame));
        let [depth_a, depth_b] = [a, b].map(|frame| world.depth(scene, frame));
        let b_from_a = scene.world_from_camera(b).inverse() * scene.world_from_camera(a);
        let mut normal = Matrix4::zeros();
        let mut right = Vector4::zeros();
        for y in 0..scene.size.height {
            for x in 0..scene.size.width {
                let (in_b, pixel) = taken(&camera, &b_from_a, [x, y], depth_a.at(x, y));
                let is_seen = range_around(&depth_b, pixel).is_some_and(|(nearest, furthest)| {
                    in_b.z > nearest * 0.999 && in_b.z < furthest * 1.001
                });
                if !is_seen {
                    continue;
                }
                let (left, top) = (pixel.x as usize, pixel.y as usize);
                let (u, v) = (pixel.x - left as f64, pixel.y - top as f64);
                let [p, q, r, s] = [(0, 0), (1, 0), (0, 1), (1, 1)]
                    .map(|(dx, dy)| f64::from(picture_b.at(left + dx, top + dy)));
                let seen = (p * (1.0 - u) + q * u) * (1.0 - v) + (r * (1.0 - u) + s * u) * v;
                let across = (q - p) * (1.0 - v) + (s - r) * v;
                let down = (r - p) * (1.0 - u) + (s - q) * u;
                // seen = slope of b * shift + gain * a + offset
                let row = Vector4::new(across, down, f64::from(picture_a.at(x, y)), 1.0);
                normal += row * row.transpose();
                right += row * seen;
            }
        }
        let found = normal.lu().solve(&right).expect("there is texture");
        found.xy()
    }

    /// Pictures that are half a pixel beside their poses and depths would be shifted where the camera turns: by an eighth of a
    /// circle before the mural.
    #[test]
    fn pictures_show_what_their_poses_and_depths_say() {
        for (name, a, b) in [
            ("office", 0, 1),
            ("object", 0, 1),
            ("street", 0, 1),
            ("facade", 0, 1),
            ("mural", 6, 8),
            ("mural", 8, 6),
        ] {
            let off = shift_of_the_picture(&small(name), a, b);
            assert!(off.norm() < 0.1, "{name}: {off}");
        }
    }

    #[test]
    fn the_homography_takes_pixels_where_their_rays_meet_the_wall() {
        for name in ["mural", "tiling"] {
            let scene = small(name);
            let camera = scene.camera();
            let depth = world(scene.place).depth(&scene, 6);
            let b_from_a = scene.world_from_camera(9).inverse() * scene.world_from_camera(6);
            let homography = scene.homography(6, 9).expect("a plane scene");
            for y in (0..scene.size.height).step_by(11) {
                for x in (0..scene.size.width).step_by(11) {
                    let z = depth.at(x, y);
                    let (_, seen) = taken(&camera, &b_from_a, [x, y], z);
                    let pixel = Point2::new(x as f64, y as f64);
                    let off = (transfer(&homography, pixel) - seen).norm();
                    assert!(off < 1e-3, "{name} {x} {y}: {off} pixels, depth {z}");
                }
            }
        }
        assert_eq!(small("office").homography(0, 1), None);
    }

    #[test]
    fn poses_are_rigid_and_the_camera_moves() {
        for scene in scenes() {
            for frame in 0..scene.frames {
                let pose = scene.world_from_camera(frame);
                let r = pose.rotation.to_rotation_matrix();
                let off = (r.matrix() * r.matrix().transpose() - Matrix3::identity()).abs();
                assert!(off.max() < 1e-12 && (r.matrix().determinant() - 1.0).abs() < 1e-12);
            }
            for frame in 1..scene.frames {
                let [a, b] = [frame - 1, frame].map(|frame| scene.world_from_camera(frame));
                let baseline = (b.translation.vector - a.translation.vector).norm();
                assert!(baseline > 0.002, "{} {frame}", scene.name);
            }
        }
    }

    #[test]
    fn a_picture_uses_the_range_of_grey_values() {
        let scene = small("office");
        let picture = world(Place::Office).render(&scene, 0);
        let mut values = picture.data().to_vec();
        values.sort_unstable();
        let at = |share: f64| values[(share * (values.len() - 1) as f64) as usize];
        assert!(at(0.05) > 5 && at(0.95) < 250, "not cut off at either end");
        assert!(at(0.95) - at(0.05) > 60, "{} to {}", at(0.05), at(0.95));
    }
}
