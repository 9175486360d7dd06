//! Samples on a turned grid, for the descriptors on nonlinear scale spaces, and the direction that
//! dominates a set of gradients.

/// Adding this to a number of 0 to 2^22 leaves it, rounded, in the lowest bits of the mantissa.
const ROUND: f32 = (1 << 23) as f32;

/// Number of gradients that give an orientation: 109, and 3 zeros.
pub const AROUND: usize = 112;
/// Places of the window of 60 degrees that slides around the circle.
const PLACES: usize = 42;
/// [`PLACES`] in whole vectors.
const WINDOWS: usize = 48;
/// How many of the slices between two places the window holds.
const WINDOW: usize = 7;
/// Distance of the places in turns where they do not quite fill the circle: 0.15 radians.
const STEP: f32 = 0.15 * 0.5 / core::f32::consts::PI;

/// Samples along a side of the grid.
const SIDE: usize = 21;
/// Length of a row of samples, in whole vectors.
const LANES: usize = 24;

/// An image and its derivatives along x and y.
#[derive(Clone, Copy, Debug)]
pub struct Planes<'a> {
    /// The pixels, the derivatives along x, those along y; row after row.
    pub planes: [&'a [f32]; 3],
    /// Pixels in a row.
    pub width: usize,
}

/// Sums of samples over the cells of a grid: `sums[plane][cell]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellSums {
    /// 4 x 4 cells of 5 x 5 samples, from (-10, -10) on, in columns of the grid.
    pub fives: [[f32; 16]; 3],
    /// 3 x 3 cells of 7 x 7 samples, from (-10, -10) on, in columns of the grid.
    pub sevens: [[f32; 9]; 3],
}

