//! How well a match agrees with a homography.
//!
//! The *symmetric transfer distance* (Hartley, Zisserman, "Multiple View Geometry in Computer Vision",
//! 2nd edition, 2004, eq. 4.7) is how far `H a` lies from b, and `H^-1 b` from a; here the mean of
//! both squares.

use std::ops::Range;

use nalgebra::{Matrix3, Point2, Vector3};

use super::PointPairs;

/// Squared symmetric transfer distance of each of the matches in `range`, written to `out`; infinite or
/// NaN for matches that are not finite or go through infinity, and for a matrix without inverse.
///
/// # Panics
/// If `range` is not within `pairs`, or `out` has another length.
pub fn squared_transfer_distances(
    h: &Matrix3<f64>,
    pairs: &PointPairs,
    range: Range<usize>,
    out: &mut [f64],
) {
    assert_eq!(range.len(), out.len(), "one entry for each match");
    let Some(inverse) = h.try_inverse() else {
        out.fill(f64::INFINITY);
        return;
    };
    for (index, out) in range.zip(out) {
        let (a, b) = pairs.get(index);
        let there = squared_distance(h, a, b);
        let back = squared_distance(&inverse, b, a);
        *out = f64::midpoint(there, back);
    }
}

fn squared_distance(h: &Matrix3<f64>, from: Point2<f64>, to: Point2<f64>) -> f64 {
    let seen: Vector3<f64> = h * from.to_homogeneous();
    if seen.z == 0.0 {
        return f64::INFINITY;
    }
    (Point2::new(seen.x / seen.z, seen.y / seen.z) - to).norm_squared()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_is_the_mean_of_both_directions() {
        // Twice as large: 1 off there is 1/2 off back.
        let h = Matrix3::new(2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0);
        let at = |a: [f64; 2], b: [f64; 2]| (Point2::from(a), Point2::from(b));
        let pairs: PointPairs = [
            at([1.0, 2.0], [2.0, 4.0]),
            at([1.0, 2.0], [3.0, 4.0]),
            at([f64::NAN, 2.0], [3.0, 4.0]),
        ]
        .into_iter()
        .collect();
        let mut out = [0.0; 3];
        squared_transfer_distances(&h, &pairs, 0..3, &mut out);
        assert_eq!(out[..2], [0.0, 0.625]);
        assert!(out[2].is_nan());
        squared_transfer_distances(&Matrix3::zeros(), &pairs, 0..3, &mut out);
        assert!(out.iter().all(|d| d.is_infinite()));
    }
}
