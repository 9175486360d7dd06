//! Procedural noise that can be tiled, from which all textures are made.
//!
//! Coordinates (u, v) go from 0 to 1 over one tile. Lattices wrap around at `cells`, so a texture can be
//! repeated without a seam.
//!
//! - Gradient noise and its sum over octaves: Perlin, "An Image Synthesizer", SIGGRAPH 1985.
//! - Distances to scattered points: Worley, "A Cellular Texture Basis Function", SIGGRAPH 1996.

/// 32 random bits that belong to the lattice point (x, y).
pub(super) fn scatter(x: i32, y: i32, seed: u32) -> u32 {
    let mut h = (x as u32).wrapping_mul(0x9e37_79b1)
        ^ (y as u32).wrapping_mul(0x85eb_ca77).rotate_left(13)
        ^ seed.wrapping_mul(0xc2b2_ae3d).rotate_left(7);
    h = (h ^ (h >> 16)).wrapping_mul(0x7feb_352d);
    h = (h ^ (h >> 15)).wrapping_mul(0x846c_a68b);
    h ^ (h >> 16)
}

/// A number in [0, 1) that belongs to the lattice point (x, y).
pub(super) fn chance(x: i32, y: i32, seed: u32) -> f32 {
    (scatter(x, y, seed) >> 8) as f32 / (1 << 24) as f32
}

/// 0 below `from`, 1 above `to`, smooth between.
pub(super) fn smoothstep(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Largest integer not above `x`, without the function call that `f32::floor` needs on older machines.
pub(super) fn floor(x: f32) -> i32 {
    let towards_zero = x as i32;
    towards_zero - i32::from(x < towards_zero as f32)
}

/// Gradient noise with `cells` x `cells` lattice squares per tile, about in [-1, 1]. `cells` must be a power of
/// two, because a division per corner would cost as much as the noise.
pub(super) fn gradient(u: f32, v: f32, cells: i32, seed: u32) -> f32 {
    let (x, y) = (u * cells as f32, v * cells as f32);
    let (column, row) = (floor(x), floor(y));
    let (fx, fy) = (x - column as f32, y - row as f32);
    debug_assert!(cells.count_ones() == 1, "{cells} is no power of two");
    let wrap = |i: i32| i & (cells - 1);
    let (left, right) = (wrap(column), wrap(column + 1));
    let (top, bottom) = (wrap(row), wrap(row + 1));
    let slope = |x: i32, y: i32, dx: f32, dy: f32| {
        let bits = scatter(x, y, seed);
        let gx = (bits & 0xffff) as i32 - 0x8000;
        let gy = (bits >> 16) as i32 - 0x8000;
        gx as f32 * dx + gy as f32 * dy
    };
    let fade = |t: f32| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let (wx, wy) = (fade(fx), fade(fy));
    let (near, far) = (slope(left, top, fx, fy), slope(right, top, fx - 1.0, fy));
    let upper = near + wx * (far - near);
    let near = slope(left, bottom, fx, fy - 1.0);
    let far = slope(right, bottom, fx - 1.0, fy - 1.0);
    let lower = near + wx * (far - near);
    (1.6 / 32768.0) * (upper + wy * (lower - upper))
}

/// Sum of `octaves` of gradient noise. Each has twice as many cells as the one before and `gain` times its
/// amplitude. About in [-1, 1].
pub(super) fn octaves(u: f32, v: f32, cells: i32, octaves: u32, gain: f32, seed: u32) -> f32 {
    let (mut sum, mut norm, mut amplitude) = (0.0, 0.0, 1.0);
    for octave in 0..octaves {
        sum += amplitude * gradient(u, v, cells << octave, seed.wrapping_add(octave));
        norm += amplitude * amplitude;
        amplitude *= gain;
    }
    sum / norm.sqrt()
}

/// The scattered point nearest to (u, v): one point lies in each of `cells` x `cells` squares.
pub(super) struct Cell {
    /// Distance to the nearest point, in squares.
    pub near: f32,
    /// Distance to the second nearest point, in squares.
    pub next: f32,
    /// Random bits that belong to the nearest point.
    pub id: u32,
}

/// See [`Cell`].
pub(super) fn worley(u: f32, v: f32, cells: i32, seed: u32) -> Cell {
    let (x, y) = (u * cells as f32, v * cells as f32);
    let (column, row) = (floor(x), floor(y));
    let mut best = Cell {
        near: f32::MAX,
        next: f32::MAX,
        id: 0,
    };
    let around = [-1, 0, 1];
    let columns = around.map(|d| (column + d, (column + d).rem_euclid(cells)));
    let rows = around.map(|d| (row + d, (row + d).rem_euclid(cells)));
    for (cy, wrapped_y) in rows {
        for (cx, wrapped_x) in columns {
            let id = scatter(wrapped_x, wrapped_y, seed);
            let dx = cx as f32 + (id & 0xffff) as f32 / 65536.0 - x;
            let dy = cy as f32 + (id >> 16) as f32 / 65536.0 - y;
            let squared = dx * dx + dy * dy;
            if squared < best.near {
                best.next = best.near;
                best.near = squared;
                best.id = id;
            } else if squared < best.next {
                best.next = squared;
            }
        }
    }
    best.near = best.near.sqrt();
    best.next = best.next.sqrt();
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_without_a_seam() {
        for i in 0..64 {
            let t = i as f32 / 64.0;
            assert_eq!(gradient(0.0, t, 8, 1), gradient(1.0, t, 8, 1));
            assert_eq!(octaves(t, 0.0, 4, 4, 0.5, 2), octaves(t, 1.0, 4, 4, 0.5, 2));
            assert_eq!(worley(0.0, t, 8, 3).id, worley(1.0, t, 8, 3).id);
        }
    }

    #[test]
    fn octaves_are_centred_and_neither_flat_nor_wild() {
        let n = 128;
        let values: Vec<f32> = (0..n * n)
            .map(|i| {
                let (u, v) = ((i % n) as f32 / n as f32, (i / n) as f32 / n as f32);
                octaves(u, v, 8, 5, 0.6, 9)
            })
            .collect();
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f32>() / values.len() as f32;
        assert!(mean.abs() < 0.05, "mean {mean}");
        assert!((0.02..0.5).contains(&variance), "variance {variance}");
        assert!(values.iter().all(|x| x.abs() < 2.5));
    }
}
