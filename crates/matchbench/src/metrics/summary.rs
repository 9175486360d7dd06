//! Every score of one matcher with one estimator on one dataset.

use serde::Serialize;

use crate::protocols;

use super::quantiles::deviation;
use super::{
    Angle, Failures, Model, PairResult, Portion, ResultSet, SCORES, Score, ScoreKind, Scores,
    StageQuartiles, Subject, SuccessCurve, ranking_auc,
};

/// All scores of one dataset, matcher and estimator. Ratios are in `[0, 1]` and NaN without pairs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Name of the dataset.
    pub dataset: String,
    /// Id of the matcher.
    pub matcher: String,
    /// Id of the estimator; empty where the results do not name it.
    pub estimator: String,
    /// What was estimated.
    pub model: Model,
    /// Id of the protocol that the poses were estimated by; the paper's where the results do not name another.
    pub protocol: &'static str,
    /// The denominator of every ratio: pairs that the dataset lists, or that a run has recorded, once per repetition.
    pub pairs: usize,
    /// How often each pair was run with another seed.
    pub repetitions: u32,
    /// Pairs without a pose, listed ones without a result included.
    pub failed: usize,
    /// The same by reason.
    pub failures: Failures,
    /// Results for pairs that the dataset does not list; they are not scored.
    pub ignored: usize,
    /// Results that other methods of a run have and this one has not recorded, see [`ResultSet::lacking`].
    pub lacking: usize,
    /// Pairs with a pose, but without a true direction to compare it with (no baseline).
    pub undirected: usize,
    /// What kind of pairs these are.
    pub portion: Portion,
    /// Every score of [`SCORES`](super::SCORES), with its interval.
    #[serde(flatten)]
    pub scores: Scores,
    /// Standard deviation of the AUC over the repetitions, where there are several: what other
    /// random choices would change.
    pub auc_deviation: Option<f64>,
    /// Letters that it shares with those of this dataset that it does not significantly differ
    /// from (see [`groups`](super::groups())); empty where nothing was compared.
    pub group: String,
    /// Whether it has no letter since the methods of its dataset form more groups than there are letters.
    #[serde(skip)]
    pub beyond_letters: bool,
    /// The share of pairs with a corner error below 1, 2, ... 15 pixels; the other curves are of poses.
    pub corner_sp: SuccessCurve,
    /// SP(1) ... SP(15) of the pose error.
    pub sp: SuccessCurve,
    /// The same of the rotation error alone.
    pub rotation_sp: SuccessCurve,
    /// The same of the translation error alone.
    pub translation_sp: SuccessCurve,
    /// Features per image and time per stage, where they were recorded.
    pub stages: StageQuartiles,
}

impl Summary {
    /// Scores one set of results.
    pub fn new(results: &ResultSet) -> Self {
        let pairs = &results.pairs;
        let failures = Failures::count(pairs);
        let curve = |angle| SuccessCurve::new(pairs, angle);
        Self {
            dataset: results.dataset.clone(),
            matcher: results.matcher.clone(),
            estimator: results.estimator.clone(),
            model: Model::of_all(pairs),
            protocol: protocols::of_estimator(&results.estimator).id,
            pairs: pairs.len(),
            repetitions: results.repetitions,
            failed: failures.total(),
            failures,
            ignored: results.ignored,
            lacking: results.lacking,
            undirected: pairs.iter().filter(|pair| is_undirected(pair)).count(),
            portion: Portion::of(pairs.iter().map(|pair| (pair.a, pair.b))),
            scores: Scores::new(pairs),
            auc_deviation: auc_deviation(results),
            group: String::new(),
            beyond_letters: false,
            corner_sp: SuccessCurve::of_corners(pairs),
            sp: curve(Angle::Pose),
            rotation_sp: curve(Angle::Rotation),
            translation_sp: curve(Angle::Translation),
            stages: StageQuartiles::new(pairs),
        }
    }

    /// Of a set without names and pairs.
    pub(crate) fn empty() -> Self {
        let nothing = ResultSet {
            dataset: String::new(),
            matcher: String::new(),
            estimator: String::new(),
            repetitions: 1,
            pairs: Vec::new(),
            ignored: 0,
            lacking: 0,
        };
        Self::new(&nothing)
    }

    /// The score that it is ranked by: the paper's AUC, or of homographies the AUC at 3 pixels.
    pub fn auc(&self) -> Score {
        self.auc_of(Angle::Pose)
    }

    /// The id of that score.
    pub fn ranked_by(&self) -> &'static str {
        match self.model {
            Model::Pose => "auc",
            Model::Homography => "auc_h3",
        }
    }

    /// The AUC of one angle of the error; a homography has none but that of the corner error, which
    /// stands in for the pose error.
    pub fn auc_of(&self, angle: Angle) -> Score {
        if self.model == Model::Homography {
            return match angle {
                Angle::Pose => self.scores.get(self.ranked_by()),
                Angle::Rotation | Angle::Translation => Score::default(),
            };
        }
        self.scores.get(match angle {
            Angle::Pose => "auc",
            Angle::Rotation => "rotation_auc",
            Angle::Translation => "translation_auc",
        })
    }
}

