//! How a small patch of the scene changes between two views of known relative pose: how far it turns, and how much it
//! grows.
//!
//! A patch is a piece of a plane around a scene point X, with normal n and distance d = n . X from the centre of view
//! `a`. The plane moves points at depth 1 by the homography `H = R + t n^T / d` (Hartley, Zisserman, "Multiple View
//! Geometry in Computer Vision", 2nd edition, 2004, sec. 13.1), and near the point by the derivative J of H there, a 2 x 2
//! matrix. The rotation nearest to J (polar decomposition) has the angle `atan2(J_21 - J_12, J_11 + J_22)`, and
//! lengths grow by `sqrt(det J)` in the geometric mean over directions.
//!
//! A match tells X, if the pose is known, but not n. *Choice*: the patch faces the middle of both cameras, so n halves
//! the angle between the two lines of sight. A keypoint found in both images cannot lie on a surface that one of them
//! sees edge on.

use nalgebra::{Matrix3, Point2, Vector3};

use super::RelativePose;

/// How a patch of the scene looks in view `b`, compared with view `a`, at depth 1 in both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PatchChange {
    /// The angle by which it is turned, in radians, from the x axis towards the y axis.
    pub(crate) turn: f64,
    /// The natural logarithm of how many times as large it is.
    pub(crate) growth: f64,
}

/// The changes of patches under one relative pose.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PatchChanges {
    /// R and t.
    rotation: Matrix3<f64>,
    direction: Vector3<f64>,
    /// The centre of view `b`, seen from `a`.
    centre_b: Vector3<f64>,
}

impl PatchChanges {
    /// Those under this pose.
    pub(crate) fn under(b_from_a: &RelativePose) -> Self {
        let rotation = *b_from_a.rotation.to_rotation_matrix().matrix();
        let direction = b_from_a.direction.into_inner();
        Self {
            rotation,
            direction,
            centre_b: -rotation.tr_mul(&direction),
        }
    }