multiversioned! {
    /// Sums over cells of a grid of 21 x 21 samples at whole pixels, the nearest ones; beyond the
    /// border the image continues with its outermost pixels.
    ///
    /// Sample (k, l) of `-10..=10` lies at `at + k axis + l (-axis.y, axis.x)`; cells are ordered
    /// by k, then l.
    ///
    /// # Panics
    /// If there is no pixel, or a plane is not a whole image of more than one pixel's rows.
    pub fn sum_cells(image: Planes<'_>, at: [f32; 2], axis: [f32; 2]) -> CellSums {
        let length = image.planes[0].len();
        let planes = image.planes.map(|plane| &plane[..length]);
        let last = [image.width - 1, length / image.width - 1].map(|v| v as f32);
        let mut fives = [[[0.0_f32; LANES]; 4]; 3];
        let mut sevens = [[[0.0_f32; LANES]; 3]; 3];
        let along: [f32; LANES] = std::array::from_fn(|l| l as f32 - 10.0);
        let mut places = [0_u32; LANES];
        let mut row = [[0.0_f32; LANES]; 3];
        for k in 0..SIDE {
            let (x, y) = (at[0] + (k as f32 - 10.0) * axis[0], at[1] + (k as f32 - 10.0) * axis[1]);
            for l in 0..LANES {
                let x = (x - along[l] * axis[1]).max(0.0).min(last[0]) + ROUND;
                let y = (y + along[l] * axis[0]).max(0.0).min(last[1]) + ROUND;
                let (x, y) = (x.to_bits() - ROUND.to_bits(), y.to_bits() - ROUND.to_bits());
                places[l] = y * image.width as u32 + x;
            }
            for (l, &place) in places[..SIDE].iter().enumerate() {
                let place = place as usize;
                row[0][l] = planes[0][place];
                row[1][l] = planes[1][place];
                row[2][l] = planes[2][place];
            }
            for plane in 0..3 {
                for l in 0..LANES {
                    sevens[plane][k / 7][l] += row[plane][l];
                }
                if k < 20 {
                    for l in 0..LANES {
                        fives[plane][k / 5][l] += row[plane][l];
                    }
                }
            }
        }
        CellSums {
            fives: fives.map(|rows| std::array::from_fn(|i| sum(&rows[i / 4][5 * (i % 4)..][..5]))),
            sevens: sevens.map(|rows| std::array::from_fn(|i| sum(&rows[i / 3][7 * (i % 3)..][..7]))),
        }
    }

    /// The direction in turns, in `[0, 1]` from the x axis towards the y axis, of the longest sum
    /// of the vectors (x, y) whose directions lie in one of 42 windows of 60 degrees; the first of
    /// equals counts. Each window holds 7 of 42 equal slices of the circle.
    pub fn longest_sum_of_slices(x: &[f32; AROUND], y: &[f32; AROUND]) -> f32 {
        let mut slices = [0_u32; AROUND];
        for i in 0..AROUND {
            slices[i] = super::truncated(super::turns(y[i], x[i]) * PLACES as f32) as u32;
        }
        // The first slices again behind the last, so that a window is one piece.
        let mut sums = [[0.0_f32; 2]; PLACES + WINDOW];
        for (i, &slice) in slices.iter().enumerate() {
            let slice = if slice < PLACES as u32 { slice as usize } else { 0 };
            sums[slice][0] += x[i];
            sums[slice][1] += y[i];
        }
        sums.copy_within(..WINDOW, PLACES);
        let mut longest = [0.0, 0.0];
        let mut squared_length = 0.0;
        for window in sums[..PLACES + WINDOW - 1].windows(WINDOW) {
            let [x, y] = window.iter().fold([0.0, 0.0], |[x, y], v| [x + v[0], y + v[1]]);
            if x * x + y * y > squared_length {
                (longest, squared_length) = ([x, y], x * x + y * y);
            }
        }
        super::turns(longest[1], longest[0])
    }

    /// As [`longest_sum_of_slices`], but the windows begin at multiples of 0.15 radians, and
    /// what lies on the edge of one is outside.
    pub fn longest_sum_of_windows(x: &[f32; AROUND], y: &[f32; AROUND]) -> f32 {
        // One lane for each window. Those across the seam are all but what lies between their
        // ends: signs are turned round.
        let mut middles = [0.0_f32; WINDOWS];
        let mut signs = [0.0_f32; WINDOWS];
        let mut limits = [0.0_f32; WINDOWS];
        for place in 0..PLACES {
            let start = place as f32 * STEP;
            let end = start + 1.0 / 6.0;
            let (other, sign) = if end > 1.0 { (end - 1.0, -1.0) } else { (end, 1.0) };
            middles[place] = 0.5 * (start + other);
            limits[place] = 0.5 * (other - start);
            signs[place] = sign;
        }
        let mut sums_x = [0.0_f32; WINDOWS];
        let mut sums_y = [0.0_f32; WINDOWS];
        for (&x, &y) in x.iter().zip(y) {
            let direction = super::turns(y, x);
            for place in 0..WINDOWS {
                let distance = (direction - middles[place]).abs() * signs[place];
                let weight: f32 = if distance < limits[place] { 1.0 } else { 0.0 };
                sums_x[place] = weight.mul_add(x, sums_x[place]);
                sums_y[place] = weight.mul_add(y, sums_y[place]);
            }
        }
        let mut longest = [0.0, 0.0];
        let mut squared_length = 0.0;
        for (&x, &y) in sums_x.iter().zip(&sums_y).take(PLACES) {
            if x * x + y * y > squared_length {
                (longest, squared_length) = ([x, y], x * x + y * y);
            }
        }
        super::turns(longest[1], longest[0])
    }

    /// Gradients over 4 x 4 overlapping cells of 9 x 9 samples, 5 apart, on a grid of 24 x 24:
    /// for each cell the weighted sums of the derivative across and along `direction` (a unit
    /// vector), and of their absolute values.
    ///
    /// Sample (k, l) of `-12..12` lies at `at + step (k direction + l (-direction.y, direction.x))`
    /// between pixels; beyond the border the image continues with its outermost pixels. Its weight
    /// in a cell is the product of `weights` for its place along k and along l. Cells are ordered
    /// by k, then l.
    ///
    /// # Panics
    /// If a plane is not a whole image of at least 2 x 2 pixels.
    pub fn sum_gradients(
        planes: [&[f32]; 2],
        width: usize,
        at: [f32; 2],
        direction: [f32; 2],
        step: f32,
        weights: &[f32; 9],
    ) -> [[f32; 4]; 16] {
        let [dx, dy] = planes;
        let (width, height) = (width as u32, (dx.len() / width) as u32);
        let axis = direction.map(|v| v * step);
        let mut cells = [[[0.0_f32; LANES]; 4]; 4];
        let along: [f32; LANES] = std::array::from_fn(|l| l as f32 - 12.0);
        let mut places = [0_u32; LANES];
        let mut fractions = [[0.0_f32; LANES]; 2];
        // Derivatives at the four pixels around each sample.
        let mut corners = [[[0.0_f32; LANES]; 4]; 2];
        let mut values = [[0.0_f32; LANES]; 4];
        for k in 0..LANES {
            let (x, y) = (at[0] + along[k] * axis[0], at[1] + along[k] * axis[1]);
            for l in 0..LANES {
                let (column, u) = split(x - along[l] * axis[1], width);
                let (row, v) = split(y + along[l] * axis[0], height);
                places[l] = row * width + column;
                fractions[0][l] = u;
                fractions[1][l] = v;
            }
            for (l, &place) in places.iter().enumerate() {
                let (upper, lower) = (place as usize, (place + width) as usize);
                for (corners, plane) in corners.iter_mut().zip([dx, dy]) {
                    take_corners(plane, [upper, lower], corners, l);
                }
            }
            for l in 0..LANES {
                let fractions = (fractions[0][l], fractions[1][l]);
                let dx = bilinear(&corners[0], l, fractions);
                let dy = bilinear(&corners[1], l, fractions);
                let across = dy * direction[0] - dx * direction[1];
                let along = dx * direction[0] + dy * direction[1];
                values[0][l] = across;
                values[1][l] = along;
                values[2][l] = across.abs();
                values[3][l] = along.abs();
            }
            for (row, cells) in cells.iter_mut().enumerate() {
                let Some(&weight) = k.checked_sub(5 * row).and_then(|i| weights.get(i)) else {
                    continue;
                };
                for (cell, values) in cells.iter_mut().zip(&values) {
                    for l in 0..LANES {
                        cell[l] = weight.mul_add(values[l], cell[l]);
                    }
                }
            }
        }
        let mut sums = [[0.0; 4]; 16];
        for (i, sums) in sums.iter_mut().enumerate() {
            for (sum, row) in sums.iter_mut().zip(&cells[i / 4]) {
                for (value, weight) in row[5 * (i % 4)..].iter().zip(weights) {
                    *sum += value * weight;
                }
            }
        }
        sums
    }
}

