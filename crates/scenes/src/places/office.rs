//! A room with a desk: monitors, books, papers, a keyboard, mugs, shelves, posters.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use matchbench_vision::seed::{Rng, Seed};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};

use super::{bush, hang, lay, stand, turned};
use crate::light::{Lamp, Lighting};
use crate::mesh::{Mesh, Surface};
use crate::model::Model;
use crate::paint;
use crate::path::{Path, Station};

pub(super) const PATH: Path = Path {
    stations: &[
        Station::new([-1.3, -0.8, 1.35], [-0.3, 0.9, 0.8]),
        Station::new([-0.95, -0.95, 1.3], [-0.2, 0.95, 0.85]),
        Station::new([-0.5, -0.65, 1.45], [-0.3, 0.9, 0.85]),
        Station::new([0.0, -0.85, 1.3], [-0.05, 0.95, 0.95]),
        Station::new([0.4, -0.6, 1.2], [0.25, 1.0, 0.85]),
        Station::new([0.85, -0.85, 1.4], [0.25, 0.9, 0.85]),
        Station::new([1.2, -0.4, 1.5], [0.3, 0.85, 0.75]),
        Station::new([1.45, 0.0, 1.35], [0.1, 0.85, 0.8]),
        Station::new([1.25, -0.5, 1.15], [0.0, 1.1, 0.9]),
        Station::new([0.7, -1.0, 1.25], [-0.1, 1.0, 0.9]),
        Station::new([0.1, -0.7, 1.5], [-0.25, 0.95, 0.8]),
    ],
    shake: [0.02, 0.02],
    seed: 101,
};

pub(super) fn model() -> Model {
    let ceiling_lamp = Lamp {
        centre: [-0.8, -0.2, 2.6],
        edges: [[0.6, 0.0, 0.0], [0.0, 0.15, 0.0]],
        power: 1.6,
    };
    let window = Lamp {
        centre: [2.9, 0.6, 1.6],
        edges: [[0.0, 0.8, 0.0], [0.0, 0.0, 0.6]],
        power: 2.2,
    };
    let lighting = Lighting {
        ambient: 0.55,
        reach: 1.2,
        lamps: vec![ceiling_lamp, window],
        sun: None,
    };
    let mut model = Model::new(1, 0.15, lighting);
    let materials = Materials {
        plaster: model.material(2.4, 512, paint::plaster),
        wood: model.material(1.6, 512, paint::wood),
        veneer: model.material(1.2, 512, paint::veneer),
        carpet: model.material(1.6, 512, paint::carpet),
        print: model.material(1.5, 1024, paint::print),
        poster: model.material(4.0, 512, paint::print),
        spines: model.material(1.2, 1024, paint::spines),
        keys: model.material(0.32, 256, paint::keyboard),
        screen: model.material(1.6, 512, paint::screen),
        metal: model.material(0.5, 256, paint::metal),
        cloth: model.material(0.8, 512, paint::cloth),
        leaves: model.material(0.5, 256, paint::leaves),
    };
    let mut rng = Seed(1).child("clutter").rng();
    room(&mut model.mesh, &materials, &mut rng);
    desk(&mut model.mesh, &materials);
    clutter(&mut model.mesh, &materials, &mut rng);
    shelves(&mut model.mesh, &materials, &mut rng);
    model
}

struct Materials {
    plaster: Surface,
    wood: Surface,
    veneer: Surface,
    carpet: Surface,
    print: Surface,
    poster: Surface,
    spines: Surface,
    keys: Surface,
    screen: Surface,
    metal: Surface,
    cloth: Surface,
    leaves: Surface,
}

