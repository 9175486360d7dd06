//! A sprayed steel cabinet in an empty room: large flat faces with next to no texture.

use nalgebra::{Point3, Vector3};

use super::super::light::{Lamp, Lighting};
use super::super::mesh::Surface;
use super::super::paint;
use super::super::path::{Path, Station};
use super::super::world::Model;
use super::{hang, lay, stand};

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
    let mut model = Model::new(
        3,
        0.15,
        Lighting {
            ambient: 0.5,
            reach: 1.2,
            lamps: vec![Lamp {
                centre: [-0.9, -1.4, 2.8],
                edges: [[0.6, 0.0, 0.0], [0.0, 0.2, 0.0]],
                power: 2.6,
            }],
            sun: None,
        },
    );
    let paint = Surface::matt(model.texture(1.4, 512, paint::paint)).glossy(0.05);
    let floor = Surface::matt(model.texture(2.6, 512, paint::linoleum));
    let metal = Surface::matt(model.texture(0.4, 256, paint::metal));
    let print = Surface::matt(model.texture(0.9, 512, paint::print));
    let mesh = &mut model.mesh;
    lay(mesh, [0.0, 0.0, 0.0], 0.2, [12.0, 12.0], floor);
    for (corner, yaw) in [
        ([-6.0, 1.8, 2.8], 0.05),
        ([-3.6, -6.0, 2.8], 1.55),
        ([3.8, 6.0, 2.8], -1.55),
        ([6.0, -4.0, 2.8], 3.1),
    ] {
        hang(mesh, corner, yaw, [12.0, 2.8], paint.shaded(1.25));
    }

    // The carcass: 1.2 m wide, 0.5 m deep, 1.3 m high; plinth and top plate stand out.
    stand(
        mesh,
        [0.0, 0.0, 0.0],
        0.0,
        [1.16, 0.46, 0.08],
        metal.shaded(0.4),
    );
    stand(
        mesh,
        [0.0, 0.0, 0.08],
        0.0,
        [1.2, 0.5, 1.2],
        paint.shaded(0.95),
    );
    stand(
        mesh,
        [0.0, -0.005, 1.28],
        0.0,
        [1.24, 0.54, 0.025],
        paint.shaded(0.8),
    );
    // Two doors with pressed panels, above them two drawers.
    for side in [-1.0, 1.0] {
        for (low, high) in [(0.11, 0.93), (0.96, 1.25)] {
            let left = if side < 0.0 { -0.585 } else { 0.008 };
            let (wide, tall) = (0.577, high - low);
            let corner = Point3::new(left, -0.27, low);
            // Rounded at the rim, with a groove 6 cm inside.
            mesh.relief(
                corner,
                Vector3::x() * wide,
                Vector3::z() * tall,
                0.012,
                paint,
                |x, y| {
                    let rim = x.min(wide - x).min(y).min(tall - y);
                    let edge = -0.018 * (1.0 - rim / 0.015).max(0.0);
                    let groove = -0.007 * (1.0 - (rim - 0.06).abs() / 0.012).max(0.0);
                    edge + groove
                },
            );
            let handle = [0.09 * side, -0.29, if tall > 0.5 { 0.6 } else { 1.1 }];
            let size = if tall > 0.5 {
                [0.018, 0.02, 0.14]
            } else {
                [0.14, 0.02, 0.018]
            };
            stand(mesh, handle, 0.0, size, metal.glossy(0.3));
        }
    }
    hang(mesh, [0.30, -0.276, 1.16], 0.0, [0.10, 0.05], print);
    hang(mesh, [-0.40, -0.276, 1.17], 0.0, [0.10, 0.05], print);
    hang(
        mesh,
        [-0.42, -0.276, 0.80],
        0.0,
        [0.14, 0.20],
        print.shaded(0.9),
    );

    // On top and beside it.
    stand(
        mesh,
        [-0.35, 0.0, 1.305],
        0.2,
        [0.32, 0.24, 0.07],
        print.shaded(0.7),
    );
    stand(
        mesh,
        [0.38, 0.05, 1.305],
        -0.3,
        [0.2, 0.2, 0.22],
        paint.shaded(0.5),
    );
    stand(
        mesh,
        [1.15, 0.1, 0.0],
        0.5,
        [0.35, 0.3, 0.3],
        paint.shaded(0.6),
    );
    hang(mesh, [1.0, 2.08, 0.5], 0.05, [0.09, 0.09], metal);
    model
}
