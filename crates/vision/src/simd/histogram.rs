//! Histograms of gradient directions, one for a disc and a grid of them for a patch.
#![allow(clippy::needless_bitwise_bool)] // a lazy `&&` is a branch, and lanes have none

/// Bins of a patch histogram, as two histograms whose sum counts: `[half][row][column][direction]`
/// with 2 x 8 x 8 x 8 places, of which a grid of 4 x 4 cells and its border use 6 x 6 x 8 of each.
pub type PatchHistogram = [f32; 1024];

/// How a rotated grid of 4 x 4 cells lies on the pixels.
#[derive(Clone, Copy, Debug)]
pub struct PatchGrid {
    /// Cosine of the grid's rotation (from x towards y), divided by the width of a cell.
    pub cos: f32,
    /// Its sine, divided by the width of a cell.
    pub sin: f32,
    /// What the direction bins are counted from, in turns.
    pub direction: f32,
}

/// Gradients along one row of pixels of a patch.
#[derive(Clone, Copy, Debug)]
pub struct PatchRow<'a> {
    /// Offset of the row from the centre of the patch.
    pub y: f32,
    /// Offset of the first pixel from the centre of the patch.
    pub x: f32,
    /// Weight of the row.
    pub weight: f32,
    /// Weights of the pixels.
    pub weights: &'a [f32],
    /// Magnitudes of the gradients.
    pub magnitudes: &'a [f32],
    /// Their directions in turns.
    pub directions: &'a [f32],
}

multiversioned! {
    /// Adds each gradient to the nearest bin of a circular histogram, by magnitude times weight.
    ///
    /// # Panics
    /// If the lengths differ.
    pub fn add_directions(row: &PatchRow<'_>, histogram: &mut [f32; 36]) {
        let n = row.magnitudes.len();
        let mut x = 0;
        while x + 8 <= n {
            directions_block::<8>(row, x, histogram);
            x += 8;
        }
        while x < n {
            directions_block::<1>(row, x, histogram);
            x += 1;
        }
    }

    /// Adds each gradient to the eight bins around it, by magnitude times weight and the distance
    /// to the bins' centres in row, column and direction.
    ///
    /// # Panics
    /// If the lengths differ.
    pub fn add_patch_row(grid: &PatchGrid, row: &PatchRow<'_>, histogram: &mut PatchHistogram) {
        let n = row.magnitudes.len();
        let mut x = 0;
        while x + 8 <= n {
            patch_block::<8>(grid, row, x, histogram);
            x += 8;
        }
        while x < n {
            patch_block::<1>(grid, row, x, histogram);
            x += 1;
        }
    }
}

#[inline(always)]
fn directions_block<const L: usize>(row: &PatchRow<'_>, start: usize, histogram: &mut [f32; 36]) {
    let (weights, magnitudes) = (
        lanes::<L>(row.weights, start),
        lanes::<L>(row.magnitudes, start),
    );
    let directions = lanes::<L>(row.directions, start);
    let mut bins = [0_u32; L];
    let mut values = [0.0_f32; L];
    for i in 0..L {
        bins[i] = whole(directions[i] * 36.0);
        values[i] = row.weight * weights[i] * magnitudes[i];
    }
    for i in 0..L {
        let bin = bins[i] as usize;
        histogram[if bin < 36 { bin } else { 0 }] += values[i];
    }
}

#[inline(always)]
fn patch_block<const L: usize>(
    grid: &PatchGrid,
    row: &PatchRow<'_>,
    start: usize,
    histogram: &mut PatchHistogram,
) {
    /// Centres of the cells are at 0, 1, 2, 3; the middle of the patch lies between 1 and 2.
    const MIDDLE: f32 = 1.5;
    let (weights, magnitudes) = (
        lanes::<L>(row.weights, start),
        lanes::<L>(row.magnitudes, start),
    );
    let directions = lanes::<L>(row.directions, start);
    let mut cells = [0_u32; L];
    let mut bins = [0_u32; L];
    let mut nexts = [0.0_f32; L];
    let mut corners = [[0.0_f32; L]; 4];
    for i in 0..L {
        let x = row.x + (start + i) as f32;
        let column = x.mul_add(grid.cos, row.y * grid.sin) + MIDDLE;
        let line = row.y.mul_add(grid.cos, -(x * grid.sin)) + MIDDLE;
        let inside = (line > -1.0) & (line < 4.0) & (column > -1.0) & (column < 4.0);
        let value = row.weight * weights[i] * magnitudes[i];
        let value = if inside { value } else { 0.0 };
        let column = if inside { column } else { 0.0 };
        let line = if inside { line } else { 0.0 };
        let bin = (directions[i] - grid.direction) * 8.0;
        let (column0, line0, bin0) = (column.floor(), line.floor(), bin.floor());
        let (column1, line1, bin1) = (column - column0, line - line0, bin - bin0);
        cells[i] = whole(line0.mul_add(64.0, column0.mul_add(8.0, 72.0)));
        bins[i] = whole(bin0) & 7;
        let below = value * line1;
        let above = value - below;
        let below_right = below * column1;
        let below_left = below - below_right;
        let above_right = above * column1;
        let above_left = above - above_right;
        corners[0][i] = above_left;
        corners[1][i] = above_right;
        corners[2][i] = below_left;
        corners[3][i] = below_right;
        nexts[i] = bin1;
    }
    for i in 0..L {
        let (bin, next) = ((bins[i] & 7) as usize, ((bins[i] + 1) & 7) as usize);
        let mut shares = [0.0_f32; 8];
        for (b, share) in shares.iter_mut().enumerate() {
            *share = nexts[i].mul_add(UNITS[7 - next + b], (1.0 - nexts[i]) * UNITS[7 - bin + b]);
        }
        // Neighbouring pixels mostly fall into the same cells; two histograms by turns, and none
        // waits for the sum before.
        let around = &mut histogram[(i & 1) * 512 + cells[i] as usize..][..80];
        for (corner, offset) in corners.iter().zip([0, 8, 64, 72]) {
            for (sum, share) in around[offset..offset + 8].iter_mut().zip(&shares) {
                *sum = corner[i].mul_add(*share, *sum);
            }
        }
    }
}

