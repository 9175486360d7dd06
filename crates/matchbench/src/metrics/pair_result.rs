//! What a score needs to know of one pair.

use crate::records::{Counts, Outcome, RunRecord, StageTimes};

use super::Failure;

/// The result of one pair, whoever computed it.
#[derive(Clone, Debug, PartialEq)]
pub struct PairResult {
    /// Index of the first frame, the reference image of its pairs.
    pub a: u32,
    /// Index of the second frame.
    pub b: u32,
    /// 0 for the first seed, 1 for the second ...
    pub repetition: u32,
    /// How far the estimated pose is from the true one, or why there is none.
    pub outcome: Result<AngularError, Failure>,
    /// Correspondences that support the pose, 0 where there is none.
    pub correspondences: u32,
    /// Numbers of features and matches, where they were recorded.
    pub counts: Option<Counts>,
    /// Stage times, where they were taken.
    pub times: StageTimes,
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

/// The larger of two angles; NaN where one is (`f64::max` would hide it).
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

impl PairResult {
    /// A pair that came to nothing.
    pub fn failed(a: u32, b: u32, failure: Failure) -> Self {
        Self {
            a,
            b,
            repetition: 0,
            outcome: Err(failure),
            correspondences: 0,
            counts: None,
            times: StageTimes::default(),
        }
    }

    /// A pair that was judged, without counts and times.
    pub fn of(a: u32, b: u32, outcome: &Outcome) -> Self {
        let (outcome, correspondences) = scored(outcome);
        Self {
            outcome,
            correspondences,
            ..Self::failed(a, b, Failure::Missing)
        }
    }

    /// One angle of the error, in degrees; `None` where there is no pose, or no true direction.
    pub fn error(&self, angle: Angle) -> Option<f64> {
        let error = self.outcome.as_ref().ok()?;
        match angle {
            Angle::Pose => error.pose(),
            Angle::Rotation => Some(error.rotation),
            Angle::Translation => error.translation,
        }
    }

    /// The sign-agnostic pose error in degrees, where there is one.
    pub fn sign_agnostic_error(&self) -> Option<f64> {
        self.outcome.as_ref().ok()?.sign_agnostic()
    }
}

/// What an outcome comes to, and how many correspondences it counts.
pub(super) fn scored(outcome: &Outcome) -> (Result<AngularError, Failure>, u32) {
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
            (Ok(error), *support)
        }
        Outcome::NoPose { reason } => (Err(Failure::from(reason)), 0),
        Outcome::Failed { .. } => (Err(Failure::Broken), 0),
    }
}

impl From<&RunRecord> for PairResult {
    fn from(record: &RunRecord) -> Self {
        let (outcome, correspondences) = scored(&record.outcome);
        Self {
            a: record.task.a,
            b: record.task.b,
            repetition: record.task.repetition,
            outcome,
            correspondences,
            counts: Some(record.counts),
            times: record.times,
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A pair with these errors in degrees and this many correspondences.
    pub(in super::super) fn solved(a: u32, rotation: f64, translation: f64, n: u32) -> PairResult {
        PairResult {
            outcome: Ok(AngularError {
                rotation,
                translation: Some(translation),
            }),
            correspondences: n,
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
    fn without_a_true_direction_only_the_rotation_is_judged() {
        let mut pair = solved(0, 0.5, 0.0, 30);
        pair.outcome = Ok(AngularError {
            rotation: 0.5,
            translation: None,
        });
        assert_eq!(pair.error(Angle::Pose), None);
        assert_eq!(pair.error(Angle::Translation), None);
        assert_eq!(pair.error(Angle::Rotation), Some(0.5));
        assert_eq!(pair.sign_agnostic_error(), None);
    }
}
