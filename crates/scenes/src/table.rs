//! The table of scenes: which place, which frames, which camera.

use matchbench_vision::image::Size;

use crate::places::Place;
use crate::scene::{Pairing, Scene, Timing};
use crate::sensor::Sensor;

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

/// Lamps that are switched on and off, and a slow shutter.
const FLICKER: Sensor = Sensor {
    shutter: 0.025,
    white: 0.9,
    wander: 1.2,
    full_well: 1800.0,
    ..INDOORS
};

/// Fragments of six frames, as in the Oxford affine set: the first with the other five.
const GROWING: Timing = Timing::Fragments {
    length: 6,
    rate: 1.0,
    every: 8.0,
};

const SHORT: Timing = Timing::Fragments {
    length: 10,
    rate: 20.0,
    every: 3.3,
};

/// See [`crate::scenes`].
pub(crate) static SCENES: [Scene; 10] = [
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
    Scene {
        name: "mural",
        description: "a painted wall; growing changes of viewpoint, distance and rotation",
        place: Place::Mural,
        size: Size::new(480, 360),
        frames: 24,
        pairing: Pairing::Fragments { length: 6 },
        focal: 420.0,
        timing: GROWING,
        sensor: OUTDOORS,
    },
    Scene {
        name: "tiling",
        description: "a wall of two kinds of tiles; repetition, changing light and motion blur",
        place: Place::Tiling,
        size: Size::new(480, 360),
        frames: 24,
        pairing: Pairing::Fragments { length: 6 },
        focal: 420.0,
        timing: GROWING,
        sensor: FLICKER,
    },
];
