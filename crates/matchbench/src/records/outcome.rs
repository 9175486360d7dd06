//! How a task ended, and how far its estimate is from the truth.

use matchbench_vision::geometry::{RelativePose, corner_error};
use matchbench_vision::image::Size;
use matchbench_vision::robust::{HomographyEstimate, NoModel, PoseProbabilities};
use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, UnitVector3, Vector3};
use serde::{Deserialize, Serialize};

/// How far a rotation, a direction or the norm of a matrix of our own may be from what it should be, for
/// rounding.
const ROUNDING: f64 = 1e-6;

/// Selected matches without which no pose is estimated.
///
/// The paper does not state this rule, nor [`MIN_SUPPORT`]; both are those of the authors'
/// evaluation, and the published results agree: no row has a count from 1 to 9.
pub const MIN_MATCHES: usize = 20;

/// Matches in front of both cameras without which a pose does not count as recovered; see
/// [`MIN_MATCHES`].
pub const MIN_SUPPORT: usize = 10;

/// How a task ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Outcome {
    /// A relative pose was estimated.
    Pose {
        /// R of `x_b = R x_a + t`, row after row.
        rotation: [f64; 9],
        /// t, of length 1.
        translation: [f64; 3],
        /// Matches that the estimator counts as inliers of its final model. In results in the authors' format, which
        /// do not know it, it is `support`.
        inliers: u32,
        /// Selected matches in front of both cameras: the paper's number of correspondences.
        support: u32,
        /// Samples drawn by the estimator.
        iterations: u32,
        /// Angle to the true rotation, in degrees.
        rotation_error: f64,
        /// Angle to the true direction of translation, in degrees, signed (0 to 180). Absent
        /// where the true translation is zero, which leaves no direction to compare with.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        translation_error: Option<f64>,
        /// The probability that the pose is right, as the matches tell; see
        /// [`TwoViews::pose_probabilities`](matchbench_vision::robust::TwoViews::pose_probabilities). Called
        /// `confidence` in runs of earlier versions. Absent from the first of them and from results of others.
        #[serde(default, alias = "confidence", skip_serializing_if = "Option::is_none")]
        pose_probability: Option<f64>,
        /// The probability that the images overlap and the matches show it; absent where `pose_probability` is.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        overlap_probability: Option<f64>,
    },
    /// The matches determine no pose; the pair counts as failed.
    NoPose {
        /// Why.
        reason: NoModel,
    },
    /// A homography was estimated.
    Homography {
        /// Takes pixels of a, as `(x, y, 1)`, to those of b; row after row, of Frobenius norm 1.
        homography: [f64; 9],
        /// Matches that agree with it.
        inliers: u32,
        /// Samples drawn by the estimator.
        iterations: u32,
        /// How far from each other it and the true homography take the corners of image a, in pixels of
        /// b: the mean over the four. Absent where a corner goes to infinity.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        corner_error: Option<f64>,
    },
    /// The matches determine no homography; the pair counts as failed.
    NoHomography {
        /// Why.
        reason: NoModel,
    },
    /// A stage broke (an image that cannot be read, an error of a matcher); the pair counts as
    /// failed and the run ends with exit code 2.
    Failed {
        /// Why, in words; what could not be read is named.
        reason: String,
        /// Whether another try may do better: a file could not be read or was damaged, or a matcher
        /// from outside gave up. Such tasks are tried again at the next start.
        #[serde(default, skip_serializing_if = "is_false")]
        may_pass: bool,
    },
}

