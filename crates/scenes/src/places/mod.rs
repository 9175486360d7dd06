//! The places that the scenes show.

mod cabinet;
mod facade;
mod mural;
mod object;
mod office;
mod street;
mod tiling;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::mesh::{Mesh, Surface};
use crate::model::Model;
use crate::noise::gradient;
use crate::path::Path;

/// A place in which pictures are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Place {
    /// A room with a desk, shelves and clutter.
    Office,
    /// A plush toy on a bare floor.
    Object,
    /// A steel cabinet in an empty room.
    Cabinet,
    /// A street between houses.
    Street,
    /// The court of a stone building.
    Facade,
    /// A painted wall, which is a plane.
    Mural,
    /// A wall of ornamental tiles, which is a plane.
    Tiling,
}

impl Place {
    /// All places.
    pub const ALL: [Self; 7] = [
        Self::Office,
        Self::Object,
        Self::Cabinet,
        Self::Street,
        Self::Facade,
        Self::Mural,
        Self::Tiling,
    ];

    pub(crate) fn model(self) -> Model {
        match self {
            Self::Office => office::model(),
            Self::Object => object::model(),
            Self::Cabinet => cabinet::model(),
            Self::Street => street::model(),
            Self::Facade => facade::model(),
            Self::Mural => mural::model(),
            Self::Tiling => tiling::model(),
        }
    }

    /// Typical distance, in metres, of the things that show motion blur first.
    pub(crate) fn distance(self) -> f64 {
        match self {
            Self::Office | Self::Object | Self::Cabinet | Self::Tiling => 1.5,
            Self::Street | Self::Mural => 6.0,
            Self::Facade => 12.0,
        }
    }

    pub(crate) fn path(self) -> &'static Path {
        match self {
            Self::Office => &office::PATH,
            Self::Object => &object::PATH,
            Self::Cabinet => &cabinet::PATH,
            Self::Street => &street::PATH,
            Self::Facade => &facade::PATH,
            Self::Mural => &mural::PATH,
            Self::Tiling => &tiling::PATH,
        }
    }

    /// Whether everything that can be seen lies in the plane y = 0 of the world.
    pub(crate) fn is_plane(self) -> bool {
        matches!(self, Self::Mural | Self::Tiling)
    }
}

/// A frame at (x, y, z), turned by `yaw` radians around the vertical.
fn turned(at: [f64; 3], yaw: f64) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(at),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw),
    )
}

/// A box that stands on `foot`, the middle of its bottom, turned by `yaw`.
fn stand(mesh: &mut Mesh, surface: Surface, foot: [f64; 3], yaw: f64, size: [f64; 3]) {
    let centre = [foot[0], foot[1], foot[2] + 0.5 * size[2]];
    mesh.cuboid(&turned(centre, yaw), size, surface);
}

/// A rectangle with its centre at `centre` that faces upwards, turned by `yaw`.
fn lay(mesh: &mut Mesh, surface: Surface, centre: [f64; 3], yaw: f64, size: [f64; 2]) {
    let frame = turned(centre, yaw);
    let corner = frame * Point3::new(-0.5 * size[0], -0.5 * size[1], 0.0);
    let (u, v) = (Vector3::x() * size[0], Vector3::y() * size[1]);
    mesh.sheet(corner, frame * u, frame * v, surface);
}

/// A vertical rectangle, such as a wall or a poster on it. It is seen by a viewer who looks along +y when `yaw`
/// is 0; `upper_left` is the corner as this viewer sees it.
fn hang(mesh: &mut Mesh, surface: Surface, upper_left: [f64; 3], yaw: f64, size: [f64; 2]) {
    let frame = turned(upper_left, yaw);
    let corner = frame * Point3::new(0.0, 0.0, -size[1]);
    let u = frame * (Vector3::x() * size[0]);
    mesh.sheet(corner, u, Vector3::z() * size[1], surface);
}

/// A wall in the plane y = 0 for a viewer who looks along +y, so large that no camera sees its end.
fn wall(mesh: &mut Mesh, surface: Surface) {
    hang(mesh, surface, [-60.0, 0.0, 60.0], 0.0, [120.0, 120.0]);
}

/// A lumpy ellipsoid: a bush, a cushion.
fn bush(mesh: &mut Mesh, surface: Surface, at: [f64; 3], radii: [f64; 3], steps: usize) {
    mesh.blob(&turned(at, 7.0 * at[0]), radii, steps, surface, |d| {
        lumps(d, 4.0, 0.3)
    });
}

/// Relief of an irregular body: about `scale` bumps per radius, of relative height `amount`.
fn lumps(direction: &Vector3<f64>, scale: f64, amount: f64) -> f64 {
    let [x, y, z] =
        [direction.x, direction.y, direction.z].map(|c| (c * scale + 8.0) as f32 / 16.0);
    let sum = gradient(x, y, 16, 5) + gradient(y, z, 16, 6) + gradient(z, x, 16, 7);
    amount * 0.6 * f64::from(sum)
}
