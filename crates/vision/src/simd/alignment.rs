//! Windows of samples that are compared by least squares: their samples, weighted sums, and the normal equations of
//! a step. `matching/refined` says what for.

use super::sampling::{bilinear, split, take_corners};

/// Samples of a window's side.
pub const ALIGNED_SIDE: usize = 15;
/// Distance of the outermost samples from the middle, in samples.
pub const ALIGNED_REACH: usize = ALIGNED_SIDE / 2;
/// Samples of a row: a whole vector. The last is the one before it again, and has no weight.
const LANES: usize = 16;
/// Samples of a row with one more on each end, in whole vectors, and rows with one more on each end.
const WIDE: usize = 24;
const TALL: usize = ALIGNED_SIDE + 2;

/// A value for each sample of a window, row by row.
pub type Samples = [[f32; LANES]; ALIGNED_SIDE];

/// Parameters of a step: of the place, and of a linear map (xx, xy, yx, yy).
pub const STEP_PARAMETERS: usize = 6;

/// What the equations of a step consist of.
#[derive(Clone, Debug, PartialEq)]
pub struct StepEquations {
    /// For each parameter the derivatives of the values, times the weights.
    pub slopes: [Samples; STEP_PARAMETERS],
    /// The matrix of the normal equations, which is symmetric.
    pub normal: [[f32; STEP_PARAMETERS]; STEP_PARAMETERS],
}

multiversioned! {
    /// The values between pixels at `at + i axes[0] + j axes[1]`, with i and j from -7 to 7. Beyond its border the image
    /// continues with its outermost pixels.
    ///
    /// # Panics
    /// If the pixels are no whole image of at least 2 x 2 pixels.
    pub fn sample_window(pixels: &[f32], width: usize, at: [f32; 2], axes: [[f32; 2]; 2]) -> Samples {
        sampled::<LANES, ALIGNED_SIDE>(pixels, width, at, axes)
    }

    /// Samples that lie `apart` pixels from each other about `at`, and their derivatives along x and y for the distance of
    /// two samples.
    ///
    /// # Panics
    /// As [`sample_window`].
    pub fn sample_with_gradients(pixels: &[f32], width: usize, at: [f32; 2], apart: f32) -> [Samples; 3] {
        let wide = sampled::<WIDE, TALL>(pixels, width, at, [[apart, 0.0], [0.0, apart]]);
        let [mut values, mut across, mut down] = [[[0.0; LANES]; ALIGNED_SIDE]; 3];
        for row in 0..ALIGNED_SIDE {
            let [above, same, below] = [&wide[row], &wide[row + 1], &wide[row + 2]];
            for i in 0..LANES {
                values[row][i] = same[i + 1];
                across[row][i] = 0.5 * (same[i + 2] - same[i]);
                down[row][i] = 0.5 * (below[i + 1] - above[i + 1]);
            }
        }
        [values, across, down]
    }

    /// Takes the weighted mean off all values and divides them by their weighted standard deviation, which is returned;
    /// values that do not differ become no numbers.
    pub fn normalize_window(weights: &Samples, values: &mut Samples) -> f32 {
        let mean = mean(weights, values);
        for row in values.iter_mut() {
            for value in row {
                *value -= mean;
            }
        }
        let deviation = product(weights, values, values).sqrt();
        for row in values {
            for value in row {
                *value /= deviation;
            }
        }
        deviation
    }

    /// The weighted sum of the products of two windows.
    pub fn product_of_windows(weights: &Samples, a: &Samples, b: &Samples) -> f32 {
        product(weights, a, b)
    }

    /// The equations of a step for a window whose values have mean 0 and standard deviation 1, and whose gradients
    /// along x and y are those of these values. What a change of the mean and of the deviation explains is taken out.
    pub fn step_equations(weights: &Samples, values: &Samples, gradients: [&Samples; 2]) -> StepEquations {
        let [across, down] = gradients;
        let mut slopes = [[[0.0; LANES]; ALIGNED_SIDE]; STEP_PARAMETERS];
        for row in 0..ALIGNED_SIDE {
            let y = (row as f32 - ALIGNED_REACH as f32) / ALIGNED_REACH as f32;
            for i in 0..LANES {
                let x = (i as f32 - ALIGNED_REACH as f32) / ALIGNED_REACH as f32;
                slopes[0][row][i] = across[row][i];
                slopes[1][row][i] = down[row][i];
                slopes[2][row][i] = across[row][i] * x;
                slopes[3][row][i] = across[row][i] * y;
                slopes[4][row][i] = down[row][i] * x;
                slopes[5][row][i] = down[row][i] * y;
            }
        }
        for slopes in &mut slopes {
            let (mean, share) = (mean(weights, slopes), product(weights, slopes, values));
            for (slopes, values) in slopes.iter_mut().zip(values) {
                for i in 0..LANES {
                    slopes[i] -= mean + share * values[i];
                }
            }
        }
        let mut normal = [[0.0; STEP_PARAMETERS]; STEP_PARAMETERS];
        for i in 0..STEP_PARAMETERS {
            let mut weighted = slopes[i];
            for (weighted, weights) in weighted.iter_mut().zip(weights) {
                for (weighted, weight) in weighted.iter_mut().zip(weights) {
                    *weighted *= weight;
                }
            }
            // The windows before this one are weighted already.
            for j in i..STEP_PARAMETERS {
                let product = product_of(&weighted, &slopes[j]);
                normal[i][j] = product;
                normal[j][i] = product;
            }
            slopes[i] = weighted;
        }
        StepEquations { slopes, normal }
    }

    /// For each parameter the sum of the products of its slopes and of what the values become more from one window to
    /// the other.
    pub fn step_sums(slopes: &[Samples; STEP_PARAMETERS], from: &Samples, to: &Samples) -> [f32; STEP_PARAMETERS] {
        let mut sums = [[0.0_f32; LANES]; STEP_PARAMETERS];
        for row in 0..ALIGNED_SIDE {
            for i in 0..LANES {
                let more = to[row][i] - from[row][i];
                for (sums, slopes) in sums.iter_mut().zip(slopes) {
                    sums[i] += slopes[row][i] * more;
                }
            }
        }
        let mut totals = [0.0; STEP_PARAMETERS];
        for (total, sums) in totals.iter_mut().zip(&sums) {
            *total = total_of(sums);
        }
        totals
    }
}