/// Eight values from place `7 - i` on are 0 but for a 1 at place `i`.
const UNITS: [f32; 15] = [
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
];

/// The integer nearest to `x` (even if there are two) modulo 2^22, for `|x|` below 2^21. The sum
/// leaves no place for a fraction, and unlike a cast it needs no care for other values.
#[inline(always)]
fn whole(x: f32) -> u32 {
    const NO_FRACTION: f32 = 1.5 * (1 << 23) as f32;
    (x + NO_FRACTION).to_bits() & 0x003f_ffff
}

#[inline(always)]
fn lanes<const L: usize>(row: &[f32], x: usize) -> &[f32; L] {
    row[x..].first_chunk::<L>().expect("rows of one length")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers() {
        for x in [-8_i32, -1, 0, 3, 71, 367] {
            assert_eq!(whole(x as f32), x as u32 & 0x003f_ffff);
        }
        assert_eq!((whole(2.5), whole(3.5), whole(35.6)), (2, 4, 36));
    }

    fn row<'a>(
        x: f32,
        magnitudes: &'a [f32],
        directions: &'a [f32],
        ones: &'a [f32],
    ) -> PatchRow<'a> {
        PatchRow {
            y: 0.0,
            x,
            weight: 1.0,
            weights: ones,
            magnitudes,
            directions,
        }
    }

    #[test]
    fn directions_go_to_the_nearest_bin() {
        let mut histogram = [0.0; 36];
        let directions = [0.0, 0.013, 0.014, 0.5, 0.985, 0.987, 1.0, 0.25, 0.75];
        add_directions(&row(0.0, &[1.0; 9], &directions, &[1.0; 9]), &mut histogram);
        let filled: Vec<_> = (0..36)
            .filter(|&i| histogram[i] > 0.0)
            .map(|i| (i, histogram[i]))
            .collect();
        assert_eq!(
            filled,
            [
                (0, 4.0),
                (1, 1.0),
                (9, 1.0),
                (18, 1.0),
                (27, 1.0),
                (35, 1.0)
            ]
        );
    }

    #[test]
    fn a_gradient_is_shared_by_eight_bins_and_none_is_lost() {
        // Cells 2 pixels wide, not turned: pixel 0 lies between the four middle cells.
        let grid = PatchGrid {
            cos: 0.5,
            sin: 0.0,
            direction: 0.0,
        };
        let mut histogram: PatchHistogram = [0.0; 1024];
        add_patch_row(
            &grid,
            &row(0.0, &[8.0], &[15.5 / 16.0], &[1.0]),
            &mut histogram,
        );
        for cell in [
            2 * 64 + 2 * 8,
            2 * 64 + 3 * 8,
            3 * 64 + 2 * 8,
            3 * 64 + 3 * 8,
        ] {
            // 7.75 bins: three quarters nearer to the seam.
            assert_eq!((histogram[cell + 7], histogram[cell]), (0.5, 1.5));
        }
        assert_eq!(histogram.iter().sum::<f32>(), 8.0);
    }

    #[test]
    fn pixels_beyond_the_grid_add_nothing_and_blocks_equal_single_pixels() {
        let grid = PatchGrid {
            cos: 0.15,
            sin: 0.2,
            direction: 0.3,
        };
        let n = 45;
        let magnitudes: Vec<f32> = (0..n).map(|i| i as f32 + 1.0).collect();
        let directions: Vec<f32> = (0..n).map(|i| i as f32 / n as f32).collect();
        let ones = vec![1.0; n];
        let mut together: PatchHistogram = [0.0; 1024];
        add_patch_row(
            &grid,
            &row(-22.0, &magnitudes, &directions, &ones),
            &mut together,
        );
        let mut single: PatchHistogram = [0.0; 1024];
        for i in 0..n {
            let x = i as f32 - 22.0;
            add_patch_row(
                &grid,
                &row(x, &magnitudes[i..=i], &directions[i..=i], &[1.0]),
                &mut single,
            );
        }
        for i in 0..512 {
            let sums = [together, single].map(|h| h[i] + h[512 + i]);
            assert!((sums[0] - sums[1]).abs() < 1e-4);
        }
        // |0.15 x| < 2.5 and |0.2 x| < 2.5.
        let inside: f32 = (0..n)
            .filter(|&i| (i as f32 - 22.0).abs() < 12.5)
            .map(|i| magnitudes[i])
            .sum();
        assert!((together.iter().sum::<f32>() - inside).abs() < 0.01);
    }
}
