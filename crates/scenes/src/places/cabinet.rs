//! A sprayed steel cabinet in an empty room: large flat faces with almost no texture.

use nalgebra::{Point3, Vector3};

use super::{hang, lay, stand};
use crate::light::{Lamp, Lighting};
use crate::mesh::{Mesh, Surface};
use crate::model::Model;
use crate::paint;
use crate::path::{Path, Station};

pub(super) const PATH: Path = Path {
    stations: &[
        Station::new([1.95, -1.1, 1.35], [0.15, 0.0, 0.75]),
        Station::new([1.55, -1.7, 1.45], [0.1, 0.0, 0.8]),
        Station::new([1.05, -1.95, 1.25], [0.05, 0.0, 0.72]),
        Station::new([0.5, -1.8, 1.35], [0.0, 0.0, 0.78]),
        Station::new([-0.05, -1.95, 1.55], [0.0, 0.0, 0.8]),
        Station::new([-0.6, -1.75, 1.35], [-0.05, 0.0, 0.75]),
        Station::new([-1.1, -1.8, 1.2], [-0.1, 0.0, 0.72]),
        Station::new([-1.6, -1.4, 1.4], [-0.15, 0.0, 0.78]),
        Station::new([-1.85, -0.95, 1.5], [-0.1, 0.0, 0.75]),
        Station::new([-1.5, -1.35, 1.25], [-0.05, 0.0, 0.8]),
        Station::new([-0.95, -1.6, 1.4], [0.0, 0.0, 0.75]),
    ],
    shake: [0.03, 0.02],
    seed: 103,
};

pub(super) fn model() -> Model {
    let lamp = Lamp {
        centre: [-0.9, -1.4, 2.8],
        edges: [[0.6, 0.0, 0.0], [0.0, 0.2, 0.0]],
        power: 2.6,
    };
    let lighting = Lighting {
        ambient: 0.5,
        reach: 1.2,
        lamps: vec![lamp],
        sun: None,
    };
    let mut model = Model::new(3, 0.15, lighting);
    let paint = model.material(1.4, 512, paint::paint).glossy(0.05);
    let floor = model.material(2.6, 512, paint::linoleum);
    let metal = model.material(0.4, 256, paint::metal);
    let print = model.material(0.9, 512, paint::print);
    let mesh = &mut model.mesh;
    lay(mesh, floor, [0.0, 0.0, 0.0], 0.2, [12.0, 12.0]);
    for (corner, yaw) in [
        ([-6.0, 1.8, 2.8], 0.05),
        ([-3.6, -6.0, 2.8], 1.55),
        ([3.8, 6.0, 2.8], -1.55),
        ([6.0, -4.0, 2.8], 3.1),
    ] {
        hang(mesh, paint.shaded(1.25), corner, yaw, [12.0, 2.8]);
    }
    cabinet(mesh, paint, metal);

    // Labels, and things on top and beside it.
    hang(mesh, print, [0.30, -0.276, 1.16], 0.0, [0.10, 0.05]);
    hang(mesh, print, [-0.40, -0.276, 1.17], 0.0, [0.10, 0.05]);
    hang(mesh, print, [-0.42, -0.276, 0.80], 0.0, [0.14, 0.20]);
    hang(mesh, metal, [1.0, 2.13, 0.5], 0.05, [0.09, 0.09]);
    stand(
        mesh,
        print.shaded(0.7),
        [-0.35, 0.0, 1.305],
        0.2,
        [0.32, 0.24, 0.07],
    );
    stand(
        mesh,
        paint.shaded(0.5),
        [0.38, 0.05, 1.305],
        -0.3,
        [0.2, 0.2, 0.22],
    );
    stand(
        mesh,
        paint.shaded(0.6),
        [1.15, 0.1, 0.0],
        0.5,
        [0.35, 0.3, 0.3],
    );
    model
}

/// 1.2 m wide, 0.5 m deep, 1.3 m high; plinth and top plate project.
fn cabinet(mesh: &mut Mesh, paint: Surface, metal: Surface) {
    stand(
        mesh,
        metal.shaded(0.4),
        [0.0, 0.0, 0.0],
        0.0,
        [1.16, 0.46, 0.08],
    );
    stand(
        mesh,
        paint.shaded(0.95),
        [0.0, 0.0, 0.08],
        0.0,
        [1.2, 0.5, 1.2],
    );
    stand(
        mesh,
        paint.shaded(0.8),
        [0.0, -0.005, 1.28],
        0.0,
        [1.24, 0.54, 0.025],
    );
    // Two doors, and above them two drawers: bottom, height, handle.
    for (low, tall, handle_at, handle) in [
        (0.11, 0.82, 0.6, [0.018, 0.02, 0.14]),
        (0.96, 0.29, 1.1, [0.14, 0.02, 0.018]),
    ] {
        for (left, side) in [(-0.585, -1.0), (0.008, 1.0)] {
            panel(mesh, paint, Point3::new(left, -0.27, low), 0.577, tall);
            let foot = [0.09 * side, -0.29, handle_at];
            stand(mesh, metal.glossy(0.3), foot, 0.0, handle);
        }
    }
}

/// A pressed front: rounded at the rim, with a groove 6 cm from the rim.
fn panel(mesh: &mut Mesh, paint: Surface, corner: Point3<f64>, wide: f64, tall: f64) {
    let (u, v) = (Vector3::x() * wide, Vector3::z() * tall);
    mesh.relief(corner, u, v, 0.012, paint, |x, y| {
        let rim = x.min(wide - x).min(y).min(tall - y);
        let edge = -0.018 * (1.0 - rim / 0.015).max(0.0);
        let groove = -0.007 * (1.0 - (rim - 0.06).abs() / 0.012).max(0.0);
        edge + groove
    });
}
