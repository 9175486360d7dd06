//! One line of `records/<dataset>/<matcher>+<estimator>.jsonl`.

use serde::{Deserialize, Serialize};

use super::Outcome;
use crate::matchers::check_seconds;

/// Largest allowed difference between a stated error and the computed one, in degrees or pixels (for large
/// pixel errors, relative to them). Records are rounded, and small angles lose half of their digits.
const ROUNDED: f64 = 1e-3;

/// Everything that one task left behind. Apart from [`RunRecord::times`] it is the same, bit for
/// bit, on every machine and for any number of threads.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunRecord {
    /// What was to be done.
    pub task: Task,
    /// How many features and matches there were at each stage.
    pub counts: Counts,
    /// Selected matches within 1, 2, ... 10 pixels of where the true homography takes them; absent where
    /// there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correct: Option<[u32; 10]>,
    /// Keypoints that were found in both images; absent where the true homography is not known, or the
    /// features were not at hand: matches from outside, or of an earlier process.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub repeated: Option<Repeated>,
    /// What the depth of both images says of them and of the matches; absent where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by_depth: Option<ByDepth>,
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
    /// homographies with an inverse, errors that are angles or distances, times that are times. Records are files, and files can hold
    /// anything.
    ///
    /// # Errors
    /// The first thing that cannot be, in words.
    pub fn check(&self) -> Result<(), String> {
        if self.task.a == self.task.b {
            return Err(format!("frame {} is matched with itself", self.task.a));
        }
        self.times.all().try_for_each(check_seconds)?;
        self.check_correct()?;
        self.repeated.as_ref().map_or(Ok(()), Repeated::check)?;
        self.check_by_depth()?;
        self.check_support()?;
        self.outcome.check()
    }

    /// How the record contradicts its estimate when that is `judged` again, in words; `None` if it does not.
    pub(crate) fn contradiction(&self, judged: &Outcome) -> Option<String> {
        let (stated, found) = (self.outcome.errors(), judged.errors());
        let of_homography = matches!(judged, Outcome::Homography { .. });
        let agrees = (stated.iter().zip(found)).all(|(stated, found)| match (stated, found) {
            (Some(stated), Some(found)) => {
                let scale = if of_homography { found.max(1.0) } else { 1.0 };
                (stated - found).abs() <= ROUNDED * scale
            }
            (None, None) => true,
            _ => false,
        });
        let (a, b) = (self.task.a, self.task.b);
        let words = |errors: [Option<f64>; 2]| {
            let [first, second] =
                errors.map(|error| error.map_or("none".to_owned(), |error| format!("{error:.4}")));
            if of_homography {
                format!("a corner error of {first}")
            } else {
                format!("errors of {first} of the rotation and {second} of the translation")
            }
        };
        let (what, unit) = if of_homography {
            ("homography", "pixels")
        } else {
            ("pose", "degrees")
        };
        (!agrees).then(|| {
            format!(
                "the record of the pair {a} {b} states {}, but its {what} has {} ({unit})",
                words(stated),
                words(found)
            )
        })
    }

    /// What agrees with an estimate are selected matches.
    fn check_support(&self) -> Result<(), String> {
        let selected = self.counts.selected;
        let agreeing = match self.outcome {
            Outcome::Pose {
                inliers, support, ..
            } => [("inliers", inliers), ("support", support)],
            Outcome::Homography { inliers, .. } => [("inliers", inliers); 2],
            Outcome::NoPose { .. } | Outcome::NoHomography { .. } | Outcome::Failed { .. } => {
                return Ok(());
            }
        };
        match agreeing.iter().find(|(_, count)| *count > selected) {
            Some((name, count)) => Err(format!("`{name}` is {count} of {selected} matches")),
            None => Ok(()),
        }
    }

    fn check_by_depth(&self) -> Result<(), String> {
        let Some(by_depth) = &self.by_depth else {
            return Ok(());
        };
        if by_depth.judged > self.counts.selected {
            return Err(format!(
                "`by_depth` judges {} of {} matches",
                by_depth.judged, self.counts.selected
            ));
        }
        by_depth.check()
    }

    /// Matches within more pixels are more matches, and none are more than all.
    fn check_correct(&self) -> Result<(), String> {
        let Some(correct) = &self.correct else {
            return Ok(());
        };
        if !correct.is_sorted() || correct[correct.len() - 1] > self.counts.selected {
            return Err(format!(
                "`correct` is {correct:?}, and counts of {} matches within more and more pixels do not \
                 fall or exceed them",
                self.counts.selected
            ));
        }
        Ok(())
    }
}

/// What the depth of two images says of them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ByDepth {
    /// Share of the pixels of one image that the other sees too, the smaller of both; absent where an image has no
    /// depth at all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub overlap: Option<f64>,
    /// Selected matches an end of which has depth.
    pub judged: u32,
    /// Those of them within 1, 2, ... 10 pixels of where the depth and the true pose take their other end.
    pub within: [u32; 10],
    /// Keypoints that were found in both images; absent where the features were not at hand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub repeated: Option<Repeated>,
}

