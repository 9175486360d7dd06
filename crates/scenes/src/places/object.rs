//! A plush bear on a bare floor: round, self-similar, in front of a dull background.

use std::f64::consts::TAU;

use matchbench_vision::seed::Seed;
use nalgebra::{Isometry3, Translation3, UnitQuaternion};

use super::{hang, lay, lumps, stand, turned};
use crate::light::{Lamp, Lighting};
use crate::mesh::{Mesh, Surface};
use crate::model::Model;
use crate::paint;
use crate::path::{Path, Station};

/// Half a turn around the bear.
pub(super) const PATH: Path = Path {
    stations: &[
        Station::new([1.2, -0.45, 0.85], [0.05, 0.0, 0.34]),
        Station::new([1.0, -0.85, 0.9], [0.0, 0.02, 0.36]),
        Station::new([0.65, -1.1, 0.75], [0.0, 0.0, 0.33]),
        Station::new([0.25, -1.25, 0.85], [-0.02, 0.0, 0.38]),
        Station::new([-0.15, -1.2, 1.0], [0.0, 0.0, 0.35]),
        Station::new([-0.55, -1.15, 0.85], [0.02, 0.0, 0.33]),
        Station::new([-0.95, -0.9, 0.75], [0.0, 0.0, 0.36]),
        Station::new([-1.2, -0.5, 0.9], [0.0, 0.0, 0.36]),
        Station::new([-1.15, -0.1, 1.0], [0.0, 0.0, 0.34]),
        Station::new([-1.05, -0.45, 0.8], [0.0, -0.05, 0.35]),
        Station::new([-0.8, -0.8, 0.7], [0.0, -0.05, 0.36]),
    ],
    shake: [0.02, 0.02],
    seed: 102,
};

pub(super) fn model() -> Model {
    let lamp = Lamp {
        centre: [0.9, -1.2, 2.6],
        edges: [[0.5, 0.0, 0.0], [0.0, 0.25, 0.0]],
        power: 2.6,
    };
    let lighting = Lighting {
        ambient: 0.5,
        reach: 0.9,
        lamps: vec![lamp],
        sun: None,
    };
    let mut model = Model::new(2, 0.15, lighting);
    let floor = model.material(2.0, 512, paint::linoleum).shaded(0.9);
    let plaster = model.material(2.4, 512, paint::plaster);
    let fur = model.material(0.5, 512, paint::fur);
    let cloth = model.material(0.25, 256, paint::cloth);
    let print = model.material(0.9, 512, paint::print);
    let mesh = &mut model.mesh;
    lay(mesh, floor, [0.0, 0.5, 0.0], 0.3, [13.0, 13.0]);
    for (corner, yaw, shade) in [
        ([-4.0, 2.2, 2.6], 0.1, 0.8),
        ([-3.0, -4.0, 2.6], 1.5, 0.7),
        ([3.2, 4.0, 2.6], -1.5, 0.75),
        ([4.0, -3.4, 2.6], 3.1, 0.8),
    ] {
        hang(mesh, plaster.shaded(shade), corner, yaw, [8.0, 2.6]);
    }
    bear(mesh, fur, cloth);
    things(mesh, plaster, cloth, print);
    model
}

fn bear(mesh: &mut Mesh, fur: Surface, cloth: Surface) {
    // Position, lean, radii, shade: body, head, muzzle; ears, arms, legs and soles in pairs.
    let single = [
        ([0.0, 0.0, 0.24], 0.0, [0.21, 0.18, 0.24], 1.0),
        ([0.0, -0.02, 0.55], 0.0, [0.16, 0.15, 0.145], 1.05),
        ([0.0, -0.15, 0.52], 0.0, [0.07, 0.06, 0.055], 1.5),
    ];
    let double = [
        ([0.13, 0.0, 0.67], 0.0, [0.06, 0.03, 0.06], 0.9),
        ([0.23, -0.08, 0.33], -0.7, [0.075, 0.075, 0.17], 1.0),
        ([0.14, -0.22, 0.09], 0.0, [0.085, 0.2, 0.085], 0.95),
        ([0.15, -0.42, 0.11], 0.0, [0.08, 0.045, 0.1], 1.6),
    ];
    let mirrored = double.map(|([x, y, z], lean, radii, shade)| ([-x, y, z], -lean, radii, shade));
    for (number, (at, lean, radii, shade)) in
        single.into_iter().chain(double).chain(mirrored).enumerate()
    {
        let frame = Isometry3::from_parts(
            Translation3::from(at),
            UnitQuaternion::from_euler_angles(0.1, lean, 0.05 * number as f64),
        );
        // A vertex about every 1.5 cm.
        let steps = (110.0 * radii[2]) as usize + 6;
        mesh.blob(&frame, radii, steps, fur.shaded(shade), |d| {
            lumps(d, 7.0, 0.05) + lumps(d, 2.5, 0.05)
        });
    }
    let bead = cloth.shaded(0.1).glossy(0.6);
    for (at, radius) in [
        ([0.0, -0.205, 0.545], 0.022),
        ([-0.06, -0.145, 0.60], 0.014),
        ([0.06, -0.145, 0.60], 0.014),
    ] {
        mesh.blob(&turned(at, 0.0), [radius; 3], 8, bead, |_| 0.0);
    }
    for side in [-1.0, 1.0] {
        let bow = turned([0.06 * side, -0.17, 0.42], 0.3 * side);
        mesh.blob(&bow, [0.06, 0.025, 0.04], 14, cloth, |d| lumps(d, 3.0, 0.2));
    }
}

/// Toy bricks, books, a ball and boxes around the bear.
fn things(mesh: &mut Mesh, plaster: Surface, cloth: Surface, print: Surface) {
    let mut rng = Seed(2).child("bricks").rng();
    for _ in 0..26 {
        let angle = -0.3 - 2.6 * rng.uniform();
        let radius = 0.42 + 0.35 * rng.uniform();
        let (x, y) = (radius * libm::cos(angle), radius * libm::sin(angle) + 0.15);
        let (wide, high) = (0.03 + 0.05 * rng.uniform(), 0.03 + 0.04 * rng.uniform());
        let brick = print.shaded(0.4 + 0.8 * rng.uniform()).glossy(0.1);
        stand(
            mesh,
            brick,
            [x, y, 0.0],
            TAU * rng.uniform(),
            [wide, 0.04, high],
        );
    }
    let ball = turned([-0.45, -0.35, 0.055], 0.0);
    mesh.blob(&ball, [0.055; 3], 12, cloth.glossy(0.1), |_| 0.0);
    stand(mesh, print, [0.62, 0.5, 0.0], 0.4, [0.24, 0.17, 0.05]);
    stand(
        mesh,
        print.shaded(0.7),
        [-0.65, 0.35, 0.0],
        1.1,
        [0.22, 0.3, 0.03],
    );
    stand(
        mesh,
        print.shaded(0.6),
        [0.9, 1.6, 0.0],
        0.2,
        [0.5, 0.4, 0.35],
    );
    stand(
        mesh,
        plaster.shaded(0.6),
        [-1.0, 1.9, 0.0],
        -0.3,
        [0.6, 0.4, 0.5],
    );
    hang(mesh, print.shaded(0.8), [-0.3, 2.5, 1.7], 0.1, [0.6, 0.8]);
}
