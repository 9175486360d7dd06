//! What ORB reads around a keypoint: corner strength (Harris), the centre of intensity, and the comparisons of pairs
//! of intensities.

mod moments;
mod pairs;

use std::f32::consts::TAU;

use super::gradient::turns;
pub use moments::intensity_moments;
pub use pairs::{PAIR_REACH, PairTable, compare_pairs};

/// Pixels of an image, row after row, as the kernels below read them.
#[derive(Clone, Copy, Debug)]
pub struct Pixels<'a> {
    /// All pixels.
    pub data: &'a [u8],
    /// Pixels in a row.
    pub width: usize,
}

impl Pixels<'_> {
    /// `L` pixels, the first of them `left` columns before and `down` rows below `centre`.
    #[inline(always)]
    fn run<const L: usize>(&self, centre: [u32; 2], left: usize, down: isize) -> &[u8; L] {
        let y = (centre[1] as usize)
            .checked_add_signed(down)
            .expect("inside the image");
        let start = y * self.width + centre[0] as usize - left;
        self.data[start..]
            .first_chunk::<L>()
            .expect("inside the image")
    }

    /// The square of `2 * reach + 1` rows and columns about `centre`, from its first pixel to its last, with what lies
    /// between its rows.
    ///
    /// # Panics
    /// If a pixel of the square is not in `data`.
    #[inline(always)]
    fn square(&self, centre: [u32; 2], reach: usize) -> &[u8] {
        let [x, y] = centre.map(|v| v as usize);
        assert!(reach <= x && reach <= y, "inside the image");
        let first = (y - reach) * self.width + x - reach;
        &self.data[first..][..=2 * reach * (self.width + 1)]
    }
}

multiversioned! {
    #![avx512]

    /// Harris corner strength `(det - 0.04 trace^2)` of the second-moment matrix of the Sobel
    /// gradients, summed over 7 x 7 pixels and scaled to intensities in `[0, 1]`, at each centre.
    /// Centres must be at least 20 pixels from the border; nearer to it, pixels from the other end of the row
    /// are read, or it panics.
    pub fn harris_strengths(pixels: Pixels<'_>, centres: &[[u32; 2]]) -> Vec<f32> {
        let mut strengths = Vec::with_capacity(centres.len());
        for &centre in centres {
            strengths.push(harris_strength(pixels, centre));
        }
        strengths
    }

    /// Directions of vectors in radians in `[0, 2 pi)` from x towards y; 0 for the zero vector.
    pub fn directions(vectors: &[[i32; 2]]) -> Vec<f32> {
        let mut angles = vec![0.0; vectors.len()];
        for (angle, &[x, y]) in angles.iter_mut().zip(vectors) {
            *angle = turns(y as f32, x as f32).fract() * TAU;
        }
        angles
    }

}

#[inline(always)]
fn harris_strength(pixels: Pixels<'_>, centre: [u32; 2]) -> f32 {
    const K: f32 = 0.04;
    const SCALE: f32 = 1.0 / (4 * 7 * 255) as f32;
    // The derivative along x and the smoothing across it, of nine rows; the eighth lane is unused.
    let mut along = [[0_i16; 8]; 9];
    let mut across = [[0_i16; 8]; 9];
    for y in 0..9 {
        let down = y as isize - 4;
        let left = pixels.run::<8>(centre, 4, down);
        let middle = pixels.run::<8>(centre, 3, down);
        let right = pixels.run::<8>(centre, 2, down);
        for i in 0..8 {
            let (left, right) = (i16::from(left[i]), i16::from(right[i]));
            along[y][i] = right - left;
            across[y][i] = left + 2 * i16::from(middle[i]) + right;
        }
    }
    let mut xx = [0_i32; 8];
    let mut yy = [0_i32; 8];
    let mut xy = [0_i32; 8];
    for y in 1..8 {
        for i in 0..8 {
            let dx = i32::from(along[y - 1][i] + 2 * along[y][i] + along[y + 1][i]);
            let dy = i32::from(across[y + 1][i] - across[y - 1][i]);
            xx[i] += dx * dx;
            yy[i] += dy * dy;
            xy[i] += dx * dy;
        }
    }
    let (mut a, mut b, mut c) = (0, 0, 0);
    for i in 0..7 {
        a += xx[i];
        b += yy[i];
        c += xy[i];
    }
    let (a, b, c) = (a as f32, b as f32, c as f32);
    (a * b - c * c - K * (a + b) * (a + b)) * (SCALE * SCALE * SCALE * SCALE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;
    use crate::simd::InstructionSet;

    /// Pixels in a row of the images in tests of kernels; they have 50 rows.
    pub(super) const WIDTH: usize = 61;

    pub(super) fn noise() -> Vec<u8> {
        let mut rng = Seed(8).rng();
        (0..WIDTH * 50).map(|_| rng.below(256) as u8).collect()
    }

    pub(super) const CENTRES: [[u32; 2]; 3] = [[20, 20], [25, 24], [40, 29]];

    /// The pixel `x` columns and `y` rows from a centre.
    pub(super) fn pixel(data: &[u8], centre: [u32; 2], x: i32, y: i32) -> i32 {
        let (x, y) = (centre[0] as i32 + x, centre[1] as i32 + y);
        i32::from(data[y as usize * WIDTH + x as usize])
    }

    #[test]
    fn directions_are_the_same_bits_in_all_sets() {
        let mut rng = Seed(33).rng();
        let mut vectors = vec![[0, 0], [7, 0], [0, 7], [-7, 0], [0, -7], [7, -1]];
        let mut part = || rng.below(1 << 20) as i32 - (1 << 19);
        vectors.extend((0..99).map(|_| [part(), part()]));
        let mut all = Vec::new();
        InstructionSet::for_each(|_| all.push(directions(&vectors)));
        assert!(all.iter().all(|angles| *angles == all[0]));
        for (&[x, y], angle) in vectors.iter().zip(&all[0]) {
            assert!((0.0..TAU).contains(angle), "{x}, {y}: {angle}");
            let exact = libm::atan2f(y as f32, x as f32);
            let error = (angle - exact).rem_euclid(TAU);
            assert!(
                error.min(TAU - error) < 2e-4,
                "{x}, {y}: {angle}, not {exact}"
            );
        }
    }

    #[test]
    fn corners_are_stronger_than_edges() {
        // A quadrant about (20, 20) and an edge through (40, 29), as bright as it gets.
        let mut data = vec![0; WIDTH * 50];
        for (i, value) in data.iter_mut().enumerate() {
            let (x, y) = (i % WIDTH, i / WIDTH);
            *value = if ((20..30).contains(&x) && y >= 20) || x >= 40 {
                255
            } else {
                0
            };
        }
        let pixels = Pixels {
            data: &data,
            width: WIDTH,
        };
        let strengths = harris_strengths(pixels, &CENTRES);
        assert!(
            strengths[0] > 0.001 && strengths[2] < -0.001,
            "{strengths:?}"
        );
        // The edge: 14 columns of gradient 4 * 255 out of 49, scaled by 1 / (4 * 7 * 255).
        let trace: f32 = 14.0 / 49.0;
        assert!(
            (strengths[2] + 0.04 * trace * trace).abs() < 1e-6,
            "{strengths:?}"
        );
    }
}
