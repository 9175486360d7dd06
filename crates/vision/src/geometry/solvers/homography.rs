//! The homography of four matches.
//!
//! Hartley, Zisserman, "Multiple View Geometry in Computer Vision", 2nd edition, 2004, secs. 2.3 and 4.1. Four
//! points of which no three lie on a line are a projective basis. The matrix with columns `l_i x_i`, i = 1 to
//! 3, with `sum l_i x_i = x_4`, takes the standard basis to it. With such matrices A and B for the points of
//! the two images, `H = B A^-1`.
//!
//! *Choice*: a homography is refused if the line that it maps to infinity separates the four points, since no
//! camera sees a plane from both sides at once.

use nalgebra::{Matrix3, Point2, Vector3};

/// If three points are this close to a line, relative to the size of the fourth, the basis is degenerate.
const DEGENERATE: f64 = 1e-9;

/// The homography with `b[i] ~ H a[i]`, of Frobenius norm 1, with the sign that keeps the points in front.
/// `None` if three points are on a line, if points are not finite, or if the points do not stay on one side of
/// the line that goes to infinity.
pub fn homography(a: &[Point2<f64>; 4], b: &[Point2<f64>; 4]) -> Option<Matrix3<f64>> {
    let h = basis(b)? * basis(a)?.try_inverse()?;
    let norm = h.norm();
    if !(norm.is_finite() && norm > 0.0) {
        return None;
    }
    let sides = a.map(|a| (h * a.to_homogeneous()).z);
    let sign = sides[0].signum();
    let one_side = sides.iter().all(|side| side * sign > 0.0);
    one_side.then(|| h * (sign / norm))
}

/// Takes the standard projective basis to these points.
fn basis(points: &[Point2<f64>; 4]) -> Option<Matrix3<f64>> {
    let [p, q, r, s] = points.map(|point| point.to_homogeneous());
    // Cramer's rule: l_i are ratios of areas of triangles.
    let area = |u: &Vector3<f64>, v: &Vector3<f64>, w: &Vector3<f64>| u.dot(&v.cross(w));
    let whole = area(&p, &q, &r);
    let parts = [area(&s, &q, &r), area(&p, &s, &r), area(&p, &q, &s)];
    let size = parts
        .iter()
        .fold(whole.abs(), |size, part| size.max(part.abs()));
    // Also true for NaN.
    let sound = |part: f64| part.abs() > DEGENERATE * size;
    if !(sound(whole) && parts.into_iter().all(sound)) {
        return None;
    }
    Some(Matrix3::from_columns(&[
        p * (parts[0] / whole),
        q * (parts[1] / whole),
        r * (parts[2] / whole),
    ]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::seed::Seed;

    #[test]
    fn four_points_determine_it() {
        let mut rng = Seed(1).rng();
        for _ in 0..500 {
            let mut near_one =
                || Matrix3::identity() + Matrix3::from_fn(|_, _| 0.2 * (rng.uniform() - 0.5));
            let truth = near_one().normalize();
            let mut rng = Seed(rng.next_u32().into()).rng();
            let a = [(); 4].map(|()| Point2::new(rng.uniform() - 0.5, rng.uniform() - 0.5));
            let b = a.map(|a| {
                let b = truth * a.to_homogeneous();
                Point2::new(b.x / b.z, b.y / b.z)
            });
            // Nearly collinear draws determine it badly.
            let found = homography(&a, &b).expect("four points");
            for (a, b) in a.iter().zip(&b) {
                let seen = found * a.to_homogeneous();
                let seen = Point2::new(seen.x / seen.z, seen.y / seen.z);
                assert!((seen - b).norm() < 1e-6);
            }
        }
    }

    #[test]
    fn degenerate_points_have_none() {
        let good = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(Point2::from);
        let with = |at: usize, point: [f64; 2]| {
            let mut points = good;
            points[at] = point.into();
            points
        };
        assert!(homography(&good, &good).is_some());
        for bad in [
            with(3, [2.0, 0.0]),
            with(0, [0.5, 0.5]),
            with(1, [0.0, 0.0]),
            with(2, [f64::NAN, 0.0]),
            with(2, [f64::INFINITY, 0.0]),
            // A corner pushed through the opposite side: seen from behind.
            with(3, [-0.2, -0.2]),
        ] {
            assert_eq!(homography(&good, &bad), None, "{bad:?}");
        }
    }
}
