//! What ORB reads around a keypoint: corner strength (Harris), the centre of intensity, and the comparisons of pairs
//! of intensities.

mod harris;
mod moments;
mod pairs;

use std::f32::consts::TAU;

use super::gradient::turns;
pub use harris::harris_strengths;
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

    /// Directions of vectors in radians in `[0, 2 pi)` from x towards y; 0 for the zero vector.
    pub fn directions(vectors: &[[i32; 2]]) -> Vec<f32> {
        let mut angles = vec![0.0; vectors.len()];
        for (angle, &[x, y]) in angles.iter_mut().zip(vectors) {
            *angle = turns(y as f32, x as f32).fract() * TAU;
        }
        angles
    }

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
}
