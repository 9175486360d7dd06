//! Strengths of corners (Harris).

#[cfg(target_arch = "x86_64")]
mod avx2;

use super::Pixels;
#[cfg(target_arch = "x86_64")]
use crate::simd::InstructionSet;

/// Harris corner strength `(det - 0.04 trace^2)` of the second-moment matrix of the Sobel
/// gradients, summed over 7 x 7 pixels and scaled to intensities in `[0, 1]`, at each centre.
/// Centres must be at least 20 pixels from the border; nearer to it, pixels from the other end of the row
/// are read, or it panics.
pub fn harris_strengths(pixels: Pixels<'_>, centres: &[[u32; 2]]) -> Vec<f32> {
    #[cfg(target_arch = "x86_64")]
    if InstructionSet::in_use() >= InstructionSet::Avx2 {
        // SAFETY: what is in use was detected on this processor.
        return unsafe { avx2::harris_strengths(pixels, centres) };
    }
    (centres.iter())
        .map(|&centre| strength(second_moments(pixels, centre)))
        .collect()
}

/// The definition of the second moments of gradients about a centre: sums of the products of x with x, y with y and x
/// with y.
fn second_moments(pixels: Pixels<'_>, centre: [u32; 2]) -> [i32; 3] {
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
    [xx, yy, xy].map(|sums| sums[..7].iter().sum())
}

/// The strength of a corner with these second moments.
#[inline(always)]
fn strength(moments: [i32; 3]) -> f32 {
    const K: f32 = 0.04;
    const SCALE: f32 = 1.0 / (4 * 7 * 255) as f32;
    let [a, b, c] = moments.map(|sum| sum as f32);
    (a * b - c * c - K * (a + b) * (a + b)) * (SCALE * SCALE * SCALE * SCALE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::InstructionSet;
    use crate::simd::orb::tests::{CENTRES, WIDTH, noise};

    #[test]
    fn strengths_are_the_same_bits_in_all_sets() {
        // Noise, and stripes of the steepest gradients.
        let stripes: Vec<u8> = (0..WIDTH * 50)
            .map(|i| {
                if (i % WIDTH / 2).is_multiple_of(2) {
                    0
                } else {
                    255
                }
            })
            .collect();
        for data in [noise(), stripes] {
            let pixels = Pixels {
                data: &data,
                width: WIDTH,
            };
            for count in 0..=CENTRES.len() {
                let centres = &CENTRES[..count];
                let defined: Vec<f32> = (centres.iter())
                    .map(|&centre| strength(second_moments(pixels, centre)))
                    .collect();
                InstructionSet::for_each(|set| {
                    assert_eq!(harris_strengths(pixels, centres), defined, "{set:?}");
                });
            }
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
