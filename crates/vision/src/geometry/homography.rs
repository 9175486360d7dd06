//! How well a match agrees with a homography, and how far apart two homographies are.
//!
//! The *symmetric transfer distance* (Hartley, Zisserman, "Multiple View Geometry in Computer Vision", 2nd
//! edition, 2004, eq. 4.7) uses two distances: that of `H a` from b, and that of `H^-1 b` from a. Here its
//! square is the mean of their two squares.
//!
//! The *corner error* (DeTone, Malisiewicz, Rabinovich, "SuperPoint: Self-Supervised Interest Point Detection
//! and Description", CVPR Workshops 2018, sec. 6) compares where two homographies map the four corners of image
//! a. It is the mean distance over the four corners, in pixels of image b.

use std::ops::Range;

use nalgebra::{Matrix3, Point2};

use super::PointPairs;
use super::epipolar::row_major;
use crate::simd;

/// The point to which a homography maps `point`; not finite if that is infinitely far away.
pub fn transfer(h: &Matrix3<f64>, point: Point2<f64>) -> Point2<f64> {
    let seen = h * point.to_homogeneous();
    Point2::new(seen.x / seen.z, seen.y / seen.z)
}

/// Writes the squared symmetric transfer distance of each match in `range` to `out`. Infinite or NaN for
/// matches that are not finite or that are mapped to infinity, and for a matrix without inverse.
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
    let points = [&pairs.a_x, &pairs.a_y, &pairs.b_x, &pairs.b_y];
    let points = points.map(|values| &values[range.clone()]);
    let Some(back) = h.try_inverse() else {
        out.fill(f64::INFINITY);
        return;
    };
    simd::squared_transfer(&row_major(h), &row_major(&back), points, out);
}

/// The corner error of an `estimate` in an image a of so many columns and rows, in pixels of image b. The
/// corners are the centres of the outermost pixels. Not finite if a corner is mapped to infinity.
pub fn corner_error(
    estimate: &Matrix3<f64>,
    truth: &Matrix3<f64>,
    (width, height): (usize, usize),
) -> f64 {
    let [right, bottom] = [width, height].map(|side| side.saturating_sub(1) as f64);
    let corners = [[0.0, 0.0], [right, 0.0], [0.0, bottom], [right, bottom]].map(Point2::from);
    let apart = |corner| (transfer(estimate, corner) - transfer(truth, corner)).norm();
    corners.map(apart).iter().sum::<f64>() / 4.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twice as large: 1 off there is 1/2 off back.
    const TWICE: Matrix3<f64> = Matrix3::new(2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0);

    #[test]
    fn distance_is_the_mean_of_both_directions() {
        let at = |a: [f64; 2], b: [f64; 2]| (Point2::from(a), Point2::from(b));
        let pairs: PointPairs = [
            at([1.0, 2.0], [2.0, 4.0]),
            at([1.0, 2.0], [3.0, 4.0]),
            at([f64::NAN, 2.0], [3.0, 4.0]),
        ]
        .into_iter()
        .collect();
        let mut out = [0.0; 3];
        squared_transfer_distances(&TWICE, &pairs, 0..3, &mut out);
        assert_eq!(out[..2], [0.0, 0.625]);
        assert!(out[2].is_nan());
        squared_transfer_distances(&Matrix3::zeros(), &pairs, 0..3, &mut out);
        assert!(out.iter().all(|d| d.is_infinite()));
    }

    #[test]
    fn corner_error_is_the_mean_over_the_corners() {
        let identity = Matrix3::identity();
        assert_eq!(corner_error(&(identity * -3.0), &identity, (640, 480)), 0.0);
        // The corners of 4 x 5 pixels are at 0 and 3, 0 and 4: doubled, they are 0, 3, 4 and 5 off.
        assert!((corner_error(&TWICE, &identity, (4, 5)) - 3.0).abs() < 1e-12);
        // The last row and column are seen at infinity.
        let vanishing = Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 3.0);
        assert!(!corner_error(&vanishing, &identity, (4, 5)).is_finite());
    }
}
