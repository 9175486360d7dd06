//! One line of `records/<dataset>/<matcher>+<estimator>.jsonl`.

use matchbench_vision::geometry::RelativePose;
use matchbench_vision::robust::NoPose;
use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, UnitVector3, Vector3};
use serde::{Deserialize, Serialize};

/// How far a rotation or a direction of our own may be from one, for rounding.
const ROUNDING: f64 = 1e-6;

/// Everything that one task left behind. Apart from [`RunRecord::times`] it is the same, bit for
/// bit, on every machine and for any number of threads.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunRecord {
    /// What was to be done.
    pub task: Task,
    /// How many features and matches there were at each stage.
    pub counts: Counts,
    /// What came out.
    pub outcome: Outcome,
    /// How long each stage took.
    pub times: StageTimes,
    /// What a matcher from outside computed on, by its own word.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device: Option<String>,
}

impl RunRecord {
    /// Whether this can be what a run recorded: rotations that are rotations, directions of length 1,
    /// errors from 0 to 180 degrees, times that are times. Records are files, and files can hold
    /// anything.
    ///
    /// # Errors
    /// The first thing that cannot be, in words.
    pub fn check(&self) -> Result<(), String> {
        if self.task.a == self.task.b {
            return Err(format!("frame {} is matched with itself", self.task.a));
        }
        for seconds in self.times.all() {
            if !(seconds >= 0.0 && seconds.is_finite()) {
                return Err(format!("{seconds} seconds are no time"));
            }
        }
        let Outcome::Pose {
            rotation,
            translation,
            rotation_error,
            translation_error,
            ..
        } = &self.outcome
        else {
            return Ok(());
        };
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
            ("translation_error", translation_error.as_ref()),
        ];
        match errors
            .into_iter()
            .find(|(_, error)| error.is_some_and(|error| !(0.0..=180.0).contains(error)))
        {
            Some((name, error)) => Err(format!(
                "`{name}` is {}, and an angle is from 0 to 180 degrees",
                error.copied().unwrap_or_default()
            )),
            None => Ok(()),
        }
    }
}

/// The smallest unit of a run: one pair, one matcher, one estimator, one seed.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// Name of the dataset.
    pub dataset: String,
    /// Id of the matcher.
    pub matcher: String,
    /// Id of the estimator.
    pub estimator: String,
    /// Index of the first frame.
    pub a: u32,
    /// Index of the second frame.
    pub b: u32,
    /// 0 for the first seed, 1 for the second ...
    pub repetition: u32,
}

/// Numbers of features and matches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Counts {
    /// Features of image `a`.
    pub features_a: u32,
    /// Features of image `b`.
    pub features_b: u32,
    /// Matches after the search.
    pub putative: u32,
    /// Matches after the selection; these go to the estimator.
    pub selected: u32,
}

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
        /// Matches that agree with the model in the consensus stage.
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
    },
    /// The matches determine no pose; the pair counts as failed.
    NoPose {
        /// Why.
        reason: NoPose,
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
        }
    }
}

/// Wall-clock time of each stage, in seconds; absent where the stage was not reached, or its
/// result was there already: read from a cache, or computed for an earlier record (the features
/// of an image serve many pairs, the matches of a pair serve many estimators). So each stage that
/// was computed is timed in exactly one record.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StageTimes {
    /// Detection and description in image `a`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub extract_a: Option<f64>,
    /// Detection and description in image `b`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub extract_b: Option<f64>,
    /// Search for putative correspondences.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search: Option<f64>,
    /// Selection.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub select: Option<f64>,
    /// Pose estimation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub estimate: Option<f64>,
    /// All before the estimation as it was waited for, where a matcher from outside did it: the times
    /// of those stages are then its own word.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outside: Option<f64>,
}

impl StageTimes {
    /// Every time that is known.
    fn all(&self) -> impl Iterator<Item = f64> {
        let Self {
            extract_a,
            extract_b,
            search,
            select,
            estimate,
            outside,
        } = *self;
        let times = [extract_a, extract_b, search, select, estimate, outside];
        times.into_iter().flatten()
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
    fn a_record_survives_its_line_bit_for_bit() {
        let estimate = RelativePose::from_isometry(&motion(0.1, [0.1, 0.2, 0.3])).unwrap();
        let record = RunRecord {
            task: Task {
                dataset: "office".into(),
                matcher: "sift".into(),
                estimator: "ransac-e".into(),
                a: 3,
                b: 4,
                repetition: 0,
            },
            counts: Counts::default(),
            outcome: Outcome::judged(&estimate, &motion(0.3, [1.0, 2.0, 0.1]), 9, 12, 100),
            times: StageTimes {
                search: Some(0.1 + 0.2),
                ..StageTimes::default()
            },
            device: None,
        };
        let line = serde_json::to_string(&record).unwrap();
        assert_eq!(serde_json::from_str::<RunRecord>(&line).unwrap(), record);
    }
}