impl Outcome {
    /// The estimated pose, if there is one.
    pub fn pose(&self) -> Option<RelativePose> {
        let Self::Pose {
            rotation,
            translation,
            ..
        } = self
        else {
            return None;
        };
        let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_row_slice(rotation));
        Some(RelativePose {
            rotation: UnitQuaternion::from_rotation_matrix(&rotation),
            direction: UnitVector3::new_normalize(Vector3::from(*translation)),
        })
    }

    /// How many matches agree with the estimate, if there is one.
    pub fn inliers(&self) -> Option<u32> {
        match self {
            Self::Pose { inliers, .. } | Self::Homography { inliers, .. } => Some(*inliers),
            Self::NoPose { .. } | Self::NoHomography { .. } | Self::Failed { .. } => None,
        }
    }

    /// The estimated pose `b_from_a`, judged by the `truth`.
    ///
    /// # Panics
    /// If the estimate holds a number that is not finite, which no record can hold.
    pub fn judged(
        b_from_a: &RelativePose,
        truth: &Isometry3<f64>,
        inliers: u32,
        support: u32,
        iterations: u32,
    ) -> Self {
        let rotation = b_from_a.rotation.to_rotation_matrix();
        let translation = b_from_a.direction.into_inner();
        assert!(
            (rotation.matrix().iter().chain(&translation)).all(|x| x.is_finite()),
            "the estimated pose has numbers that are not finite"
        );
        let error = RelativePose::from_isometry(truth).map(|truth| b_from_a.error(&truth));
        let rotation_error = error.map_or_else(
            || b_from_a.rotation.angle_to(&truth.rotation),
            |error| error.rotation,
        );
        let mut rows = [0.0; 9];
        rows.copy_from_slice(rotation.matrix().transpose().as_slice());
        Self::Pose {
            rotation: rows,
            translation: translation.into(),
            inliers,
            support,
            iterations,
            rotation_error: rotation_error.to_degrees(),
            translation_error: error.map(|error| error.translation.to_degrees()),
            pose_probability: None,
            overlap_probability: None,
        }
    }

    /// A pose with how far it can be trusted.
    ///
    /// # Panics
    /// If that holds what is no probability.
    #[must_use]
    pub fn with_probabilities(mut self, stated: PoseProbabilities) -> Self {
        let PoseProbabilities { overlap, right } = stated;
        for p in [overlap, right] {
            assert!((0.0..=1.0).contains(&p), "{p} is no probability");
        }
        if let Self::Pose {
            pose_probability,
            overlap_probability,
            ..
        } = &mut self
        {
            *pose_probability = Some(right);
            *overlap_probability = Some(overlap);
        }
        self
    }

    /// The estimated homography, judged by the `truth` in an image a of this size.
    ///
    /// # Panics
    /// If the estimate holds a number that is not finite, which no record can hold.
    pub fn judged_homography(
        estimate: &HomographyEstimate,
        truth: &Matrix3<f64>,
        size_a: Size,
    ) -> Self {
        let h = estimate.b_from_a;
        assert!(
            h.iter().all(|x| x.is_finite()),
            "the estimated homography has numbers that are not finite"
        );
        let count = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
        let error = corner_error(&h, truth, (size_a.width, size_a.height));
        let mut rows = [0.0; 9];
        rows.copy_from_slice(h.transpose().as_slice());
        Self::Homography {
            homography: rows,
            inliers: count(estimate.inliers.len()),
            iterations: count(estimate.iterations),
            corner_error: error.is_finite().then_some(error),
        }
    }

    /// The estimated homography from a to b, if there is one.
    pub fn homography(&self) -> Option<Matrix3<f64>> {
        match self {
            Self::Homography { homography, .. } => Some(Matrix3::from_row_slice(homography)),
            _ => None,
        }
    }

    /// The stated errors: two angles of a pose, one distance of a homography.
    pub(super) fn errors(&self) -> [Option<f64>; 2] {
        match *self {
            Self::Pose {
                rotation_error,
                translation_error,
                ..
            } => [Some(rotation_error), translation_error],
            Self::Homography { corner_error, .. } => [corner_error, None],
            _ => [None; 2],
        }
    }

    /// Whether there is an estimate: a pose or a homography.
    pub fn is_estimate(&self) -> bool {
        matches!(self, Self::Pose { .. } | Self::Homography { .. })
    }

    /// Whether the task broke, so that there is no result.
    pub fn has_failed(&self) -> bool {
        matches!(self, Self::Failed { .. })
    }

    /// Whether it is that of an estimator of homographies, else of poses; a failure may be of either.
    pub(super) fn is_of_homographies(&self) -> Option<bool> {
        match self {
            Self::Pose { .. } | Self::NoPose { .. } => Some(false),
            Self::Homography { .. } | Self::NoHomography { .. } => Some(true),
            Self::Failed { .. } => None,
        }
    }

    /// Whether this can be what a run recorded; see [`RunRecord::check`](super::RunRecord::check).
    pub(super) fn check(&self) -> Result<(), String> {
        match self {
            Self::Pose {
                rotation,
                translation,
                rotation_error,
                translation_error,
                pose_probability,
                overlap_probability,
                ..
            } => {
                let stated = [
                    ("pose_probability", pose_probability),
                    ("overlap_probability", overlap_probability),
                ];
                for (name, p) in stated {
                    if p.is_some_and(|p| !(0.0..=1.0).contains(&p)) {
                        return Err(format!("`{name}` is no probability"));
                    }
                }
                check_pose(rotation, translation, *rotation_error, *translation_error)
            }
            Self::Homography {
                homography,
                corner_error,
                ..
            } => check_homography(homography, *corner_error),
            Self::NoPose { .. } | Self::NoHomography { .. } | Self::Failed { .. } => Ok(()),
        }
    }
}

