//! Histograms of gradient directions, one for a disc and a grid of them for a patch.

/// Bins of a patch histogram: `[row][column][direction]` with 8 x 8 x 8 places, of which a grid
/// of 4 x 4 cells and its border use 6 x 6 x 8. Strides of powers of two need no bounds checks.
pub type PatchHistogram = [f32; 512];

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
        const LANES: usize = 8;
        let n = row.magnitudes.len();
        let (weights, directions) = (&row.weights[..n], &row.directions[..n]);
        let mut start = 0;
        while start < n {
            let m = LANES.min(n - start);
            let mut bins = [0_u32; LANES];
            let mut values = [0.0_f32; LANES];
            for i in 0..m {
                bins[i] = (directions[start + i] * 36.0).round_ties_even() as u32;
                values[i] = row.weight * weights[start + i] * row.magnitudes[start + i];
            }
            for (&bin, &value) in bins[..m].iter().zip(&values) {
                histogram[if bin >= 36 { 0 } else { bin as usize }] += value;
            }
            start += LANES;
        }
    }

    /// Adds each gradient to the eight bins around it, by magnitude times weight and the distance
    /// to the bins' centres in row, column and direction.
    ///
    /// # Panics
    /// If the lengths differ.
    pub fn add_patch_row(grid: &PatchGrid, row: &PatchRow<'_>, histogram: &mut PatchHistogram) {
        let n = row.magnitudes.len();
        let (weights, magnitudes, directions) =
            (&row.weights[..n], row.magnitudes, &row.directions[..n]);
        let (blocks, _) = magnitudes.as_chunks::<8>();
        for b in 0..blocks.len() {
            patch_block::<8>(grid, row, 8 * b, weights, magnitudes, directions, histogram);
        }
        for start in 8 * blocks.len()..n {
            patch_block::<1>(grid, row, start, weights, magnitudes, directions, histogram);
        }
    }
}

#[inline(always)]
fn patch_block<const L: usize>(
    grid: &PatchGrid,
    row: &PatchRow<'_>,
    start: usize,
    weights: &[f32],
    magnitudes: &[f32],
    directions: &[f32],
    histogram: &mut PatchHistogram,
) {
    /// Centres of the cells are at 0, 1, 2, 3; the middle of the patch lies between 1 and 2.
    const MIDDLE: f32 = 1.5;
    let weights: &[f32; L] = weights[start..].first_chunk().expect("one weight a pixel");
    let magnitudes: &[f32; L] = magnitudes[start..].first_chunk().expect("a whole block");
    let directions: &[f32; L] = directions[start..].first_chunk().expect("one a pixel");
    let mut places = [0_u32; L];
    let mut values = [[0.0_f32; L]; 8];
    for i in 0..L {
        let x = row.x + (start + i) as f32;
        let column = x.mul_add(grid.cos, row.y * grid.sin) + MIDDLE;
        let line = row.y.mul_add(grid.cos, -(x * grid.sin)) + MIDDLE;
        let inside = line > -1.0 && line < 4.0 && column > -1.0 && column < 4.0;
        let value = row.weight * weights[i] * magnitudes[i];
        let (value, column, line) = if inside {
            (value, column, line)
        } else {
            (0.0, 0.0, 0.0)
        };
        let bin = (directions[i] - grid.direction) * 8.0;
        let (column0, line0, bin0) = (column.floor(), line.floor(), bin.floor());
        let (column1, line1, bin1) = (column - column0, line - line0, bin - bin0);
        let cell = (line0 as i32 + 1) * 64 + (column0 as i32 + 1) * 8;
        places[i] = (cell + (bin0 as i32 & 7)) as u32;
        let below = value * line1;
        let above = value - below;
        let below_right = below * column1;
        let below_left = below - below_right;
        let above_right = above * column1;
        let above_left = above - above_right;
        for (pair, cell) in [above_left, above_right, below_left, below_right]
            .into_iter()
            .enumerate()
        {
            values[2 * pair + 1][i] = cell * bin1;
            values[2 * pair][i] = cell - cell * bin1;
        }
    }
    for i in 0..L {
        let place = places[i] as usize;
        let cell = place & !7;
        let (bin, next) = (place & 7, (place + 1) & 7);
        for (pair, neighbour) in [0, 8, 64, 72].into_iter().enumerate() {
            histogram[(cell + neighbour + bin) & 511] += values[2 * pair][i];
            histogram[(cell + neighbour + next) & 511] += values[2 * pair + 1][i];
        }
    }
}
