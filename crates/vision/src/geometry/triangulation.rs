//! Depths of matched points under a given pose.
//!
//! Linear triangulation (Hartley, Zisserman, "Multiple View Geometry in Computer Vision", 2nd
//! edition, 2004, sec. 12.2): each view gives two equations `x P_3 - P_1 = 0`, `y P_3 - P_2 = 0` in
//! the homogeneous scene point X, with `P_a = [I | 0]` and `P_b = [R | t]`, and X is the unit
//! vector that violates the four least. The depths are `X_3 / X_4` and `(R X)_3 / X_4 + t_3`, in
//! units of the baseline, since t has length 1.
//!
//! *Choice*: X is computed as the eigenvector of the normal matrix `A^T A`, by Jacobi rotations and for several
//! matches at once, and not by a singular value decomposition of A for each match. The condition number is
//! squared by this, but that costs no digit that a depth below 50 baselines would need.
//!
//! [`ray_depths`] is a cheaper function. With `p = R a` the lines of sight meet where `l_b b = l_a p + t`. The
//! cross products with b and with p give both depths in closed form, at a fiftieth of the cost. Where the lines
//! miss each other, the depths are the least-squares solutions of the two equations. They are meant for their
//! signs.

use super::epipolar::row_major;
use super::{PointPairs, RelativePose};
use crate::simd;

/// Depths of each match in view `a` and in view `b`, in baselines; negative behind the camera,
/// infinite or NaN where the lines of sight are parallel or coordinates not finite.
///
/// # Panics
/// If `depth_a` or `depth_b` does not have an entry for each of the `pairs`.
pub fn triangulate_depths(
    b_from_a: &RelativePose,
    pairs: &PointPairs,
    depth_a: &mut [f64],
    depth_b: &mut [f64],
) {
    let PointPairs {
        a_x, a_y, b_x, b_y, ..
    } = pairs;
    let (r, t) = matrices(b_from_a);
    simd::triangulate_depths(&r, &t, a_x, a_y, b_x, b_y, depth_a, depth_b);
}

/// Depths of each match in view `a` and in view `b`, in baselines, at the place where its two lines of sight
/// come nearest to each other. Negative behind the camera; infinite or NaN if the lines are parallel or
/// coordinates are not finite.
///
/// # Panics
/// If `depth_a` or `depth_b` does not have an entry for each of the `pairs`.
pub fn ray_depths(
    b_from_a: &RelativePose,
    pairs: &PointPairs,
    depth_a: &mut [f64],
    depth_b: &mut [f64],
) {
    let PointPairs {
        a_x, a_y, b_x, b_y, ..
    } = pairs;
    let (r, t) = matrices(b_from_a);
    simd::ray_depths(&r, &t, a_x, a_y, b_x, b_y, depth_a, depth_b);
}

/// R in row-major order, and t.
fn matrices(b_from_a: &RelativePose) -> ([f64; 9], [f64; 3]) {
    let rotation = b_from_a.rotation.to_rotation_matrix();
    let t = &b_from_a.direction;
    (row_major(rotation.matrix()), [t.x, t.y, t.z])
}
