//! What SURF reads: box filters on an integral image, and patches that are turned to the orientation of a keypoint.

use super::{Pixels, truncated, turns};

/// Samples of Haar wavelets that give an orientation: 113, and 7 zeros.
pub const WAVELETS: usize = 120;
/// Samples along a side of the described patch.
pub const PATCH_SIDE: usize = 21;
/// Length of a row of the patch, in whole vectors.
const PATCH_ROW: usize = 24;
/// Most samples along a side of the window that a patch is the mean of.
pub const WINDOW_SIDE: usize = 176;

/// Adding this to a number of 0 to 2^22 leaves it, rounded, in the lowest bits of the mantissa.
const ROUND: f32 = (1 << 23) as f32;

/// Rows of an integral image, each from the first corner of a box on, for the three second
/// derivatives; entry `k` of each belongs to filter `k` of a row of filters.
#[derive(Clone, Copy, Debug)]
pub struct BoxRows<'a> {
    /// Along x: the upper and the lower ends of four columns.
    pub xx: [[&'a [u32]; 4]; 2],
    /// Along y: the left and the right ends of four rows.
    pub yy: [[&'a [u32]; 4]; 2],
    /// Mixed: four columns in each of four rows.
    pub xy: [[&'a [u32]; 4]; 4],
}

/// What sums over boxes are multiplied by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxWeights {
    /// Left, middle and right.
    pub xx: [f32; 3],
    /// Upper, middle and lower.
    pub yy: [f32; 3],
    /// Left and right of the upper two, then of the lower two.
    pub xy: [f32; 4],
}

/// A window of an image in which samples are taken, with its pixels packed: the pixel, the next
/// one, and the two below them, from the lowest byte on.
#[derive(Clone, Debug)]
pub struct PackedWindow {
    quads: Box<[u32; 1 << 16]>,
    stride: u16,
}

/// The samples of a window that one row or column of the patch is the mean of: for each sample the
/// cell it lies in, and the shares of the sample that count there and in the next cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Shares {
    /// Index of the cell, from the first to the last.
    pub cell: Vec<u8>,
    /// Shares in this cell and in the next.
    pub share: Vec<[f32; 2]>,
}

multiversioned! {
    /// The approximated determinants of the Hessian, `xx yy - (0.9 xy)^2`, of a row of filters.
    ///
    /// # Panics
    /// If a row of sums is shorter than `out`.
    pub fn box_determinants(rows: &BoxRows<'_>, weights: &BoxWeights, out: &mut [f32]) {
        const LANES: usize = 16;
        let n = out.len();
        let mut x = 0;
        while x + LANES <= n {
            determinants::<LANES>(rows, weights, x, &mut out[x..]);
            x += LANES;
        }
        while x < n {
            determinants::<1>(rows, weights, x, &mut out[x..]);
            x += 1;
        }
    }

    /// Fills the window with `size` (width, height) pixels from column and row `first` on; beyond
    /// the border the image continues with its outermost pixels.
    ///
    /// # Panics
    /// If there are more than 2^16 pixels to fill, or none in the image.
    pub fn pack_window(pixels: Pixels<'_>, first: [i32; 2], size: [usize; 2], window: &mut PackedWindow) {
        let [width, height] = size;
        window.stride = width as u16;
        let last = [pixels.width, pixels.data.len() / pixels.width].map(|v| v as i32 - 1);
        let inside = first[0] >= 0 && first[0] + (width as i32) <= last[0];
        let mut copies = [[0_u8; 257]; 2];
        for (y, quads) in window.quads.chunks_exact_mut(width).take(height).enumerate() {
            let rows = [0, 1].map(|below| {
                let y = (first[1] + y as i32 + below).clamp(0, last[1]) as usize;
                &pixels.data[y * pixels.width..][..pixels.width]
            });
            let rows = if inside {
                rows.map(|row| &row[first[0] as usize..][..=width])
            } else {
                for (copy, row) in copies.iter_mut().zip(rows) {
                    for (x, copy) in copy[..=width].iter_mut().enumerate() {
                        *copy = row[(first[0] + x as i32).clamp(0, last[0]) as usize];
                    }
                }
                copies.each_ref().map(|copy| &copy[..=width])
            };
            let [upper, lower] = rows;
            let (upper_next, lower_next) = (&upper[1..], &lower[1..]);
            let (upper, lower) = (&upper[..width], &lower[..width]);
            for x in 0..width {
                let upper = u32::from(upper[x]) | u32::from(upper_next[x]) << 8;
                let lower = u32::from(lower[x]) | u32::from(lower_next[x]) << 8;
                quads[x] = upper | lower << 16;
            }
        }
    }

    /// The direction in turns, in `[0, 1]` from the x axis towards the y axis, of the longest sum
    /// of the vectors (x, y) whose directions, rounded to degrees, lie less than 30 degrees from a
    /// multiple of 5; the first of equals counts.
    pub fn longest_sum_of_degrees(x: &[f32; WAVELETS], y: &[f32; WAVELETS]) -> f32 {
        // Windows begin and end on multiples of 5 degrees, which they do not hold: one bin for
        // each multiple and one for the four degrees up to the next, 30 again behind the last.
        const BINS: usize = 144;
        const HALF: usize = 11;
        let mut bins = [0_u32; WAVELETS];
        for i in 0..WAVELETS {
            let degree = (turns(y[i], x[i]) * 360.0 + ROUND).to_bits() - ROUND.to_bits();
            bins[i] = 2 * (degree / 5) + u32::from(!degree.is_multiple_of(5));
        }
        let mut sums = [[0.0_f32; 2]; BINS + 2 * HALF];
        for (i, &bin) in bins.iter().enumerate() {
            let bin = (bin as usize % BINS + HALF) % BINS;
            sums[bin][0] += x[i];
            sums[bin][1] += y[i];
        }
        sums.copy_within(..2 * HALF, BINS);
        let mut longest = [0.0, 0.0];
        let mut squared_length = 0.0;
        for window in sums.windows(2 * HALF + 1).step_by(2) {
            let [x, y] = window.iter().fold([0.0, 0.0], |[x, y], v| [x + v[0], y + v[1]]);
            if x * x + y * y > squared_length {
                (longest, squared_length) = ([x, y], x * x + y * y);
            }
        }
        turns(longest[1], longest[0])
    }

    /// Means over the cells of a turned square window, as whole grey levels, in rows of 24 of which
    /// the first 21 count. Sample (i, j) of `side` x `side` lies at `start + j axis + i (-axis.y,
    /// axis.x)` between pixels of the window; each is rounded, as are the means.
    ///
    /// # Panics
    /// If the shares are not of `side` samples.
    pub fn turned_patch(
        window: &PackedWindow,
        start: [f32; 2],
        axis: [f32; 2],
        shares: &Shares,
    ) -> [[f32; PATCH_ROW]; PATCH_SIDE] {
        let side = shares.cell.len();
        assert!(shares.share.len() == side && side <= WINDOW_SIDE, "shares of {side} samples");
        // In whole vectors; what lies beyond the side is not used.
        let blocks = side.next_multiple_of(8);
        // Sums of samples for the row of cells and the next.
        let mut sums = [[0.0_f32; WINDOW_SIDE]; 2];
        let mut patch = [[0.0; PATCH_ROW]; PATCH_SIDE];
        let mut places = [0_u16; WINDOW_SIDE];
        let mut fractions = [[0.0_f32; WINDOW_SIDE]; 2];
        let mut quads = [0_u32; WINDOW_SIDE];
        let mut cell = 0;
        for (i, (&this_cell, &[here, next])) in shares.cell.iter().zip(&shares.share).enumerate() {
            if this_cell != cell {
                patch[usize::from(cell)] = mean_columns(&sums[0], shares);
                cell = this_cell;
                sums = [sums[1], [0.0; WINDOW_SIDE]];
            }
            let (x, y) = (start[0] - i as f32 * axis[1], start[1] + i as f32 * axis[0]);
            let [u, v] = &mut fractions;
            for j in 0..blocks {
                let (x, y) = (x + j as i32 as f32 * axis[0], y + j as i32 as f32 * axis[1]);
                let (column, row) = (truncated(x), truncated(y));
                u[j] = x - column as f32;
                v[j] = y - row as f32;
                places[j] = (row as u16).wrapping_mul(window.stride).wrapping_add(column as u16);
            }
            for (quad, &place) in quads[..side].iter_mut().zip(&places) {
                *quad = window.quads[usize::from(place)];
            }
            let [above, below] = &mut sums;
            for j in 0..blocks {
                let a = (quads[j] & 255) as i32 as f32;
                let b = (quads[j] >> 8 & 255) as i32 as f32;
                let c = (quads[j] >> 16 & 255) as i32 as f32;
                let d = (quads[j] >> 24) as i32 as f32;
                let upper = u[j].mul_add(b - a, a);
                let lower = u[j].mul_add(d - c, c);
                u[j] = (v[j].mul_add(lower - upper, upper) + ROUND) - ROUND;
                above[j] = here.mul_add(u[j], above[j]);
            }
            // Most samples lie in one row of cells.
            if next != 0.0 {
                for j in 0..blocks {
                    below[j] = next.mul_add(u[j], below[j]);
                }
            }
        }
        patch[usize::from(cell)] = mean_columns(&sums[0], shares);
        patch
    }

    /// Sums of weighted gradients over 4 x 4 cells of 5 x 5 places of a patch: for each cell the
    /// sums of the derivatives along x and y and of their absolute values; `[0]` of those where the
    /// other derivative is negative, `[1]` of the rest.
    pub fn sum_patch_gradients(
        patch: &[[f32; PATCH_ROW]; PATCH_SIDE],
        weights: &[f32; PATCH_ROW],
    ) -> [[[f32; 4]; 2]; 16] {
        let mut sums = [[[[0.0_f32; PATCH_ROW]; 4]; 2]; 4];
        for (i, rows) in patch.windows(2).enumerate() {
            let (upper, lower) = (&rows[0], &rows[1]);
            let [negative, rest] = &mut sums[i / 5];
            for j in 0..PATCH_ROW - 1 {
                let weight = weights[i] * weights[j];
                let dx = (upper[j + 1] - upper[j] + lower[j + 1] - lower[j]) * weight;
                let dy = (lower[j] - upper[j] + lower[j + 1] - upper[j + 1]) * weight;
                let (dx_negative, dx_rest) = if dy < 0.0 { (dx, 0.0) } else { (0.0, dx) };
                let (dy_negative, dy_rest) = if dx < 0.0 { (dy, 0.0) } else { (0.0, dy) };
                negative[0][j] += dx_negative;
                negative[1][j] += dy_negative;
                negative[2][j] += dx_negative.abs();
                negative[3][j] += dy_negative.abs();
                rest[0][j] += dx_rest;
                rest[1][j] += dy_rest;
                rest[2][j] += dx_rest.abs();
                rest[3][j] += dy_rest.abs();
            }
        }
        std::array::from_fn(|cell| {
            sums[cell / 4].map(|sums| sums.map(|row| row[5 * (cell % 4)..][..5].iter().sum()))
        })
    }
}

impl PackedWindow {
    /// A window without pixels.
    pub fn new() -> Self {
        let quads = vec![0; 1 << 16].into_boxed_slice();
        Self {
            quads: quads.try_into().expect("as long as a 16-bit index reaches"),
            stride: 0,
        }
    }
}

impl Default for PackedWindow {
    fn default() -> Self {
        Self::new()
    }
}

#[inline(always)]
fn determinants<const L: usize>(
    rows: &BoxRows<'_>,
    weights: &BoxWeights,
    x: usize,
    out: &mut [f32],
) {
    let [xx, yy] = [
        three_boxes::<L>(&rows.xx, &weights.xx, x),
        three_boxes::<L>(&rows.yy, &weights.yy, x),
    ];
    let mut xy = [0.0; L];
    for (rows, weights) in rows
        .xy
        .as_chunks::<2>()
        .0
        .iter()
        .zip(weights.xy.as_chunks::<2>().0)
    {
        for (columns, weight) in [[0, 1], [2, 3]].into_iter().zip(weights) {
            let [a, b] = columns.map(|c| lanes::<L>(rows[0][c], x));
            let [c, d] = columns.map(|c| lanes::<L>(rows[1][c], x));
            for i in 0..L {
                let sum = (d[i].wrapping_sub(c[i])).wrapping_sub(b[i].wrapping_sub(a[i]));
                xy[i] += sum as i32 as f32 * weight;
            }
        }
    }
    for (i, out) in out[..L].iter_mut().enumerate() {
        *out = xx[i] * yy[i] - 0.81 * xy[i] * xy[i];
    }
}

/// The weighted sums over three boxes side by side, from the two ends of the four lines between.
#[inline(always)]
fn three_boxes<const L: usize>(ends: &[[&[u32]; 4]; 2], weights: &[f32; 3], x: usize) -> [f32; L] {
    let mut total = [0.0; L];
    let mut before = [0; L];
    for line in 0..4 {
        let (first, second) = (lanes::<L>(ends[0][line], x), lanes::<L>(ends[1][line], x));
        for i in 0..L {
            let here = second[i].wrapping_sub(first[i]);
            if line > 0 {
                total[i] += here.wrapping_sub(before[i]) as i32 as f32 * weights[line - 1];
            }
            before[i] = here;
        }
    }
    total
}

/// Means over the columns of cells, rounded.
///
/// The sums of a cell and of the next stay in registers until its last sample: in memory, each would wait for the one
/// before it.
#[inline(always)]
fn mean_columns(sums: &[f32; WINDOW_SIDE], shares: &Shares) -> [f32; PATCH_ROW] {
    let mut means = [0.0; PATCH_ROW];
    let mut samples = shares.cell.iter().zip(&shares.share).zip(sums).peekable();
    let mut next_mean = 0.0;
    for (cell, mean) in means[..PATCH_SIDE].iter_mut().enumerate() {
        *mean = std::mem::take(&mut next_mean);
        let is_here = |((of, _), _): &((&u8, _), _)| usize::from(**of) == cell;
        while let Some(((_, [here, next]), sum)) = samples.next_if(is_here) {
            *mean += here * sum;
            next_mean += next * sum;
        }
    }
    // Half up, as OpenCV rounds means of two by two.
    means.map(|mean| (mean + 0.5) as i32 as f32)
}

#[inline(always)]
fn lanes<const L: usize>(row: &[u32], x: usize) -> &[u32; L] {
    row[x..].first_chunk::<L>().expect("rows of one length")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    #[test]
    fn packed_pixels_continue_beyond_the_border() {
        let data: Vec<u8> = (0..20 * 10).map(|i| i as u8).collect();
        let pixels = Pixels {
            data: &data,
            width: 20,
        };
        let at = |x: i32, y: i32| u32::from(data[(y.clamp(0, 9) * 20 + x.clamp(0, 19)) as usize]);
        let mut window = PackedWindow::new();
        for first in [[2, 3], [-4, -3], [15, 7], [100, -100]] {
            pack_window(pixels, first, [7, 5], &mut window);
            for y in 0..5 {
                for x in 0..7 {
                    let (column, row) = (first[0] + x, first[1] + y);
                    let expected = at(column, row)
                        | at(column + 1, row) << 8
                        | at(column, row + 1) << 16
                        | at(column + 1, row + 1) << 24;
                    assert_eq!(window.quads[(y * 7 + x) as usize], expected, "{first:?}");
                }
            }
        }
    }

    #[test]
    fn a_patch_is_the_means_of_a_turned_window() {
        // A plane, of which every sample and mean is known.
        let data: Vec<u8> = (0..200 * 200)
            .map(|i| (i % 200 / 2 + i / 200 / 2) as u8)
            .collect();
        let pixels = Pixels {
            data: &data,
            width: 200,
        };
        let mut window = PackedWindow::new();
        pack_window(pixels, [0, 0], [199, 199], &mut window);
        for side in [42, 50] {
            let length = side as f32 / PATCH_SIDE as f32;
            let cell: Vec<u8> = (0..side).map(|i| (i * PATCH_SIDE / side) as u8).collect();
            let share = cell.iter().enumerate().map(|(i, &cell)| {
                let here = ((f32::from(cell) + 1.0) * length - i as f32).min(1.0) / length;
                [here, 1.0 / length - here]
            });
            let shares = Shares {
                share: share.collect(),
                cell,
            };
            let patch = turned_patch(&window, [80.0, 70.0], [0.8, 0.6], &shares);
            for (i, row) in patch.iter().enumerate() {
                for (j, value) in row[..PATCH_SIDE].iter().enumerate() {
                    // The middle of the cell, in samples.
                    let [i, j] = [i, j].map(|v| (v as f32 + 0.5) * length - 0.5);
                    let (x, y) = (80.0 + 0.8 * j - 0.6 * i, 70.0 + 0.6 * j + 0.8 * i);
                    let expected = f32::midpoint(x, y) - 0.5;
                    assert!((value - expected).abs() < 1.3, "{value}, not {expected}");
                }
            }
        }
    }

    #[test]
    fn gradients_are_summed_by_cell_and_sign() {
        // Brighter by 2 to the right and darker by 1 downwards.
        let patch =
            std::array::from_fn(|i| std::array::from_fn(|j| 100.0 + 2.0 * j as f32 - i as f32));
        let cells = sum_patch_gradients(&patch, &[1.0; PATCH_ROW]);
        for [negative, rest] in cells {
            assert_eq!(negative, [100.0, 0.0, 100.0, 0.0]);
            assert_eq!(rest, [0.0, -50.0, 0.0, 50.0]);
        }
    }

    #[test]
    fn the_window_of_degrees_with_the_longest_sum_wins() {
        let mut rng = Seed(13).rng();
        let mut x = [0.0; WAVELETS];
        let mut y = [0.0; WAVELETS];
        assert_eq!(longest_sum_of_degrees(&x, &y), 0.0);
        for _ in 0..20 {
            for i in 0..WAVELETS {
                x[i] = rng.uniform() as f32 - 0.3;
                y[i] = rng.uniform() as f32 - 0.4;
            }
            let mut longest = [0.0, 0.0];
            for middle in (0..360).step_by(5) {
                let mut sum = [0.0, 0.0];
                for i in 0..WAVELETS {
                    let degree = (turns(y[i], x[i]) * 360.0).round_ties_even() as i32;
                    let away = (degree - middle).abs();
                    if !(30..=330).contains(&away) {
                        sum[0] += x[i];
                        sum[1] += y[i];
                    }
                }
                if sum[0] * sum[0] + sum[1] * sum[1]
                    > longest[0] * longest[0] + longest[1] * longest[1]
                {
                    longest = sum;
                }
            }
            let expected = turns(longest[1], longest[0]);
            assert!((longest_sum_of_degrees(&x, &y) - expected).abs() < 1e-4);
        }
    }
}
