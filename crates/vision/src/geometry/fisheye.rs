//! Fisheye lenses.
//!
//! Kannala, Brandt, "A Generic Camera Model and Calibration Method for Conventional, Wide-Angle, and Fish-Eye
//! Lenses", IEEE TPAMI 28(8), 2006: its radial part, with the coefficients of OpenCV's `fisheye` module and of COLMAP's
//! model OPENCV_FISHEYE.
//!
//! Let `theta = atan(r)` be the angle between the axis and the ray to the point at `r` from the centre (depth 1). The
//! lens shows the point in the same direction from the centre, at the distance
//! `theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)`. Rays of 90 degrees and more have no point at depth 1.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Matrix2, Point2};

/// Distortion of a fisheye lens, with the coefficients in OpenCV's order and meaning.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Fisheye {
    /// Of theta^3.
    pub k1: f64,
    /// Of theta^5.
    pub k2: f64,
    /// Of theta^7.
    pub k3: f64,
    /// Of theta^9.
    pub k4: f64,
}

/// Largest angle from the axis of a point at depth 1, in radians: 0.06 degrees below a right angle. It is at 1000.
const MOST: f64 = FRAC_PI_2 - 1e-3;

/// Parts of the range of angles, in each of which the polynomial turns once at most.
const PARTS: u32 = 64;

/// Below this distance from the centre, series are used in place of quotients of small numbers.
const SMALL: f64 = 1e-5;

impl Fisheye {
    /// Where the lens moves the point that an ideal camera sees at `p` (depth 1).
    pub fn distort(&self, p: Point2<f64>) -> Point2<f64> {
        let r = p.coords.norm();
        p * self.scale(r)
    }

    /// Inverse of [`Fisheye::distort`] where the lens model has one: the lens shows the returned point at
    /// `seen`, to 1e-9 or better.
    ///
    /// No point at depth 1 is seen at a place beyond 90 degrees from the axis, or beyond the *fold*, the angle from
    /// which on the polynomial falls. There the answer is the last point before, in this direction.
    pub fn undistort(&self, seen: Point2<f64>) -> Point2<f64> {
        let distance = seen.coords.norm();
        if distance < SMALL * SMALL {
            return seen;
        }
        let theta = self.angle(distance);
        seen * (libm::tan(theta) / distance)
    }

    /// Whether a point at depth 1 is where [`Fisheye::undistort`] puts all that is seen beyond 90 degrees.
    pub(super) fn is_last(p: Point2<f64>) -> bool {
        libm::atan(p.coords.norm()) > MOST - 1e-9
    }

    /// Derivative of [`Fisheye::distort`] at `p`.
    pub fn derivative(&self, p: Point2<f64>) -> Matrix2<f64> {
        let r = p.coords.norm();
        let scale = self.scale(r);
        // Derivative of the scale by r, divided by r.
        let slope = if r < SMALL {
            2.0 * (self.k1 - 1.0 / 3.0)
        } else {
            (self.slope(libm::atan(r)) / (1.0 + r * r) - scale) / (r * r)
        };
        Matrix2::identity() * scale + p.coords * p.coords.transpose() * slope
    }

    /// The factor by which the lens moves a point at the distance `r` from the centre.
    fn scale(&self, r: f64) -> f64 {
        if r < SMALL {
            return 1.0 + (self.k1 - 1.0 / 3.0) * r * r;
        }
        self.shown(libm::atan(r)) / r
    }

    /// The distance from the centre at which a ray of this angle is seen.
    fn shown(&self, theta: f64) -> f64 {
        let t2 = theta * theta;
        theta * (1.0 + t2 * (self.k1 + t2 * (self.k2 + t2 * (self.k3 + t2 * self.k4))))
    }

    /// Derivative of [`Fisheye::shown`].
    fn slope(&self, theta: f64) -> f64 {
        let t2 = theta * theta;
        1.0 + t2
            * (3.0 * self.k1 + t2 * (5.0 * self.k2 + t2 * (7.0 * self.k3 + t2 * 9.0 * self.k4)))
    }

    /// The angle at which a point is seen at `distance`.
    fn angle(&self, distance: f64) -> f64 {
        let (mut low, mut high) = (0.0, 0.0);
        // The first part where the polynomial rises up to the distance.
        for part in 1..=PARTS {
            (low, high) = (high, MOST * f64::from(part) / f64::from(PARTS));
            let folds = self.slope(high) <= 0.0;
            if folds {
                high = self.fold(low, high);
            }
            if self.shown(high) >= distance {
                break;
            }
            if folds || part == PARTS {
                return high;
            }
        }
        // Newton's method, and bisection where it leaves the part.
        let mut theta = f64::midpoint(low, high);
        for _ in 0..100 {
            let off = self.shown(theta) - distance;
            if off > 0.0 {
                high = theta;
            } else {
                low = theta;
            }
            let newton = theta - off / self.slope(theta);
            let next = if (low..=high).contains(&newton) {
                newton
            } else {
                f64::midpoint(low, high)
            };
            let step = (next - theta).abs();
            theta = next;
            if step < 1e-15 {
                break;
            }
        }
        theta
    }