/// Floor, walls, posters and notes, a bean bag, boxes on the floor.
fn room(mesh: &mut Mesh, m: &Materials, rng: &mut Rng) {
    lay(mesh, m.carpet, [0.0, 0.0, 0.0], 0.0, [6.0, 5.0]);
    for (corner, yaw, width, shade) in [
        ([-3.0, 2.4, 2.7], 0.0, 6.0, 1.0),
        ([-3.0, -2.5, 2.7], FRAC_PI_2, 5.0, 0.9),
        ([3.0, 2.5, 2.7], -FRAC_PI_2, 5.0, 0.9),
        ([3.0, -2.5, 2.7], PI, 6.0, 1.0),
    ] {
        hang(mesh, m.plaster.shaded(shade), corner, yaw, [width, 2.7]);
    }
    for (x, z, size) in [
        (-1.25, 2.15, [0.7, 0.95]),
        (-0.42, 2.1, [0.5, 0.7]),
        (0.2, 2.2, [0.95, 0.62]),
        (0.25, 1.5, [0.3, 0.42]),
        (0.65, 1.52, [0.42, 0.3]),
        (-0.4, 1.33, [0.21, 0.297]),
    ] {
        let poster = m.poster.shaded(0.6 + 0.5 * rng.uniform());
        hang(mesh, poster, [x, 2.39, z], 0.0, size);
    }
    for (y, z) in [(1.6, 1.9), (0.4, 1.8), (-0.9, 2.0)] {
        hang(mesh, m.poster, [-2.99, y - 0.8, z], FRAC_PI_2, [0.6, 0.85]);
        hang(mesh, m.poster, [2.99, y + 0.2, z], -FRAC_PI_2, [0.6, 0.85]);
    }
    bush(mesh, m.cloth, [-1.15, 1.9, 0.25], [0.3, 0.2, 0.27], 16);
    stand(
        mesh,
        m.print.shaded(0.6),
        [1.1, 1.95, 0.0],
        0.4,
        [0.4, 0.35, 0.45],
    );
    stand(mesh, m.wood, [1.15, 1.9, 0.45], 0.1, [0.3, 0.3, 0.3]);
}

/// A desk with two monitors and keyboards, and a chair in front of it.
fn desk(mesh: &mut Mesh, m: &Materials) {
    stand(
        mesh,
        m.veneer.glossy(0.06),
        [0.0, 0.9, 0.70],
        0.0,
        [2.2, 0.95, 0.035],
    );
    stand(mesh, m.wood, [0.75, 0.95, 0.05], 0.0, [0.42, 0.6, 0.62]);
    for (x, y) in [(-1.0, 0.5), (1.0, 0.5), (-1.0, 1.3), (1.0, 1.3)] {
        stand(mesh, m.metal, [x, y, 0.0], 0.0, [0.06, 0.06, 0.70]);
    }
    let plastic = m.metal.shaded(0.2).glossy(0.1);
    let picture = m.screen.shaded(1.3).glossy(0.05);
    for (x, y, yaw, tall) in [(-0.32, 1.12, 0.18, 0.36), (0.42, 1.15, -0.22, 0.32)] {
        stand(mesh, plastic, [x, y, 0.735], yaw, [0.22, 0.16, 0.02]);
        stand(mesh, plastic, [x, y, 0.75], yaw, [0.05, 0.04, 0.16]);
        stand(mesh, plastic, [x, y, 0.86], yaw, [0.58, 0.045, tall + 0.03]);
        let corner = turned([x, y, 0.0], yaw) * Point3::new(-0.27, -0.026, 0.875 + tall);
        hang(mesh, picture, corner.coords.into(), yaw, [0.54, tall]);
    }
    stand(mesh, m.keys, [-0.28, 0.72, 0.735], 0.1, [0.44, 0.15, 0.02]);
    stand(
        mesh,
        m.keys.shaded(3.5),
        [0.45, 0.66, 0.735],
        -0.25,
        [0.40, 0.14, 0.02],
    );

    stand(mesh, m.cloth, [-0.2, 0.05, 0.44], 0.5, [0.46, 0.46, 0.08]);
    stand(mesh, m.cloth, [-0.32, -0.17, 0.62], 0.5, [0.44, 0.06, 0.36]);
    mesh.cylinder(&turned([-0.2, 0.05, 0.0], 0.0), 0.03, 0.45, m.metal);
}