/// Samples of a grid about a place; in each row those beyond the grid repeat its last.
#[inline(always)]
fn sampled<const L: usize, const ROWS: usize>(
    pixels: &[f32],
    width: usize,
    at: [f32; 2],
    [across, down]: [[f32; 2]; 2],
) -> [[f32; L]; ROWS] {
    let (columns, lines) = (width as u32, (pixels.len() / width) as u32);
    let reach = (ROWS / 2) as f32;
    let mut samples = [[0.0; L]; ROWS];
    let mut places = [0_u32; L];
    let mut fractions = [[0.0_f32; L]; 2];
    let mut corners = [[0.0_f32; L]; 4];
    for (row, samples) in samples.iter_mut().enumerate() {
        let j = row as f32 - reach;
        let (x, y) = (at[0] + j * down[0], at[1] + j * down[1]);
        for l in 0..L {
            let i = (l as f32 - reach).min(reach);
            let (column, u) = split(x + i * across[0], columns);
            let (line, v) = split(y + i * across[1], lines);
            places[l] = line * columns + column;
            fractions[0][l] = u;
            fractions[1][l] = v;
        }
        for (l, &place) in places.iter().enumerate() {
            let (upper, lower) = (place as usize, (place + columns) as usize);
            take_corners(pixels, [upper, lower], &mut corners, l);
        }
        for l in 0..L {
            samples[l] = bilinear(&corners, l, (fractions[0][l], fractions[1][l]));
        }
    }
    samples
}

