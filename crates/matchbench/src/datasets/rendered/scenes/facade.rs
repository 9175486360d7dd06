//! The court of a stone building: two wings with rows of windows, arches, cornices.

use matchbench_vision::seed::Seed;
use nalgebra::{Point3, Vector3};

use super::super::light::Lighting;
use super::super::mesh::Surface;
use super::super::noise::octaves;
use super::super::paint;
use super::super::path::{Path, Station};
use super::super::world::Model;
use super::office::lumps;
use super::{stand, turned};

/// Through the court, always towards the building.
pub(super) const PATH: Path = Path {
    stations: &[
        Station::new([2.0, -13.0, 1.7], [-11.0, -2.0, 4.0]),
        Station::new([4.0, -12.0, 1.6], [-8.0, 1.0, 4.0]),
        Station::new([5.0, -14.0, 1.8], [-5.0, 2.0, 4.2]),
        Station::new([2.0, -14.5, 1.7], [-4.0, 2.0, 4.0]),
        Station::new([-2.0, -14.0, 1.7], [-2.0, 2.0, 4.5]),
        Station::new([-5.0, -13.0, 1.6], [1.0, 2.0, 4.0]),
        Station::new([-8.0, -13.5, 1.8], [4.0, 2.0, 4.3]),
        Station::new([-9.0, -11.0, 1.7], [7.0, 2.0, 4.0]),
        Station::new([-7.0, -9.0, 1.7], [10.0, 1.0, 4.0]),
        Station::new([-6.0, -11.0, 1.6], [12.0, -3.0, 4.2]),
        Station::new([-5.0, -13.0, 1.7], [12.0, -6.0, 4.0]),
        Station::new([-3.0, -14.5, 1.8], [12.0, -5.0, 4.4]),
    ],
    shake: [0.1, 0.03],
    seed: 105,
};

pub(super) fn model() -> Model {
    let mut model = Model::new(
        5,
        1.0,
        Lighting {
            ambient: 0.65,
            reach: 4.0,
            lamps: vec![],
            sun: Some(([-0.55, -0.6, 0.7], 1.1)),
        },
    );
    let stone = Surface::matt(model.texture(12.0, 1024, paint::stone));
    let stucco = Surface::matt(model.texture(7.0, 512, paint::stucco));
    let pane = Surface::matt(model.texture(6.0, 512, paint::pane)).glossy(0.3);
    let tiles = Surface::matt(model.texture(9.0, 512, paint::tiles));
    let gravel = Surface::matt(model.texture(6.0, 512, paint::gravel));
    let leaves = Surface::matt(model.texture(3.0, 512, paint::leaves));
    let wood = Surface::matt(model.texture(2.0, 512, paint::wood));
    let mesh = &mut model.mesh;
    let mut rng = Seed(5).child("court").rng();

    mesh.sheet(
        Point3::new(-40.0, -40.0, 0.0),
        Vector3::x() * 80.0,
        Vector3::y() * 60.0,
        gravel,
    );
    // Each wing: where its front begins, which way it runs, and how long it is.
    for (number, (x, y, yaw, wide)) in [
        (-13.0, 2.0, 0.0, 25.0),
        (12.0, 2.0, -1.5708, 16.0),
        (-13.6, -6.0, 1.2, 9.0),
    ]
    .into_iter()
    .enumerate()
    {
        let frame = turned([x, y, 0.0], yaw);
        let place = |x: f64, y: f64, z: f64| (frame * Point3::new(x, y, z)).coords.into();
        let wall = if number == 2 { stucco } else { stone };
        // The front, hewn: every stone has its own depth.
        mesh.relief(
            frame * Point3::origin(),
            frame * (Vector3::x() * wide),
            Vector3::z() * 9.0,
            0.2,
            wall,
            |x, y| 0.05 * f64::from(octaves(x as f32 / 12.0, y as f32 / 12.0, 32, 3, 0.8, 7)),
        );
        stand(
            mesh,
            place(0.5 * wide, 3.1, 0.0),
            yaw,
            [wide, 6.0, 9.0],
            stone,
        );
        for z in [0.0, 3.4, 6.3, 8.8] {
            let out = if z > 8.0 { 0.9 } else { 0.4 };
            stand(
                mesh,
                place(0.5 * wide, 0.0, z),
                yaw,
                [wide + 0.3, out, 0.3],
                stone.shaded(1.15),
            );
        }
        stand(
            mesh,
            place(0.5 * wide, 2.5, 9.1),
            yaw,
            [wide, 4.0, 2.2],
            tiles,
        );
        let columns = (wide / 3.1) as i32;
        for column in 0..columns {
            let along = wide * (f64::from(column) + 0.5) / f64::from(columns);
            for (low, high) in [(0.9, 1.9), (4.2, 1.8), (7.0, 1.5)] {
                let trim = stone.shaded(1.1 + 0.2 * rng.uniform());
                stand(
                    mesh,
                    place(along, 0.0, low - 0.2),
                    yaw,
                    [1.7, 0.24, high + 0.4],
                    trim,
                );
                stand(mesh, place(along, 0.0, low), yaw, [1.25, 0.3, high], pane);
                for cross in [-0.21, 0.21] {
                    stand(
                        mesh,
                        place(along + cross, 0.0, low),
                        yaw,
                        [0.05, 0.34, high],
                        wood,
                    );
                }
                stand(
                    mesh,
                    place(along, 0.0, low + 0.6 * high),
                    yaw,
                    [1.25, 0.34, 0.06],
                    wood,
                );
                stand(
                    mesh,
                    place(along, 0.0, low - 0.32),
                    yaw,
                    [1.9, 0.5, 0.12],
                    trim,
                );
            }
            if column % 2 == 0 {
                let pilaster = place(along + 0.5 * wide / f64::from(columns), 0.0, 0.0);
                stand(mesh, pilaster, yaw, [0.5, 0.5, 8.8], stone.shaded(0.95));
            }
        }
    }
    // A gate, a well, boxes, shrubs.
    stand(
        mesh,
        [-0.3, 1.9, 0.0],
        0.0,
        [2.6, 0.5, 3.3],
        stone.shaded(1.3),
    );
    stand(mesh, [-0.3, 1.7, 0.0], 0.0, [1.9, 0.3, 2.8], wood);
    mesh.cylinder(&turned([-4.5, -4.0, 0.0], 0.0), 1.1, 0.9, stone.shaded(1.1));
    for (x, y) in [(-5.3, -4.0), (-3.7, -4.0)] {
        mesh.cylinder(&turned([x, y, 0.0], 0.0), 0.09, 2.6, wood);
    }
    stand(mesh, [-4.5, -4.0, 2.6], 0.0, [2.2, 1.4, 0.12], tiles);
    for _ in 0..7 {
        let at = [-9.0 + 19.0 * rng.uniform(), -1.5 * rng.uniform(), 0.5];
        let wide = 0.5 + 0.5 * rng.uniform();
        mesh.blob(&turned(at, 0.0), [wide, wide, 0.8], 20, leaves, |d| {
            lumps(d, 4.0, 0.3)
        });
    }
    for (x, y) in [(4.0, -2.0), (4.8, -2.4), (-8.0, -1.5)] {
        stand(mesh, [x, y, 0.0], rng.uniform(), [0.7, 0.7, 0.7], wood);
    }
    model
}