/// The things on the desk: papers, piles of books, mugs and pens, a globe, a plant.
fn clutter(mesh: &mut Mesh, m: &Materials, rng: &mut Rng) {
    for sheet in 0..14 {
        let x = -0.95 + 1.9 * rng.uniform();
        let y = 0.50 + 0.75 * rng.uniform();
        let z = 0.737 + 0.0015 * f64::from(sheet);
        lay(mesh, m.print, [x, y, z], TAU * rng.uniform(), [0.21, 0.297]);
    }
    for (x, y, books) in [
        (-0.82, 0.95, 7),
        (-0.66, 0.6, 4),
        (0.85, 0.72, 5),
        (0.1, 0.62, 2),
    ] {
        let mut z = 0.737;
        for _ in 0..books {
            let [wide, long, thick] = [(0.15, 0.08), (0.21, 0.08), (0.015, 0.03)]
                .map(|(least, spread)| least + spread * rng.uniform());
            let cover = m.print.shaded(0.5 + 0.7 * rng.uniform()).glossy(0.08);
            stand(
                mesh,
                cover,
                [x, y, z],
                0.7 * rng.uniform(),
                [wide, long, thick],
            );
            z += thick;
        }
    }
    for (x, y, shade) in [(0.02, 0.92, 1.8), (0.98, 1.1, 0.6), (-0.52, 0.88, 1.2)] {
        let mug = m.print.shaded(shade).glossy(0.25);
        mesh.cylinder(&turned([x, y, 0.735], 0.0), 0.04, 0.095, mug);
    }
    for pen in 0..9 {
        let number = f64::from(pen);
        let lean = UnitQuaternion::from_euler_angles(0.25 - 0.06 * number, 0.2, number);
        let frame = Isometry3::from_parts(Translation3::new(0.02, 0.92, 0.76), lean);
        mesh.cylinder(&frame, 0.004, 0.14, m.print.shaded(0.8));
    }
    stand(
        mesh,
        m.print.shaded(0.8),
        [-0.95, 1.22, 0.735],
        0.3,
        [0.2, 0.2, 0.26],
    );
    let globe = m.print.shaded(0.9).glossy(0.2);
    mesh.blob(
        &turned([0.93, 1.2, 0.92], 0.4),
        [0.11; 3],
        12,
        globe,
        |_| 0.0,
    );
    mesh.cylinder(&turned([0.05, 1.22, 0.735], 0.0), 0.07, 0.13, m.cloth);
    bush(mesh, m.leaves, [0.05, 1.22, 0.98], [0.13, 0.13, 0.16], 24);
}

/// Two shelves along the back wall; single books project by up to 5 cm.
fn shelves(mesh: &mut Mesh, m: &Materials, rng: &mut Rng) {
    for (left, tall) in [(-2.6, 2.0), (1.35, 1.65)] {
        stand(
            mesh,
            m.wood.shaded(0.7),
            [left + 0.55, 2.24, 0.0],
            0.0,
            [1.16, 0.28, tall],
        );
        for row in 0..(tall / 0.33) as i32 {
            let mut x = left + 0.03;
            while x < left + 1.05 {
                let wide = 0.022 + 0.035 * rng.uniform();
                let high = 0.19 + 0.09 * rng.uniform();
                let out = 0.05 * rng.uniform();
                let foot = [x + 0.5 * wide, 2.10 - out, 0.04 + 0.33 * f64::from(row)];
                let spine = m.spines.shaded(0.5 + rng.uniform()).glossy(0.05);
                stand(mesh, spine, foot, 0.0, [wide, 0.1, high]);
                x += wide + 0.003;
            }
        }
    }
}
