//! Squared Sampson distances of many matches.

/// Thresholds of [`mean_gain`].
pub const THRESHOLDS: usize = 3;

multiversioned! {
    /// Squared Sampson distance (see [`crate::geometry::squared_sampson_distances`]) of each
    /// match to the matrix `e`, in row-major order. Where both epipolar lines vanish, and for
    /// coordinates that are not finite, it is NaN or infinite.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn squared_sampson(e: &[f64; 9], a_x: &[f64], a_y: &[f64], b_x: &[f64], b_y: &[f64], out: &mut [f64]) {
        let n = out.len();
        assert!(
            a_x.len() == n && a_y.len() == n && b_x.len() == n && b_y.len() == n,
            "one entry for each match"
        );
        for i in 0..n {
            let (algebraic, [line_x, line_y], [back_x, back_y]) = epipolar(e, [a_x[i], a_y[i]], [b_x[i], b_y[i]]);
            let lines = line_x.mul_add(line_x, line_y * line_y);
            let backs = back_x.mul_add(back_x, back_y * back_y);
            out[i] = algebraic * algebraic / (lines + backs);
        }
    }

    /// As [`squared_sampson`], in units of depth 1 where the lens shows the points: where noise of one such unit has the
    /// covariance S (xx, xy, yy; of
    /// view a, then of view b), a gradient g has the squared length `g^T S g`.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn squared_tangent_sampson(e: &[f64; 9], points: [&[f64]; 4], covariances: [[&[f64]; 3]; 2], out: &mut [f64]) {
        let n = out.len();
        let [a_x, a_y, b_x, b_y] = points;
        let [[a_xx, a_xy, a_yy], [b_xx, b_xy, b_yy]] = covariances;
        assert!(
            points.iter().chain(covariances.as_flattened()).all(|x| x.len() == n),
            "one entry for each match"
        );
        for i in 0..n {
            let (algebraic, line, back) = epipolar(e, [a_x[i], a_y[i]], [b_x[i], b_y[i]]);
            let line_b = covariance_times([b_xx[i], b_xy[i], b_yy[i]], line);
            let line_a = covariance_times([a_xx[i], a_xy[i], a_yy[i]], back);
            let lines = line[0].mul_add(line_b[0], line[1] * line_b[1]);
            let backs = back[0].mul_add(line_a[0], back[1] * line_a[1]);
            out[i] = algebraic * algebraic / (lines + backs);
        }
    }

    /// How many of the `values` are at most `limit`; NaN is not.
    pub fn count_at_most(values: &[f64], limit: f64) -> usize {
        // Counted in lanes as wide as the values, which is what makes it vectorise.
        let (lanes, rest) = values.as_chunks::<8>();
        let mut counts = [0_u64; 8];
        for lane in lanes {
            for (count, value) in counts.iter_mut().zip(lane) {
                *count += u64::from(*value <= limit);
            }
        }
        let whole: u64 = counts.iter().sum();
        whole as usize + rest.iter().filter(|&&value| value <= limit).count()
    }

    /// The sum of `min(value, limit)`; NaN counts as the limit.
    pub fn sum_truncated(values: &[f64], limit: f64) -> f64 {
        let truncate = |value: f64| if value < limit { value } else { limit };
        let (lanes, rest) = values.as_chunks::<8>();
        let mut sums = [0.0; 8];
        for lane in lanes {
            for (sum, value) in sums.iter_mut().zip(lane) {
                *sum += truncate(*value);
            }
        }
        let rest: f64 = rest.iter().map(|&value| truncate(value)).sum();
        sums.iter().sum::<f64>() + rest
    }

    /// How far the values are below the limit: the sum of `weight max(limit - value, 0)`; NaN counts as
    /// the limit.
    pub fn sum_below(values: &[f64], weights: &[f64], limit: f64) -> f64 {
        assert_eq!(values.len(), weights.len(), "a weight for each value");
        let below = |value: f64| if value < limit { limit - value } else { 0.0 };
        let (value_lanes, values) = values.as_chunks::<8>();
        let (weight_lanes, weights) = weights.as_chunks::<8>();
        let mut sums = [0.0; 8];
        for (value_lane, weight_lane) in value_lanes.iter().zip(weight_lanes) {
            for (sum, (value, weight)) in sums.iter_mut().zip(value_lane.iter().zip(weight_lane)) {
                *sum += weight * below(*value);
            }
        }
        let rest = values.iter().zip(weights);
        let rest: f64 = rest.map(|(&value, weight)| weight * below(value)).sum();
        sums.iter().sum::<f64>() + rest
    }

    /// The sum of `weight max(1 - value / limit, 0)`, in the mean over the limits, which are positive; NaN
    /// counts as a value beyond them.
    pub fn mean_gain(values: &[f64], weights: &[f64], limits: &[f64; THRESHOLDS]) -> f64 {
        assert_eq!(values.len(), weights.len(), "a weight for each value");
        let inverse = limits.map(|limit| 1.0 / limit);
        let gain = |value: f64| {
            let mut gain = 0.0;
            for k in 0..THRESHOLDS {
                gain += if value < limits[k] { value.mul_add(-inverse[k], 1.0) } else { 0.0 };
            }
            gain
        };
        let (value_lanes, values) = values.as_chunks::<8>();
        let (weight_lanes, weights) = weights.as_chunks::<8>();
        let mut sums = [0.0; 8];
        for (value_lane, weight_lane) in value_lanes.iter().zip(weight_lanes) {
            for (sum, (value, weight)) in sums.iter_mut().zip(value_lane.iter().zip(weight_lane)) {
                *sum = weight.mul_add(gain(*value), *sum);
            }
        }
        let mut sum: f64 = sums.iter().sum();
        for (value, weight) in values.iter().zip(weights) {
            sum = weight.mul_add(gain(*value), sum);
        }
        sum / THRESHOLDS as f64
    }
}

