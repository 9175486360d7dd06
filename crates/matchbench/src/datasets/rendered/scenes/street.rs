//! A street between houses, driven along at 10 frames per second.

use matchbench_vision::seed::Seed;
use nalgebra::{Point3, Vector3};

use super::super::light::Lighting;
use super::super::mesh::Surface;
use super::super::paint;
use super::super::path::{Path, Station};
use super::super::world::Model;
use super::office::lumps;
use super::{hang, stand, turned};

/// 9 metres per second, with a gentle bend.
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
    let mut model = Model::new(
        4,
        1.5,
        Lighting {
            ambient: 0.75,
            reach: 4.0,
            lamps: vec![],
            sun: Some(([-0.35, -0.6, 0.75], 1.0)),
        },
    );
    let asphalt = Surface::matt(model.texture(7.0, 512, paint::asphalt));
    let marking = Surface::matt(model.texture(3.0, 256, paint::marking));
    let paving = Surface::matt(model.texture(6.0, 512, paint::paving));
    let brick = Surface::matt(model.texture(4.0, 512, paint::brick));
    let stucco = Surface::matt(model.texture(7.0, 512, paint::stucco));
    let tiles = Surface::matt(model.texture(10.0, 512, paint::tiles));
    let pane = Surface::matt(model.texture(5.0, 512, paint::pane)).glossy(0.3);
    let leaves = Surface::matt(model.texture(3.0, 512, paint::leaves));
    let bark = Surface::matt(model.texture(1.5, 256, paint::bark));
    let gravel = Surface::matt(model.texture(6.0, 512, paint::gravel));
    let print = Surface::matt(model.texture(9.0, 512, paint::print));
    let lacquer = Surface::matt(model.texture(4.0, 512, paint::paint)).glossy(0.35);
    let metal = Surface::matt(model.texture(2.0, 256, paint::metal));
    let mesh = &mut model.mesh;
    let mut rng = Seed(4).child("town").rng();

    let (x, y) = (Vector3::x(), Vector3::y());
    mesh.sheet(Point3::new(-20.0, -4.0, 0.0), x * 180.0, y * 8.0, asphalt);
    for dash in 0..28 {
        let at = Point3::new(-15.0 + 6.0 * f64::from(dash), -0.07, 0.008);
        mesh.sheet(at, x * 3.0, y * 0.14, marking);
    }
    for side in [-1.0, 1.0] {
        // Kerb, pavement, and a strip of green.
        stand(
            mesh,
            [70.0, 4.1 * side, 0.0],
            0.0,
            [180.0, 0.2, 0.13],
            paving.shaded(1.1),
        );
        let from = if side > 0.0 { 4.2 } else { -6.8 };
        mesh.sheet(Point3::new(-20.0, from, 0.12), x * 180.0, y * 2.6, paving);
        let from = if side > 0.0 { 6.8 } else { -9.5 };
        mesh.sheet(Point3::new(-20.0, from, 0.08), x * 180.0, y * 2.7, gravel);
        mesh.sheet(
            Point3::new(-20.0, 4.0 * side - 0.06, 0.006),
            x * 180.0,
            y * 0.12,
            marking,
        );

        // Houses: walls with sunken windows, sills, a door, a roof.
        let mut start = -18.0;
        while start < 150.0 {
            let wide = 8.0 + 6.0 * rng.uniform();
            let deep = 7.0 + 2.0 * rng.uniform();
            let tall = 5.5 + 5.0 * rng.uniform();
            let front = (8.6 + 1.6 * rng.uniform()) * side;
            let middle = [start + 0.5 * wide, front + 0.5 * deep * side, 0.0];
            let shade = 0.65 + 0.5 * rng.uniform();
            let wall = if rng.uniform() < 0.5 { brick } else { stucco }.shaded(shade);
            stand(mesh, middle, 0.0, [wide, deep, tall], wall);
            stand(
                mesh,
                [middle[0], middle[1] - 0.3 * side, tall],
                0.0,
                [wide + 0.5, deep + 0.7, 0.25],
                stucco.shaded(0.8),
            );
            stand(
                mesh,
                [middle[0], middle[1], tall + 0.25],
                0.0,
                [wide, deep - 1.0, 1.3],
                tiles,
            );
            let columns = (wide / 2.2) as i32;
            for column in 0..columns {
                let at = start + wide * (f64::from(column) + 0.5) / f64::from(columns);
                for floor in 0..(tall / 2.9) as i32 {
                    let z = 0.9 + 2.9 * f64::from(floor);
                    let frame = [at, front, z - 0.1];
                    stand(mesh, frame, 0.0, [1.35, 0.16, 1.75], stucco.shaded(1.2));
                    stand(mesh, [at, front, z], 0.0, [1.1, 0.2, 1.5], pane);
                    stand(
                        mesh,
                        [at, front, z],
                        0.0,
                        [0.06, 0.24, 1.5],
                        stucco.shaded(1.3),
                    );
                    stand(
                        mesh,
                        [at, front, z - 0.16],
                        0.0,
                        [1.5, 0.4, 0.08],
                        paving.shaded(1.2),
                    );
                }
            }
            start += wide
                + if rng.uniform() < 0.5 {
                    0.0
                } else {
                    2.5 * rng.uniform()
                };
        }

        // Trees, lamp posts, hedges, parked cars, signs.
        for i in 0..15 {
            let along = -8.0 + 10.0 * f64::from(i) + 4.0 * rng.uniform();
            let trunk = turned([along, 7.0 * side, 0.0], 0.0);
            mesh.cylinder(&trunk, 0.14, 2.6, bark);
            let wide = 1.1 + 0.5 * rng.uniform();
            let crown = turned(
                [along, 7.0 * side, 3.4 + 0.4 * rng.uniform()],
                6.0 * rng.uniform(),
            );
            mesh.blob(&crown, [wide, wide, 1.4], 12, leaves, |d| {
                lumps(d, 4.0, 0.35)
            });
        }
        for i in 0..7 {
            let along = 24.0 * f64::from(i) + 5.0 * side;
            mesh.cylinder(&turned([along, 4.7 * side, 0.0], 0.0), 0.07, 6.0, metal);
            stand(mesh, [along, 4.0 * side, 5.9], 0.0, [0.3, 1.6, 0.12], metal);
        }
        for i in 0..9 {
            let along = 3.0 + 15.0 * f64::from(i) + 4.0 * rng.uniform();
            let body = lacquer.shaded(0.15 + 1.1 * rng.uniform());
            car(
                mesh,
                [along, 3.05 * side],
                body,
                pane.shaded(0.6),
                metal.shaded(0.2),
            );
        }
        for i in 0..10 {
            let along = 1.0 + 14.0 * f64::from(i) + 5.0 * rng.uniform();
            mesh.cylinder(&turned([along, 4.5 * side, 0.1], 0.0), 0.03, 2.3, metal);
            // Facing the traffic.
            hang(
                mesh,
                [along - 0.04, 4.8 * side, 2.4],
                -1.5708,
                [0.6, 0.6],
                print,
            );
        }
        for i in 0..12 {
            let along = -5.0 + 12.0 * f64::from(i) + 3.0 * rng.uniform();
            let hedge = turned([along, 8.0 * side, 0.6], 0.0);
            mesh.blob(&hedge, [2.2, 0.5, 0.65], 10, leaves.shaded(0.8), |d| {
                lumps(d, 4.0, 0.25)
            });
        }
    }
    // What closes the street at its end.
    stand(mesh, [165.0, 0.0, 0.0], 0.0, [8.0, 40.0, 7.0], brick);
    stand(mesh, [165.0, 0.0, 7.0], 0.0, [6.0, 40.0, 2.5], tiles);
    for i in 0..9 {
        let crown = turned([158.0, -20.0 + 5.0 * f64::from(i), 2.5], f64::from(i));
        mesh.blob(&crown, [2.0, 2.4, 2.8], 10, leaves, |d| lumps(d, 4.0, 0.35));
    }
    mesh.sheet(
        Point3::new(-20.0, -60.0, -0.05),
        x * 200.0,
        y * 120.0,
        gravel,
    );
    model
}

