//! Small patches: resampled from an image, and their gradients spread over eight directions.

use super::{truncated, turns};

/// Directions that a gradient is spread over.
pub const DIRECTIONS: usize = 8;

/// Pixels of an image, row after row without gaps.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a, P = u8> {
    /// The pixels.
    pub data: &'a [P],
    /// Number of columns, at least 2.
    pub width: usize,
    /// Number of rows, at least 2.
    pub height: usize,
}

/// Pixels that are resampled together.
const SAMPLED: usize = 16;

multiversioned! {
    #![avx512]

    /// Interpolates `row.len()` pixels along a line, `step` apart, the first at `start`; the image
    /// is continued beyond its border by its outermost pixels. Bilinear, rounded half up.
    ///
    /// # Panics
    /// If the image is smaller than 2 x 2 or `data` does not hold all its rows.
    pub fn sample_line(source: Source<'_>, start: [f32; 2], step: [f32; 2], row: &mut [u8]) {
        sample(source, start, step, row);
    }

    /// The same of an image of real values, which are not rounded.
    ///
    /// # Panics
    /// As [`sample_line`].
    pub fn sample_line_of_floats(source: Source<'_, f32>, start: [f32; 2], step: [f32; 2], row: &mut [f32]) {
        sample(source, start, step, row);
    }

    /// Magnitudes of the central differences of a row, each shared between the two of eight
    /// directions (0, 45, ... degrees from the x axis upwards) on either side of its own.
    ///
    /// `here` is the row with one more pixel at each end than `above` and `below`.
    ///
    /// # Panics
    /// If the lengths do not fit.
    pub fn spread_gradients(
        above: &[f32],
        here: &[f32],
        below: &[f32],
        spread: &mut [[f32; DIRECTIONS]],
    ) {
        spread_row(above, here, below, spread, |_| {});
    }

    /// As [`spread_gradients`]; the squares of the shares are added to `squares`, pixel after pixel.
    ///
    /// *Benefit*: each sum waits for the one before, which costs nothing beside what is to be done for
    /// a pixel here, and more than all of it alone.
    pub fn spread_and_square(
        above: &[f32],
        here: &[f32],
        below: &[f32],
        spread: &mut [[f32; DIRECTIONS]],
        squares: &mut [f32; DIRECTIONS],
    ) {
        let mut sums = *squares;
        spread_row(above, here, below, spread, |shares| {
            for i in 0..DIRECTIONS {
                sums[i] = shares[i].mul_add(shares[i], sums[i]);
            }
        });
        *squares = sums;
    }
}

/// A pixel that can be interpolated.
trait Pixel: Copy {
    /// Two neighbours in a row: one load, widened later in whole vectors.
    type Two: Copy + Default;

    /// The pixel `at` an index and the next.
    fn two(data: &[Self], at: usize) -> Self::Two;

    /// Their values.
    fn values(two: Self::Two) -> [f32; 2];

    /// The pixel of an interpolated value, which is not negative where pixels are not.
    fn of(value: f32) -> Self;
}

impl Pixel for u8 {
    type Two = u16;

    #[inline(always)]
    fn two(data: &[u8], at: usize) -> u16 {
        u16::from_le_bytes([data[at], data[at + 1]])
    }

    #[inline(always)]
    fn values(two: u16) -> [f32; 2] {
        [two & 255, two >> 8].map(|value| i32::from(value) as f32)
    }

    #[inline(always)]
    fn of(value: f32) -> u8 {
        truncated(value + 0.5) as u8
    }
}

impl Pixel for f32 {
    type Two = [f32; 2];

    #[inline(always)]
    fn two(data: &[f32], at: usize) -> [f32; 2] {
        [data[at], data[at + 1]]
    }

    #[inline(always)]
    fn values(two: [f32; 2]) -> [f32; 2] {
        two
    }

    #[inline(always)]
    fn of(value: f32) -> f32 {
        value
    }
}

#[inline(always)]
fn sample<P: Pixel>(source: Source<'_, P>, start: [f32; 2], step: [f32; 2], row: &mut [P]) {
    let mut i = 0;
    while i + SAMPLED <= row.len() {
        sample_block::<SAMPLED, P>(source, start, step, i, row);
        i += SAMPLED;
    }
    while i < row.len() {
        sample_block::<1, P>(source, start, step, i, row);
        i += 1;
    }
}

#[inline(always)]
fn sample_block<const L: usize, P: Pixel>(
    source: Source<'_, P>,
    start: [f32; 2],
    step: [f32; 2],
    first: usize,
    row: &mut [P],
) {
    let Source {
        data,
        width,
        height,
    } = source;
    let (right, bottom) = ((width - 1) as f32, (height - 1) as f32);
    let (mut columns, mut lines) = ([0_u32; L], [0_u32; L]);
    let (mut along, mut across) = ([0.0_f32; L], [0.0_f32; L]);
    for i in 0..L {
        let n = (first + i) as f32;
        let x = within(n.mul_add(step[0], start[0]), right);
        let y = within(n.mul_add(step[1], start[1]), bottom);
        let (column, line) = (
            smaller(x.floor(), right - 1.0),
            smaller(y.floor(), bottom - 1.0),
        );
        columns[i] = truncated(column) as u32;
        lines[i] = truncated(line) as u32;
        along[i] = x - column;
        across[i] = y - line;
    }
    let (mut upper, mut lower) = ([P::Two::default(); L], [P::Two::default(); L]);
    for i in 0..L {
        let at = lines[i] as usize * width + columns[i] as usize;
        upper[i] = P::two(data, at);
        lower[i] = P::two(data, at + width);
    }
    let row = row[first..].first_chunk_mut::<L>().expect("a whole block");
    for i in 0..L {
        let ([a, b], [c, d]) = (P::values(upper[i]), P::values(lower[i]));
        let (upper, lower) = (along[i].mul_add(b - a, a), along[i].mul_add(d - c, c));
        row[i] = P::of(across[i].mul_add(lower - upper, upper));
    }
}

