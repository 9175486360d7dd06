//! A street between houses, driven along at 10 frames per second.

use std::f64::consts::FRAC_PI_2;

use matchbench_vision::seed::{Rng, Seed};

use super::{bush, hang, lay, lumps, stand, turned};
use crate::light::Lighting;
use crate::mesh::{Mesh, Surface};
use crate::model::Model;
use crate::paint;
use crate::path::{Path, Station};

/// The path of a car at 9 metres per second, with a gentle bend.
pub(super) const PATH: Path = Path {
    stations: &[
        Station::new([0.0, 1.0, 1.65], [30.0, 0.6, 1.4]),
        Station::new([9.0, 0.9, 1.65], [39.0, 0.2, 1.5]),
        Station::new([18.0, 0.7, 1.65], [48.0, 1.6, 1.4]),
        Station::new([27.0, 0.8, 1.65], [57.0, 2.2, 1.4]),
        Station::new([36.0, 1.1, 1.65], [66.0, 0.9, 1.5]),
        Station::new([45.0, 1.2, 1.65], [75.0, 0.2, 1.4]),
        Station::new([54.0, 1.0, 1.65], [84.0, 0.8, 1.5]),
    ],
    shake: [0.02, 0.006],
    seed: 104,
};

pub(super) fn model() -> Model {
    let lighting = Lighting {
        ambient: 0.75,
        reach: 4.0,
        lamps: vec![],
        sun: Some(([-0.35, -0.6, 0.75], 1.0)),
    };
    let mut model = Model::new(4, 1.5, lighting);
    let materials = Materials {
        asphalt: model.material(7.0, 512, paint::asphalt),
        marking: model.material(3.0, 256, paint::marking),
        paving: model.material(6.0, 512, paint::paving),
        brick: model.material(4.0, 512, paint::brick),
        stucco: model.material(7.0, 512, paint::stucco),
        tiles: model.material(10.0, 512, paint::tiles),
        pane: model.material(5.0, 512, paint::pane).glossy(0.3),
        leaves: model.material(3.0, 512, paint::leaves),
        bark: model.material(1.5, 256, paint::bark),
        gravel: model.material(6.0, 512, paint::gravel),
        print: model.material(9.0, 512, paint::print).shaded(0.7),
        lacquer: model.material(4.0, 512, paint::paint).glossy(0.35),
        metal: model.material(2.0, 256, paint::metal),
    };
    let mut rng = Seed(4).child("town").rng();
    road(&mut model.mesh, &materials);
    for side in [-1.0, 1.0] {
        houses(&mut model.mesh, &materials, &mut rng, side);
        plants(&mut model.mesh, &materials, &mut rng, side);
        furniture(&mut model.mesh, &materials, &mut rng, side);
    }
    model
}

struct Materials {
    asphalt: Surface,
    marking: Surface,
    paving: Surface,
    brick: Surface,
    stucco: Surface,
    tiles: Surface,
    pane: Surface,
    leaves: Surface,
    bark: Surface,
    gravel: Surface,
    print: Surface,
    lacquer: Surface,
    metal: Surface,
}

/// The ground, from the middle of the road outwards, and what closes the street at its end.
fn road(mesh: &mut Mesh, m: &Materials) {
    let mut strip = |surface, y: f64, z: f64, wide: f64| {
        lay(mesh, surface, [70.0, y, z], 0.0, [180.0, wide]);
    };
    strip(m.gravel, 0.0, -0.05, 120.0);
    strip(m.asphalt, 0.0, 0.0, 8.0);
    for side in [-1.0, 1.0] {
        strip(m.marking, 3.8 * side, 0.006, 0.12);
        strip(m.paving, 5.5 * side, 0.12, 2.6);
        strip(m.gravel, 8.15 * side, 0.08, 2.7);
    }
    for side in [-1.0, 1.0] {
        let kerb = m.paving.shaded(1.1);
        stand(mesh, kerb, [70.0, 4.1 * side, 0.0], 0.0, [180.0, 0.2, 0.13]);
    }
    for dash in 0..28 {
        let x = -13.5 + 6.0 * f64::from(dash);
        lay(mesh, m.marking, [x, 0.0, 0.008], 0.0, [3.0, 0.14]);
    }
    stand(mesh, m.brick, [165.0, 0.0, 0.0], 0.0, [8.0, 40.0, 7.0]);
    stand(mesh, m.tiles, [165.0, 0.0, 7.0], 0.0, [6.0, 40.0, 2.5]);
    for tree in 0..9 {
        let at = [158.0, -20.0 + 5.0 * f64::from(tree), 2.5];
        bush(mesh, m.leaves, at, [2.0, 2.4, 2.8], 10);
    }
}

