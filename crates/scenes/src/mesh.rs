//! Shapes made of triangles: sheets with relief, boxes, cylinders, blobs.
//!
//! Everything is made of triangles, so one intersection routine gives the exact geometry of all scenes. Relief
//! (stone blocks, door panels, fur) is real geometry with real parallax. Texture coordinates are metres along
//! the surface. World frame: z up, metres.

use matchbench_vision::seed::Rng;
use nalgebra::{Isometry3, Point3, Vector3};

/// The material of a surface.
#[derive(Clone, Copy)]
pub(super) struct Surface {
    /// Index of its texture.
    pub texture: usize,
    /// Factor on the texture's albedo.
    pub shade: f32,
    /// Strength of the highlight; 0 is matt.
    pub gloss: f32,
}

impl Surface {
    /// A matt surface that shows a random part of `texture`.
    pub(super) fn matt(texture: usize) -> Self {
        Self {
            texture,
            shade: 1.0,
            gloss: 0.0,
        }
    }

    /// The same surface, lighter or darker.
    pub(super) fn shaded(self, shade: f64) -> Self {
        Self {
            shade: shade as f32,
            ..self
        }
    }

    /// The same surface with a highlight.
    pub(super) fn glossy(self, gloss: f32) -> Self {
        Self { gloss, ..self }
    }
}

/// A corner that triangles share.
pub(super) struct Vertex {
    pub position: Vector3<f32>,
    pub normal: Vector3<f32>,
    pub uv: [f32; 2],
}

/// Three corners and their material.
pub(super) struct Triangle {
    pub corners: [u32; 3],
    pub texture: u16,
    pub shade: f32,
    pub gloss: f32,
}

/// All triangles of a scene.
pub(super) struct Mesh {
    pub vertices: Vec<Vertex>,
    pub triangles: Vec<Triangle>,
    grain: f64,
    rng: Rng,
}

impl Mesh {
    /// A mesh without triangles. Flat surfaces get a vertex about every `grain` metres, where light is
    /// computed. `rng` chooses the part of its texture that each surface shows.
    pub(super) fn new(grain: f64, rng: Rng) -> Self {
        Self {
            vertices: Vec::new(),
            triangles: Vec::new(),
            grain,
            rng,
        }
    }

    /// A flat parallelogram `corner + s u + t v` for s and t in [0, 1]. Its front is the side from which u, v
    /// and the normal are right-handed.
    pub(super) fn sheet(
        &mut self,
        corner: Point3<f64>,
        u: Vector3<f64>,
        v: Vector3<f64>,
        surface: Surface,
    ) {
        self.relief(corner, u, v, self.grain, surface, |_, _| 0.0);
    }

    /// A sheet that is raised by `height(x, y)` metres, x and y in metres along its edges, with a
    /// vertex about every `cell` metres.
    pub(super) fn relief(
        &mut self,
        corner: Point3<f64>,
        u: Vector3<f64>,
        v: Vector3<f64>,
        cell: f64,
        surface: Surface,
        height: impl Fn(f64, f64) -> f64,
    ) {
        let (width, length) = (u.norm(), v.norm());
        let up = u.cross(&v).normalize();
        self.patch(
            surface,
            (width / cell).ceil().max(1.0) as usize,
            (length / cell).ceil().max(1.0) as usize,
            |s, t| {
                let (x, y) = (s * width, t * length);
                (corner + u * s + v * t + up * height(x, y), [x, y])
            },
        );
    }

