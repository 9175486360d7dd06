//! A painted texture that is looked up with a footprint, so that it has no detail finer than the pixels that
//! see it, and high frequencies do not alias into noise.
//!
//! Williams, "Pyramidal Parametrics", SIGGRAPH 1983: a pyramid of halved images, bilinear within
//! a level and linear between two levels.

use matchbench_vision::image::{FloatImage, Size};

use super::noise::floor;

/// Albedo over a square of `side` metres that repeats in both directions.
pub(super) struct Texture {
    side: f32,
    /// From full resolution down to one texel; every width is a power of two.
    levels: Vec<FloatImage>,
}

impl Texture {
    /// Evaluates `paint(u, v)`, with u and v in [0, 1), at `resolution` x `resolution` texels.
    ///
    /// # Panics
    /// If `resolution` is not a power of two.
    pub(super) fn paint(side: f32, resolution: usize, paint: impl Fn(f32, f32) -> f32) -> Self {
        assert!(resolution.is_power_of_two(), "levels must halve exactly");
        let texel = 1.0 / resolution as f32;
        let base = FloatImage::from_fn(Size::new(resolution, resolution), |x, y| {
            let albedo = paint((x as f32 + 0.5) * texel, (y as f32 + 0.5) * texel);
            albedo.clamp(0.01, 0.95) // nothing real is blacker or whiter
        });
        let mut levels = vec![base];
        while let Some(finest) = levels.last().filter(|level| level.width() > 1) {
            levels.push(halve(finest));
        }
        Self { side, levels }
    }

    /// Mean albedo seen through a footprint of `width` metres around (u, v), in metres.
    pub(super) fn look_up(&self, u: f32, v: f32, width: f32) -> f32 {
        let (u, v) = (u / self.side, v / self.side);
        let (u, v) = (u - floor(u) as f32, v - floor(v) as f32);
        let texels = width / self.side * self.levels[0].width() as f32;
        let level = libm::log2f(texels.max(1.0)).min((self.levels.len() - 1) as f32);
        let finer = level as usize;
        let coarser = (finer + 1).min(self.levels.len() - 1);
        let fine = bilinear(&self.levels[finer], u, v);
        let coarse = bilinear(&self.levels[coarser], u, v);
        fine + (level - finer as f32) * (coarse - fine)
    }
}

fn halve(fine: &FloatImage) -> FloatImage {
    FloatImage::from_fn(Size::new(fine.width() / 2, fine.height() / 2), |x, y| {
        let upper = fine.at(2 * x, 2 * y) + fine.at(2 * x + 1, 2 * y);
        let lower = fine.at(2 * x, 2 * y + 1) + fine.at(2 * x + 1, 2 * y + 1);
        0.25 * (upper + lower)
    })
}

fn bilinear(image: &FloatImage, u: f32, v: f32) -> f32 {
    let mask = image.width() as i32 - 1;
    let x = u * image.width() as f32 - 0.5;
    let y = v * image.height() as f32 - 0.5;
    let (left, top) = (floor(x), floor(y));
    let (fx, fy) = (x - left as f32, y - top as f32);
    let column = |dx: i32| ((left + dx) & mask) as usize;
    let row = |dy: i32| image.row(((top + dy) & mask) as usize);
    let across = |row: &[f32]| row[column(0)] + fx * (row[column(1)] - row[column(0)]);
    let (upper, lower) = (across(row(0)), across(row(1)));
    upper + fy * (lower - upper)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wide_footprint_sees_the_mean_and_a_narrow_one_the_texel() {
        let checks = Texture::paint(2.0, 64, |u, _| if u < 0.5 { 0.2 } else { 0.6 });
        assert!((checks.look_up(0.5, 0.3, 0.0) - 0.2).abs() < 1e-6);
        assert!((checks.look_up(1.5, 0.3, 0.0) - 0.6).abs() < 1e-6);
        assert!((checks.look_up(0.7, 0.3, 100.0) - 0.4).abs() < 1e-6);
    }

    #[test]
    fn repeats_after_its_side() {
        let ramp = Texture::paint(1.5, 32, |u, v| 0.1 + 0.5 * u + 0.2 * v);
        let here = ramp.look_up(0.4, 0.6, 0.01);
        assert!((ramp.look_up(0.4 + 1.5, 0.6 - 3.0, 0.01) - here).abs() < 1e-4);
    }
}
