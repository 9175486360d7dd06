//! Normal equations of the signed Sampson distance, summed over many matches: what a step of the refinement of a pose
//! needs.

use super::sampson::{covariance_times, epipolar};

/// Matches at once: two registers of doubles.
const LANES: usize = 4;

multiversioned! {
    /// For each match the signed Sampson distance `r = b^T E a / sqrt(n)` to the matrix `e` has a
    /// derivative `J_k` in each of five `directions` (derivatives of E; all in row-major order).
    /// The result is the lower triangle of `sum w J^T J`, row after row (15 numbers), then
    /// `sum w J r` (5). A match of weight 0 does not count, finite or not.
    ///
    /// # Panics
    /// If the slices of `points` (x, y in view a, x, y in view b) or `weights` differ in length.
    pub fn sampson_normal_equations(
        e: &[f64; 9],
        directions: &[[f64; 9]; 5],
        points: [&[f64]; 4],
        weights: &[f64],
    ) -> [f64; 20] {
        normal_equations(e, directions, points, weights)
    }

    /// As [`sampson_normal_equations`], of the distance in units of the image
    /// (see [`squared_tangent_sampson`](super::squared_tangent_sampson)): with the points come the entries xx, xy
    /// and yy of the covariances in view a and in view b.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn tangent_sampson_normal_equations(
        e: &[f64; 9],
        directions: &[[f64; 9]; 5],
        points: [&[f64]; 10],
        weights: &[f64],
    ) -> [f64; 20] {
        normal_equations(e, directions, points, weights)
    }
}

/// Four arrays of points, or ten with their covariances.
#[inline(always)]
fn normal_equations<const P: usize>(
    e: &[f64; 9],
    directions: &[[f64; 9]; 5],
    points: [&[f64]; P],
    weights: &[f64],
) -> [f64; 20] {
    let n = weights.len();
    assert!(
        points.iter().all(|p| p.len() == n),
        "one entry for each match"
    );
    let mut sums = [[0.0; LANES]; 20];
    for start in (0..n).step_by(LANES) {
        let (lanes, mut weight) = weighted_lanes::<P, LANES>(points, weights, start);
        if weight == [0.0; LANES] {
            continue;
        }
        let mut residual = [0.0; LANES];
        let mut jacobian = [[0.0; LANES]; 5];
        for lane in 0..LANES {
            let entry = |k: usize| lanes[k][lane];
            let [ax, ay, bx, by] = [entry(0), entry(1), entry(2), entry(3)];
            let (algebraic, line, back) = epipolar(e, [ax, ay], [bx, by]);
            let ([line_x, line_y], [back_x, back_y]) = if P > 4 {
                (
                    covariance_times([entry(P - 3), entry(P - 2), entry(P - 1)], line),
                    covariance_times([entry(P - 6), entry(P - 5), entry(P - 4)], back),
                )
            } else {
                (line, back)
            };
            let squares = line[0].mul_add(line_x, line[1] * line_y)
                + back[0].mul_add(back_x, back[1] * back_y);
            let usable = squares > 0.0;
            let inverse = if usable { 1.0 / squares.sqrt() } else { 0.0 };
            weight[lane] = if usable { weight[lane] } else { 0.0 };
            residual[lane] = algebraic * inverse;
            let pull = -algebraic * inverse * inverse;
            // Derivative of r by each entry of E.
            let by_entry = [
                pull.mul_add(line_x.mul_add(ax, back_x * bx), bx * ax) * inverse,
                pull.mul_add(line_x.mul_add(ay, back_y * bx), bx * ay) * inverse,
                pull.mul_add(line_x, bx) * inverse,
                pull.mul_add(line_y.mul_add(ax, back_x * by), by * ax) * inverse,
                pull.mul_add(line_y.mul_add(ay, back_y * by), by * ay) * inverse,
                pull.mul_add(line_y, by) * inverse,
                pull.mul_add(back_x, ax) * inverse,
                pull.mul_add(back_y, ay) * inverse,
                inverse,
            ];
            for (j, direction) in jacobian.iter_mut().zip(directions) {
                let mut sum = 0.0;
                for (g, d) in by_entry.iter().zip(direction) {
                    sum = g.mul_add(*d, sum);
                }
                j[lane] = sum;
            }
        }
        let mut next = 0;
        for i in 0..5 {
            let mut weighted = [0.0; LANES];
            for lane in 0..LANES {
                weighted[lane] = weight[lane] * jacobian[i][lane];
            }
            for other in &jacobian[..=i] {
                for lane in 0..LANES {
                    sums[next][lane] = weighted[lane].mul_add(other[lane], sums[next][lane]);
                }
                next += 1;
            }
            for lane in 0..LANES {
                sums[15 + i][lane] = weighted[lane].mul_add(residual[lane], sums[15 + i][lane]);
            }
        }
    }
    sums.map(|lanes| (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]))
}

/// The matches from `start` on, one in each lane, and their weights. Empty lanes and matches without weight
/// hold a finite point, with weight 0.
#[inline(always)]
pub(super) fn weighted_lanes<const P: usize, const L: usize>(
    points: [&[f64]; P],
    weights: &[f64],
    start: usize,
) -> ([[f64; L]; P], [f64; L]) {
    let mut lanes = [[0.0; L]; P];
    let mut weight = [0.0; L];
    for (lane, i) in (start..weights.len().min(start + L)).enumerate() {
        if weights[i] > 0.0 {
            weight[lane] = weights[i];
            for (to, from) in lanes.iter_mut().zip(points) {
                to[lane] = from[i];
            }
        }
    }
    (lanes, weight)
}
