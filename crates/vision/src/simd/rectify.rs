//! Small patches: resampled from an image, and their gradients spread over eight directions.

use super::turns;

/// Directions that a gradient is spread over.
pub const DIRECTIONS: usize = 8;

/// Pixels of an 8-bit image, row after row without gaps.
#[derive(Clone, Copy, Debug)]
pub struct Source<'a> {
    /// The pixels.
    pub data: &'a [u8],
    /// Number of columns, at least 2.
    pub width: usize,
    /// Number of rows, at least 2.
    pub height: usize,
}

multiversioned! {
    /// Interpolates `row.len()` pixels along a line, `step` apart, the first at `start`; the image
    /// is continued beyond its border by its outermost pixels. Bilinear, rounded half up.
    ///
    /// # Panics
    /// If the image is smaller than 2 x 2 or `data` does not hold all its rows.
    pub fn sample_line(source: Source<'_>, start: [f32; 2], step: [f32; 2], row: &mut [u8]) {
        let mut i = 0;
        while i + 8 <= row.len() {
            sample_block::<8>(source, start, step, i, row);
            i += 8;
        }
        while i < row.len() {
            sample_block::<1>(source, start, step, i, row);
            i += 1;
        }
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
        let n = spread.len();
        let mut i = 0;
        while i + 8 <= n {
            spread_block::<8>(above, here, below, i, spread);
            i += 8;
        }
        while i < n {
            spread_block::<1>(above, here, below, i, spread);
            i += 1;
        }
    }
}

#[inline(always)]
fn sample_block<const L: usize>(
    source: Source<'_>,
    start: [f32; 2],
    step: [f32; 2],
    first: usize,
    row: &mut [u8],
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
        let x = n.mul_add(step[0], start[0]).max(0.0).min(right);
        let y = n.mul_add(step[1], start[1]).max(0.0).min(bottom);
        let (column, line) = (x.floor().min(right - 1.0), y.floor().min(bottom - 1.0));
        columns[i] = column as u32;
        lines[i] = line as u32;
        along[i] = x - column;
        across[i] = y - line;
    }
    let mut corners = [[0.0_f32; L]; 4];
    for i in 0..L {
        let at = lines[i] as usize * width + columns[i] as usize;
        let (upper, lower) = (&data[at..at + 2], &data[at + width..at + width + 2]);
        corners[0][i] = f32::from(upper[0]);
        corners[1][i] = f32::from(upper[1]);
        corners[2][i] = f32::from(lower[0]);
        corners[3][i] = f32::from(lower[1]);
    }
    for i in 0..L {
        let upper = along[i].mul_add(corners[1][i] - corners[0][i], corners[0][i]);
        let lower = along[i].mul_add(corners[3][i] - corners[2][i], corners[2][i]);
        row[first + i] = (across[i].mul_add(lower - upper, upper) + 0.5) as u8;
    }
}

#[inline(always)]
fn spread_block<const L: usize>(
    above: &[f32],
    here: &[f32],
    below: &[f32],
    first: usize,
    spread: &mut [[f32; DIRECTIONS]],
) {
    let (above, below) = (&above[first..][..L], &below[first..][..L]);
    let (left, right) = (&here[first..][..L], &here[first + 2..][..L]);
    let (mut magnitudes, mut directions) = ([0.0_f32; L], [0.0_f32; L]);
    for i in 0..L {
        let (dx, dy) = (right[i] - left[i], above[i] - below[i]);
        magnitudes[i] = dx.mul_add(dx, dy * dy).sqrt();
        directions[i] = DIRECTIONS as f32 * turns(dy, dx);
    }
    for i in 0..L {
        let shares = &mut spread[first + i];
        for (b, share) in shares.iter_mut().enumerate() {
            let off = (directions[i] - b as f32).abs();
            let off = off.min(DIRECTIONS as f32 - off);
            *share = magnitudes[i] * (1.0 - off).max(0.0);
        }
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