/// The weighted mean, with weights whose sum is 1.
#[inline(always)]
fn mean(weights: &Samples, values: &Samples) -> f32 {
    product_of(weights, values)
}

#[inline(always)]
fn product_of(a: &Samples, b: &Samples) -> f32 {
    let mut sums = [0.0; LANES];
    for (a, b) in a.iter().zip(b) {
        for i in 0..LANES {
            sums[i] += a[i] * b[i];
        }
    }
    total_of(&sums)
}

/// The weighted sum of products.
#[inline(always)]
fn product(weights: &Samples, a: &Samples, b: &Samples) -> f32 {
    let mut sums = [0.0; LANES];
    for (weights, (a, b)) in weights.iter().zip(a.iter().zip(b)) {
        for i in 0..LANES {
            sums[i] += weights[i] * a[i] * b[i];
        }
    }
    total_of(&sums)
}

#[inline(always)]
fn total_of(sums: &[f32; LANES]) -> f32 {
    let mut sums = *sums;
    for half in [8, 4, 2, 1] {
        for i in 0..half {
            sums[i] += sums[i + half];
        }
    }
    sums[0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;
    use crate::simd::InstructionSet;

    const WIDTH: usize = 41;
    const HEIGHT: usize = 37;

    fn image(pixel: impl Fn(f32, f32) -> f32) -> Vec<f32> {
        (0..WIDTH * HEIGHT)
            .map(|i| pixel((i % WIDTH) as f32, (i / WIDTH) as f32))
            .collect()
    }

    /// Values for the samples, each for its place from the middle; those beyond the window are 0.
    fn window(value: impl Fn(f32, f32) -> f32) -> Samples {
        let mut samples = Samples::default();
        for (j, row) in samples.iter_mut().enumerate() {
            for (i, sample) in row[..ALIGNED_SIDE].iter_mut().enumerate() {
                *sample = value(
                    i as f32 - ALIGNED_REACH as f32,
                    j as f32 - ALIGNED_REACH as f32,
                );
            }
        }
        samples
    }

    fn weights() -> Samples {
        let weights = window(|x, y| 100.0 - x * x - y * y);
        let sum: f32 = weights.as_flattened().iter().sum();
        weights.map(|row| row.map(|weight| weight / sum))
    }

    #[test]
    fn samples_lie_on_the_axes_and_their_gradients_between_neighbours() {
        // Bilinear, so that interpolation is exact.
        let value = |x: f32, y: f32| 3.0 + 0.5 * x - 2.0 * y + 0.25 * x * y;
        let pixels = image(value);
        let (at, axes) = ([20.3, 17.1], [[1.1, -0.4], [0.3, 0.9]]);
        let samples = sample_window(&pixels, WIDTH, at, axes);
        for (j, row) in samples.iter().enumerate() {
            for (i, sample) in row.iter().enumerate() {
                // The last is the one before it again.
                let [i, j] = [i.min(14), j].map(|v| v as f32 - 7.0);
                let [x, y] = [0, 1].map(|k| at[k] + i * axes[0][k] + j * axes[1][k]);
                let expected = value(x, y);
                assert!((sample - expected).abs() < 1e-3, "{sample}, not {expected}");
            }
        }
        let [samples, across, down] = sample_with_gradients(&pixels, WIDTH, at, 1.5);
        for j in 0..ALIGNED_SIDE {
            for i in 0..ALIGNED_SIDE {
                let [x, y] = [
                    at[0] + 1.5 * (i as f32 - 7.0),
                    at[1] + 1.5 * (j as f32 - 7.0),
                ];
                let expected = [value(x, y), 1.5 * (0.5 + 0.25 * y), 1.5 * (0.25 * x - 2.0)];
                for (found, expected) in [samples, across, down].iter().zip(expected) {
                    let found = found[j][i];
                    assert!((found - expected).abs() < 1e-3, "{found}, not {expected}");
                }
            }
        }
        // Beyond the border are its pixels again.
        let corner = sample_window(&pixels, WIDTH, [-50.0, 1e9], axes);
        assert_eq!(corner, [[value(0.0, 36.0); LANES]; ALIGNED_SIDE]);
    }

    #[test]
    fn normalized_windows_have_mean_0_and_deviation_1() {
        let weights = weights();
        let mut values = window(|x, y| 5.0 + 2.0 * x + y * y);
        let before = values;
        let deviation = normalize_window(&weights, &mut values);
        assert!(mean(&weights, &values).abs() < 1e-6);
        assert!((product_of_windows(&weights, &values, &values) - 1.0).abs() < 1e-5);
        let back = deviation * (values[3][4] - values[9][1]);
        assert!((back - (before[3][4] - before[9][1])).abs() < 1e-4);
        // No texture, no numbers.
        let mut flat = [[7.0; LANES]; ALIGNED_SIDE];
        assert_eq!(normalize_window(&weights, &mut flat), 0.0);
        assert!(flat[0][0].is_nan());
    }

    #[test]
    fn equations_tell_the_place_but_neither_brightness_nor_contrast() {
        let weights = weights();
        let value = |x: f32, y: f32| (0.4 * x).sin() + (0.3 * y + 0.02 * x * y).cos();
        let mut values = window(value);
        let deviation = normalize_window(&weights, &mut values);
        let slope = |dx: f32, dy: f32| {
            let e = 0.01;
            let ahead = |x, y| value(x + e * dx, y + e * dy) - value(x - e * dx, y - e * dy);
            window(|x, y| ahead(x, y) / (2.0 * e) / deviation)
        };
        let equations = step_equations(&weights, &values, [&slope(1.0, 0.0), &slope(0.0, 1.0)]);
        // The change of every parameter brings the row of the matrix that belongs to it.
        for parameter in 0..STEP_PARAMETERS {
            let e = 0.01;
            let moved = window(|x, y| {
                let (u, v) = (x / 7.0, y / 7.0);
                let moves = [
                    (1.0, 0.0),
                    (0.0, 1.0),
                    (u, 0.0),
                    (v, 0.0),
                    (0.0, u),
                    (0.0, v),
                ];
                let (dx, dy) = moves[parameter];
                value(x + e * dx, y + e * dy)
            });
            // In another light.
            let mut moved = moved.map(|row| row.map(|value| 40.0 + 3.0 * value));
            normalize_window(&weights, &mut moved);
            let sums = step_sums(&equations.slopes, &values, &moved);
            for (sum, entry) in sums.iter().zip(equations.normal[parameter]) {
                let expected = e * entry;
                assert!(
                    (sum - expected).abs() < 1e-4,
                    "{parameter}: {sum}, not {expected}"
                );
            }
        }
        let brighter = values.map(|row| row.map(|value| 1.2 * value + 0.5));
        for sum in step_sums(&equations.slopes, &values, &brighter) {
            assert!(sum.abs() < 1e-5, "{sum}");
        }
    }

    #[test]
    fn all_instruction_sets_have_the_same_bits() {
        let mut rng = Seed(5).rng();
        let pixels: Vec<f32> = (0..WIDTH * HEIGHT).map(|_| rng.normal() as f32).collect();
        let weights = weights();
        let mut all = Vec::new();
        InstructionSet::for_each(|_| {
            let axes = [[0.7, 0.6], [-0.5, 0.8]];
            let [mut values, across, down] =
                sample_with_gradients(&pixels, WIDTH, [19.6, 18.2], 1.3);
            let mut window = sample_window(&pixels, WIDTH, [20.1, 17.7], axes);
            let deviations = [&mut values, &mut window].map(|v| normalize_window(&weights, v));
            let equations = step_equations(&weights, &values, [&across, &down]);
            let sums = step_sums(&equations.slopes, &values, &window);
            let product = product_of_windows(&weights, &values, &window);
            all.push((values, window, deviations, equations, sums, product));
        });
        assert!(all.iter().all(|found| *found == all[0]));
    }
}
