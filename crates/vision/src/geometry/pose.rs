//! Relative pose of two cameras up to scale, and the error of an estimated pose.

use nalgebra::{Isometry3, UnitQuaternion, UnitVector3, Vector3};

/// Rotation and direction of translation that take a point from camera `a` to camera `b`:
/// `x_b = R x_a + s t` for an unknown scale `s > 0`. Two images cannot tell the scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativePose {
    /// R.
    pub rotation: UnitQuaternion<f64>,
    /// t, of length 1.
    pub direction: UnitVector3<f64>,
}

/// Angles between an estimated pose and the true one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseError {
    /// Angle of the rotation between the two rotations, in radians, in `[0, pi]`.
    pub rotation: f64,
    /// Angle between the two directions of translation, in radians, in `[0, pi]`. The sign counts: opposite
    /// directions are `pi` apart, since cheirality decides the sign and can decide it wrongly.
    pub translation: f64,
}

impl RelativePose {
    /// The pose without its scale; `None` where the translation is zero or not finite.
    pub fn from_isometry(b_from_a: &Isometry3<f64>) -> Option<Self> {
        Some(Self {
            rotation: b_from_a.rotation,
            direction: Self::direction_of(&b_from_a.translation.vector)?,
        })
    }

    /// The direction of a translation of any length; `None` where it is zero or not finite.
    ///
    /// Squares of lengths above 1e154 overflow, and those of lengths below 1e-154 become zero. Such a
    /// translation is first divided by its largest coordinate.
    pub fn direction_of(translation: &Vector3<f64>) -> Option<UnitVector3<f64>> {
        let largest = translation.amax();
        let scaled = if (1e-100..=1e100).contains(&largest) {
            *translation
        } else {
            translation.unscale(largest)
        };
        let direction = UnitVector3::try_new(scaled, f64::MIN_POSITIVE)?;
        direction.iter().all(|x| x.is_finite()).then_some(direction)
    }

    /// The angles between this pose and the `true_pose`.
    ///
    /// ```
    /// use matchbench_vision::geometry::RelativePose;
    /// use matchbench_vision::nalgebra::{UnitQuaternion, UnitVector3, Vector3};
    ///
    /// let towards = |x, z| RelativePose {
    ///     rotation: UnitQuaternion::identity(),
    ///     direction: UnitVector3::new_normalize(Vector3::new(x, 0.0, z)),
    /// };
    /// let error = towards(1.0, 1.0).error(&towards(1.0, 0.0));
    /// assert!((error.max().to_degrees() - 45.0).abs() < 1e-9);
    /// ```
    pub fn error(&self, true_pose: &Self) -> PoseError {
        PoseError {
            rotation: self.rotation.angle_to(&true_pose.rotation),
            translation: self.direction.angle(&true_pose.direction),
        }
    }
}

impl PoseError {
    /// The pose error of the MatchBench paper (Bian et al., Sec. 3): the larger of the two angles, in radians; NaN if
    /// one is.
    pub fn max(&self) -> f64 {
        larger(self.rotation, self.translation)
    }
}

/// The larger of two angles; NaN where one is (`f64::max` would hide it).
pub fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    fn pose(angle: f64, direction: [f64; 3]) -> RelativePose {
        RelativePose {
            rotation: UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle),
            direction: UnitVector3::new_normalize(Vector3::from(direction)),
        }
    }

    #[test]
    fn error_is_the_larger_of_the_two_angles() {
        let error = pose(0.3, [0.0, 0.0, 1.0]).error(&pose(0.1, [0.0, 0.0, 2.0]));
        assert!((error.rotation - 0.2).abs() < 1e-12);
        assert!(error.translation < 1e-7);
        assert_eq!(error.max(), error.rotation);
    }

    #[test]
    fn an_angle_that_is_not_a_number_is_no_small_error() {
        for (rotation, translation) in [(f64::NAN, 0.1), (0.1, f64::NAN), (f64::NAN, f64::NAN)] {
            let error = PoseError {
                rotation,
                translation,
            };
            assert!(error.max().is_nan(), "{error:?}");
        }
    }

    #[test]
    fn the_opposite_translation_is_180_degrees_wrong() {
        let error = pose(0.0, [1.0, 0.0, 0.0]).error(&pose(0.0, [-1.0, 0.0, 0.0]));
        assert!((error.translation - PI).abs() < 1e-7);
    }

    #[test]
    fn a_direction_has_length_1_however_long_the_translation() {
        for length in [5e-324, 1e-308, 1e-200, 1.0, 1e154, 1e200, f64::MAX] {
            let direction = RelativePose::direction_of(&Vector3::new(0.0, -length, 0.0));
            let direction = direction.expect("it is finite and not zero");
            assert_eq!(direction.into_inner(), Vector3::new(0.0, -1.0, 0.0));
            let other = RelativePose::direction_of(&Vector3::new(length, length, 0.0)).unwrap();
            assert!((other.norm() - 1.0).abs() < 1e-12);
        }
        for wrong in [f64::NAN, f64::INFINITY, 0.0] {
            assert_eq!(
                RelativePose::direction_of(&Vector3::new(0.0, wrong, 0.0)),
                None
            );
        }
        assert_eq!(
            RelativePose::direction_of(&Vector3::new(f64::NAN, 1.0, 0.0)),
            None
        );
    }

    #[test]
    fn a_pose_without_translation_has_no_direction() {
        assert_eq!(RelativePose::from_isometry(&Isometry3::identity()), None);
    }
}