fn check_pose(
    rotation: &[f64; 9],
    translation: &[f64; 3],
    rotation_error: f64,
    translation_error: Option<f64>,
) -> Result<(), String> {
    let r = Matrix3::from_row_slice(rotation);
    let deviation = r.transpose() * r - Matrix3::identity();
    if !(deviation.iter().all(|x| x.abs() <= ROUNDING) && r.determinant() > 0.0) {
        return Err("`rotation` is not a rotation".into());
    }
    let length = Vector3::from(*translation).norm();
    if !(1.0 - ROUNDING..=1.0 + ROUNDING).contains(&length) {
        return Err(format!("`translation` has length {length}, not 1"));
    }
    let errors = [
        ("rotation_error", Some(rotation_error)),
        ("translation_error", translation_error),
    ];
    match errors
        .into_iter()
        .find(|(_, error)| error.is_some_and(|error| !(0.0..=180.0).contains(&error)))
    {
        Some((name, error)) => Err(format!(
            "`{name}` is {}, and an angle is from 0 to 180 degrees",
            error.unwrap_or_default()
        )),
        None => Ok(()),
    }
}

fn check_homography(homography: &[f64; 9], corner_error: Option<f64>) -> Result<(), String> {
    let h = Matrix3::from_row_slice(homography);
    let norm = h.norm();
    if !(1.0 - ROUNDING..=1.0 + ROUNDING).contains(&norm) {
        return Err(format!("`homography` has norm {norm}, not 1"));
    }
    if h.try_inverse().is_none() {
        return Err("`homography` has no inverse".into());
    }
    match corner_error.filter(|error| !(*error >= 0.0 && error.is_finite())) {
        Some(error) => Err(format!("`corner_error` is {error}, and no distance")),
        None => Ok(()),
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "as serde calls it")]
fn is_false(value: &bool) -> bool {
    !value
}

#[cfg(test)]
mod tests {
    use nalgebra::Translation3;

    use super::*;