/// The four pixels around a place, for [`bilinear`]: two from `upper` on and two from `lower` on.
#[inline(always)]
pub(super) fn take_corners<const L: usize>(
    plane: &[f32],
    [upper, lower]: [usize; 2],
    corners: &mut [[f32; L]; 4],
    l: usize,
) {
    let (upper, lower) = (&plane[upper..][..2], &plane[lower..][..2]);
    corners[0][l] = upper[0];
    corners[1][l] = upper[1];
    corners[2][l] = lower[0];
    corners[3][l] = lower[1];
}

/// Between the four pixels around a place: those above, from left to right, and those below.
#[inline(always)]
pub(super) fn bilinear<const L: usize>(
    corners: &[[f32; L]; 4],
    l: usize,
    (u, v): (f32, f32),
) -> f32 {
    let (a, b, c, d) = (corners[0][l], corners[1][l], corners[2][l], corners[3][l]);
    let (upper, lower) = (u.mul_add(b - a, a), u.mul_add(d - c, c));
    v.mul_add(lower - upper, upper)
}

/// The pixel before a position among `count` (of at least 2), and how far the position is from
/// it; positions outside are moved to the border.
#[inline(always)]
pub(super) fn split(position: f32, count: u32) -> (u32, f32) {
    let position = position.max(0.0).min((count - 1) as f32);
    let first = super::truncated(position).min(count as i32 - 2);
    (first as u32, position - first as f32)
}

