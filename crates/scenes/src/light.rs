//! Light: soft light is computed once per vertex, sharp sunlight per sample.
//!
//! Light from the sky and from lamps, and dark corners, vary slowly. So they are computed at the vertices and
//! interpolated. As in reality they do not move with the camera; only highlights do.

use matchbench_vision::seed::Seed;
use nalgebra::Vector3;
use rayon::prelude::*;

use super::mesh::{Mesh, Vertex};
use super::trace::{LANES, NOTHING, Rays, Tree};

/// The light of a scene.
pub(super) struct Lighting {
    /// Irradiance from all directions at a place with nothing near it.
    pub ambient: f32,
    /// Largest distance, in metres, at which a surface darkens another.
    pub reach: f32,
    /// Rectangles that emit light.
    pub lamps: Vec<Lamp>,
    /// Direction to the sun and its irradiance.
    pub sun: Option<([f32; 3], f32)>,
}

/// A lamp or a window: a rectangle that emits light to both sides.
pub(super) struct Lamp {
    pub centre: [f32; 3],
    /// Half its width and half its height.
    pub edges: [[f32; 3]; 2],
    /// Irradiance on a surface that faces it at 1 metre.
    pub power: f32,
}

/// Number of directions of the hemisphere that are tested at a vertex, and of points of a lamp.
const DIRECTIONS: usize = 16;
const LAMP_POINTS: usize = 16;

impl Lighting {
    /// Irradiance at each vertex, without the sun's direct light.
    pub(super) fn gather(&self, mesh: &Mesh, tree: &Tree) -> Vec<f32> {
        let directions = hemisphere();
        mesh.vertices
            .par_iter()
            .map(|vertex| {
                let lamps: f32 = self
                    .lamps
                    .iter()
                    .map(|lamp| lamp.reaches(vertex, tree))
                    .sum();
                self.ambient * self.openness(vertex, tree, &directions) + lamps
            })
            .collect()
    }

    /// Direction in which a highlight mirrors the brightest light, as seen from `at`.
    pub(super) fn brightest(&self, at: &Vector3<f32>) -> Vector3<f32> {
        match (&self.sun, self.lamps.first()) {
            (Some((direction, _)), _) => Vector3::from(*direction),
            (None, Some(lamp)) => (Vector3::from(lamp.centre) - at).normalize(),
            (None, None) => Vector3::z(),
        }
    }

    /// Share of the ambient light that reaches the vertex, between 0 and 1.
    fn openness(
        &self,
        vertex: &Vertex,
        tree: &Tree,
        directions: &[Vector3<f32>; DIRECTIONS],
    ) -> f32 {
        let normal = vertex.normal;
        let side = if normal.x.abs() < 0.6 {
            Vector3::x()
        } else {
            Vector3::y()
        };
        let tangent = normal.cross(&side).normalize();
        let bitangent = normal.cross(&tangent);
        let mut open = 0.0;
        for bundle in directions.chunks_exact(LANES) {
            let towards = std::array::from_fn(|lane| {
                tangent * bundle[lane].x + bitangent * bundle[lane].y + normal * bundle[lane].z
            });
            let rays = Rays::new([lifted(vertex); LANES], towards);
            let hits = tree.nearest(&rays, self.reach);
            for lane in 0..LANES {
                let distance = hits.distance[lane] / self.reach;
                // A near surface blocks light, but reflects some of its own.
                open += if hits.triangle[lane] == NOTHING {
                    1.0
                } else {
                    0.25 + 0.75 * distance
                };
            }
        }
        open / DIRECTIONS as f32
    }
}

impl Lamp {
    /// Irradiance at the vertex from this lamp, with soft shadows.
    fn reaches(&self, vertex: &Vertex, tree: &Tree) -> f32 {
        let [u, v] = self.edges.map(Vector3::from);
        let facing = u.cross(&v).normalize();
        let at = lifted(vertex);
        let points: [Vector3<f32>; LAMP_POINTS] = std::array::from_fn(|i| {
            let place = |k: usize| 0.5 * k as f32 - 0.75;
            Vector3::from(self.centre) + u * place(i % 4) + v * place(i / 4)
        });
        let mut sum = 0.0;
        for bundle in points.chunks_exact(LANES) {
            let ways: [Vector3<f32>; LANES] = std::array::from_fn(|lane| bundle[lane] - at);
            let lengths = ways.map(|way| way.norm());
            let furthest = lengths.iter().fold(0.0_f32, |a, &b| a.max(b));
            let directions = std::array::from_fn(|lane| ways[lane] / lengths[lane]);
            let rays = Rays::new([at; LANES], directions);
            let hits = tree.nearest(&rays, 0.99 * furthest);
            for lane in 0..LANES {
                if hits.triangle[lane] == NOTHING || hits.distance[lane] > 0.98 * lengths[lane] {
                    let cosines = vertex.normal.dot(&directions[lane]).max(0.0)
                        * facing.dot(&directions[lane]).abs();
                    sum += cosines / (lengths[lane] * lengths[lane]).max(0.04);
                }
            }
        }
        self.power * sum / LAMP_POINTS as f32
    }
}

/// The vertex, moved a little off its own surface.
fn lifted(vertex: &Vertex) -> Vector3<f32> {
    vertex.position + vertex.normal * 0.004
}

/// Cosine-weighted directions around z: a spiral of equal shares.
fn hemisphere() -> [Vector3<f32>; DIRECTIONS] {
    let mut rng = Seed(1).rng();
    std::array::from_fn(|i| {
        let share = (i as f64 + 0.5) / DIRECTIONS as f64;
        let turn = std::f64::consts::TAU * (0.618_033_988_75 * i as f64 + 0.1 * rng.uniform());
        let radius = share.sqrt();
        Vector3::new(
            radius * libm::cos(turn),
            radius * libm::sin(turn),
            (1.0 - share).sqrt(),
        )
        .cast()
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::mesh::Surface;

    #[test]
    fn a_roof_takes_the_light_away() {
        let mut mesh = Mesh::new(1.0, Seed(0).rng());
        let (x, y) = (Vector3::x(), Vector3::y());
        mesh.sheet(Point3::new(-5.0, -0.5, 0.0), x, y, Surface::matt(0));
        mesh.sheet(Point3::new(5.0, -0.5, 0.0), x, y, Surface::matt(0));
        mesh.sheet(
            Point3::new(4.0, -1.5, 0.2),
            x * 3.0,
            y * 3.0,
            Surface::matt(0),
        );
        let corners: Vec<_> = mesh
            .triangles
            .iter()
            .map(|triangle| triangle.corners.map(|i| mesh.vertices[i as usize].position))
            .collect();
        let lighting = Lighting {
            ambient: 1.0,
            reach: 10.0,
            lamps: vec![],
            sun: None,
        };
        let light = lighting.gather(&mesh, &Tree::new(&corners));
        assert!((light[0] - 1.0).abs() < 1e-6, "in the open: {}", light[0]);
        assert!(light[4] < 0.7, "under the roof: {}", light[4]);
    }
}