/// The algebraic residual `b^T E a` and its gradients: by b, the first two entries of `E a`, and by a, those of `E^T b`.
#[inline(always)]
pub(super) fn epipolar(
    e: &[f64; 9],
    [ax, ay]: [f64; 2],
    [bx, by]: [f64; 2],
) -> (f64, [f64; 2], [f64; 2]) {
    let line_x = e[0].mul_add(ax, e[1].mul_add(ay, e[2]));
    let line_y = e[3].mul_add(ax, e[4].mul_add(ay, e[5]));
    let line_z = e[6].mul_add(ax, e[7].mul_add(ay, e[8]));
    let back_x = e[0].mul_add(bx, e[3].mul_add(by, e[6]));
    let back_y = e[1].mul_add(bx, e[4].mul_add(by, e[7]));
    let algebraic = line_x.mul_add(bx, line_y.mul_add(by, line_z));
    (algebraic, [line_x, line_y], [back_x, back_y])
}

/// `S g` for the symmetric matrix S of these entries xx, xy, yy.
#[inline(always)]
pub(super) fn covariance_times([xx, xy, yy]: [f64; 3], [x, y]: [f64; 2]) -> [f64; 2] {
    [xx.mul_add(x, xy * y), xy.mul_add(x, yy * y)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_of_integers_is_exact() {
        // E = [t]x for t = (1, 0, 0): epipolar lines are rows, the distance is vertical.
        let e = [0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0];
        let a_y: Vec<f64> = (0..21).map(f64::from).collect();
        let (x, b_y) = (vec![3.0; 21], vec![10.0; 21]);
        let mut out = vec![0.0; 21];
        squared_sampson(&e, &x, &a_y, &x, &b_y, &mut out);
        for (distance, y) in out.iter().zip(&a_y) {
            assert_eq!(*distance, (y - 10.0) * (y - 10.0) / 2.0);
        }
    }

    #[test]
    fn where_a_pixel_is_as_long_everywhere_the_distances_are_the_same_bits() {
        let e = [0.1, -0.5, 0.2, 0.7, 0.05, -0.9, -0.1, 0.8, 0.02];
        let points: [Vec<f64>; 4] =
            std::array::from_fn(|k| (0..21).map(|i| (i as f64 * (k + 2) as f64).sin()).collect());
        let [a_x, a_y, b_x, b_y] = points.each_ref().map(|x| &x[..]);
        let (one, zero) = ([1.0; 21], [0.0; 21]);
        let (mut plain, mut tangent) = ([0.0; 21], [0.0; 21]);
        squared_sampson(&e, a_x, a_y, b_x, b_y, &mut plain);
        let identities = [[&one[..], &zero, &one]; 2];
        squared_tangent_sampson(&e, [a_x, a_y, b_x, b_y], identities, &mut tangent);
        assert_eq!(plain, tangent);
    }

    #[test]
    fn counting_leaves_out_what_is_not_a_number() {
        for n in 0..40 {
            let mut values: Vec<f64> = (0..n).map(f64::from).collect();
            values.extend([f64::NAN, f64::INFINITY, 3.0]);
            assert_eq!(count_at_most(&values, 3.0), 1 + n.min(4) as usize);
        }
    }

    #[test]
    fn truncated_sums_take_what_is_not_a_number_for_the_limit() {
        for n in 0..40 {
            let mut values: Vec<f64> = (0..n).map(f64::from).collect();
            values.extend([f64::NAN, f64::INFINITY]);
            let expected: i32 = (0..n).map(|i| i.min(3)).sum::<i32>() + 6;
            assert_eq!(sum_truncated(&values, 3.0), f64::from(expected));
        }
    }

    #[test]
    fn mean_gains_are_those_of_each_limit() {
        let limits = [0.5, 2.0, 8.0];
        for n in 0..40 {
            let mut values: Vec<f64> = (0..n).map(|i| 0.3 * f64::from(i)).collect();
            values.extend([f64::NAN, f64::INFINITY]);
            let weights: Vec<f64> = (1..=n + 2).map(f64::from).collect();
            let each = limits.map(|limit| sum_below(&values, &weights, limit) / limit);
            let expected = each.iter().sum::<f64>() / 3.0;
            let found = mean_gain(&values, &weights, &limits);
            assert!(
                (found - expected).abs() <= 1e-12 * expected,
                "{found} {expected}"
            );
        }
    }

    #[test]
    fn weighted_sums_below_the_limit_leave_out_what_is_not_a_number() {
        for n in 0..40 {
            let mut values: Vec<f64> = (0..n).map(f64::from).collect();
            values.extend([f64::NAN, f64::INFINITY]);
            let weights: Vec<f64> = (1..=n + 2).map(f64::from).collect();
            let expected: i32 = (0..n.min(3)).map(|i| (i + 1) * (3 - i)).sum();
            assert_eq!(sum_below(&values, &weights, 3.0), f64::from(expected));
        }
    }
}