/// A parked car: body, cabin, wheels.
fn car(
    mesh: &mut super::super::mesh::Mesh,
    [x, y]: [f64; 2],
    body: Surface,
    glass: Surface,
    tyre: Surface,
) {
    let round = |power: f64| {
        move |d: &Vector3<f64>| {
            // A superellipsoid: between a ball and a box.
            let sum: f64 = d.iter().map(|c| libm::pow(c.abs(), power)).sum();
            libm::pow(sum, -1.0 / power) - 1.0
        }
    };
    mesh.blob(
        &turned([x, y, 0.62], 0.0),
        [2.1, 0.85, 0.36],
        8,
        body,
        round(6.0),
    );
    mesh.blob(
        &turned([x - 0.15, y, 1.12], 0.0),
        [1.2, 0.74, 0.36],
        6,
        glass,
        round(4.0),
    );
    mesh.blob(
        &turned([x - 0.15, y, 1.43], 0.0),
        [1.08, 0.7, 0.08],
        5,
        body,
        round(4.0),
    );
    for (dx, dy) in [(-1.3, -0.8), (-1.3, 0.8), (1.3, -0.8), (1.3, 0.8)] {
        mesh.blob(
            &turned([x + dx, y + dy, 0.31], 0.0),
            [0.31, 0.1, 0.31],
            4,
            tyre,
            round(2.0),
        );
    }
}