impl ByDepth {
    /// Whether the numbers can be a share and counts.
    fn check(&self) -> Result<(), String> {
        if let Some(overlap) = (self.overlap).filter(|share| !(0.0..=1.0).contains(share)) {
            return Err(format!("`overlap` is {overlap}, and no share"));
        }
        if !self.within.is_sorted() || self.within[9] > self.judged {
            return Err(format!(
                "`by_depth` has {:?} matches within more and more pixels, of {}",
                self.within, self.judged
            ));
        }
        self.repeated.as_ref().map_or(Ok(()), Repeated::check)
    }
}

/// Keypoints in the part of the scene that both images of a pair show, by the true homography or by depth; those at
/// one place count once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Repeated {
    /// Those of images `a` and `b`.
    pub visible: [u32; 2],
    /// Pairs of them that are each other's nearest and lie within 1, 2, ... 10 pixels of image `b`.
    pub within: [u32; 10],
}

impl Repeated {
    /// The smaller number of keypoints that could be found again.
    pub fn least_visible(&self) -> u32 {
        self.visible[0].min(self.visible[1])
    }

    /// Whether the numbers can be counts.
    fn check(&self) -> Result<(), String> {
        if !self.within.is_sorted() || self.within[9] > self.least_visible() {
            return Err(format!(
                "`repeated` has {:?} pairs within more and more pixels, of {:?} keypoints",
                self.within, self.visible
            ));
        }
        Ok(())
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

impl Counts {
    /// Whether any feature is counted. A matcher that has matches and never counts one has none: matches that come from
    /// outside may come without features.
    pub fn counts_features(&self) -> bool {
        self.features_a > 0 || self.features_b > 0
    }

    /// Whether the numbers of features are known, of a pair of a matcher that has features.
    pub fn has_features(&self) -> bool {
        self.selected == 0 || self.counts_features()
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

#[cfg(test)]
mod tests {
    use matchbench_vision::geometry::RelativePose;
    use nalgebra::{Isometry3, Vector3};

    use super::*;

    /// A record of this outcome and nothing else.
    fn record_of(outcome: Outcome) -> RunRecord {
        RunRecord {
            task: Task {
                dataset: "office".into(),
                matcher: "sift".into(),
                estimator: "ransac-e".into(),
                a: 3,
                b: 4,
                repetition: 0,
            },
            counts: Counts::default(),
            correct: None,
            repeated: None,
            by_depth: None,
            outcome,
            times: StageTimes::default(),
            device: None,
        }
    }

    #[test]
    fn a_record_survives_its_line_bit_for_bit() {
        let estimate = RelativePose::from_isometry(&Isometry3::new(
            Vector3::new(0.1, 0.2, 0.3),
            Vector3::y() * 0.1,
        ))
        .unwrap();
        let outcome = Outcome::judged(
            &estimate,
            &Isometry3::translation(1.0, 2.0, 0.1),
            9,
            12,
            100,
        );
        let record = RunRecord {
            by_depth: Some(ByDepth {
                overlap: Some(0.1 + 0.2),
                judged: 0,
                within: [0; 10],
                repeated: None,
            }),
            times: StageTimes {
                search: Some(0.1 + 0.2),
                ..StageTimes::default()
            },
            ..record_of(outcome)
        };
        let line = serde_json::to_string(&record).unwrap();
        assert_eq!(serde_json::from_str::<RunRecord>(&line).unwrap(), record);
    }

    /// The errors that a record may state where these are found, by whether it is believed.
    fn is_believed(stated: Outcome, found: &Outcome) -> bool {
        record_of(stated).contradiction(found).is_none()
    }

    #[test]
    fn a_record_may_be_rounded_to_a_thousandth_of_a_degree() {
        let pose = |rotation_error: f64, translation_error: Option<f64>| Outcome::Pose {
            rotation: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            translation: [1.0, 0.0, 0.0],
            inliers: 9,
            support: 9,
            iterations: 9,
            rotation_error,
            translation_error,
            pose_probability: None,
            overlap_probability: None,
        };
        let found = pose(0.5, Some(90.0));
        for (stated, believed) in [
            (pose(0.5009, Some(89.9991)), true),
            (pose(0.502, Some(90.0)), false),
            // Large angles are not rounded more.
            (pose(0.5, Some(90.002)), false),
            (pose(0.5, None), false),
        ] {
            assert_eq!(is_believed(stated.clone(), &found), believed, "{stated:?}");
            // Whichever of both is stated.
            assert_eq!(is_believed(found.clone(), &stated), believed, "{stated:?}");
        }
        assert!(is_believed(pose(0.5, None), &pose(0.5, None)));
    }

    #[test]
    fn a_corner_error_may_be_rounded_to_a_thousandth_of_a_pixel_or_of_itself() {
        let corners = |corner_error: Option<f64>| Outcome::Homography {
            homography: [0.0; 9],
            inliers: 9,
            iterations: 9,
            corner_error,
        };
        for (stated, found, believed) in [
            (Some(0.5009), Some(0.5), true),
            (Some(0.502), Some(0.5), false),
            (Some(200.19), Some(200.0), true),
            (Some(200.3), Some(200.0), false),
            (None, Some(200.0), false),
            (Some(200.0), None, false),
            (None, None, true),
        ] {
            let is_believed = is_believed(corners(stated), &corners(found));
            assert_eq!(is_believed, believed, "{stated:?} {found:?}");
        }
    }
}
