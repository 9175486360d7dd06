//! Samples of an image and its derivatives on a turned grid, for the descriptors on nonlinear
//! scale spaces, and the direction that dominates a set of gradients.

/// Adding this to a number of 0 to 2^22 leaves it, rounded, in the lowest bits of the mantissa.
const ROUND: f32 = (1 << 23) as f32;

/// Number of gradients that give an orientation: 109, and 3 zeros.
pub const AROUND: usize = 112;
/// Slices of a full circle.
const SLICES: usize = 42;
/// Slices of the window that slides around the circle: 60 degrees.
const WINDOW: usize = 7;

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
        for k in 0..SIDE {
            let (x, y) = (at[0] + (k as f32 - 10.0) * axis[0], at[1] + (k as f32 - 10.0) * axis[1]);
            let mut places = [0_u32; LANES];
            for l in 0..LANES {
                let x = (x - along[l] * axis[1]).max(0.0).min(last[0]) + ROUND;
                let y = (y + along[l] * axis[0]).max(0.0).min(last[1]) + ROUND;
                let [x, y] = [x, y].map(|v| v.to_bits() - ROUND.to_bits());
                places[l] = y * image.width as u32 + x;
            }
            let mut row = [[0.0_f32; LANES]; 3];
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
    /// of the vectors (x, y) whose directions lie in a window of 60 degrees. The window starts at
    /// each of 42 directions; the first of equals counts.
    pub fn dominant_direction(x: &[f32; AROUND], y: &[f32; AROUND]) -> f32 {
        let mut slices = [0_u32; AROUND];
        for i in 0..AROUND {
            slices[i] = (super::gradient::turns(y[i], x[i]) * SLICES as f32) as i32 as u32;
        }
        // The first slices again behind the last, so that a window is one piece.
        let mut sums = [[0.0_f32; 2]; SLICES + WINDOW];
        for (i, &slice) in slices.iter().enumerate() {
            let slice = if slice < SLICES as u32 { slice as usize } else { 0 };
            sums[slice][0] += x[i];
            sums[slice][1] += y[i];
        }
        sums.copy_within(..WINDOW, SLICES);
        let mut longest = [0.0, 0.0];
        let mut squared_length = 0.0;
        for window in sums[..SLICES + WINDOW - 1].windows(WINDOW) {
            let [x, y] = window.iter().fold([0.0, 0.0], |[x, y], v| [x + v[0], y + v[1]]);
            if x * x + y * y > squared_length {
                (longest, squared_length) = ([x, y], x * x + y * y);
            }
        }
        super::gradient::turns(longest[1], longest[0])
    }
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
        assert_eq!(dominant_direction(&x, &y), 0.0);
        // Two vectors 40 degrees apart, across the seam, beat a longer single one.
        for (i, (length, degrees)) in [(1.0, 350.0), (1.0, 30.0), (1.5, 180.0)]
            .into_iter()
            .enumerate()
        {
            let (sin, cos) = libm::sincos(f64::to_radians(degrees));
            (x[i], y[i]) = ((length * cos) as f32, (length * sin) as f32);
        }
        let turns = dominant_direction(&x, &y);
        assert!((turns - 10.0 / 360.0).abs() < 1e-4, "{turns}");
    }
}
