//! A room with a desk: monitors, books, papers, a keyboard, mugs, shelves, posters.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use matchbench_vision::seed::Seed;

use super::super::light::{Lamp, Lighting};
use super::super::mesh::Surface;
use super::super::noise::gradient;
use super::super::paint;
use super::super::path::{Path, Station};
use super::super::world::Model;
use super::{hang, lay, stand, turned};

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
    let mut model = Model::new(
        1,
        0.15,
        Lighting {
            ambient: 0.55,
            reach: 1.2,
            lamps: vec![
                Lamp {
                    centre: [-0.8, -0.2, 2.6],
                    edges: [[0.6, 0.0, 0.0], [0.0, 0.15, 0.0]],
                    power: 1.6,
                },
                Lamp {
                    centre: [2.9, 0.6, 1.6],
                    edges: [[0.0, 0.8, 0.0], [0.0, 0.0, 0.6]],
                    power: 2.2,
                },
            ],
            sun: None,
        },
    );
    let plaster = Surface::matt(model.texture(2.4, 512, paint::plaster));
    let wood = Surface::matt(model.texture(1.6, 512, paint::wood));
    let veneer = Surface::matt(model.texture(1.2, 512, paint::veneer));
    let carpet = Surface::matt(model.texture(1.6, 512, paint::carpet));
    let print = Surface::matt(model.texture(1.5, 1024, paint::print));
    let poster = Surface::matt(model.texture(4.0, 512, paint::print));
    let spines = Surface::matt(model.texture(1.2, 1024, paint::spines));
    let keys = Surface::matt(model.texture(0.32, 256, paint::keyboard));
    let screen = Surface::matt(model.texture(1.6, 512, paint::screen));
    let metal = Surface::matt(model.texture(0.5, 256, paint::metal));
    let cloth = Surface::matt(model.texture(0.8, 512, paint::cloth));
    let leaves = Surface::matt(model.texture(0.5, 256, paint::leaves));
    let mesh = &mut model.mesh;
    let mut rng = Seed(1).child("clutter").rng();

    // The room.
    lay(mesh, [0.0, 0.0, 0.0], 0.0, [6.0, 5.0], carpet);
    let wall = plaster.shaded(1.0);
    hang(mesh, [-3.0, 2.4, 2.7], 0.0, [6.0, 2.7], wall);
    hang(
        mesh,
        [-3.0, -2.5, 2.7],
        1.5708,
        [5.0, 2.7],
        wall.shaded(0.9),
    );
    hang(mesh, [3.0, 2.5, 2.7], -1.5708, [5.0, 2.7], wall.shaded(0.9));
    hang(mesh, [3.0, -2.5, 2.7], 3.14159, [6.0, 2.7], wall);

    // The desk, and one more behind it, at an angle.
    stand(
        mesh,
        [0.0, 0.9, 0.70],
        0.0,
        [2.2, 0.95, 0.035],
        veneer.glossy(0.06),
    );
    for (x, y) in [(-1.0, 0.5), (1.0, 0.5), (-1.0, 1.3), (1.0, 1.3)] {
        stand(mesh, [x, y, 0.0], 0.0, [0.06, 0.06, 0.70], metal);
    }
    stand(mesh, [0.75, 0.95, 0.05], 0.0, [0.42, 0.6, 0.62], wood);

    // Two monitors with stands.
    for (x, y, yaw, tall) in [(-0.32, 1.12, 0.18, 0.36), (0.42, 1.15, -0.22, 0.32)] {
        stand(
            mesh,
            [x, y, 0.735],
            yaw,
            [0.22, 0.16, 0.02],
            metal.shaded(0.3),
        );
        stand(
            mesh,
            [x, y, 0.75],
            yaw,
            [0.05, 0.04, 0.16],
            metal.shaded(0.3),
        );
        stand(
            mesh,
            [x, y, 0.86],
            yaw,
            [0.58, 0.045, tall + 0.03],
            metal.shaded(0.15).glossy(0.1),
        );
        let frame = turned([x, y, 0.0], yaw);
        let corner = frame * Point3::new(-0.27, -0.026, 0.875 + tall);
        hang(
            mesh,
            corner.coords.into(),
            yaw,
            [0.54, tall],
            screen.shaded(1.3).glossy(0.05),
        );
    }

    // Keyboards, papers, books, mugs, boxes on the desk.
    stand(
        mesh,
        [-0.28, 0.72, 0.735],
        0.1,
        [0.44, 0.15, 0.02],
        keys.shaded(1.0),
    );
    stand(
        mesh,
        [0.45, 0.66, 0.735],
        -0.25,
        [0.40, 0.14, 0.02],
        keys.shaded(3.5),
    );
    for i in 0..14 {
        let x = -0.95 + 1.9 * rng.uniform();
        let y = 0.50 + 0.75 * rng.uniform();
        let z = 0.737 + 0.0015 * f64::from(i);
        lay(mesh, [x, y, z], 6.3 * rng.uniform(), [0.21, 0.297], print);
    }
    for (x, y, count) in [
        (-0.82, 0.95, 7),
        (-0.66, 0.60, 4),
        (0.85, 0.72, 5),
        (0.10, 0.62, 2),
    ] {
        let mut z = 0.737;
        for _ in 0..count {
            let thick = 0.015 + 0.03 * rng.uniform();
            let size = [
                0.15 + 0.08 * rng.uniform(),
                0.21 + 0.08 * rng.uniform(),
                thick,
            ];
            let shade = 0.5 + 0.7 * rng.uniform();
            stand(
                mesh,
                [x, y, z],
                0.7 * rng.uniform(),
                size,
                print.shaded(shade).glossy(0.08),
            );
            z += thick;
        }
    }
    for (x, y, shade) in [(0.02, 0.92, 1.8), (0.98, 1.1, 0.6), (-0.52, 0.88, 1.2)] {
        let mug = print.shaded(shade).glossy(0.25);
        mesh.cylinder(&turned([x, y, 0.735], 0.0), 0.04, 0.095, mug);
    }
    for i in 0..9 {
        let lean = UnitQuaternion::from_euler_angles(0.25 - 0.06 * f64::from(i), 0.2, f64::from(i));
        let pen = Isometry3::from_parts(Translation3::new(0.02, 0.92, 0.76), lean);
        mesh.cylinder(&pen, 0.004, 0.14, print.shaded(0.8));
    }
    stand(
        mesh,
        [-0.95, 1.22, 0.735],
        0.3,
        [0.2, 0.2, 0.26],
        print.shaded(0.8),
    );
    let globe = turned([0.93, 1.2, 0.92], 0.4);
    mesh.blob(&globe, [0.11; 3], 12, print.shaded(0.9).glossy(0.2), |_| {
        0.0
    });

    // A pot plant.
    mesh.cylinder(
        &turned([0.05, 1.22, 0.735], 0.0),
        0.07,
        0.13,
        cloth.shaded(0.8),
    );
    mesh.blob(
        &turned([0.05, 1.22, 0.98], 0.0),
        [0.13, 0.13, 0.16],
        24,
        leaves,
        |d| lumps(d, 5.0, 0.35),
    );

    // The chair.
    stand(mesh, [-0.2, 0.05, 0.44], 0.5, [0.46, 0.46, 0.08], cloth);
    stand(mesh, [-0.32, -0.17, 0.62], 0.5, [0.44, 0.06, 0.36], cloth);
    mesh.cylinder(&turned([-0.2, 0.05, 0.0], 0.0), 0.03, 0.45, metal);

    // Shelves with books along the back wall; single books stand out by up to 5 cm.
    for (left, tall) in [(-2.6, 2.0), (1.35, 1.65)] {
        stand(
            mesh,
            [left + 0.55, 2.24, 0.0],
            0.0,
            [1.16, 0.28, tall],
            wood.shaded(0.7),
        );
        for row in 0..(tall / 0.33) as i32 {
            let mut x = left + 0.03;
            while x < left + 1.05 {
                let wide = 0.022 + 0.035 * rng.uniform();
                let high = 0.19 + 0.09 * rng.uniform();
                let out = 0.05 * rng.uniform();
                let at = [x + 0.5 * wide, 2.10 - out, 0.04 + 0.33 * f64::from(row)];
                let spine = spines.shaded(0.5 + rng.uniform()).glossy(0.05);
                stand(mesh, at, 0.0, [wide, 0.1, high], spine);
                x += wide + 0.003;
            }
        }
    }

    // Posters and notes on the walls, a coat, a bin.
    for (x, z, wide, high) in [
        (-1.25, 2.15, 0.7, 0.95),
        (-0.42, 2.1, 0.5, 0.7),
        (0.2, 2.2, 0.95, 0.62),
        (0.25, 1.5, 0.3, 0.42),
        (0.65, 1.52, 0.42, 0.3),
        (-0.4, 1.33, 0.21, 0.297),
    ] {
        hang(
            mesh,
            [x, 2.39, z],
            0.0,
            [wide, high],
            poster.shaded(0.6 + 0.5 * rng.uniform()),
        );
    }
    for (y, z) in [(1.6, 1.9), (0.4, 1.8), (-0.9, 2.0)] {
        hang(mesh, [-2.99, y - 0.8, z], 1.5708, [0.6, 0.85], poster);
        hang(mesh, [2.99, y + 0.2, z], -1.5708, [0.6, 0.85], poster);
    }
    mesh.blob(
        &turned([-1.15, 1.9, 0.25], 0.0),
        [0.3, 0.2, 0.27],
        16,
        cloth,
        |d| lumps(d, 3.0, 0.2),
    );
    stand(
        mesh,
        [1.1, 1.95, 0.0],
        0.4,
        [0.4, 0.35, 0.45],
        print.shaded(0.6),
    );
    stand(mesh, [1.15, 1.9, 0.45], 0.1, [0.3, 0.3, 0.3], wood);
    model
}

/// Relief of an irregular body: `scale` bumps per radius, of relative height `amount`.
pub(super) fn lumps(direction: &Vector3<f64>, scale: f64, amount: f64) -> f64 {
    let [x, y, z] =
        [direction.x, direction.y, direction.z].map(|c| (c * scale + 8.0) as f32 / 16.0);
    let sum = gradient(x, y, 16, 5) + gradient(y, z, 16, 6) + gradient(z, x, 16, 7);
    amount * 0.6 * f64::from(sum)
}
