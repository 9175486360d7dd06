//! What ORB reads around a keypoint: corner strength (Harris), the centre of intensity, and the comparisons of pairs
//! of intensities.

#[cfg(target_arch = "x86_64")]
mod avx512;

use std::f32::consts::TAU;

#[cfg(target_arch = "x86_64")]
use super::InstructionSet;
use super::gradient::turns;

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
}

/// Radius of the patch whose centre of intensity gives the orientation.
const MOMENT_RADIUS: usize = 15;
/// Half the length of the rows of a circular patch, from the middle row outwards: the circle of
/// radius 15, made symmetric about the diagonals.
const HALF_ROWS: [usize; MOMENT_RADIUS + 1] =
    [15, 15, 15, 15, 14, 14, 14, 13, 13, 12, 11, 10, 9, 8, 6, 3];

/// Places of the compared pairs relative to an upright keypoint, bit after bit.
#[derive(Clone, Debug, PartialEq)]
pub struct PairTable {
    /// x, then y, of the first place of each pair.
    pub first: [[f32; 256]; 2],
    /// x, then y, of the second place of each pair.
    pub second: [[f32; 256]; 2],
}

/// Pixels that turned places reach to each side: they lie in a square of `2 * 19 + 1` rows and columns.
pub const PAIR_REACH: usize = 19;
/// Size of the rows of a copy of that square.
const COPY_ROW: usize = 64;

/// First moments (of x, then of y) of the intensities in the circle of radius 15 about each
/// centre.
/// Centres must be at least 20 pixels from the border; nearer to it, pixels from the other end of the row
/// are read, or it panics.
pub fn intensity_moments(pixels: Pixels<'_>, centres: &[[u32; 2]]) -> Vec<[i32; 2]> {
    #[cfg(target_arch = "x86_64")]
    if InstructionSet::in_use() >= InstructionSet::Avx512 {
        // SAFETY: what is in use was detected on this processor.
        return unsafe { avx512::intensity_moments(pixels, centres) };
    }
    intensity_moments_by_columns(pixels, centres)
}

/// 256 bits for each centre: whether the first place of each pair is darker than the second,
/// all places turned by the angle whose cosine and sine are given, to the nearest pixel.
/// Centres must be at least 20 pixels from the border; nearer to it, pixels from the other end of the row
/// are read, or it panics. Places must not be farther from it than 18.5 pixels.
///
/// # Panics
/// If there are not as many turns as centres.
pub fn compare_pairs(
    pixels: Pixels<'_>,
    centres: &[[u32; 2]],
    turns: &[[f32; 2]],
    pairs: &PairTable,
) -> Vec<u64> {
    assert_eq!(centres.len(), turns.len(), "one turn for each centre");
    #[cfg(target_arch = "x86_64")]
    if InstructionSet::in_use() >= InstructionSet::Avx512 {
        // SAFETY: what is in use was detected on this processor.
        return unsafe { avx512::compare_pairs(pixels, centres, turns, pairs) };
    }
    compare_pair_by_pair(pixels, centres, turns, pairs)
}

