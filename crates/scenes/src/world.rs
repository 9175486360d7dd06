//! A place that is ready to be rendered: geometry, painted textures, computed light.

use std::fmt;

use matchbench_vision::image::{FloatImage, GrayImage, Image};
use matchbench_vision::seed::Seed;
use nalgebra::{Isometry3, Point2, Vector3};
use rayon::prelude::*;

use super::light::Lighting;
use super::mesh::Mesh;
use super::model::Model;
use super::noise::{octaves, smoothstep};
use super::places::Place;
use super::scene::Scene;
use super::texture::Texture;
use super::trace::{LANES, Lanes, NOTHING, Rays, Tree};

/// A place that can be rendered. Building one takes some tenths of a second.
pub struct World {
    place: Place,
    mesh: Mesh,
    tree: Tree,
    textures: Vec<Texture>,
    lighting: Lighting,
    /// Irradiance at each vertex of the mesh.
    light: Vec<f32>,
}

impl fmt::Debug for World {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("World")
            .field("place", &self.place)
            .finish_non_exhaustive()
    }
}

/// A camera at one instant, in the precision of the ray caster.
struct View {
    eye: Vector3<f32>,
    /// Direction of a pixel: `right * x + down * y + forward` for the point (x, y) at depth 1.
    axes: [Vector3<f32>; 3],
}

impl World {
    /// Builds the place with all available threads.
    pub fn build(place: Place) -> Self {
        let Model {
            mesh,
            lighting,
            textures,
        } = place.model();
        let corners: Vec<_> = mesh
            .triangles
            .iter()
            .map(|triangle| triangle.corners.map(|i| mesh.vertices[i as usize].position))
            .collect();
        let tree = Tree::new(&corners);
        let light = lighting.gather(&mesh, &tree);
        let textures = textures
            .into_par_iter()
            .map(|(side, resolution, painter)| Texture::paint(side, resolution, painter))
            .collect();
        Self {
            place,
            mesh,
            tree,
            textures,
            lighting,
            light,
        }
    }

    /// The picture of frame `frame` of `scene`. It depends only on the arguments.
    ///
    /// # Panics
    /// If the scene belongs to another place.
    pub fn render(&self, scene: &Scene, frame: u32) -> GrayImage {
        assert_eq!(scene.place, self.place, "a scene is rendered in its place");
        let time = scene.time(frame);
        let seed = Seed(0).child(scene.name).number(u64::from(frame));
        let radiance = self.radiance(scene, time);
        scene.sensor.expose(&radiance, time, seed)
    }

    /// Depth (z coordinate in the frame of the camera, in metres) of the point that each pixel centre sees in
    /// the middle of the exposure; infinite where it sees the sky.
    ///
    /// # Panics
    /// If the scene belongs to another place.
    pub fn depth(&self, scene: &Scene, frame: u32) -> FloatImage {
        assert_eq!(scene.place, self.place, "a scene is rendered in its place");
        let view = View::new(&scene.world_from_camera(frame));
        let size = scene.size;
        let mut depth = FloatImage::filled(size, f32::INFINITY);
        for y in 0..size.height {
            for first in (0..size.width).step_by(LANES) {
                let directions = std::array::from_fn(|lane| {
                    view.direction(scene, (first + lane) as f64, y as f64)
                });
                let rays = Rays::new([view.eye; LANES], directions);
                let hits = self.tree.nearest(&rays, f32::MAX);
                for lane in (0..LANES).take_while(|lane| first + lane < size.width) {
                    if hits.triangle[lane] != NOTHING {
                        let z = hits.distance[lane] * directions[lane].dot(&view.axes[2]);
                        depth.set(first + lane, y, z);
                    }
                }
            }
        }
        depth
    }

    /// Light that falls on each pixel while the shutter is open. Each sample of a pixel has its own position in
    /// the pixel and its own time, so edges and motion are smooth.
    fn radiance(&self, scene: &Scene, time: f64) -> FloatImage {
        // Times about one pixel of motion apart; the blur of the lens hides the steps.
        let bundles = (0.25 * scene.blur_in_pixels(time)).ceil().clamp(1.0, 4.0);
        let samples = bundles as usize * LANES;
        let views: Vec<View> = (0..samples)
            .map(|i| {
                let part = (i as f64 + 0.5) / samples as f64 - 0.5;
                View::new(
                    &scene
                        .path()
                        .world_from_camera(time + scene.sensor.shutter * part),
                )
            })
            .collect();
        let places = places(samples);
        Image::from_fn(scene.size, |x, y| {
            let mut sum = 0.0;
            for (views, places) in views.chunks_exact(LANES).zip(places.chunks_exact(LANES)) {
                let origins = std::array::from_fn(|lane| views[lane].eye);
                let directions = std::array::from_fn(|lane| {
                    let (dx, dy) = places[lane];
                    views[lane].direction(scene, x as f64 + dx, y as f64 + dy)
                });
                sum += self
                    .shade(scene, samples, origins, directions)
                    .iter()
                    .sum::<f32>();
            }
            sum / samples as f32
        })
    }

