//! A painted wall: figures of flat colour, outlines, writing and spray on rough plaster. It is a plane.

use std::f64::consts::PI;

use super::wall;
use crate::light::Lighting;
use crate::model::Model;
use crate::noise::{octaves, smoothstep, worley};
use crate::paint::{letters, mosaic, speckle};
use crate::path::{Path, Station};

/// Four groups of six pictures. In each group every picture is farther from the first: around the normal of the
/// wall, away with the camera turned, down to the ground, and all of these together. Two more stations bring
/// the camera to rest in between.
pub(super) const PATH: Path = Path {
    stations: &[
        Station::new([0.2, -5.0, 2.0], [0.0, 0.0, 2.0]),
        Station::new([1.2, -4.9, 2.1], [0.1, 0.0, 2.0]),
        Station::new([2.2, -4.5, 1.9], [0.0, 0.0, 2.1]),
        Station::new([3.0, -3.9, 2.0], [0.1, 0.0, 2.0]),
        Station::new([3.7, -3.3, 2.1], [0.2, 0.0, 1.9]),
        Station::new([4.2, -2.6, 2.0], [0.2, 0.0, 2.0]),
        Station::new([4.2, -2.6, 2.0], [0.2, 0.0, 2.0]),
        Station::new([9.6, -3.2, 2.5], [9.7, 0.0, 2.6]),
        Station::new([9.6, -3.2, 2.5], [9.7, 0.0, 2.6]),
        Station::new([9.7, -3.8, 2.4], [9.6, 0.0, 2.5]).rolled(0.12 * PI),
        Station::new([9.8, -4.6, 2.6], [9.8, 0.0, 2.6]).rolled(0.25 * PI),
        Station::new([9.6, -5.6, 2.5], [9.6, 0.0, 2.7]).rolled(0.4 * PI),
        Station::new([9.5, -6.8, 2.4], [9.7, 0.0, 2.5]).rolled(0.6 * PI),
        Station::new([9.6, -8.2, 2.5], [9.6, 0.0, 2.6]).rolled(0.85 * PI),
        Station::new([9.6, -8.2, 2.5], [9.6, 0.0, 2.6]).rolled(0.85 * PI),
        Station::new([-5.8, -5.2, 3.0], [-5.9, 0.0, 3.0]),
        Station::new([-5.8, -5.2, 3.0], [-5.9, 0.0, 3.0]),
        Station::new([-5.7, -5.0, 2.1], [-5.8, 0.0, 3.2]),
        Station::new([-5.8, -4.6, 1.2], [-5.8, 0.0, 3.4]),
        Station::new([-5.9, -4.2, 0.4], [-5.9, 0.0, 3.5]),
        Station::new([-5.8, -3.6, -0.4], [-5.8, 0.0, 3.5]),
        Station::new([-5.7, -2.9, -1.0], [-5.8, 0.0, 3.4]),
        Station::new([-5.7, -2.9, -1.0], [-5.8, 0.0, 3.4]),
        Station::new([21.1, -6.5, 4.0], [20.1, 0.0, 4.2]),
        Station::new([21.1, -6.5, 4.0], [20.1, 0.0, 4.2]),
        Station::new([21.9, -5.8, 3.6], [20.2, 0.0, 4.1]).rolled(-0.08 * PI),
        Station::new([22.5, -5.0, 3.2], [20.3, 0.0, 4.2]).rolled(-0.16 * PI),
        Station::new([23.0, -4.2, 2.9], [20.3, 0.0, 4.3]).rolled(-0.25 * PI),
        Station::new([23.3, -3.4, 2.6], [20.4, 0.0, 4.2]).rolled(-0.34 * PI),
        Station::new([23.4, -2.7, 2.4], [20.5, 0.0, 4.2]).rolled(-0.45 * PI),
    ],
    shake: [0.03, 0.015],
    seed: 106,
};

pub(super) fn model() -> Model {
    let lighting = Lighting {
        ambient: 0.4,
        reach: 1.0,
        lamps: vec![],
        sun: Some(([-0.5, -0.6, 0.6], 0.45)),
    };
    let mut model = Model::new(6, 4.0, lighting);
    let painted = model.material(8.0, 2048, painting);
    wall(&mut model.mesh, painted);
    model
}

/// The painting of eight metres of the wall.
fn painting(u: f32, v: f32) -> f32 {
    // Edges drawn by hand.
    let (x, y) = (
        u + 0.016 * octaves(u, v, 16, 4, 0.7, 251),
        v + 0.016 * octaves(u, v, 16, 4, 0.7, 252),
    );
    let figure = worley(x, y, 12, 253);
    let tone = 0.08 + 0.6 * (figure.id >> 24) as f32 / 255.0;
    let filled = match figure.id % 5 {
        0 => tone + 0.16 * octaves(u, v, 16, 4, 0.8, 254),
        1 => 0.5 * (tone + mosaic(x, y, 60, 255)),
        2 => tone - 0.35 * letters(u, 1.0 - v, 48, 30, 256),
        3 => tone + 0.25 * letters(x, 1.0 - y, 22, 14, figure.id),
        _ => tone * (0.7 + 0.3 * smoothstep(0.1, 0.9, figure.near)),
    };
    let edge = figure.next - figure.near;
    let outline = 1.0 - smoothstep(0.03, 0.055, edge);
    let glow = 0.5 * smoothstep(0.16, 0.07, edge) * f32::from(figure.id.is_multiple_of(3));
    let drawn = filled + (0.75 - filled) * glow;
    let drawn = drawn + (0.04 - drawn) * outline;
    let plaster = octaves(u, v, 32, 6, 0.9, 259);
    let worn = smoothstep(0.2, 0.6, octaves(u, v, 8, 7, 0.85, 260));
    let bare = 0.42 + 0.05 * octaves(u, v, 64, 4, 0.9, 261);
    (drawn + worn * (bare - drawn)) * (1.0 + 0.14 * plaster) + 0.16 * speckle(u, v, 90, 0.16, 258)
}
