//! What a score needs to know of one pair.

use matchbench_vision::geometry::larger;
use serde::Serialize;

use crate::records::{ByDepth, Counts, Outcome, RunRecord, StageTimes};

use super::Failure;

/// Pixels within which a keypoint is found again, and a match is correct, in the scores of detectors.
pub(super) const FOUND_PX: usize = 3;

/// The result of one pair, whoever computed it.
#[derive(Clone, Debug, PartialEq)]
pub struct PairResult {
    /// Index of the first frame, the reference image of its pairs.
    pub a: u32,
    /// Index of the second frame.
    pub b: u32,
    /// 0 for the first seed, 1 for the second ...
    pub repetition: u32,
    /// What was to be estimated.
    pub model: Model,
    /// How far the estimate is from the truth, or why there is none.
    pub outcome: Result<Deviation, Failure>,
    /// Correspondences that support the estimate, 0 if there is no estimate; `None` if the results do not say.
    pub correspondences: Option<u32>,
    /// The probability that the pose is right, as the matches told; `None` where there is no pose, or nobody said.
    pub pose_probability: Option<f64>,
    /// The probability that the images overlap and the matches show it; `None` likewise.
    pub overlap_probability: Option<f64>,
    /// Selected matches within 1, 2, ... 10 pixels of where the true homography takes them; `None`
    /// where there is none.
    pub correct: Option<[u32; 10]>,
    /// Keypoints that could be found in both images, the smaller number of both, and those that were, within
    /// 3 pixels; where the true homography tells.
    pub found_again: Option<(u32, u32)>,
    /// What the depth of both images says; `None` where there is none, as in most runs, so that it is kept apart.
    pub by_depth: Option<Box<ByDepth>>,
    /// Numbers of features and matches, where they were recorded.
    pub counts: Option<Counts>,
    /// Stage times, where they were taken.
    pub times: StageTimes,
}

/// What is estimated from matches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Model {
    /// The relative pose of two cameras.
    #[default]
    Pose,
    /// The homography between two images.
    Homography,
}

/// How far an estimate is from the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Deviation {
    /// Of a pose.
    Pose(AngularError),
    /// Of a pose, the larger of both angles in degrees, where nothing else is told.
    Larger(f64),
    /// Of a homography: the mean distance of the corners of image a, in pixels of b; `None` where one
    /// of them goes to infinity.
    Corners(Option<f64>),
}

/// Distance of an estimated pose from the true one, in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AngularError {
    /// Angle of the rotation that takes one to the other, in `[0, 180]`.
    pub rotation: f64,
    /// Angle between the directions of translation, in `[0, 180]`; opposite directions are 180
    /// apart. `None` where the true translation is zero and has no direction.
    pub translation: Option<f64>,
}

/// Which angle a score is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Angle {
    /// The paper's pose error `e = max(e_r, e_t)`.
    Pose,
    /// The rotation error `e_r` alone.
    Rotation,
    /// The translation error `e_t` alone.
    Translation,
}

impl AngularError {
    /// The larger of the two angles; `None` where the true translation has no direction.
    ///
    /// The formula of the paper is undefined there (the angle to a zero vector), and an undefined
    /// error is below no threshold: such a pair cannot be a success. The published datasets have
    /// none (their shortest baseline is 0.1 mm), so their scores do not depend on this choice.
    /// The rotation is still judged, by [`Angle::Rotation`].
    pub fn pose(&self) -> Option<f64> {
        self.translation.map(|t| larger(t, self.rotation))
    }

    /// Like [`AngularError::pose`], but a translation and its opposite count as the same:
    /// `max(e_r, min(e_t, 180 - e_t))`, the error of SuperGlue and its followers.
    pub fn sign_agnostic(&self) -> Option<f64> {
        self.translation
            .map(|t| larger(t.min(180.0 - t), self.rotation))
    }
}

impl PairResult {
    /// A pair without an estimate.
    pub fn failed(a: u32, b: u32, failure: Failure) -> Self {
        Self {
            a,
            b,
            repetition: 0,
            model: Model::Pose,
            outcome: Err(failure),
            correspondences: Some(0),
            pose_probability: None,
            overlap_probability: None,
            correct: None,
            found_again: None,
            by_depth: None,
            counts: None,
            times: StageTimes::default(),
        }
    }

    /// Whether the answer is that the images have no overlap, as far as the matches tell: that is more likely than not.
    pub fn has_no_overlap(&self) -> bool {
        self.overlap_probability.is_some_and(|p| p < 0.5)
    }

