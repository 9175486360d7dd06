//! The description of a place before it is built: shapes, lights, textures still to be painted.

use matchbench_vision::seed::Seed;

use super::light::Lighting;
use super::mesh::{Mesh, Surface};
use super::paint::Painter;

/// What the file of a place describes.
pub(super) struct Model {
    pub mesh: Mesh,
    pub lighting: Lighting,
    pub(super) textures: Vec<(f32, usize, Painter)>,
}

impl Model {
    /// An empty place; see [`Mesh::new`] for `grain`.
    pub(super) fn new(seed: u64, grain: f64, lighting: Lighting) -> Self {
        Self {
            mesh: Mesh::new(grain, Seed(seed).rng()),
            lighting,
            textures: Vec::new(),
        }
    }

    /// A new matt material whose texture repeats every `side` metres.
    pub(super) fn material(&mut self, side: f32, resolution: usize, painter: Painter) -> Surface {
        self.textures.push((side, resolution, painter));
        Surface::matt(self.textures.len() - 1)
    }
}