    /// The change of a patch around the scene point at `depth_a` (in baselines) on the line of sight of `a`, a point at
    /// depth 1 in view `a`. If the depth is not positive, the patch is infinitely far: the depth of a far point is
    /// uncertain and may come out behind the camera. `None` if view `b` does not see the front of the patch.
    pub(crate) fn at(&self, a: Point2<f64>, depth_a: f64) -> Option<PatchChange> {
        let sight = a.to_homogeneous();
        let mut h = self.rotation;
        if depth_a > 0.0 && depth_a < f64::INFINITY {
            let point = sight * depth_a;
            let normal = point.normalize() + (point - self.centre_b).normalize();
            h += self.direction * (normal / normal.dot(&point)).transpose();
        }
        let seen = h * sight;
        let (x, y) = (seen.x / seen.z, seen.y / seen.z);
        let row = |row: usize, at: f64| {
            [0, 1].map(|column| (h[(row, column)] - at * h[(2, column)]) / seen.z)
        };
        let ([xx, xy], [yx, yy]) = (row(0, x), row(1, y));
        let determinant = xx * yy - xy * yx;
        (determinant > 0.0).then(|| PatchChange {
            turn: libm::atan2(yx - xy, xx + yy),
            growth: 0.5 * libm::log(determinant),
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, UnitVector3};

    use super::*;

    fn pose(angles: [f64; 3], direction: [f64; 3]) -> RelativePose {
        RelativePose {
            rotation: UnitQuaternion::from_euler_angles(angles[0], angles[1], angles[2]),
            direction: UnitVector3::new_normalize(Vector3::from(direction)),
        }
    }

    #[test]
    fn a_camera_that_rolls_turns_patches_and_one_that_comes_near_enlarges_them() {
        let origin = Point2::origin();
        // Half as far away: from 2 baselines to 1.
        let roll = pose([0.0, 0.0, 0.4], [0.0, 0.0, -1.0]);
        let found = PatchChanges::under(&roll)
            .at(origin, 2.0)
            .expect("it is seen");
        assert!((found.turn - 0.4).abs() < 1e-12);
        assert!((found.growth - 2.0_f64.ln()).abs() < 1e-12);
        for depth in [f64::INFINITY, f64::NAN, -3.0, 0.0] {
            let far = PatchChanges::under(&roll)
                .at(origin, depth)
                .expect("it is seen");
            assert!((far.turn - 0.4).abs() < 1e-12 && far.growth.abs() < 1e-12);
        }
    }

    /// The change of a small circle that is drawn on the patch, measured.
    fn measured(pose: &RelativePose, a: Point2<f64>, depth: f64) -> [f64; 2] {
        let centre = a.to_homogeneous() * depth;
        let from_b = centre + pose.rotation.inverse() * pose.direction.into_inner();
        let normal = (centre.normalize() + from_b.normalize()).normalize();
        let points: Vec<_> = (0..3600)
            .map(|i| {
                let (s, c) = (f64::from(i) * std::f64::consts::TAU / 3600.0).sin_cos();
                let step = Vector3::new(c, s, 0.0) * 1e-5;
                // The point of the plane that view a sees there.
                let sight = a.to_homogeneous() + step;
                let x = sight * (normal.dot(&centre) / normal.dot(&sight));
                let x = pose.rotation * x + pose.direction.into_inner();
                (step.xy(), Point2::new(x.x / x.z, x.y / x.z))
            })
            .collect();
        let middle = points
            .iter()
            .map(|(_, b)| b.coords)
            .sum::<nalgebra::Vector2<f64>>();
        let middle = middle / points.len() as f64;
        // Of b in terms of a: sum of products, as Procrustes' rotation; and the area.
        let (mut dot, mut cross, mut area) = (0.0, 0.0, 0.0);
        for (i, (step, b)) in points.iter().enumerate() {
            let b = b.coords - middle;
            let next = points[(i + 1) % points.len()].1.coords - middle;
            dot += step.dot(&b);
            cross += step.x * b.y - step.y * b.x;
            area += 0.5 * (b.x * next.y - b.y * next.x);
        }
        [
            cross.atan2(dot),
            0.5 * (area / (std::f64::consts::PI * 1e-10)).ln(),
        ]
    }

    #[test]
    fn the_change_is_that_of_a_small_circle() {
        for (angles, direction, a, depth) in [
            ([0.1, -0.3, 0.2], [0.8, 0.1, 0.3], [0.3, -0.2], 3.0),
            ([-0.4, 0.5, 2.5], [-0.5, 0.4, -0.6], [-0.4, 0.3], 1.7),
            ([0.0, -0.7, 0.0], [1.0, 0.0, 0.1], [0.1, 0.1], 1.2),
            // Seen from near by, and then from further away: a quarter as large.
            ([0.1, 0.0, 0.3], [0.2, 0.1, 1.0], [0.2, -0.1], 0.3),
        ] {
            let pose = pose(angles, direction);
            let a = Point2::from(a);
            let found = PatchChanges::under(&pose).at(a, depth).expect("it is seen");
            let [turn, growth] = measured(&pose, a, depth);
            assert!((found.turn - turn).abs() < 1e-4, "{} {turn}", found.turn);
            assert!(
                (found.growth - growth).abs() < 1e-4,
                "{} {growth}",
                found.growth
            );
        }
    }

    #[test]
    fn what_cannot_be_seen_and_what_is_no_number_has_no_change() {
        // The camera looks back.
        let back = pose([0.0, std::f64::consts::PI, 0.0], [1.0, 0.0, 0.0]);
        assert_eq!(PatchChanges::under(&back).at(Point2::origin(), 3.0), None);
        let pose = pose([0.1, 0.2, 0.3], [1.0, 0.0, 0.0]);
        assert_eq!(
            PatchChanges::under(&pose).at(Point2::new(f64::NAN, 0.0), 3.0),
            None
        );
    }
}