#[inline(always)]
fn sum(values: &[f32]) -> f32 {
    values.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_ordered_along_the_axis_and_clamped_at_the_border() {
        let (width, height) = (50, 40);
        let pixels = |f: fn(usize, usize) -> f32| -> Vec<f32> {
            (0..width * height)
                .map(|i| f(i % width, i / width))
                .collect()
        };
        let (x, y, one) = (
            pixels(|x, _| x as f32),
            pixels(|_, y| y as f32),
            pixels(|_, _| 1.0),
        );
        let image = Planes {
            planes: [&x, &y, &one],
            width,
        };
        // Along x: k is the column, l the row.
        let sums = sum_cells(image, [25.2, 19.8], [1.0, 0.0]);
        assert_eq!(sums.fives[2], [25.0; 16]);
        assert_eq!(sums.sevens[2], [49.0; 9]);
        for cell in 0..16 {
            assert_eq!(sums.fives[0][cell], 25.0 * (17 + 5 * (cell / 4)) as f32);
            assert_eq!(sums.fives[1][cell], 25.0 * (12 + 5 * (cell % 4)) as f32);
        }
        for cell in 0..9 {
            assert_eq!(sums.sevens[0][cell], 49.0 * (18 + 7 * (cell / 3)) as f32);
        }
        // Along y: k is the row, l the column backwards.
        let sums = sum_cells(image, [25.0, 20.0], [0.0, 1.0]);
        assert_eq!(sums.sevens[1][0], 49.0 * 13.0);
        assert_eq!(sums.sevens[0][0], 49.0 * 32.0);
        // Far outside all samples are the corner.
        let sums = sum_cells(image, [-500.0, 1e6], [1.0, 2.0]);
        assert_eq!(
            (sums.fives[0], sums.fives[1]),
            ([0.0; 16], [25.0 * 39.0; 16])
        );
    }

    #[test]
    fn the_window_with_the_longest_sum_wins() {
        let mut x = [0.0; AROUND];
        let mut y = [0.0; AROUND];
        assert_eq!(longest_sum_of_slices(&x, &y), 0.0);
        assert_eq!(longest_sum_of_windows(&x, &y), 0.0);
        // Two vectors 40 degrees apart, across the seam, beat a longer single one.
        for (i, (length, degrees)) in [(1.0, 350.0), (1.0, 30.0), (1.5, 180.0)]
            .into_iter()
            .enumerate()
        {
            let (sin, cos) = libm::sincos(f64::to_radians(degrees));
            (x[i], y[i]) = ((length * cos) as f32, (length * sin) as f32);
        }
        for turns in [
            longest_sum_of_slices(&x, &y),
            longest_sum_of_windows(&x, &y),
        ] {
            assert!((turns - 10.0 / 360.0).abs() < 1e-4, "{turns}");
        }
    }

    #[test]
    fn gradients_are_interpolated_turned_and_summed_over_overlapping_cells() {
        let (width, height) = (60, 50);
        let plane = |f: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..width * height)
                .map(|i| f((i % width) as f32, (i / width) as f32))
                .collect()
        };
        // Linear, so that interpolation is exact.
        let (dx, dy) = (plane(|x, _| x), plane(|_, y| -y));
        let mut weights = [0.0; 9];
        weights[4] = 0.5;
        let at = [30.25, 24.5];
        let cells = sum_gradients([&dx, &dy], width, at, [0.6, 0.8], 0.5, &weights);
        for (i, cell) in cells.iter().enumerate() {
            // The sample in the middle of the cell.
            let [k, l] = [i / 4, i % 4].map(|v| 5.0 * v as f32 - 8.0);
            let (x, y) = (
                at[0] + 0.5 * (0.6 * k - 0.8 * l),
                at[1] + 0.5 * (0.8 * k + 0.6 * l),
            );
            let (across, along) = (-y * 0.6 - x * 0.8, x * 0.6 - y * 0.8);
            let expected = [across, along, across.abs(), along.abs()].map(|v| 0.25 * v);
            for (value, expected) in cell.iter().zip(expected) {
                assert!((value - expected).abs() < 1e-4, "{cell:?} {expected:?}");
            }
        }
        let corner = sum_gradients([&dx, &dy], width, [1e6, -1e6], [1.0, 0.0], 1.0, &[1.0; 9]);
        assert_eq!(corner, [[0.0, 81.0 * 59.0, 0.0, 81.0 * 59.0]; 16]);
    }
}
