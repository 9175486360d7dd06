//! Transfer distances of many matches under a homography, and their normal equations.

use super::refine::weighted_lanes;

/// Matches at once: two registers of doubles.
const LANES: usize = 4;

/// Sums that [`transfer_normal_equations`] returns: a lower triangle of 8 x 8, and 8.
pub const TRANSFER_SUMS: usize = 36 + 8;

multiversioned! {
    /// The mean of two squares for each match: how far `h` takes its point in a from that in b, and
    /// `back` that in b from that in a (both matrices in row-major order). Infinite or NaN for points
    /// that are not finite or go to infinity.
    ///
    /// # Panics
    /// If the slices of `points` (x, y in view a, x, y in view b) or `out` differ in length.
    pub fn squared_transfer(h: &[f64; 9], back: &[f64; 9], points: [&[f64]; 4], out: &mut [f64]) {
        let n = out.len();
        let [a_x, a_y, b_x, b_y] = points;
        assert!(
            a_x.len() == n && a_y.len() == n && b_x.len() == n && b_y.len() == n,
            "one entry for each match"
        );
        for i in 0..n {
            let (ax, ay, bx, by) = (a_x[i], a_y[i], b_x[i], b_y[i]);
            let z = h[6].mul_add(ax, h[7].mul_add(ay, h[8]));
            let x = h[0].mul_add(ax, h[1].mul_add(ay, h[2])) / z - bx;
            let y = h[3].mul_add(ax, h[4].mul_add(ay, h[5])) / z - by;
            let back_z = back[6].mul_add(bx, back[7].mul_add(by, back[8]));
            let back_x = back[0].mul_add(bx, back[1].mul_add(by, back[2])) / back_z - ax;
            let back_y = back[3].mul_add(bx, back[4].mul_add(by, back[5])) / back_z - ay;
            out[i] = 0.5 * (x.mul_add(x, y * y) + back_x.mul_add(back_x, back_y * back_y));
        }
    }

    /// The four residuals of a match are `h a - b` and `back b - a`, in x and y; they have derivatives J
    /// along eight directions in which `h` and `back` move (their derivatives, in row-major order). The
    /// result is the lower triangle of `sum w J^T J`, row after row (36 numbers), then `sum w J^T r` (8).
    /// A match of weight 0 does not count, finite or not.
    ///
    /// # Panics
    /// If the slices of `points` (x, y in view a, x, y in view b) or `weights` differ in length.
    pub fn transfer_normal_equations(
        there: (&[f64; 9], &[[f64; 9]; 8]),
        back: (&[f64; 9], &[[f64; 9]; 8]),
        points: [&[f64]; 4],
        weights: &[f64],
    ) -> [f64; TRANSFER_SUMS] {
        let n = weights.len();
        assert!(points.iter().all(|p| p.len() == n), "one entry for each match");
        let mut sums = [[0.0; LANES]; TRANSFER_SUMS];
        for start in (0..n).step_by(LANES) {
            let (lanes, weight) = weighted_lanes::<4, LANES>(points, weights, start);
            if weight == [0.0; LANES] {
                continue;
            }
            for ((matrix, directions), [from_x, from_y, to_x, to_y]) in [
                (there, [0, 1, 2, 3]),
                (back, [2, 3, 0, 1]),
            ] {
                let [from_x, from_y, to_x, to_y] = [lanes[from_x], lanes[from_y], lanes[to_x], lanes[to_y]];
                let mut inverse = [0.0; LANES];
                let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
                let mut w = weight;
                for lane in 0..LANES {
                    let (px, py) = (from_x[lane], from_y[lane]);
                    let z = matrix[6].mul_add(px, matrix[7].mul_add(py, matrix[8]));
                    let usable = z != 0.0;
                    inverse[lane] = if usable { 1.0 / z } else { 0.0 };
                    w[lane] = if usable { w[lane] } else { 0.0 };
                    x[lane] = matrix[0].mul_add(px, matrix[1].mul_add(py, matrix[2])) * inverse[lane];
                    y[lane] = matrix[3].mul_add(px, matrix[4].mul_add(py, matrix[5])) * inverse[lane];
                }
                let (mut by_x, mut by_y) = ([[0.0; LANES]; 8], [[0.0; LANES]; 8]);
                for (k, d) in directions.iter().enumerate() {
                    for lane in 0..LANES {
                        let (px, py) = (from_x[lane], from_y[lane]);
                        let dz = d[6].mul_add(px, d[7].mul_add(py, d[8]));
                        let dx = d[0].mul_add(px, d[1].mul_add(py, d[2]));
                        let dy = d[3].mul_add(px, d[4].mul_add(py, d[5]));
                        by_x[k][lane] = (dx - x[lane] * dz) * inverse[lane];
                        by_y[k][lane] = (dy - y[lane] * dz) * inverse[lane];
                    }
                }
                let mut next = 0;
                for i in 0..8 {
                    let (mut weighted_x, mut weighted_y) = ([0.0; LANES], [0.0; LANES]);
                    for lane in 0..LANES {
                        weighted_x[lane] = w[lane] * by_x[i][lane];
                        weighted_y[lane] = w[lane] * by_y[i][lane];
                    }
                    for j in 0..=i {
                        for lane in 0..LANES {
                            let sum = weighted_x[lane].mul_add(by_x[j][lane], sums[next][lane]);
                            sums[next][lane] = weighted_y[lane].mul_add(by_y[j][lane], sum);
                        }
                        next += 1;
                    }
                    for lane in 0..LANES {
                        let sum = weighted_x[lane].mul_add(x[lane] - to_x[lane], sums[36 + i][lane]);
                        sums[36 + i][lane] = weighted_y[lane].mul_add(y[lane] - to_y[lane], sum);
                    }
                }
            }
        }
        sums.map(|lanes| (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]))
    }
}