    /// A pair that was judged, without counts and times.
    pub fn of(a: u32, b: u32, outcome: &Outcome) -> Self {
        let model = Model::of(outcome).unwrap_or_default();
        let [pose_probability, overlap_probability] = stated(outcome);
        let (outcome, correspondences) = scored(outcome);
        Self {
            model,
            outcome,
            correspondences: Some(correspondences),
            pose_probability,
            overlap_probability,
            ..Self::failed(a, b, Failure::Missing)
        }
    }

    /// One angle of the error, in degrees; `None` where there is no pose, or no true direction, or only the larger
    /// angle was told and another is asked for.
    pub fn error(&self, angle: Angle) -> Option<f64> {
        if let Some(larger) = self.larger_error() {
            return (angle == Angle::Pose).then_some(larger);
        }
        let error = self.angular_error()?;
        match angle {
            Angle::Pose => error.pose(),
            Angle::Rotation => Some(error.rotation),
            Angle::Translation => error.translation,
        }
    }

    /// The sign-agnostic pose error in degrees, where there is one; where only the larger angle was told, that.
    pub fn sign_agnostic_error(&self) -> Option<f64> {
        (self.larger_error()).or_else(|| self.angular_error()?.sign_agnostic())
    }

    /// The pose error of a pair of which nothing else was told.
    pub(super) fn larger_error(&self) -> Option<f64> {
        match self.outcome {
            Ok(Deviation::Larger(error)) => Some(error),
            _ => None,
        }
    }

    /// How far the estimated pose is from the true one, where there is one and both angles were told.
    pub fn angular_error(&self) -> Option<AngularError> {
        match self.outcome {
            Ok(Deviation::Pose(error)) => Some(error),
            _ => None,
        }
    }

    /// The error that the pair is judged by, where there is one: of poses that of the pose in degrees, of
    /// homographies that of the corners in pixels.
    pub fn judged_error(&self) -> Option<f64> {
        match self.model {
            Model::Pose => self.error(Angle::Pose),
            Model::Homography => self.corner_error(),
        }
    }

    /// The corner error of the estimated homography in pixels, where there is one.
    pub fn corner_error(&self) -> Option<f64> {
        match self.outcome {
            Ok(Deviation::Corners(error)) => error,
            _ => None,
        }
    }
}

impl Model {
    /// What an outcome is of; a broken task does not say.
    fn of(outcome: &Outcome) -> Option<Self> {
        match outcome {
            Outcome::Pose { .. } | Outcome::NoPose { .. } => Some(Self::Pose),
            Outcome::Homography { .. } | Outcome::NoHomography { .. } => Some(Self::Homography),
            Outcome::Failed { .. } => None,
        }
    }

    /// What all of these results are of: those of broken tasks do not say.
    pub(crate) fn of_all(pairs: &[PairResult]) -> Self {
        let homography = |pair: &PairResult| pair.model == Self::Homography;
        if pairs.iter().any(homography) {
            Self::Homography
        } else {
            Self::Pose
        }
    }
}

/// What an outcome comes to, and how many correspondences it counts.
pub(super) fn scored(outcome: &Outcome) -> (Result<Deviation, Failure>, u32) {
    match outcome {
        Outcome::Pose {
            support,
            rotation_error,
            translation_error,
            ..
        } => {
            let error = AngularError {
                rotation: *rotation_error,
                translation: *translation_error,
            };
            (Ok(Deviation::Pose(error)), *support)
        }
        Outcome::Homography {
            inliers,
            corner_error,
            ..
        } => (Ok(Deviation::Corners(*corner_error)), *inliers),
        Outcome::NoPose { reason } | Outcome::NoHomography { reason } => {
            (Err(Failure::from(reason)), 0)
        }
        Outcome::Failed { .. } => (Err(Failure::Broken), 0),
    }
}

/// The probabilities that the pose is right, and that the images overlap, where they were stated.
fn stated(outcome: &Outcome) -> [Option<f64>; 2] {
    match outcome {
        Outcome::Pose {
            pose_probability,
            overlap_probability,
            ..
        } => [*pose_probability, *overlap_probability],
        _ => [None, None],
    }
}

