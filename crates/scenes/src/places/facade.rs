//! The courtyard of a stone building: two wings with rows of windows, arches, cornices.

use std::f64::consts::FRAC_PI_2;

use matchbench_vision::seed::{Rng, Seed};
use nalgebra::{Isometry3, Point3, Vector3};

use super::{bush, lay, stand, turned};
use crate::light::Lighting;
use crate::mesh::{Mesh, Surface};
use crate::model::Model;
use crate::noise::octaves;
use crate::paint;
use crate::path::{Path, Station};

/// A path through the courtyard that always looks towards the building.
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
    let lighting = Lighting {
        ambient: 0.65,
        reach: 4.0,
        lamps: vec![],
        sun: Some(([-0.55, -0.6, 0.7], 1.1)),
    };
    let mut model = Model::new(5, 1.0, lighting);
    let materials = Materials {
        stone: model.material(12.0, 1024, paint::stone),
        stucco: model.material(7.0, 512, paint::stucco),
        pane: model.material(6.0, 512, paint::pane).glossy(0.3),
        tiles: model.material(9.0, 512, paint::tiles),
        gravel: model.material(6.0, 512, paint::gravel),
        leaves: model.material(3.0, 512, paint::leaves),
        wood: model.material(2.0, 512, paint::wood),
    };
    let mut rng = Seed(5).child("court").rng();
    court(&mut model.mesh, &materials, &mut rng);
    // Where each front begins, its direction, and its length.
    for (x, y, yaw, wide, wall) in [
        (-13.0, 2.0, 0.0, 25.0, materials.stone),
        (12.0, 2.0, -FRAC_PI_2, 16.0, materials.stone),
        (-13.6, -6.0, 1.2, 9.0, materials.stucco),
    ] {
        let mut wing = Wing {
            mesh: &mut model.mesh,
            frame: turned([x, y, 0.0], yaw),
            yaw,
        };
        wing.walls(&materials, wall, wide);
        wing.openings(&materials, wide, &mut rng);
    }
    model
}

struct Materials {
    stone: Surface,
    stucco: Surface,
    pane: Surface,
    tiles: Surface,
    gravel: Surface,
    leaves: Surface,
    wood: Surface,
}

/// A wing under construction: x runs along its front, y into it.
struct Wing<'a> {
    mesh: &'a mut Mesh,
    frame: Isometry3<f64>,
    yaw: f64,
}

impl Wing<'_> {
    fn stand(&mut self, surface: Surface, x: f64, y: f64, z: f64, size: [f64; 3]) {
        let foot = self.frame * Point3::new(x, y, z);
        stand(self.mesh, surface, foot.coords.into(), self.yaw, size);
    }

    /// A front of stones with individual depths, cornices, a roof.
    fn walls(&mut self, m: &Materials, wall: Surface, wide: f64) {
        let (origin, u) = (
            self.frame * Point3::origin(),
            self.frame * (Vector3::x() * wide),
        );
        self.mesh
            .relief(origin, u, Vector3::z() * 9.0, 0.2, wall, |x, y| {
                0.05 * f64::from(octaves(x as f32 / 12.0, y as f32 / 12.0, 32, 3, 0.8, 7))
            });
        let middle = 0.5 * wide;
        self.stand(m.stone, middle, 3.1, 0.0, [wide, 6.0, 9.0]);
        for (z, out) in [(0.0, 0.4), (3.4, 0.4), (6.3, 0.4), (8.8, 0.9)] {
            self.stand(m.stone.shaded(1.15), middle, 0.0, z, [wide + 0.3, out, 0.3]);
        }
        self.stand(m.tiles, middle, 2.5, 9.1, [wide, 4.0, 2.2]);
    }

    /// Three rows of windows that differ only in their panes, and pilasters between them.
    fn openings(&mut self, m: &Materials, wide: f64, rng: &mut Rng) {
        let columns = (wide / 3.1) as i32;
        let spacing = wide / f64::from(columns);
        for column in 0..columns {
            let x = spacing * (f64::from(column) + 0.5);
            for (z, high) in [(0.9, 1.9), (4.2, 1.8), (7.0, 1.5)] {
                let trim = m.stone.shaded(1.1 + 0.2 * rng.uniform());
                self.stand(trim, x, 0.0, z - 0.2, [1.7, 0.24, high + 0.4]);
                self.stand(m.pane, x, 0.0, z, [1.25, 0.3, high]);
                self.stand(m.wood, x - 0.21, 0.0, z, [0.05, 0.34, high]);
                self.stand(m.wood, x + 0.21, 0.0, z, [0.05, 0.34, high]);
                self.stand(m.wood, x, 0.0, z + 0.6 * high, [1.25, 0.34, 0.06]);
                self.stand(trim, x, 0.0, z - 0.32, [1.9, 0.5, 0.12]);
            }
            if column % 2 == 0 {
                let pilaster = m.stone.shaded(0.95);
                self.stand(pilaster, x + 0.5 * spacing, 0.0, 0.0, [0.5, 0.5, 8.8]);
            }
        }
    }
}

/// The ground, a gate, a well, crates, shrubs.
fn court(mesh: &mut Mesh, m: &Materials, rng: &mut Rng) {
    lay(mesh, m.gravel, [0.0, -10.0, 0.0], 0.0, [80.0, 60.0]);
    stand(
        mesh,
        m.stone.shaded(1.3),
        [-0.3, 1.9, 0.0],
        0.0,
        [2.6, 0.5, 3.3],
    );
    stand(mesh, m.wood, [-0.3, 1.7, 0.0], 0.0, [1.9, 0.3, 2.8]);
    mesh.cylinder(&turned([-4.5, -4.0, 0.0], 0.0), 1.1, 0.9, m.stone);
    for x in [-5.3, -3.7] {
        mesh.cylinder(&turned([x, -4.0, 0.0], 0.0), 0.09, 2.6, m.wood);
    }
    stand(mesh, m.tiles, [-4.5, -4.0, 2.6], 0.0, [2.2, 1.4, 0.12]);
    for _ in 0..7 {
        let at = [-9.0 + 19.0 * rng.uniform(), -1.5 * rng.uniform(), 0.5];
        let wide = 0.5 + 0.5 * rng.uniform();
        bush(mesh, m.leaves, at, [wide, wide, 0.8], 20);
    }
    for (x, y) in [(4.0, -2.0), (4.8, -2.4), (-8.0, -1.5)] {
        stand(mesh, m.wood, [x, y, 0.0], rng.uniform(), [0.7, 0.7, 0.7]);
    }
}