    /// A box of `size`; its centre and axes are those of `frame`.
    pub(super) fn cuboid(&mut self, frame: &Isometry3<f64>, size: [f64; 3], surface: Surface) {
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                let mut edges = [Vector3::zeros(); 3];
                for (k, edge) in edges.iter_mut().enumerate() {
                    edge[(axis + k) % 3] = size[(axis + k) % 3];
                }
                let [normal, mut u, mut v] = edges;
                if sign < 0.0 {
                    std::mem::swap(&mut u, &mut v);
                }
                let corner = Point3::from((normal * sign - u - v) * 0.5);
                self.sheet(frame * corner, frame * u, frame * v, surface);
            }
        }
    }

    /// A cylinder on the xy plane of `frame`, along its z axis, with a lid.
    pub(super) fn cylinder(
        &mut self,
        frame: &Isometry3<f64>,
        radius: f64,
        height: f64,
        surface: Surface,
    ) {
        let turn = std::f64::consts::TAU;
        let around = |s: f64| Vector3::new(libm::cos(turn * s), libm::sin(turn * s), 0.0) * radius;
        let steps = (height / self.grain).ceil().max(1.0) as usize;
        self.patch(surface, 20, steps, |s, t| {
            let at = Point3::from(around(s) + Vector3::z() * (height * t));
            (frame * at, [turn * radius * s, height * t])
        });
        self.patch(surface, 20, 1, |s, t| {
            let at = Point3::from(around(s) * t + Vector3::z() * height);
            (frame * at, [around(s).x * t, around(s).y * t])
        });
    }

    /// An ellipsoid of `radii` whose radius in each direction is scaled by `1 + bump(direction)`. It is made of
    /// the six faces of a cube, so that there is no pole where the texture is squeezed.
    pub(super) fn blob(
        &mut self,
        frame: &Isometry3<f64>,
        radii: [f64; 3],
        steps: usize,
        surface: Surface,
        bump: impl Fn(&Vector3<f64>) -> f64,
    ) {
        let radii = Vector3::from(radii);
        let face_length = radii.mean() * 1.6;
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                self.patch(surface, steps, steps, |s, t| {
                    let mut cube = Vector3::zeros();
                    // The tangent makes the vertices evenly spaced on the sphere.
                    let spread = |x: f64| libm::tan((x - 0.5) * std::f64::consts::FRAC_PI_2);
                    cube[axis] = sign;
                    cube[(axis + 1) % 3] = spread(s) * sign;
                    cube[(axis + 2) % 3] = spread(t);
                    let direction = cube.normalize();
                    let at = direction.component_mul(&radii) * (1.0 + bump(&direction));
                    (frame * Point3::from(at), [s * face_length, t * face_length])
                });
            }
        }
    }

    /// A grid of `columns` x `rows` quads over the unit square; `place` gives position and texture
    /// coordinates. Normals are those of the triangles around each vertex.
    fn patch(
        &mut self,
        surface: Surface,
        columns: usize,
        rows: usize,
        place: impl Fn(f64, f64) -> (Point3<f64>, [f64; 2]),
    ) {
        let [u0, v0] = [0, 1].map(|_| 64.0 * self.rng.uniform());
        let first = self.vertices.len();
        for j in 0..=rows {
            for i in 0..=columns {
                let (at, [u, v]) = place(i as f64 / columns as f64, j as f64 / rows as f64);
                self.vertices.push(Vertex {
                    position: at.coords.cast(),
                    normal: Vector3::zeros(),
                    uv: [(u0 + u) as f32, (v0 + v) as f32],
                });
            }
        }
        for j in 0..rows {
            for i in 0..columns {
                let corner = (first + j * (columns + 1) + i) as u32;
                let below = corner + columns as u32 + 1;
                self.triangle([corner, corner + 1, below + 1], surface);
                self.triangle([corner, below + 1, below], surface);
            }
        }
        for vertex in &mut self.vertices[first..] {
            let length = vertex.normal.norm();
            if length > 0.0 {
                vertex.normal /= length;
            }
        }
    }

    fn triangle(&mut self, corners: [u32; 3], surface: Surface) {
        let [a, b, c] = corners.map(|i| self.vertices[i as usize].position);
        let area_normal = (b - a).cross(&(c - a));
        if area_normal.norm() == 0.0 {
            return; // a corner of a lid or a pole
        }
        for corner in corners {
            self.vertices[corner as usize].normal += area_normal;
        }
        self.triangles.push(Triangle {
            corners,
            texture: u16::try_from(surface.texture).expect("a scene has few textures"),
            shade: surface.shade,
            gloss: surface.gloss,
        });
    }
}