impl From<&RunRecord> for PairResult {
    fn from(record: &RunRecord) -> Self {
        let (outcome, correspondences) = scored(&record.outcome);
        let [pose_probability, overlap_probability] = stated(&record.outcome);
        Self {
            a: record.task.a,
            b: record.task.b,
            repetition: record.task.repetition,
            model: Model::of(&record.outcome).unwrap_or_default(),
            outcome,
            correspondences: Some(correspondences),
            pose_probability,
            overlap_probability,
            correct: record.correct,
            found_again: (record.repeated)
                .map(|repeated| (repeated.least_visible(), repeated.within[FOUND_PX - 1])),
            by_depth: record.by_depth.map(Box::new),
            counts: Some(record.counts),
            times: record.times,
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use matchbench_vision::robust::NoModel;

    use super::*;
    use crate::records::{Repeated, Task};

    /// A pair with these errors in degrees and this many correspondences.
    pub(in super::super) fn solved(a: u32, rotation: f64, translation: f64, n: u32) -> PairResult {
        PairResult {
            outcome: Ok(Deviation::Pose(AngularError {
                rotation,
                translation: Some(translation),
            })),
            correspondences: Some(n),
            by_depth: Some(Box::new(ByDepth {
                overlap: Some(0.5),
                judged: n,
                within: [n / 2; 10],
                repeated: Some(Repeated {
                    visible: [4 * n, 5 * n],
                    within: [2 * n; 10],
                }),
            })),
            counts: Some(Counts {
                selected: n,
                ..Counts::default()
            }),
            ..PairResult::failed(a, a + 1, Failure::Missing)
        }
    }

    /// A pair with this corner error, and all of its `n` matches correct from 2 pixels on.
    pub(in super::super) fn transferred(a: u32, corner_error: f64, n: u32) -> PairResult {
        let mut correct = [n; 10];
        correct[0] = n / 2;
        PairResult {
            model: Model::Homography,
            outcome: Ok(Deviation::Corners(Some(corner_error))),
            correspondences: Some(n),
            correct: Some(correct),
            found_again: Some((4 * n, 2 * n)),
            counts: Some(Counts {
                selected: n,
                ..Counts::default()
            }),
            ..PairResult::failed(a, a + 1, Failure::Missing)
        }
    }

    #[test]
    fn pose_error_is_the_larger_angle_and_signed() {
        let error = AngularError {
            rotation: 2.0,
            translation: Some(179.0),
        };
        assert_eq!(error.pose(), Some(179.0));
        assert_eq!(error.sign_agnostic(), Some(2.0));
    }

    #[test]
    fn there_is_no_overlap_where_that_is_more_likely_than_not() {
        let answer = |overlap_probability| {
            let pair = PairResult {
                overlap_probability,
                ..solved(0, 0.5, 0.5, 30)
            };
            pair.has_no_overlap()
        };
        let answers = [Some(0.499), Some(0.5), Some(0.9), None].map(answer);
        assert_eq!(answers, [true, false, false, false]);
    }

    #[test]
    fn without_a_true_direction_only_the_rotation_is_judged() {
        let mut pair = solved(0, 0.5, 0.0, 30);
        pair.outcome = Ok(Deviation::Pose(AngularError {
            rotation: 0.5,
            translation: None,
        }));
        assert_eq!(pair.error(Angle::Pose), None);
        assert_eq!(pair.error(Angle::Translation), None);
        assert_eq!(pair.error(Angle::Rotation), Some(0.5));
        assert_eq!(pair.sign_agnostic_error(), None);
    }

    #[test]
    fn what_a_record_counts_is_taken_from_its_own_field() {
        let steps = |k: u32| std::array::from_fn(|i| k * (i as u32 + 1));
        let record = RunRecord {
            task: Task {
                dataset: "room".into(),
                matcher: "sift".into(),
                estimator: "best".into(),
                a: 3,
                b: 5,
                repetition: 2,
            },
            counts: Counts {
                features_a: 900,
                features_b: 800,
                putative: 700,
                selected: 600,
            },
            correct: Some(steps(50)),
            repeated: Some(Repeated {
                visible: [400, 300],
                within: steps(20),
            }),
            by_depth: Some(ByDepth {
                overlap: Some(0.5),
                judged: 500,
                within: steps(40),
                repeated: Some(Repeated {
                    visible: [200, 250],
                    within: steps(10),
                }),
            }),
            outcome: Outcome::NoPose {
                reason: NoModel::NoSupport {
                    found: 0,
                    needed: 1,
                },
            },
            times: StageTimes::default(),
            device: None,
        };
        let pair = PairResult::from(&record);
        assert_eq!((pair.a, pair.b, pair.repetition), (3, 5, 2));
        assert_eq!(pair.correct, Some(steps(50)));
        // Within 3 pixels, of the smaller number of both images.
        assert_eq!(pair.found_again, Some((300, 60)));
        assert_eq!(pair.by_depth.as_deref(), record.by_depth.as_ref());
        assert_eq!(pair.counts, Some(record.counts));
    }
}