    /// Radiance that comes along each ray.
    fn shade(
        &self,
        scene: &Scene,
        samples: usize,
        origins: [Vector3<f32>; LANES],
        directions: [Vector3<f32>; LANES],
    ) -> Lanes {
        let hits = self.tree.nearest(&Rays::new(origins, directions), f32::MAX);
        let pixel = 1.0 / scene.focal as f32;
        let mut points = origins;
        let mut normals = [Vector3::z(); LANES];
        let mut albedo = [0.0; LANES];
        let mut soft = [0.0; LANES];
        let mut gloss = [0.0; LANES];
        for lane in 0..LANES {
            if hits.triangle[lane] == NOTHING {
                continue;
            }
            let triangle = &self.mesh.triangles[hits.triangle[lane] as usize];
            let [a, b, c] = triangle.corners.map(|i| &self.mesh.vertices[i as usize]);
            let (v, w) = (hits.u[lane], hits.v[lane]);
            let u = 1.0 - v - w;
            let normal = (a.normal * u + b.normal * v + c.normal * w).normalize();
            let [la, lb, lc] = triangle.corners.map(|i| self.light[i as usize]);
            let distance = hits.distance[lane];
            // On a slanted surface the footprint of a pixel is long; the samples divide it into pieces.
            let across = distance * pixel;
            let along = across / normal.dot(&directions[lane]).abs().max(0.02);
            let width = (across / (samples as f32).sqrt()).max(along / samples as f32);
            albedo[lane] = triangle.shade
                * self.textures[usize::from(triangle.texture)].look_up(
                    a.uv[0] * u + b.uv[0] * v + c.uv[0] * w,
                    a.uv[1] * u + b.uv[1] * v + c.uv[1] * w,
                    width,
                );
            soft[lane] = la * u + lb * v + lc * w;
            gloss[lane] = triangle.gloss;
            normals[lane] = normal;
            points[lane] = origins[lane] + directions[lane] * distance + normal * 0.003;
        }
        let sun = self.sunlight(&points, &normals);
        std::array::from_fn(|lane| {
            if hits.triangle[lane] == NOTHING {
                return sky(&directions[lane]);
            }
            let mut highlight = 0.0;
            if gloss[lane] > 0.0 {
                // Blinn, "Models of Light Reflection for Computer Synthesized Pictures", 1977,
                // with an exponent of 32.
                let towards = self.lighting.brightest(&points[lane]);
                let half = (towards - directions[lane]).normalize();
                let mut cosine = normals[lane].dot(&half).max(0.0);
                for _ in 0..5 {
                    cosine *= cosine;
                }
                highlight = gloss[lane] * cosine * (soft[lane] + sun[lane]);
            }
            albedo[lane] * (soft[lane] + sun[lane]) + highlight
        })
    }

    /// Direct sunlight at each point, 0 in the shade.
    fn sunlight(&self, points: &[Vector3<f32>; LANES], normals: &[Vector3<f32>; LANES]) -> Lanes {
        let Some((direction, strength)) = self.lighting.sun else {
            return [0.0; LANES];
        };
        let direction = Vector3::from(direction).normalize();
        let cosines = normals.map(|normal| normal.dot(&direction).max(0.0));
        if cosines == [0.0; LANES] {
            return cosines;
        }
        let blocked = self.tree.blocked(&Rays::new(*points, [direction; LANES]));
        std::array::from_fn(|lane| {
            if blocked[lane] {
                0.0
            } else {
                strength * cosines[lane]
            }
        })
    }
}

/// Where in a pixel each of its samples lies, from its centre. They are evenly spread, and their mean is the centre,
/// so that a picture shows each point where its camera says.
///
/// Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences", 2018.
fn places(samples: usize) -> Vec<(f64, f64)> {
    const STEPS: (f64, f64) = (0.754_877_666_246_692_7, 0.569_840_290_998_053_2);
    let axis = |step: f64| {
        let parts: Vec<f64> = (1..=samples)
            .map(|i| (0.5 + step * i as f64).fract())
            .collect();
        let mean = parts.iter().sum::<f64>() / samples as f64;
        parts.into_iter().map(move |part| part - mean)
    };
    axis(STEPS.0).zip(axis(STEPS.1)).collect()
}

impl View {
    fn new(world_from_camera: &Isometry3<f64>) -> Self {
        let rotation = world_from_camera.rotation.to_rotation_matrix();
        Self {
            eye: world_from_camera.translation.vector.cast(),
            axes: [0, 1, 2].map(|k| rotation.matrix().column(k).into_owned().cast()),
        }
    }

    /// Unit vector along which the pixel (x, y) looks, in the world.
    fn direction(&self, scene: &Scene, x: f64, y: f64) -> Vector3<f32> {
        let ideal = scene.camera().normalize(Point2::new(x, y));
        let [right, down, forward] = self.axes;
        (right * ideal.x as f32 + down * ideal.y as f32 + forward).normalize()
    }
}

/// Clouds; brighter than most surfaces.
fn sky(direction: &Vector3<f32>) -> f32 {
    let height = direction.z.max(0.05);
    let (u, v) = (0.05 * direction.x / height, 0.05 * direction.y / height);
    let cloud = smoothstep(-0.3, 0.9, octaves(u, v, 8, 3, 0.55, 301));
    0.65 + 0.5 * cloud
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_samples_of_a_pixel_lie_around_its_centre() {
        for samples in [4, 8, 12, 16] {
            let places = places(samples);
            let mean = |axis: fn(&(f64, f64)) -> f64| {
                places.iter().map(axis).sum::<f64>() / samples as f64
            };
            let off = libm::hypot(mean(|place| place.0), mean(|place| place.1));
            assert!(off < 1e-12, "{samples} samples: {off} pixels");
            for (i, (x, y)) in places.iter().enumerate() {
                assert!(x.abs() < 0.5 && y.abs() < 0.5, "{x} {y}");
                let others = places[..i].iter();
                let nearest = others.map(|other| libm::hypot(x - other.0, y - other.1));
                let apart = nearest.fold(f64::INFINITY, f64::min);
                assert!(apart * (samples as f64).sqrt() > 0.5, "{apart}");
            }
        }
    }
}