    /// A turn by `degrees` about the y axis and a translation.
    fn motion(degrees: f64, translation: [f64; 3]) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::from(Vector3::from(translation)),
            UnitQuaternion::from_axis_angle(&Vector3::y_axis(), degrees.to_radians()),
        )
    }

    fn errors(outcome: &Outcome) -> (f64, Option<f64>) {
        let Outcome::Pose {
            rotation_error,
            translation_error,
            ..
        } = outcome
        else {
            panic!("{outcome:?} is no pose")
        };
        (*rotation_error, *translation_error)
    }

    #[test]
    fn a_probability_is_read_by_its_earlier_name() {
        let truth = motion(3.0, [0.0, 0.0, 0.5]);
        let estimate = RelativePose::from_isometry(&truth).unwrap();
        let stated = PoseProbabilities {
            right: 0.25,
            overlap: 0.5,
        };
        let outcome = Outcome::judged(&estimate, &truth, 9, 12, 100).with_probabilities(stated);
        let text = serde_json::to_string(&outcome).unwrap();
        assert!(text.contains("\"pose_probability\":0.25"), "{text}");
        let earlier = text.replace("pose_probability", "confidence");
        assert_eq!(serde_json::from_str::<Outcome>(&earlier).unwrap(), outcome);
    }

    #[test]
    fn errors_are_in_degrees_and_the_translation_is_signed() {
        let estimate = RelativePose::from_isometry(&motion(10.0, [0.0, 0.0, -2.0])).unwrap();
        let outcome = Outcome::judged(&estimate, &motion(3.0, [0.0, 0.0, 0.5]), 9, 12, 100);
        let (rotation, translation) = errors(&outcome);
        assert!((rotation - 7.0).abs() < 1e-9, "{rotation}");
        assert!((translation.unwrap() - 180.0).abs() < 1e-6);
    }

    #[test]
    fn the_estimated_pose_can_be_taken_out_again() {
        let estimate = RelativePose::from_isometry(&motion(10.0, [0.3, 0.1, -2.0])).unwrap();
        let outcome = Outcome::judged(&estimate, &Isometry3::identity(), 9, 12, 100);
        let error = outcome.pose().unwrap().error(&estimate);
        assert!(error.max() < 1e-7, "{error:?}");
        let failed = Outcome::Failed {
            reason: String::new(),
            may_pass: false,
        };
        assert_eq!(failed.pose(), None);
    }

    #[test]
    fn without_a_baseline_only_the_rotation_is_judged() {
        let estimate = RelativePose::from_isometry(&motion(2.0, [1.0, 0.0, 0.0])).unwrap();
        let outcome = Outcome::judged(&estimate, &motion(0.0, [0.0; 3]), 0, 0, 0);
        let (rotation, translation) = errors(&outcome);
        assert!((rotation - 2.0).abs() < 1e-9 && translation.is_none());
    }

    #[test]
    fn the_rotation_is_written_row_after_row() {
        let estimate = RelativePose::from_isometry(&motion(90.0, [1.0, 0.0, 0.0])).unwrap();
        let outcome = Outcome::judged(&estimate, &Isometry3::identity(), 0, 0, 0);
        let Outcome::Pose { rotation, .. } = outcome else {
            panic!("a pose was judged")
        };
        let expected = [0.0, 0.0, 1.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0];
        assert!(
            (rotation.iter().zip(expected))
                .all(|(found, expected)| (found - expected).abs() < 1e-15)
        );
    }

    #[test]
    #[should_panic(expected = "not finite")]
    fn a_pose_that_is_not_a_number_is_refused() {
        let estimate = RelativePose {
            rotation: UnitQuaternion::identity(),
            direction: UnitVector3::new_unchecked(Vector3::new(f64::NAN, 0.0, 0.0)),
        };
        let _ = Outcome::judged(&estimate, &Isometry3::identity(), 0, 0, 0);
    }
    #[test]
    fn a_homography_is_judged_by_the_corners_and_can_be_taken_out_again() {
        let estimate = HomographyEstimate {
            b_from_a: Matrix3::new(2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0).normalize(),
            inliers: vec![1, 4, 6],
            iterations: 20,
        };
        let judged = |truth| Outcome::judged_homography(&estimate, truth, Size::new(4, 5));
        let identity = Matrix3::identity();
        let outcome = judged(&identity);
        let Outcome::Homography {
            corner_error,
            inliers,
            ..
        } = outcome
        else {
            panic!("a homography was judged")
        };
        assert!((corner_error.unwrap() - 3.0).abs() < 1e-12 && inliers == 3);
        assert_eq!(outcome.homography(), Some(estimate.b_from_a));
        assert_eq!((outcome.pose(), outcome.check()), (None, Ok(())));
        // The truth takes the last row to infinity.
        let vanishing = Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 4.0);
        let Outcome::Homography { corner_error, .. } = judged(&vanishing) else {
            panic!("a homography was judged")
        };
        assert_eq!(corner_error, None);
    }
}
