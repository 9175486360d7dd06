//! First moments of the intensities about a keypoint.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;

use super::Pixels;
#[cfg(target_arch = "x86_64")]
use crate::simd::InstructionSet;

/// Radius of the patch whose centre of intensity gives the orientation.
const RADIUS: usize = 15;
/// Half the length of the rows of a circular patch, from the middle row outwards: the circle of
/// radius 15, made symmetric about the diagonals.
const HALF_ROWS: [usize; RADIUS + 1] = [15, 15, 15, 15, 14, 14, 14, 13, 13, 12, 11, 10, 9, 8, 6, 3];

/// Of the rows above and below the middle one, from that on outwards: x, then y, of each pixel that lies in the circle, in
/// the 32 bytes of the row above and in those of the row below. The middle row counts once.
#[cfg(target_arch = "x86_64")]
static OFFSETS: Offsets = Offsets(offsets());

#[cfg(target_arch = "x86_64")]
#[repr(align(64))]
struct Offsets([[[i8; 64]; 2]; RADIUS + 1]);

/// First moments (of x, then of y) of the intensities in the circle of radius 15 about each
/// centre.
/// Centres must be at least 20 pixels from the border; nearer to it, pixels from the other end of the row
/// are read, or it panics.
pub fn intensity_moments(pixels: Pixels<'_>, centres: &[[u32; 2]]) -> Vec<[i32; 2]> {
    #[cfg(target_arch = "x86_64")]
    match InstructionSet::in_use_unless_halved() {
        // SAFETY: what is in use was detected on this processor.
        InstructionSet::Avx512 | InstructionSet::Amx => {
            return unsafe { avx512::intensity_moments(pixels, centres) };
        }
        // SAFETY: as before.
        InstructionSet::Avx2 => return unsafe { avx2::intensity_moments(pixels, centres) },
        InstructionSet::Portable => {}
    }
    intensity_moments_by_columns(pixels, centres)
}

/// The definition of [`intensity_moments`].
fn intensity_moments_by_columns(pixels: Pixels<'_>, centres: &[[u32; 2]]) -> Vec<[i32; 2]> {
    let mut moments = Vec::with_capacity(centres.len());
    for &centre in centres {
        moments.push(intensity_moment(pixels, centre));
    }
    moments
}

/// The first of 32 pixels of the row of `centre`, one more than the circle is wide. As many can be read in each of the
/// `RADIUS` rows above and below.
///
/// # Panics
/// If they are not all inside the image.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn middle_row(pixels: Pixels<'_>, centre: [u32; 2]) -> *const u8 {
    const REACH: usize = RADIUS + 1;
    // Of the whole square, since rows above are read too.
    let square = pixels.square(centre, REACH).as_ptr();
    square.wrapping_add(REACH * pixels.width + 1)
}

#[inline(always)]
fn intensity_moment(pixels: Pixels<'_>, centre: [u32; 2]) -> [i32; 2] {
    static IN_CIRCLE: [[u8; 32]; RADIUS + 1] = circle_masks();
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
        moment[0] += (i as i32 - RADIUS as i32) * i32::from(sums[i]);
        moment[1] += i32::from(weighted[i]);
    }
    moment
}

#[inline(always)]
fn row_in_circle(pixels: Pixels<'_>, centre: [u32; 2], down: isize, mask: &[u8; 32]) -> [i16; 32] {
    let run = pixels.run::<32>(centre, RADIUS, down);
    let mut row = [0; 32];
    for i in 0..32 {
        row[i] = i16::from(run[i] & mask[i]);
    }
    row
}

const fn circle_masks() -> [[u8; 32]; RADIUS + 1] {
    let mut masks = [[0; 32]; RADIUS + 1];
    let mut y = 0;
    while y <= RADIUS {
        let mut x = RADIUS - HALF_ROWS[y];
        while x <= RADIUS + HALF_ROWS[y] {
            masks[y][x] = 255;
            x += 1;
        }
        y += 1;
    }
    masks
}

#[cfg(target_arch = "x86_64")]
const fn offsets() -> [[[i8; 64]; 2]; RADIUS + 1] {
    let mut offsets = [[[0; 64]; 2]; RADIUS + 1];
    let mut y = 0;
    while y <= RADIUS {
        let mut x = RADIUS - HALF_ROWS[y];
        while x <= RADIUS + HALF_ROWS[y] {
            let along = x as i8 - RADIUS as i8;
            [offsets[y][0][x], offsets[y][1][x]] = [along, -(y as i8)];
            if y > 0 {
                [offsets[y][0][x + 32], offsets[y][1][x + 32]] = [along, y as i8];
            }
            x += 1;
        }
        y += 1;
    }
    offsets
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::InstructionSet;
    use crate::simd::orb::tests::{CENTRES, WIDTH, noise, pixel};

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
    fn sums_of_the_brightest_pixels_do_not_overflow() {
        let data = vec![255; WIDTH * 50];
        let pixels = Pixels {
            data: &data,
            width: WIDTH,
        };
        let half = |bright: fn(usize) -> bool| -> Vec<u8> {
            let value = |i: usize| if bright(i) { 255 } else { 0 };
            (0..data.len()).map(value).collect()
        };
        let (right, below) = (half(|i| i % WIDTH > 25), half(|i| i / WIDTH > 24));
        InstructionSet::for_each(|set| {
            assert_eq!(intensity_moments(pixels, &CENTRES), [[0, 0]; 3], "{set:?}");
            let [x, y] = [&right, &below].map(|data| {
                let pixels = Pixels { data, width: WIDTH };
                intensity_moments(pixels, &CENTRES[1..2])[0]
            });
            // 255 times the sum of x over half of the circle.
            let columns = (1..=15).map(|x| x * (2 * HALF_ROWS[x] + 1)).sum::<usize>();
            assert_eq!(
                (x, y),
                ([255 * columns as i32, 0], [0, 255 * columns as i32]),
                "{set:?}"
            );
        });
    }
}