    /// The angle between `low` and `high` from which on the polynomial falls.
    fn fold(&self, mut low: f64, mut high: f64) -> f64 {
        for _ in 0..60 {
            let middle = f64::midpoint(low, high);
            if self.slope(middle) > 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;

    use super::*;

    /// A GoPro, as OpenCV calibrates it.
    const GOPRO: Fisheye = Fisheye {
        k1: 0.0436,
        k2: 0.0203,
        k3: -0.0237,
        k4: 0.0053,
    };

    /// Points at depth 1, and where OpenCV 4.14 has them (`cv2.fisheye.distortPoints`, K the identity).
    const OPENCV: [[[f64; 2]; 2]; 5] = [
        [[0.1, 0.05], [0.09964056350539753, 0.04982028175269877]],
        [[-0.7, 0.4], [-0.6022636008274038, 0.3441506290442308]],
        [[1.5, -2.0], [0.7545064204844886, -1.006008560645985]],
        [[8.0, 0.0], [1.539855418484688, 0.0]],
        [[1e-7, -2e-7], [9.999999999999854e-8, -1.999999999999971e-7]],
    ];

    #[test]
    fn points_are_where_opencv_has_them() {
        for [p, seen] in OPENCV {
            let found = GOPRO.distort(Point2::new(p[0], p[1]));
            let off = found - Point2::new(seen[0], seen[1]);
            assert!(off.norm() < 1e-12, "{p:?}: {found}");
        }
    }

    #[test]
    fn it_is_undone_up_to_the_fold_and_to_a_right_angle() {
        let mut points = 0;
        for k1 in [-0.3, -0.05, 0.0, 0.05, 0.4] {
            for k2 in [-0.1, 0.0, 0.05] {
                for k4 in [-0.01, 0.0, 0.02] {
                    let lens = Fisheye {
                        k1,
                        k2,
                        k3: 0.01,
                        k4,
                    };
                    for step in 0..300 {
                        let theta = MOST * f64::from(step) / 300.0;
                        if lens.slope(theta) < 1e-3 {
                            break;
                        }
                        let p = Point2::from(Vector2::new(0.6, -0.8) * theta.tan());
                        let back = lens.undistort(lens.distort(p));
                        let angle = back.coords.norm().atan();
                        assert!((angle - theta).abs() < 1e-9, "{lens:?}: {theta} is {angle}");
                        points += 1;
                    }
                }
            }
        }
        assert!(points > 9000, "{points}");
        assert_eq!(GOPRO.undistort(Point2::origin()), Point2::origin());
    }

    #[test]
    fn beyond_the_fold_and_a_right_angle_is_the_last_point() {
        let norm = |lens: Fisheye, at: f64| lens.undistort(Point2::new(at, 0.0)).coords.norm();
        // Without coefficients, pixels are angles.
        let angles = Fisheye::default();
        assert!((norm(angles, 1.0) - 1_f64.tan()).abs() < 1e-12);
        for at in [1.5703, 2.0, 1e100] {
            assert!((norm(angles, at) - MOST.tan()).abs() < 1e-6);
        }
        // theta (1 - theta^2 / 3) is largest at 1, where it is 2 / 3.
        let folding = Fisheye {
            k1: -1.0 / 3.0,
            ..angles
        };
        for at in [0.667, 0.8, 5.0] {
            assert!((norm(folding, at) - 1_f64.tan()).abs() < 1e-6);
        }
        assert!(norm(folding, 0.66) < norm(folding, 0.666));
        assert!(norm(folding, f64::NAN).is_nan());
    }

    #[test]
    fn the_derivative_is_that_of_the_lens() {
        for p in [
            (0.3, -0.4),
            (-3.0, 0.1),
            (1e-6, 0.0),
            (1.2e-5, 2e-6),
            (0.0, 0.0),
        ] {
            let p = Point2::new(p.0, p.1);
            let derivative = GOPRO.derivative(p);
            for axis in 0..2 {
                let mut step = Vector2::zeros();
                step[axis] = 1e-6;
                let slope = (GOPRO.distort(p + step) - GOPRO.distort(p - step)) / 2e-6;
                assert!((derivative.column(axis) - slope).norm() < 1e-8, "{p}");
            }
        }
    }
}
