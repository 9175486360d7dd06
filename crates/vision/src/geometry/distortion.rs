//! Radial and tangential lens distortion.

use nalgebra::{Matrix2, Point2};

/// Radial and tangential lens distortion (Brown, "Close-Range Camera Calibration", 1971), with
/// the coefficients in OpenCV's order and meaning.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distortion {
    /// Radial, of r^2.
    pub k1: f64,
    /// Radial, of r^4.
    pub k2: f64,
    /// Tangential.
    pub p1: f64,
    /// Tangential.
    pub p2: f64,
    /// Radial, of r^6.
    pub k3: f64,
}

impl Distortion {
    /// Where the lens moves the point that an ideal camera sees at `p` (depth 1).
    pub fn distort(&self, p: Point2<f64>) -> Point2<f64> {
        let r2 = p.x * p.x + p.y * p.y;
        let radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3));
        let (dx, dy) = self.tangential(p, r2);
        Point2::new(p.x * radial + dx, p.y * radial + dy)
    }

    /// Inverse of [`Distortion::distort`] where the lens model has one: the lens shows the returned point at
    /// `seen`, to 1e-9 or better.
    ///
    /// The method is fixed-point iteration, and Newton's method where that does not converge (k1 r^2 above 1,
    /// or close to the fold). The *fold* is the radius beyond which the lens model maps points back inwards. No
    /// point is seen at a place beyond the fold; there the answer is the last finite point of the iteration.
    pub fn undistort(&self, seen: Point2<f64>) -> Point2<f64> {
        let mut p = seen;
        for _ in 0..50 {
            let r2 = p.x * p.x + p.y * p.y;
            let radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3));
            let (dx, dy) = self.tangential(p, r2);
            let next = Point2::new((seen.x - dx) / radial, (seen.y - dy) / radial);
            let step = (next - p).abs().max();
            if !step.is_finite() {
                break;
            }
            p = next;
            if step < 1e-14 {
                return p;
            }
        }
        if is_close(self.distort(p), seen) {
            return p;
        }
        self.undistort_by_newton(seen).unwrap_or(p)
    }

    /// Newton's method, started on the axis, where no lens moves a point. A step is halved until it reduces the
    /// error by at least half of what it promises and does not cross the fold, where the determinant of the
    /// derivative changes its sign.
    fn undistort_by_newton(&self, seen: Point2<f64>) -> Option<Point2<f64>> {
        let mut p = Point2::origin();
        let mut missing = seen.coords;
        let mut step = missing;
        let mut part = 1.0;
        for _ in 0..100 {
            let next = p + step * part;
            if next == p {
                break;
            }
            let left = seen - self.distort(next);
            let derivative = self.derivative(next);
            if left.norm() <= (1.0 - part / 2.0) * missing.norm() && derivative.determinant() > 0.0
            {
                (p, missing, part) = (next, left, 1.0);
                step = derivative.try_inverse()? * left;
            } else {
                part /= 2.0;
            }
        }
        is_close(self.distort(p), seen).then_some(p)
    }

    /// Derivative of [`Distortion::distort`] at `p`.
    pub fn derivative(&self, p: Point2<f64>) -> Matrix2<f64> {
        let Self { k1, k2, p1, p2, k3 } = *self;
        let (x, y) = (p.x, p.y);
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        // The derivative of the factor is this times (x, y).
        let slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));
        let mixed = slope * x * y + 2.0 * (p1 * x + p2 * y);
        Matrix2::new(
            radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x,
            mixed,
            mixed,
            radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x,
        )
    }

    fn tangential(&self, p: Point2<f64>, r2: f64) -> (f64, f64) {
        (
            2.0 * self.p1 * p.x * p.y + self.p2 * (r2 + 2.0 * p.x * p.x),
            self.p1 * (r2 + 2.0 * p.y * p.y) + 2.0 * self.p2 * p.x * p.y,
        )
    }
}

/// Whether two points are the same to 1e-9, relative to their size where that is above 1.
fn is_close(p: Point2<f64>, q: Point2<f64>) -> bool {
    (p - q).norm() <= 1e-9 * q.coords.norm().max(1.0)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;

    use super::*;

    /// That of the colour camera of TUM's freiburg1, the strongest among the supported datasets.
    const FREIBURG1: Distortion = Distortion {
        k1: 0.2624,
        k2: -0.9531,
        p1: -0.0054,
        p2: 0.0026,
        k3: 1.1633,
    };

    /// Radii from the axis to where the lens folds, at most 1.5, in the direction of `angle`.
    fn radii_before_the_fold(lens: &Distortion, angle: f64) -> impl Iterator<Item = Point2<f64>> {
        let direction = Vector2::new(angle.cos(), angle.sin());
        (1..=150)
            .map(move |step| Point2::from(direction * (f64::from(step) / 100.0 - 0.003)))
            .take_while(|&p| lens.derivative(p).determinant() > 1e-3)
    }

    #[test]
    fn strong_lenses_are_undone_wherever_they_do_not_fold() {
        let mut points = 0;
        for k1 in [-0.45, -0.3, -0.1, 0.3, 0.8, 1.2, 1.5] {
            for k2 in [-0.5, -0.1, 0.0, 0.2, 1.0] {
                for (p1, p2) in [(0.0, 0.0), (0.01, -0.02), (-0.03, 0.005)] {
                    let k3 = 0.0;
                    let lens = Distortion { k1, k2, p1, p2, k3 };
                    for angle in 0..8 {
                        for p in radii_before_the_fold(&lens, f64::from(angle) * 0.8) {
                            let back = lens.undistort(lens.distort(p));
                            // The derivative may be as small as 1e-3.
                            assert!((back - p).norm() < 1e-5, "{lens:?}: {p} is {back}");
                            assert!(is_close(lens.distort(back), lens.distort(p)));
                            points += 1;
                        }
                    }
                }
            }
        }
        assert!(points > 50_000, "{points}");
    }

    #[test]
    fn beyond_the_fold_the_answer_is_finite() {
        let lens = Distortion {
            k1: -0.45,
            ..Distortion::default()
        };
        // At most 0.574 is seen.
        for x in [0.6, 1.0, 3.0] {
            let p = lens.undistort(Point2::new(x, 0.1));
            assert!(p.x.is_finite() && p.y.is_finite(), "{p}");
        }
        // The first step would divide by zero.
        for (k1, x) in [(-1.0, 1.0), (-0.25, 2.0)] {
            let lens = Distortion {
                k1,
                ..Distortion::default()
            };
            let p = lens.undistort(Point2::new(x, 0.0));
            assert!(p.x.is_finite() && p.y.is_finite(), "{p}");
        }
    }

    #[test]
    fn the_derivative_is_that_of_the_lens() {
        let lens = FREIBURG1;
        for p in [Point2::new(0.3, -0.4), Point2::new(-0.6, 0.1)] {
            let derivative = lens.derivative(p);
            for axis in 0..2 {
                let mut step = Vector2::zeros();
                step[axis] = 1e-6;
                let slope = (lens.distort(p + step) - lens.distort(p - step)) / 2e-6;
                assert!((derivative.column(axis) - slope).norm() < 1e-8);
            }
        }
    }
}