/// `value` moved into `0..=last`; 0 if it is no number.
#[inline(always)]
pub(super) fn within(value: f32, last: f32) -> f32 {
    smaller(if value > 0.0 { value } else { 0.0 }, last)
}

/// The smaller of two numbers: one instruction, where `f32::min` asks whether they are numbers.
#[inline(always)]
pub(super) fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The shares of a row, those of each pixel given to `each` in turn.
#[inline(always)]
fn spread_row(
    above: &[f32],
    here: &[f32],
    below: &[f32],
    spread: &mut [[f32; DIRECTIONS]],
    mut each: impl FnMut(&[f32; DIRECTIONS]),
) {
    const L: usize = 8;
    let n = spread.len();
    let (blocks, rest) = spread.as_chunks_mut::<L>();
    for (spread, first) in blocks.iter_mut().zip((0..).step_by(L)) {
        let sides = [block::<L>(here, first), block::<L>(here, first + 2)];
        spread_block(
            block::<L>(above, first),
            sides,
            block::<L>(below, first),
            spread,
            &mut each,
        );
    }
    if !rest.is_empty() {
        // What completes the block has no gradient.
        let start = n - rest.len();
        let complete = |row: &[f32]| {
            let mut block = [0.0; L];
            block[..n - start].copy_from_slice(&row[..n - start]);
            block
        };
        let (above, below) = (complete(&above[start..]), complete(&below[start..]));
        let (left, right) = (complete(&here[start..]), complete(&here[start + 2..]));
        spread_block(&above, [&left, &right], &below, rest, &mut each);
    }
}

#[inline(always)]
fn block<const L: usize>(row: &[f32], first: usize) -> &[f32; L] {
    row[first..].first_chunk().expect("rows of fitting lengths")
}

#[inline(always)]
fn spread_block<const L: usize>(
    above: &[f32; L],
    [left, right]: [&[f32; L]; 2],
    below: &[f32; L],
    spread: &mut [[f32; DIRECTIONS]],
    each: &mut impl FnMut(&[f32; DIRECTIONS]),
) {
    let (mut magnitudes, mut directions) = ([0.0_f32; L], [0.0_f32; L]);
    for i in 0..L {
        let (dx, dy) = (right[i] - left[i], above[i] - below[i]);
        magnitudes[i] = dx.mul_add(dx, dy * dy).sqrt();
        directions[i] = DIRECTIONS as f32 * turns(dy, dx);
    }
    for (i, shares) in spread.iter_mut().enumerate() {
        for (b, share) in shares.iter_mut().enumerate() {
            let off = (directions[i] - b as f32).abs();
            let near = 1.0 - smaller(off, DIRECTIONS as f32 - off);
            *share = magnitudes[i] * if near > 0.0 { near } else { 0.0 };
        }
        each(shares);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_interpolated_and_continued_beyond_the_border() {
        let data: Vec<u8> = (0..12).map(|i| 10 * i).collect();
        let source = Source {
            data: &data,
            width: 4,
            height: 3,
        };
        let mut row = [0; 11];
        sample_line(source, [-1.0, 1.0], [0.5, 0.0], &mut row);
        assert_eq!(row, [40, 40, 40, 45, 50, 55, 60, 65, 70, 70, 70]);
        sample_line(source, [1.0, -1.0], [0.0, 0.5], &mut row);
        assert_eq!(row, [10, 10, 10, 30, 50, 70, 90, 90, 90, 90, 90]);
    }

    #[test]
    fn real_values_are_interpolated_as_bytes_are() {
        let data: Vec<u8> = (0..12).map(|i| 17 * i % 251).collect();
        let floats: Vec<f32> = data.iter().map(|&v| f32::from(v)).collect();
        let (start, step) = ([-0.7, 1.9], [0.31, -0.17]);
        let (mut bytes, mut row) = ([0; 19], [0.0; 19]);
        let (width, height) = (4, 3);
        sample_line(
            Source {
                data: &data,
                width,
                height,
            },
            start,
            step,
            &mut bytes,
        );
        sample_line_of_floats(
            Source {
                data: &floats,
                width,
                height,
            },
            start,
            step,
            &mut row,
        );
        assert_eq!(row.map(|v| (v + 0.5) as u8), bytes);
        assert!(row.iter().any(|v| v.fract() != 0.0));
    }

    #[test]
    fn a_place_that_is_no_number_is_the_first_pixel() {
        let source = Source {
            data: &[7, 1, 2, 3],
            width: 2,
            height: 2,
        };
        let mut row = [0; 9];
        sample_line(source, [f32::NAN, f32::NAN], [1.0, 0.0], &mut row);
        assert_eq!(row, [7; 9]);
    }

    #[test]
    fn a_gradient_is_shared_between_two_directions() {
        // Brighter to the right by 3 and upwards by 4 over one pixel each: 53.13 degrees.
        let row = |y: f32| -> Vec<f32> { (0..13).map(|x| 3.0 * x as f32 - 4.0 * y).collect() };
        let mut spread = [[0.0; DIRECTIONS]; 11];
        spread_gradients(&row(0.0)[1..12], &row(1.0), &row(2.0)[1..12], &mut spread);
        for shares in spread {
            assert!((shares.iter().sum::<f32>() - 10.0).abs() < 1e-4);
            assert!(
                (shares[2] - 10.0 * (53.13 - 45.0) / 45.0).abs() < 0.01,
                "{shares:?}"
            );
            assert!(shares[1] > 8.0 && shares[3..].iter().all(|&share| share == 0.0));
        }
    }
}
