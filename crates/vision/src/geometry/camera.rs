//! A pinhole camera with optional lens distortion.

use std::fmt;

use nalgebra::{Matrix3, Point2};

use super::lens::Lens;

/// Pinhole camera: `u = fx x + cx`, `v = fy y + cy` for the point (x, y) at depth 1, after lens
/// distortion. Lengths are in pixels; pixel centres are at integers.
///
/// ```
/// use matchbench_vision::geometry::Camera;
/// use matchbench_vision::nalgebra::Point2;
///
/// let camera = Camera::pinhole(525.0, 525.0, 319.5, 239.5);
/// assert_eq!(camera.normalize(Point2::new(319.5, 239.5)), Point2::origin());
/// assert_eq!(camera.project(Point2::new(1.0, 0.0)), Point2::new(844.5, 239.5));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Camera {
    /// Horizontal focal length, in pixels.
    pub fx: f64,
    /// Vertical focal length, in pixels.
    pub fy: f64,
    /// Column of the principal point.
    pub cx: f64,
    /// Row of the principal point.
    pub cy: f64,
    /// Lens distortion, if the images are not rectified.
    #[cfg_attr(
        feature = "serde",
        serde(default, skip_serializing_if = "Option::is_none")
    )]
    pub distortion: Option<Lens>,
}

/// Why a matrix or a set of numbers is not a valid camera.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraError(String);

impl fmt::Display for CameraError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for CameraError {}

impl Camera {
    /// A camera without distortion. The numbers are taken as they are; those of others should pass
    /// [`check`](Self::check), since all that uses a camera relies on it.
    pub const fn pinhole(fx: f64, fy: f64, cx: f64, cy: f64) -> Self {
        Self {
            fx,
            fy,
            cx,
            cy,
            distortion: None,
        }
    }

    /// The camera whose calibration matrix is `[fx 0 cx; 0 fy cy; 0 0 1]`.
    ///
    /// # Errors
    /// If the matrix has another form, a number that is not finite or a focal length that is not
    /// positive.
    pub fn from_matrix(k: &Matrix3<f64>) -> Result<Self, CameraError> {
        if !k.iter().all(|x| x.is_finite()) {
            return Err(CameraError(
                "the calibration matrix has a number that is not finite".into(),
            ));
        }
        if k[(0, 1)] != 0.0 {
            return Err(CameraError(format!(
                "the calibration matrix has skew {}: only cameras without skew are supported",
                k[(0, 1)]
            )));
        }
        if (k[(1, 0)], k[(2, 0)], k[(2, 1)], k[(2, 2)]) != (0.0, 0.0, 0.0, 1.0) {
            return Err(CameraError(
                "the calibration matrix is not [fx 0 cx; 0 fy cy; 0 0 1]".into(),
            ));
        }
        let camera = Self::pinhole(k[(0, 0)], k[(1, 1)], k[(0, 2)], k[(1, 2)]);
        camera.check().map(|()| camera)
    }

    /// Checks that a camera can have these numbers: all are finite, focal lengths are positive and not below
    /// [`Camera::MIN_FOCAL`], no length is above [`Camera::MAX_PIXELS`], and no coefficient of the lens is
    /// above [`Camera::MAX_DISTORTION`] in size.
    ///
    /// # Errors
    /// The first number that is not allowed.
    pub fn check(&self) -> Result<(), CameraError> {
        let Self { fx, fy, cx, cy, .. } = *self;
        if fx < Self::MIN_FOCAL || fy < Self::MIN_FOCAL {
            return Err(CameraError(format!(
                "focal lengths must be positive, {} pixels at least, found fx {fx:?} and fy {fy:?}",
                Self::MIN_FOCAL
            )));
        }
        let pixels = [("fx", fx), ("fy", fy), ("cx", cx), ("cy", cy)]
            .map(|(name, x)| (name, x, Self::MAX_PIXELS));
        let lens = self.distortion.iter().flat_map(Lens::coefficients);
        let lens = lens.map(|(name, x)| (name, x, Self::MAX_DISTORTION));
        match (pixels.into_iter().chain(lens)).find(|(_, x, most)| x.is_nan() || x.abs() > *most) {
            Some((name, x, most)) => Err(CameraError(format!(
                "{name} is {x:?}; no camera has one beyond {most}"
            ))),
            None => Ok(()),
        }
    }

    /// Least focal length in pixels. The coordinates of rays must be numbers that can be squared.
    pub const MIN_FOCAL: f64 = 1e-3;
    /// Largest focal length and coordinate of the principal point, in pixels.
    pub const MAX_PIXELS: f64 = 1e7;
    /// Largest coefficient of lens distortion; those of real lenses are below 10.
    pub const MAX_DISTORTION: f64 = 1e3;

    /// The calibration matrix `K`.
    pub fn matrix(&self) -> Matrix3<f64> {
        Matrix3::new(self.fx, 0.0, self.cx, 0.0, self.fy, self.cy, 0.0, 0.0, 1.0)
    }

    /// Mean of the two focal lengths, in pixels: turns a pixel threshold into a normalised one.
    pub fn mean_focal(&self) -> f64 {
        f64::midpoint(self.fx, self.fy)
    }

    /// The point at depth 1 that is seen at `pixel`: calibration and distortion are undone.
    pub fn normalize(&self, pixel: Point2<f64>) -> Point2<f64> {
        let distorted = Point2::new((pixel.x - self.cx) / self.fx, (pixel.y - self.cy) / self.fy);
        self.distortion
            .map_or(distorted, |lens| lens.undistort(distorted))
    }