/// The scores that a table of these summaries shows: those of poses where any were estimated, and what is
/// known of homographies and by depth.
pub fn shown_scores(summaries: &[Summary]) -> Vec<&'static ScoreKind> {
    let poses = summaries.is_empty() || summaries.iter().any(|s| s.model == Model::Pose);
    let known = |kind: &ScoreKind| {
        let value = |s: &Summary| s.scores.get(kind.id).value;
        summaries.iter().any(|s| value(s).is_some())
    };
    (SCORES.iter())
        .filter(|kind| match kind.about {
            Subject::Poses => poses,
            Subject::Homographies => known(kind),
            // The same that a homography tells of a plane, by another way.
            Subject::Depth => poses && known(kind),
        })
        .collect()
}

/// Sample standard deviation of the AUC over the repetitions.
fn auc_deviation(results: &ResultSet) -> Option<f64> {
    let mut pairs: Vec<&PairResult> = results.pairs.iter().collect();
    pairs.sort_by_key(|pair| pair.repetition);
    let auc = |pairs: &[&PairResult]| {
        let pairs: Vec<PairResult> = pairs.iter().copied().cloned().collect();
        ranking_auc(&pairs)
    };
    let aucs: Vec<f64> = (pairs.chunk_by(|one, next| one.repetition == next.repetition))
        .map(auc)
        .collect();
    if aucs.len() != results.repetitions as usize {
        return None;
    }
    deviation(&aucs)
}

fn is_undirected(pair: &PairResult) -> bool {
    (pair.angular_error()).is_some_and(|error| error.translation.is_none())
}

#[cfg(test)]
mod tests {
    use super::super::pair_result::tests::solved;
    use super::super::{Failure, MIN_IMAGES};
    use super::*;

    fn results(pairs: Vec<PairResult>) -> ResultSet {
        ResultSet {
            dataset: "street".into(),
            matcher: "sift".into(),
            estimator: "ransac-e".into(),
            repetitions: 1,
            pairs,
            ignored: 2,
            lacking: 0,
        }
    }

    #[test]
    fn scores_of_a_small_set_by_hand() {
        let summary = Summary::new(&results(vec![
            // Below all of 1 ... 15: adds 15.
            solved(0, 0.2, 0.9, 300),
            // e = 4.5: below 5 ... 15, adds 11.
            solved(0, 4.5, 1.0, 100),
            // e = 12: below 13, 14, 15, adds 3.
            solved(1, 0.1, 12.0, 900),
            PairResult::failed(1, 5, Failure::TooFewMatches),
        ]));
        assert_eq!((summary.pairs, summary.failed, summary.ignored), (4, 1, 2));
        let auc = summary.auc().value.expect("there are pairs");
        assert!((auc - (15.0 + 11.0 + 3.0) / (4.0 * 15.0)).abs() < 1e-15);
        // Rotation alone: 0.2, 4.5 and 0.1 add 15, 11 and 15.
        let rotation = summary
            .auc_of(Angle::Rotation)
            .value
            .expect("there are pairs");
        assert!((rotation - 41.0 / 60.0).abs() < 1e-15);
        assert_eq!(summary.scores.get("ap5").value, Some(200.0));
        assert_eq!(summary.sp.at(1), 0.25);
        assert_eq!(summary.auc().interval, None);
    }

    #[test]
    fn deviation_is_that_of_the_repetitions() {
        let repeated = |repetition, error| PairResult {
            repetition,
            ..solved(0, error, 0.1, 50)
        };
        let mut set = results(vec![repeated(0, 0.5), repeated(1, 3.5), repeated(2, 6.5)]);
        assert_eq!(Summary::new(&set).auc_deviation, None);
        set.repetitions = 3;
        let deviation = Summary::new(&set).auc_deviation;
        // The AUCs are 15, 12 and 9 of 15.
        assert!((deviation.expect("three repetitions") - 0.2).abs() < 1e-12);
        set.repetitions = 4;
        let deviation = Summary::new(&set).auc_deviation;
        assert_eq!(deviation, None, "nothing is known of the fourth");
    }

    #[test]
    fn few_images_have_scores_but_no_interval() {
        // Of images in a row, all but the first and the last are in two pairs.
        let of = |images: u32| {
            let pairs = (0..=images).map(|a| solved(a, 0.1, f64::from(a), 50));
            Summary::new(&results(pairs.collect())).auc()
        };
        assert_eq!((of(0).value, of(0).interval), (Some(1.0), None));
        assert_eq!(of(MIN_IMAGES as u32 - 1).interval, None);
        let many = of(MIN_IMAGES as u32);
        let interval = many.interval.expect("enough images");
        assert!((interval.low..interval.high).contains(&many.value.expect("there are pairs")));
    }

    #[test]
    fn without_pairs_every_score_is_unknown() {
        let summary = Summary::new(&results(vec![]));
        assert_eq!(
            (summary.auc().value, summary.scores.get("ap5").value),
            (None, None)
        );
        assert!(summary.scores.get("maa_10").value.is_none() && summary.sp.at(1).is_nan());
    }
}