/// Houses of all sizes along one side, with sunken windows, sills and roofs.
fn houses(mesh: &mut Mesh, m: &Materials, rng: &mut Rng, side: f64) {
    let mut start = -18.0;
    while start < 150.0 {
        let [wide, deep, tall] =
            [(8.0, 6.0), (7.0, 2.0), (5.5, 5.0)].map(|(a, b)| a + b * rng.uniform());
        let front = (8.6 + 1.6 * rng.uniform()) * side;
        let (x, y) = (start + 0.5 * wide, front + 0.5 * deep * side);
        let kind = if rng.uniform() < 0.5 {
            m.brick
        } else {
            m.stucco
        };
        let wall = kind.shaded(0.65 + 0.5 * rng.uniform());
        stand(mesh, wall, [x, y, 0.0], 0.0, [wide, deep, tall]);
        let eaves = [wide + 0.5, deep + 0.7, 0.25];
        stand(
            mesh,
            m.stucco.shaded(0.8),
            [x, y - 0.3 * side, tall],
            0.0,
            eaves,
        );
        stand(
            mesh,
            m.tiles,
            [x, y, tall + 0.25],
            0.0,
            [wide, deep - 1.0, 1.3],
        );
        let columns = (wide / 2.2) as i32;
        for column in 0..columns {
            let along = start + wide * (f64::from(column) + 0.5) / f64::from(columns);
            for floor in 0..(tall / 2.9) as i32 {
                window(mesh, m, [along, front, 0.9 + 2.9 * f64::from(floor)]);
            }
        }
        let gap = 2.5 * rng.uniform();
        start += wide + if rng.uniform() < 0.5 { 0.0 } else { gap };
    }
}

fn window(mesh: &mut Mesh, m: &Materials, [x, y, z]: [f64; 3]) {
    stand(
        mesh,
        m.stucco.shaded(1.2),
        [x, y, z - 0.1],
        0.0,
        [1.35, 0.16, 1.75],
    );
    stand(mesh, m.pane, [x, y, z], 0.0, [1.1, 0.2, 1.5]);
    stand(
        mesh,
        m.stucco.shaded(1.3),
        [x, y, z],
        0.0,
        [0.06, 0.24, 1.5],
    );
    stand(
        mesh,
        m.paving.shaded(1.2),
        [x, y, z - 0.16],
        0.0,
        [1.5, 0.4, 0.08],
    );
}

/// Trees and hedges along one side.
fn plants(mesh: &mut Mesh, m: &Materials, rng: &mut Rng, side: f64) {
    for tree in 0..15 {
        let x = -8.0 + 10.0 * f64::from(tree) + 4.0 * rng.uniform();
        mesh.cylinder(&turned([x, 7.0 * side, 0.0], 0.0), 0.14, 2.6, m.bark);
        let wide = 1.1 + 0.5 * rng.uniform();
        let at = [x, 7.0 * side, 3.4 + 0.4 * rng.uniform()];
        bush(mesh, m.leaves, at, [wide, wide, 1.4], 12);
    }
    for hedge in 0..12 {
        let x = -5.0 + 12.0 * f64::from(hedge) + 3.0 * rng.uniform();
        let at = turned([x, 8.0 * side, 0.6], 0.0);
        mesh.blob(&at, [2.2, 0.5, 0.65], 10, m.leaves.shaded(0.8), |d| {
            lumps(d, 4.0, 0.25)
        });
    }
}

/// Lamp posts, signs and parked cars along one side.
fn furniture(mesh: &mut Mesh, m: &Materials, rng: &mut Rng, side: f64) {
    for lamp in 0..7 {
        let x = 24.0 * f64::from(lamp) + 5.0 * side;
        mesh.cylinder(&turned([x, 4.7 * side, 0.0], 0.0), 0.07, 6.0, m.metal);
        stand(mesh, m.metal, [x, 4.0 * side, 5.9], 0.0, [0.3, 1.6, 0.12]);
    }
    for sign in 0..10 {
        let x = 1.0 + 14.0 * f64::from(sign) + 5.0 * rng.uniform();
        mesh.cylinder(&turned([x, 4.5 * side, 0.1], 0.0), 0.03, 2.3, m.metal);
        let upper_left = [x - 0.04, 4.5 * side + 0.3, 2.4]; // facing the traffic
        hang(mesh, m.print, upper_left, -FRAC_PI_2, [0.6, 0.6]);
    }
    for parked in 0..9 {
        let x = 3.0 + 15.0 * f64::from(parked) + 4.0 * rng.uniform();
        let body = m.lacquer.shaded(0.15 + 1.1 * rng.uniform());
        car(mesh, m, body, x, 3.05 * side);
    }
}

/// Body, cabin, roof, wheels: superellipsoids, which are shapes between ellipsoids and boxes.
fn car(mesh: &mut Mesh, m: &Materials, body: Surface, x: f64, y: f64) {
    let mut part = |surface, [dx, dy, z]: [f64; 3], radii, steps, power: f64| {
        mesh.blob(
            &turned([x + dx, y + dy, z], 0.0),
            radii,
            steps,
            surface,
            |d| {
                let sum: f64 = d.iter().map(|c| libm::pow(c.abs(), power)).sum();
                libm::pow(sum, -1.0 / power) - 1.0
            },
        );
    };
    part(body, [0.0, 0.0, 0.62], [2.1, 0.85, 0.36], 8, 6.0);
    part(
        m.pane.shaded(0.6),
        [-0.15, 0.0, 1.12],
        [1.2, 0.74, 0.36],
        6,
        4.0,
    );
    part(body, [-0.15, 0.0, 1.43], [1.0, 0.66, 0.07], 5, 4.0);
    for (dx, dy) in [(-1.3, -0.8), (-1.3, 0.8), (1.3, -0.8), (1.3, 0.8)] {
        part(
            m.metal.shaded(0.2),
            [dx, dy, 0.31],
            [0.31, 0.1, 0.31],
            4,
            2.0,
        );
    }
}