    /// The pixel where the model of the lens has the point at depth 1. Polynomials that were fitted to an image may fold
    /// and bring points far beside it back into it: [`Camera::seen_at`] leaves those out.
    pub fn project(&self, normalized: Point2<f64>) -> Point2<f64> {
        let distorted = self
            .distortion
            .map_or(normalized, |lens| lens.distort(normalized));
        self.pixel_of(distorted)
    }

    /// The pixel where the point at depth 1 is seen on an image that is large enough; `None` where the lens cannot show
    /// it, so that another point is seen at the pixel that it is [projected](Camera::project) to.
    pub fn seen_at(&self, normalized: Point2<f64>) -> Option<Point2<f64>> {
        let Some(lens) = self.distortion else {
            return Some(self.pixel_of(normalized));
        };
        let distorted = lens.distort(normalized);
        let there = lens.undistort(distorted);
        // Where the model is about to fold, a pixel says little of what is seen there.
        let is_seen = (there - normalized).norm() <= 1e-3 * normalized.coords.norm().max(1.0);
        is_seen.then(|| self.pixel_of(distorted))
    }

    fn pixel_of(&self, distorted: Point2<f64>) -> Point2<f64> {
        Point2::new(
            self.fx * distorted.x + self.cx,
            self.fy * distorted.y + self.cy,
        )
    }
}

#[cfg(test)]
mod tests {
    use crate::geometry::Distortion;

    use super::*;

    #[test]
    fn the_mean_focal_length_is_that_of_both_axes() {
        assert_eq!(Camera::pinhole(500.0, 700.0, 1.0, 2.0).mean_focal(), 600.0);
    }

    /// Brown's model with k1 alone is seen up to where `r (1 + k1 r^2)` is largest, at `r^2 = -1 / (3 k1)`.
    #[test]
    fn what_a_lens_folds_back_into_the_image_is_not_seen() {
        let camera = Camera {
            distortion: Some(Lens::Brown(Distortion {
                k1: -0.1,
                ..Distortion::default()
            })),
            ..Camera::pinhole(1000.0, 1000.0, 1000.0, 750.0)
        };
        let fold = (10.0_f64 / 3.0).sqrt();
        for (share, sees) in [
            (0.0, true),
            (0.5, true),
            (0.99, true),
            (1.01, false),
            (1.5, false),
            (1.9, false),
        ] {
            let point = Point2::new(0.8, -0.6) * (share * fold);
            let expected = sees.then(|| camera.project(point));
            assert_eq!(camera.seen_at(point), expected, "{share}");
        }
        // 3 / 10 of what an ideal camera sees at 3, which is in the image.
        let seen = camera.project(Point2::new(3.0, 0.0));
        assert!(
            (seen - Point2::new(1300.0, 750.0)).norm() < 1e-9
                && camera.seen_at(Point2::new(3.0, 0.0)).is_none()
        );
        let far = Point2::new(1e6, 0.0);
        assert_eq!(Camera::pinhole(1.0, 1.0, 0.0, 0.0).seen_at(far), Some(far));
        assert_eq!(camera.seen_at(Point2::new(f64::NAN, 0.0)), None);
    }

    /// The colour camera of TUM's freiburg1, the strongest lens among the supported datasets.
    const FREIBURG1: Camera = Camera {
        fx: 517.3,
        fy: 516.5,
        cx: 318.6,
        cy: 255.3,
        distortion: Some(Lens::Brown(Distortion {
            k1: 0.2624,
            k2: -0.9531,
            p1: -0.0054,
            p2: 0.0026,
            k3: 1.1633,
        })),
    };

    #[test]
    fn projecting_undoes_normalizing_over_the_whole_image() {
        for (u, v) in [
            (0.0, 0.0),
            (639.0, 0.0),
            (0.0, 479.0),
            (639.0, 479.0),
            (320.5, 200.25),
        ] {
            let pixel = Point2::new(u, v);
            let back = FREIBURG1.project(FREIBURG1.normalize(pixel));
            assert!((back - pixel).norm() < 1e-9, "{pixel} comes back as {back}");
        }
    }

    #[test]
    fn skew_is_refused_by_name() {
        let mut k = FREIBURG1.matrix();
        k[(0, 1)] = 0.5;
        assert!(
            Camera::from_matrix(&k)
                .unwrap_err()
                .to_string()
                .contains("skew 0.5")
        );
    }

    #[test]
    fn what_no_camera_has_is_refused_by_name() {
        type Change = fn(&mut Camera);
        assert_eq!(FREIBURG1.check(), Ok(()));
        let cases: [(Change, &str); 7] = [
            (|c| c.fx = 0.0, "positive"),
            (|c| c.fy = -500.0, "positive"),
            (|c| c.fx = f64::NAN, "fx is NaN"),
            (|c| c.fy = f64::INFINITY, "fy is inf"),
            (|c| c.cx = f64::NAN, "cx is NaN"),
            (|c| c.cy = 1e300, "cy is 1"),
            (
                |c| {
                    let lens = Distortion {
                        k3: 1e9,
                        ..Distortion::default()
                    };
                    c.distortion = Some(lens.into());
                },
                "k3 is 1000000000",
            ),
        ];
        for (change, named) in cases {
            let mut camera = FREIBURG1;
            change(&mut camera);
            let message = camera.check().unwrap_err().to_string();
            assert!(message.contains(named), "{message}");
        }
    }

    #[test]
    fn matrix_comes_back() {
        let camera = Camera::pinhole(2759.48, 2764.16, 1520.69, 1006.81);
        assert_eq!(Camera::from_matrix(&camera.matrix()), Ok(camera));
    }
}
