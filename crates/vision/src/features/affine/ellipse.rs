//! An ellipse about a keypoint.

use nalgebra::Matrix2;

/// An ellipse by its half axes, in pixels of the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::features) struct Ellipse {
    /// The shorter half axis and the longer one.
    pub(in crate::features) axes: [f32; 2],
    /// Unit vector along the shorter one; the longer one is a quarter turn (from x towards y) ahead.
    pub(in crate::features) direction: [f32; 2],
}

impl Ellipse {
    /// A circle.
    pub(in crate::features) const fn circle(radius: f32) -> Self {
        Self {
            axes: [radius; 2],
            direction: [1.0, 0.0],
        }
    }

    /// The ellipse of the same shape that is `factor` times as large.
    #[must_use]
    pub(in crate::features) fn scaled(self, factor: f32) -> Self {
        Self {
            axes: self.axes.map(|axis| factor * axis),
            ..self
        }
    }

    /// The longer half axis in shorter ones.
    pub(in crate::features) fn aspect(&self) -> f32 {
        self.axes[1] / self.axes[0]
    }

    /// The linear map that takes the unit circle to the ellipse, x to the shorter half axis.
    pub(in crate::features) fn map(&self) -> Matrix2<f32> {
        let ([short, long], [x, y]) = (self.axes, self.direction);
        Matrix2::new(short * x, -long * y, short * y, long * x)
    }

    /// The frame (row after row, see [`Features::frame`](super::super::Features::frame)) of this ellipse whose x axis
    /// is at an `angle`, in radians, where [`Self::map`] makes it a circle.
    pub(in crate::features) fn frame(&self, angle: f32) -> [f32; 4] {
        let (sin, cos) = libm::sincosf(angle);
        let frame = self.map() * Matrix2::new(cos, -sin, sin, cos);
        [frame.m11, frame.m12, frame.m21, frame.m22]
    }

    /// The ellipse of the same area with which a neighbourhood has gradients of equal strength in all directions, if
    /// with this one, where it is a circle, their second moments are `moments`; `None` without any gradient, or
    /// with none in one direction.
    pub(in crate::features) fn adapted(&self, moments: Matrix2<f64>) -> Option<Self> {
        let map = self.map().cast::<f64>();
        // `M mu^-1 M^T` up to a factor: the squares of the half axes are its eigenvalues.
        let adjugate = Matrix2::new(moments.m22, -moments.m12, -moments.m21, moments.m11);
        let shape = map * adjugate * map.transpose();
        let (p, q, r) = (shape.m11, 0.5 * (shape.m12 + shape.m21), shape.m22);
        let spread = ((p - r) * (p - r) + 4.0 * q * q).sqrt();
        let (long, short) = (p + r + spread, p + r - spread);
        let is_ellipse = short > 0.0 && long.is_finite();
        is_ellipse.then(|| {
            let (sin, cos) = libm::sincos(0.5 * libm::atan2(2.0 * q, p - r));
            let radius = (f64::from(self.axes[0]) * f64::from(self.axes[1])).sqrt();
            // The root of the aspect, whose square is the ratio of the eigenvalues' roots.
            let root = (long / short).sqrt().sqrt();
            Self {
                axes: [radius / root, radius * root].map(|axis| axis as f32),
                direction: [sin as f32, -cos as f32],
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_adapted_ellipse_makes_its_moments_round() {
        let ellipse = Ellipse {
            axes: [2.0, 3.0],
            direction: [0.6, 0.8],
        };
        let moments = Matrix2::new(5.0, -2.0, -2.0, 4.0);
        let adapted = ellipse.adapted(moments).expect("an ellipse");
        assert!((adapted.axes[0] * adapted.axes[1] - 6.0).abs() < 1e-5);
        // Moments of the image, seen with the new ellipse.
        let inverse = ellipse.map().cast::<f64>().try_inverse().expect("regular");
        let of_image = inverse.transpose() * moments * inverse;
        let map = adapted.map().cast::<f64>();
        let seen = map.transpose() * of_image * map;
        assert!((seen.m11 / seen.m22 - 1.0).abs() < 1e-5, "{seen}");
        assert!(seen.m12.abs() < 1e-5 * seen.m11, "{seen}");
    }

    #[test]
    fn nothing_fits_where_a_direction_has_no_gradient() {
        for moments in [
            [0.0; 4],
            [1.0, 0.0, 0.0, 0.0],
            [f64::NAN; 4],
            [1.0, 1.0, 1.0, 1.0],
        ] {
            let [a, b, c, d] = moments;
            let adapted = Ellipse::circle(2.0).adapted(Matrix2::new(a, b, c, d));
            assert_eq!(adapted, None, "{moments:?}");
        }
    }

    #[test]
    fn frames_have_the_area_of_their_ellipse_and_are_no_mirrors() {
        let ellipse = Ellipse {
            axes: [2.0, 3.0],
            direction: [-0.6, 0.8],
        };
        for angle in [0.0, 1.0, 4.0] {
            let [xx, xy, yx, yy] = ellipse.frame(angle);
            assert!((xx * yy - xy * yx - 6.0).abs() < 1e-5);
        }
        let [xx, xy, yx, yy] = ellipse.frame(0.0);
        assert_eq!([xx, yx], [2.0 * -0.6, 2.0 * 0.8]);
        assert_eq!([xy, yy], [-3.0 * 0.8, 3.0 * -0.6]);
        assert_eq!(ellipse.scaled(2.0).aspect(), 1.5);
    }
}
