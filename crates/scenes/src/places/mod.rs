//! The places and the table of scenes taken in them.

mod cabinet;
mod facade;
mod object;
mod office;
mod street;

use matchbench_vision::image::Size;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::mesh::{Mesh, Surface};
use crate::noise::gradient;
use crate::path::Path;
use crate::scene::{Pairing, Scene, Timing};
use crate::sensor::Sensor;
use crate::world::Model;

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
}

impl Place {
    /// All places.
    pub const ALL: [Self; 5] = [
        Self::Office,
        Self::Object,
        Self::Cabinet,
        Self::Street,
        Self::Facade,
    ];

    pub(crate) fn model(self) -> Model {
        match self {
            Self::Office => office::model(),
            Self::Object => object::model(),
            Self::Cabinet => cabinet::model(),
            Self::Street => street::model(),
            Self::Facade => facade::model(),
        }
    }

    /// How far away, in metres, the things are that show motion blur first.
    pub(crate) fn distance(self) -> f64 {
        match self {
            Self::Office | Self::Object | Self::Cabinet => 1.5,
            Self::Street => 6.0,
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
        }
    }
}

/// A hand-held camera indoors: little light, long exposure.
const INDOORS: Sensor = Sensor {
    shutter: 0.012,
    blur: 0.65,
    white: 0.6,
    wander: 0.25,
    full_well: 3000.0,
    read_noise: 12.0,
};

/// The same with the lamps turned down: fewer photons.
const DIM: Sensor = Sensor {
    full_well: 900.0,
    ..INDOORS
};

/// A good camera in daylight.
const OUTDOORS: Sensor = Sensor {
    shutter: 0.004,
    blur: 0.6,
    white: 0.75,
    wander: 0.2,
    full_well: 5000.0,
    read_noise: 12.0,
};

const SHORT: Timing = Timing::Fragments {
    length: 10,
    rate: 20.0,
    every: 3.3,
};

/// See [`crate::scenes`].
pub(crate) static SCENES: [Scene; 8] = [
    Scene {
        name: "office",
        description: "a cluttered desk, hand-held; text and repeated shapes",
        place: Place::Office,
        size: Size::new(320, 240),
        frames: 30,
        pairing: Pairing::Fragments { length: 10 },
        focal: 265.0,
        timing: SHORT,
        sensor: INDOORS,
    },
    Scene {
        name: "object",
        description: "a plush toy, hand-held; round, self-similar fur",
        place: Place::Object,
        size: Size::new(320, 240),
        frames: 30,
        pairing: Pairing::Fragments { length: 10 },
        focal: 265.0,
        timing: SHORT,
        sensor: INDOORS,
    },
    Scene {
        name: "cabinet",
        description: "a steel cabinet, hand-held; little texture, much noise",
        place: Place::Cabinet,
        size: Size::new(320, 240),
        frames: 30,
        pairing: Pairing::Fragments { length: 10 },
        focal: 265.0,
        timing: SHORT,
        sensor: DIM,
    },
    Scene {
        name: "street",
        description: "a drive through a street; forward motion, repeated windows",
        place: Place::Street,
        size: Size::new(620, 188),
        frames: 25,
        pairing: Pairing::Fragments { length: 5 },
        focal: 359.0,
        timing: Timing::Fragments {
            length: 5,
            rate: 10.0,
            every: 1.4,
        },
        sensor: OUTDOORS,
    },
    Scene {
        name: "facade",
        description: "a stone court from all sides; strong perspective, repeated arches",
        place: Place::Facade,
        size: Size::new(480, 320),
        frames: 12,
        pairing: Pairing::All,
        focal: 430.0,
        timing: Timing::Every(1.0),
        sensor: OUTDOORS,
    },
    Scene {
        name: "office-wide",
        description: "the office, four frames in three seconds",
        place: Place::Office,
        size: Size::new(320, 240),
        frames: 14,
        pairing: Pairing::Window { size: 4 },
        focal: 265.0,
        timing: Timing::Every(0.75),
        sensor: INDOORS,
    },
    Scene {
        name: "object-wide",
        description: "the plush toy, two frames per second",
        place: Place::Object,
        size: Size::new(320, 240),
        frames: 14,
        pairing: Pairing::Window { size: 4 },
        focal: 265.0,
        timing: Timing::Every(0.5),
        sensor: INDOORS,
    },
    Scene {
        name: "cabinet-wide",
        description: "the cabinet, four frames in three seconds",
        place: Place::Cabinet,
        size: Size::new(320, 240),
        frames: 14,
        pairing: Pairing::Window { size: 4 },
        focal: 265.0,
        timing: Timing::Every(0.75),
        sensor: DIM,
    },
];

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

/// A rectangle with its middle at `centre` that shows its upper side, turned by `yaw`.
fn lay(mesh: &mut Mesh, surface: Surface, centre: [f64; 3], yaw: f64, size: [f64; 2]) {
    let frame = turned(centre, yaw);
    let corner = frame * Point3::new(-0.5 * size[0], -0.5 * size[1], 0.0);
    let (u, v) = (Vector3::x() * size[0], Vector3::y() * size[1]);
    mesh.sheet(corner, frame * u, frame * v, surface);
}

/// A vertical rectangle, such as a wall or a poster on it, seen by those who look along +y when
/// `yaw` is 0; `upper_left` as they see it.
fn hang(mesh: &mut Mesh, surface: Surface, upper_left: [f64; 3], yaw: f64, size: [f64; 2]) {
    let frame = turned(upper_left, yaw);
    let corner = frame * Point3::new(0.0, 0.0, -size[1]);
    let u = frame * (Vector3::x() * size[0]);
    mesh.sheet(corner, u, Vector3::z() * size[1], surface);
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
