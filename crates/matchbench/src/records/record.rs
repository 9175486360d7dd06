//! One line of `records/<dataset>/<matcher>+<estimator>.jsonl`.

use matchbench_vision::robust::NoPose;
use serde::{Deserialize, Serialize};

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
        /// Why, in words.
        reason: String,
    },
}

/// Wall-clock time of each stage, in seconds; absent where the stage's result came from a cache
/// or the stage was not reached.
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
}
