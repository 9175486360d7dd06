//! An indoor wall of glazed tiles with two ornaments that alternate. Tiles with the same ornament differ only
//! by glaze, chips and stains. The wall is a plane.

use std::f64::consts::PI;

use super::wall;
use crate::light::{Lamp, Lighting};
use crate::model::Model;
use crate::noise::{chance, floor, octaves, scatter, smoothstep};
use crate::paint::{letters, speckle};
use crate::path::{Path, Station};

/// Four groups of six pictures. In each group every picture is farther from the first: sideways, turning,
/// closer, and around. Two more stations bring the camera to rest in between.
pub(super) const PATH: Path = Path {
    stations: &[
        Station::new([0.0, -1.9, 1.4], [0.0, 0.0, 1.4]),
        Station::new([0.3, -1.9, 1.4], [0.1, 0.0, 1.4]),
        Station::new([0.6, -1.8, 1.5], [0.1, 0.0, 1.4]),
        Station::new([0.9, -1.7, 1.4], [0.2, 0.0, 1.4]),
        Station::new([1.2, -1.5, 1.3], [0.2, 0.0, 1.4]),
        Station::new([1.4, -1.3, 1.4], [0.2, 0.0, 1.4]),
        Station::new([1.4, -1.3, 1.4], [0.2, 0.0, 1.4]),
        Station::new([4.0, -1.7, 1.5], [4.0, 0.0, 1.5]),
        Station::new([4.0, -1.7, 1.5], [4.0, 0.0, 1.5]),
        Station::new([4.1, -1.7, 1.5], [4.0, 0.0, 1.5]).rolled(0.06 * PI),
        Station::new([4.0, -1.8, 1.4], [4.0, 0.0, 1.5]).rolled(0.14 * PI),
        Station::new([3.9, -1.9, 1.5], [4.0, 0.0, 1.5]).rolled(0.22 * PI),
        Station::new([4.0, -2.0, 1.6], [4.0, 0.0, 1.5]).rolled(0.32 * PI),
        Station::new([4.1, -2.1, 1.5], [4.0, 0.0, 1.5]).rolled(0.43 * PI),
        Station::new([4.1, -2.1, 1.5], [4.0, 0.0, 1.5]).rolled(0.43 * PI),
        Station::new([-4.0, -2.6, 1.5], [-4.0, 0.0, 1.5]),
        Station::new([-4.0, -2.6, 1.5], [-4.0, 0.0, 1.5]),
        Station::new([-4.0, -2.3, 1.5], [-4.1, 0.0, 1.5]),
        Station::new([-4.1, -2.0, 1.4], [-4.0, 0.0, 1.5]),
        Station::new([-4.0, -1.7, 1.5], [-4.0, 0.0, 1.4]),
        Station::new([-3.9, -1.4, 1.5], [-4.0, 0.0, 1.5]),
        Station::new([-4.0, -1.1, 1.4], [-4.0, 0.0, 1.4]),
        Station::new([-4.0, -1.1, 1.4], [-4.0, 0.0, 1.4]),
        Station::new([-9.0, -2.0, 1.8], [-8.8, 0.0, 1.5]),
        Station::new([-9.0, -2.0, 1.8], [-8.8, 0.0, 1.5]),
        Station::new([-8.8, -2.0, 1.6], [-8.8, 0.0, 1.5]),
        Station::new([-8.6, -1.9, 1.3], [-8.8, 0.0, 1.5]),
        Station::new([-8.4, -1.8, 1.0], [-8.8, 0.0, 1.5]).rolled(-0.04 * PI),
        Station::new([-8.2, -1.7, 0.8], [-8.8, 0.0, 1.5]).rolled(-0.08 * PI),
        Station::new([-8.0, -1.6, 0.6], [-8.8, 0.0, 1.5]).rolled(-0.12 * PI),
    ],
    shake: [0.02, 0.02],
    seed: 107,
};

pub(super) fn model() -> Model {
    let lamp = Lamp {
        centre: [-1.0, -2.5, 3.0],
        edges: [[1.5, 0.0, 0.0], [0.0, 0.2, 0.0]],
        power: 2.2,
    };
    let lighting = Lighting {
        ambient: 0.45,
        reach: 1.0,
        lamps: vec![lamp],
        sun: None,
    };
    let mut model = Model::new(7, 0.8, lighting);
    let tiles = model.material(6.4, 2048, tiles);
    wall(&mut model.mesh, tiles);
    model
}

/// Number of tiles along each side of the texture.
const TILES: f32 = 32.0;

/// Tiles of twenty centimetres.
fn tiles(u: f32, v: f32) -> f32 {
    let (x, y) = (u * TILES, v * TILES);
    let (column, row) = (floor(x), floor(y));
    let (s, t) = (x - column as f32 - 0.5, y - row as f32 - 0.5);
    let id = scatter(column, row, 271);
    let own = 0.06 * (chance(column, row, 272) - 0.5);
    let glaze = 0.66 + own + 0.03 * octaves(u, v, 32, 5, 0.85, 273);
    let ink = match (id % 17, (column + row) & 1) {
        // Some tiles were replaced.
        (0, _) => 0.3,
        (1, _) => letters(s + 0.5, 0.5 - t, 5, 4, id),
        (_, 0) => flower(s, t),
        _ => lattice(s, t),
    };
    let joint = smoothstep(0.475, 0.488, s.abs().max(t.abs()));
    let chip = speckle(u, v, 60, 0.09, 274);
    let stain = smoothstep(0.5, 1.4, octaves(u, v, 4, 6, 0.75, 275));
    let tile = glaze - 0.5 * ink - 0.2 * chip;
    (tile + joint * (0.24 - tile)) * (1.0 - 0.3 * stain)
}

/// Petals along both diagonals, and a ring around them.
fn flower(s: f32, t: f32) -> f32 {
    let radius = (s * s + t * t).sqrt();
    // A sine of four times the angle, from 0 along the axes to 1 along the diagonals.
    let turn = 2.0 * (s * t).abs() / (radius * radius).max(1e-6);
    let petal = smoothstep(0.02, 0.05, 0.34 * turn - radius) * smoothstep(0.08, 0.1, radius);
    let ring = 1.0 - smoothstep(0.015, 0.03, (radius - 0.4).abs());
    let heart = 1.0 - smoothstep(0.05, 0.06, radius);
    petal.max(ring).max(heart)
}

/// Crossed bands with a star between them.
fn lattice(s: f32, t: f32) -> f32 {
    let band = |x: f32| 1.0 - smoothstep(0.03, 0.045, (x.abs() - 0.3).abs());
    let star = 1.0
        - smoothstep(
            0.15,
            0.17,
            (s.abs() + t.abs()).min(1.4 * s.abs().max(t.abs())),
        );
    band(s + t).max(band(s - t)).max(star)
}