/// Adding this leaves the rounded integer in the lowest bits of the mantissa.
const ROUND: f32 = 1.5 * (1 << 23) as f32;

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

    /// The definition of [`intensity_moments`].
    fn intensity_moments_by_columns(pixels: Pixels<'_>, centres: &[[u32; 2]]) -> Vec<[i32; 2]> {
        let mut moments = Vec::with_capacity(centres.len());
        for &centre in centres {
            moments.push(intensity_moment(pixels, centre));
        }
        moments
    }

    /// The definition of [`compare_pairs`].
    fn compare_pair_by_pair(
        pixels: Pixels<'_>,
        centres: &[[u32; 2]],
        turns: &[[f32; 2]],
        pairs: &PairTable,
    ) -> Vec<u64> {
        let mut bits = Vec::with_capacity(4 * centres.len());
        // As long as a 16-bit index may reach, so that no access needs a check; only the first
        // rows are used.
        let copy = vec![0; 1 << 16].into_boxed_slice();
        let mut copy: Box<[u8; 1 << 16]> = copy.try_into().expect("as long as that");
        let mut first = [0; 256];
        let mut second = [0; 256];
        for (&centre, &turn) in centres.iter().zip(turns) {
            for (y, row) in copy.chunks_exact_mut(COPY_ROW).take(2 * PAIR_REACH + 1).enumerate() {
                let down = y as isize - PAIR_REACH as isize;
                row[..40].copy_from_slice(pixels.run::<40>(centre, PAIR_REACH, down));
            }
            turn_places(&pairs.first, turn, &mut first);
            turn_places(&pairs.second, turn, &mut second);
            for (first, second) in first.as_chunks::<64>().0.iter().zip(second.as_chunks::<64>().0) {
                let mut word = 0_u64;
                for i in (0..64).rev() {
                    let a = copy[usize::from(first[i])];
                    let b = copy[usize::from(second[i])];
                    word = word << 1 | u64::from(a < b);
                }
                bits.push(word);
            }
        }
        bits
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

#[inline(always)]
fn intensity_moment(pixels: Pixels<'_>, centre: [u32; 2]) -> [i32; 2] {
    static IN_CIRCLE: [[u8; 32]; MOMENT_RADIUS + 1] = circle_masks();
    // Per column: the sum, and the sum weighted by y, at most 31 * 255 and 120 * 255.
    let mut sums: [i16; 32] = row_in_circle(pixels, centre, 0, &IN_CIRCLE[0]);
    let mut weighted = [0_i16; 32];
    for (y, mask) in IN_CIRCLE.iter().enumerate().skip(1) {
        let above = row_in_circle(pixels, centre, -(y as isize), mask);
        let below = row_in_circle(pixels, centre, y as isize, mask);
        for i in 0..32 {
            sums[i] += above[i] + below[i];
            weighted[i] += y as i16 * (below[i] - above[i]);
        }
    }
    let mut moment = [0; 2];
    for i in 0..32 {
        moment[0] += (i as i32 - MOMENT_RADIUS as i32) * i32::from(sums[i]);
        moment[1] += i32::from(weighted[i]);
    }
    moment
}

#[inline(always)]
fn row_in_circle(pixels: Pixels<'_>, centre: [u32; 2], down: isize, mask: &[u8; 32]) -> [i16; 32] {
    let run = pixels.run::<32>(centre, MOMENT_RADIUS, down);
    let mut row = [0; 32];
    for i in 0..32 {
        row[i] = i16::from(run[i] & mask[i]);
    }
    row
}

const fn circle_masks() -> [[u8; 32]; MOMENT_RADIUS + 1] {
    let mut masks = [[0; 32]; MOMENT_RADIUS + 1];
    let mut y = 0;
    while y <= MOMENT_RADIUS {
        let mut x = MOMENT_RADIUS - HALF_ROWS[y];
        while x <= MOMENT_RADIUS + HALF_ROWS[y] {
            masks[y][x] = 255;
            x += 1;
        }
        y += 1;
    }
    masks
}

/// Places in the copied square, after a turn by the angle of cosine and sine `turn`.
#[inline(always)]
fn turn_places(places: &[[f32; 256]; 2], turn: [f32; 2], out: &mut [u16; 256]) {
    let [cos, sin] = turn;
    for (i, out) in out.iter_mut().enumerate() {
        let (x, y) = (places[0][i], places[1][i]);
        let turned_x = (x * cos - y * sin + ROUND).to_bits() as u16;
        let turned_y = (x * sin + y * cos + ROUND).to_bits() as u16;
        let (row, column) = (
            turned_y.wrapping_add(PAIR_REACH as u16),
            turned_x.wrapping_add(PAIR_REACH as u16),
        );
        *out = row.wrapping_mul(COPY_ROW as u16).wrapping_add(column);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;
    use crate::simd::InstructionSet;

    const WIDTH: usize = 61;

    fn noise() -> Vec<u8> {
        let mut rng = Seed(8).rng();
        (0..WIDTH * 50).map(|_| rng.below(256) as u8).collect()
    }

    const CENTRES: [[u32; 2]; 3] = [[20, 20], [25, 24], [40, 29]];

    fn pixel(data: &[u8], centre: [u32; 2], x: i32, y: i32) -> i32 {
        let (x, y) = (centre[0] as i32 + x, centre[1] as i32 + y);
        i32::from(data[y as usize * WIDTH + x as usize])
    }

    #[test]
    fn moments_follow_the_definition() {
        let data = noise();
        let pixels = Pixels {
            data: &data,
            width: WIDTH,
        };
        InstructionSet::for_each(|set| {
            let expected = intensity_moments_by_columns(pixels, &CENTRES);
            assert_eq!(intensity_moments(pixels, &CENTRES), expected, "{set:?}");
        });
        for (centre, found) in CENTRES.iter().zip(intensity_moments(pixels, &CENTRES)) {
            let mut expected = [0, 0];
            for y in -15..=15_i32 {
                let half = HALF_ROWS[y.unsigned_abs() as usize] as i32;
                for x in -half..=half {
                    expected[0] += x * pixel(&data, *centre, x, y);
                    expected[1] += y * pixel(&data, *centre, x, y);
                }
            }
            assert_eq!(found, expected);
        }
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

    #[test]
    fn bits_follow_the_definition() {
        let data = noise();
        let pixels = Pixels {
            data: &data,
            width: WIDTH,
        };
        let mut rng = Seed(9).rng();
        let mut places = || std::array::from_fn(|_| rng.below(27) as f32 - 13.0);
        let pairs = PairTable {
            first: [places(), places()],
            second: [places(), places()],
        };
        let turns = [[1.0, 0.0], [0.0, -1.0], [0.8, 0.6]];
        let bits = compare_pairs(pixels, &CENTRES, &turns, &pairs);
        InstructionSet::for_each(|set| {
            assert_eq!(
                compare_pairs(pixels, &CENTRES, &turns, &pairs),
                bits,
                "{set:?}"
            );
        });
        assert_eq!(bits.len(), 4 * CENTRES.len());
        for (k, (&centre, [cos, sin])) in CENTRES.iter().zip(turns).enumerate() {
            let value = |places: &[[f32; 256]; 2], i: usize| {
                let (x, y) = (places[0][i], places[1][i]);
                let round = |v: f32| v.round_ties_even() as i32;
                pixel(
                    &data,
                    centre,
                    round(x * cos - y * sin),
                    round(x * sin + y * cos),
                )
            };
            for i in 0..256 {
                let darker = value(&pairs.first, i) < value(&pairs.second, i);
                assert_eq!(
                    bits[4 * k + i / 64] >> (i % 64) & 1,
                    u64::from(darker),
                    "{k} {i}"
                );
            }
        }
    }
}
