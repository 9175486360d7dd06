//! Rows of a simulated view: of an image that is turned, and of one that is compressed.

use super::rectify::{Source, smaller, within};
use super::truncated;

/// A turn of an image about its centre.
#[derive(Clone, Copy, Debug)]
pub struct Turn {
    /// The sine of the angle by which the turned image is seen: a step along its rows is (cos, -sin) in the image.
    pub sin: f32,
    /// The cosine of the angle.
    pub cos: f32,
    /// Column and row of the centre of the image.
    pub from: [f32; 2],
    /// Column and row of the centre of the turned image.
    pub to: [f32; 2],
}

/// Pixels of a turned row that are made together.
const TURNED: usize = 16;
/// Columns that are summed together.
const SUMMED: usize = 32;

multiversioned! {
    #![avx512]

    /// Row `y` of the turned image, from its first column on: bilinear between pixels of `source`, which is continued beyond
    /// its border by its outermost pixels.
    ///
    /// # Panics
    /// If the image has less than two columns or no row, or `data` does not hold all its rows.
    pub fn turn_row(source: Source<'_>, turn: &Turn, y: usize, row: &mut [f32]) {
        assert!(source.width > 1 && source.height > 0, "two columns");
        for first in whole_blocks(row.len(), TURNED) {
            turn_block::<TURNED>(source, turn, y, first, row);
        }
        if row.len() < TURNED {
            for x in 0..row.len() {
                turn_block::<1>(source, turn, y, x, row);
            }
        }
    }

    /// Weighted sums of rows, rounded half up: from a half on, the product of each row with its weight is added, the first
    /// row first.
    ///
    /// # Panics
    /// If a row is shorter than `out`.
    pub fn weigh_rows_to_u8(rows: &[&[f32]], weights: &[f32], out: &mut [u8]) {
        for first in whole_blocks(out.len(), SUMMED) {
            weigh_block::<SUMMED>(rows, weights, first, out);
        }
        if out.len() < SUMMED {
            for x in 0..out.len() {
                weigh_block::<1>(rows, weights, x, out);
            }
        }
    }
}

/// Where blocks of this `size` begin that cover `count` columns; none if there are fewer. The last block again makes some of
/// what the one before it makes.
#[inline(always)]
fn whole_blocks(count: usize, size: usize) -> impl Iterator<Item = usize> {
    let last = count.checked_sub(size);
    last.into_iter()
        .flat_map(move |last| (0..count).step_by(size).map(move |first| first.min(last)))
}

#[inline(always)]
fn turn_block<const L: usize>(
    source: Source<'_>,
    turn: &Turn,
    y: usize,
    first: usize,
    row: &mut [f32],
) {
    let Source {
        data,
        width,
        height,
    } = source;
    let (right, bottom) = ((width - 1) as f32, (height - 1) as f32);
    let Turn { sin, cos, from, to } = *turn;
    let dy = y as f32 - to[1];
    let (mut upper, mut lower) = ([0_u32; L], [0_u32; L]);
    let (mut along, mut across) = ([0.0_f32; L], [0.0_f32; L]);
    for i in 0..L {
        let dx = (first as i32 + i as i32) as f32 - to[0];
        let x = within(cos * dx + sin * dy + from[0], right);
        let y = within(cos * dy - sin * dx + from[1], bottom);
        // The last column is all of the second of two; the last row is both the upper and the lower one, for the
        // difference of what lies along them is not exact.
        let column = truncated(smaller(x, right - 1.0));
        let line = truncated(y);
        along[i] = x - column as f32;
        across[i] = y - line as f32;
        upper[i] = line as u32 * width as u32 + column as u32;
        lower[i] = upper[i] + if y < bottom { width as u32 } else { 0 };
    }
    let (mut above, mut below) = ([0_u16; L], [0_u16; L]);
    for i in 0..L {
        let two = |at: usize| u16::from_le_bytes([data[at], data[at + 1]]);
        above[i] = two(upper[i] as usize);
        below[i] = two(lower[i] as usize);
    }
    let row = row[first..].first_chunk_mut::<L>().expect("a whole block");
    for i in 0..L {
        let between = |two: u16| {
            let [a, b] = [two & 255, two >> 8].map(|value| i32::from(value) as f32);
            a + along[i] * (b - a)
        };
        let (above, below) = (between(above[i]), between(below[i]));
        row[i] = above + across[i] * (below - above);
    }
}

#[inline(always)]
fn weigh_block<const L: usize>(rows: &[&[f32]], weights: &[f32], first: usize, out: &mut [u8]) {
    let mut sums = [0.5_f32; L];
    for (row, &weight) in rows.iter().zip(weights) {
        let row: &[f32; L] = row[first..].first_chunk().expect("rows as long as `out`");
        for i in 0..L {
            sums[i] += weight * row[i];
        }
    }
    let out = out[first..].first_chunk_mut::<L>().expect("a whole block");
    for i in 0..L {
        out[i] = truncated(sums[i]) as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;
    use crate::simd::InstructionSet;

    /// The same pixel by pixel.
    fn turned(source: Source<'_>, turn: &Turn, x: usize, y: usize) -> f32 {
        let Turn { sin, cos, from, to } = *turn;
        let (dx, dy) = (x as f32 - to[0], y as f32 - to[1]);
        let (last_x, last_y) = (source.width - 1, source.height - 1);
        let at_x = (cos * dx + sin * dy + from[0]).clamp(0.0, last_x as f32);
        let at_y = (cos * dy - sin * dx + from[1]).clamp(0.0, last_y as f32);
        let (x0, y0) = (at_x as usize, at_y as usize);
        let pixel = |x: usize, y: usize| {
            f32::from(source.data[y.min(last_y) * source.width + x.min(last_x)])
        };
        let along = |y: usize| {
            let (first, second) = (pixel(x0, y), pixel(x0 + 1, y));
            first + (at_x - x0 as f32) * (second - first)
        };
        let (above, below) = (along(y0), along(y0 + 1));
        above + (at_y - y0 as f32) * (below - above)
    }

    #[test]
    fn rows_turn_to_the_same_bits_in_all_sets() {
        let mut rng = Seed(41).rng();
        for [width, height] in [[57, 40], [2, 1], [2, 9], [30, 1]] {
            let data: Vec<u8> = (0..width * height).map(|_| rng.below(256) as u8).collect();
            let source = Source {
                data: &data,
                width,
                height,
            };
            // The turned image is larger, so that places beyond all sides are asked for.
            for (degrees, columns) in [(0.0_f32, 75), (33.0, 75), (90.0, 48), (137.0, 9)] {
                let (sin, cos) = libm::sincosf(degrees.to_radians());
                let centre =
                    |width: usize, height: usize| [width, height].map(|v| (v as f32 - 1.0) / 2.0);
                let turn = Turn {
                    sin,
                    cos,
                    from: centre(width, height),
                    to: centre(columns, 70),
                };
                for y in 0..70 {
                    let expected: Vec<f32> =
                        (0..columns).map(|x| turned(source, &turn, x, y)).collect();
                    InstructionSet::for_each(|set| {
                        let mut row = vec![f32::NAN; columns];
                        turn_row(source, &turn, y, &mut row);
                        assert_eq!(row, expected, "{set:?}, {width} x {height}, {degrees}, {y}");
                    });
                }
            }
        }
    }

    #[test]
    fn sums_of_rows_are_the_same_bits_in_all_sets() {
        let mut rng = Seed(42).rng();
        let rows: Vec<Vec<f32>> = (0..7)
            .map(|_| (0..77).map(|_| 255.0 * rng.uniform() as f32).collect())
            .collect();
        let weights = [0.02_f32, 0.1, 0.2, 0.36, 0.2, 0.1, 0.02];
        for count in [0, 1, 31, 32, 33, 77] {
            let rows: Vec<&[f32]> = rows.iter().map(|row| &row[..count]).collect();
            let expected: Vec<u8> = (0..count)
                .map(|x| {
                    let products = rows
                        .iter()
                        .zip(weights)
                        .map(|(row, weight)| weight * row[x]);
                    products.fold(0.5, |sum, product| sum + product) as u8
                })
                .collect();
            InstructionSet::for_each(|set| {
                let mut out = vec![0; count];
                weigh_rows_to_u8(&rows, &weights, &mut out);
                assert_eq!(out, expected, "{set:?}, {count}");
            });
        }
    }
}
