//! Every score, defined once: what it is called, what it means, how it is computed and written.
//!
//! Tables, CSV, the page and its definitions walk [`SCORES`]; to add a score, add an entry. A score
//! is a function of the pairs of one [`ResultSet`](super::ResultSet). It is about poses, homographies or depth, and
//! unknown where there are no pairs that have these. One that is a ratio of sums over pairs also says what a
//! pair adds to it ([`Term`]) and thereby has an interval.

use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

use super::auc::{corner_auc_terms, exact_auc_terms, maa_term};
use super::average_matches::{average_matches, is_right};
use super::depth_scores;
use super::pair_result::FOUND_PX;
use super::score_kind::{Detail, Notation, ScoreKind, Spread, Subject, mean_of_terms, share_term};
use super::success::{HEADLINE_PX, share_of_thresholds};
use super::{Angle, Interval, Model, PairResult, SuccessCurve, Term, corner_auc, exact_auc, maa};

/// The threshold at which the paper shows AP, in degrees.
pub(super) const AP_THRESHOLD: f64 = 5.0;

/// All scores, in the order of tables; the first is the paper's.
pub const SCORES: &[ScoreKind] = &[
    ScoreKind {
        id: "auc",
        about: Subject::Poses,
        heading: "AUC",
        definition: "Mean of SP(1) ... SP(15), as in \"MatchBench: An Evaluation of Feature Matchers\".",
        value: |pairs| auc(pairs, Angle::Pose),
        spread: Spread::Terms(|pair| auc_term(pair, Angle::Pose)),
        notation: Notation::Ratio,
        detail: Detail::Glance,
    },
    ScoreKind {
        id: "sp5",
        about: Subject::Poses,
        heading: "SP(5)",
        definition: SP,
        value: |pairs| Some(SuccessCurve::new(pairs, Angle::Pose).at(5)),
        spread: Spread::Unknown,
        notation: Notation::Ratio,
        detail: Detail::Glance,
    },
    ScoreKind {
        id: "sp10",
        about: Subject::Poses,
        heading: "SP(10)",
        definition: SP,
        value: |pairs| Some(SuccessCurve::new(pairs, Angle::Pose).at(10)),
        spread: Spread::Unknown,
        notation: Notation::Ratio,
        detail: Detail::Complete,
    },
    ScoreKind {
        id: "rotation_auc",
        about: Subject::Poses,
        heading: "AUC rot.",
        definition: ONE_ANGLE,
        value: |pairs| auc(pairs, Angle::Rotation),
        spread: Spread::Terms(|pair| auc_term(pair, Angle::Rotation)),
        notation: Notation::Ratio,
        detail: Detail::Glance,
    },
    ScoreKind {
        id: "translation_auc",
        about: Subject::Poses,
        heading: "AUC trans.",
        definition: ONE_ANGLE,
        value: |pairs| auc(pairs, Angle::Translation),
        spread: Spread::Terms(|pair| auc_term(pair, Angle::Translation)),
        notation: Notation::Ratio,
        detail: Detail::Glance,
    },
    ScoreKind {
        id: "ap5",
        about: Subject::Poses,
        heading: "AP(5)",
        definition: "Mean number of correspondences of the pairs with a pose error below 5 degrees.",
        value: |pairs| average_matches(pairs, AP_THRESHOLD),
        spread: Spread::Terms(ap_term),
        notation: Notation::Count,
        detail: Detail::Glance,
    },
    ScoreKind {
        id: "exact_auc_5",
        about: Subject::Poses,
        heading: "Exact AUC 5°",
        definition: EXACT_AUC,
        value: |pairs| Some(exact_auc(pairs, 5.0)),
        spread: Spread::TermsOfAll(|pairs| exact_auc_terms(pairs, 5.0)),
        notation: Notation::Ratio,
        detail: Detail::Complete,
    },
    ScoreKind {
        id: "exact_auc_10",
        about: Subject::Poses,
        heading: "Exact AUC 10°",
        definition: EXACT_AUC,
        value: |pairs| Some(exact_auc(pairs, 10.0)),
        spread: Spread::TermsOfAll(|pairs| exact_auc_terms(pairs, 10.0)),
        notation: Notation::Ratio,
        detail: Detail::Complete,
    },
    ScoreKind {
        id: "exact_auc_20",
        about: Subject::Poses,
        heading: "Exact AUC 20°",
        definition: EXACT_AUC,
        value: |pairs| Some(exact_auc(pairs, 20.0)),
        spread: Spread::TermsOfAll(|pairs| exact_auc_terms(pairs, 20.0)),
        notation: Notation::Ratio,
        detail: Detail::Complete,
    },
    ScoreKind {
        id: "maa_10",
        about: Subject::Poses,
        heading: "mAA 10°",
        definition: "Mean share of pairs with a pose error below 1, 2, ... 10 degrees, as in the Image \
                     Matching Challenge; a translation and its opposite count as the same.",
        value: |pairs| Some(maa(pairs, 10)),
        spread: Spread::Terms(|pair| maa_term(pair, 10)),
        notation: Notation::Ratio,
        detail: Detail::Complete,
    },
    corners::<1>("auc_h1", "AUC 1 px"),
    corners::<3>("auc_h3", "AUC 3 px"),
    corners::<5>("auc_h5", "AUC 5 px"),
    corners::<10>("auc_h10", "AUC 10 px"),
    accuracy::<1>("mma1", "MMA 1 px", Detail::Complete),
    accuracy::<2>("mma2", "MMA 2 px", Detail::Complete),
    accuracy::<3>("mma3", "MMA 3 px", Detail::Glance),
    accuracy::<4>("mma4", "MMA 4 px", Detail::Complete),
    accuracy::<5>("mma5", "MMA 5 px", Detail::Complete),
    accuracy::<6>("mma6", "MMA 6 px", Detail::Complete),
    accuracy::<7>("mma7", "MMA 7 px", Detail::Complete),
    accuracy::<8>("mma8", "MMA 8 px", Detail::Complete),
    accuracy::<9>("mma9", "MMA 9 px", Detail::Complete),
    accuracy::<10>("mma10", "MMA 10 px", Detail::Complete),
    ScoreKind {
        id: "repeatability",
        about: Subject::Homographies,
        heading: "Repeatability",
        definition: FOUND_AGAIN,
        value: |pairs| Some(mean_of_terms(pairs, repeatability_term)),
        spread: Spread::Terms(repeatability_term),
        notation: Notation::Ratio,
        detail: Detail::Glance,
    },
    ScoreKind {
        id: "matching_score",
        about: Subject::Homographies,
        heading: "Matching score",
        definition: FOUND_AGAIN,
        value: |pairs| Some(mean_of_terms(pairs, matching_term)),
        spread: Spread::Terms(matching_term),
        notation: Notation::Ratio,
        detail: Detail::Glance,
    },
    depth_scores::precision::<1>("precision_1px", "Precision 1 px", Detail::Complete),
    depth_scores::precision::<3>("precision_3px", "Precision 3 px", Detail::Glance),
    depth_scores::precision::<5>("precision_5px", "Precision 5 px", Detail::Complete),
    depth_scores::REPEATABILITY,
    depth_scores::MATCHING_SCORE,
];

/// The AUC of the corner error up to so many pixels.
const fn corners<const PX: u32>(id: &'static str, heading: &'static str) -> ScoreKind {
    ScoreKind {
        id,
        about: Subject::Homographies,
        heading,
        definition: CORNER_AUC,
        value: |pairs| Some(corner_auc(pairs, f64::from(PX))),
        spread: Spread::TermsOfAll(|pairs| corner_auc_terms(pairs, f64::from(PX))),
        notation: Notation::Ratio,
        detail: Detail::Glance,
    }
}

/// The mean matching accuracy within so many pixels.
const fn accuracy<const PX: usize>(
    id: &'static str,
    heading: &'static str,
    detail: Detail,
) -> ScoreKind {
    ScoreKind {
        id,
        about: Subject::Homographies,
        heading,
        definition: MMA,
        value: |pairs| Some(mean_of_terms(pairs, |pair| accuracy_term(pair, PX))),
        spread: Spread::Terms(|pair| accuracy_term(pair, PX)),
        notation: Notation::Ratio,
        detail,
    }
}

/// The score that methods are ranked by: of poses the paper's AUC, of homographies that of the corner error at
/// 3 pixels. NaN where there are no pairs.
pub fn ranking_auc(pairs: &[PairResult]) -> f64 {
    match Model::of_all(pairs) {
        Model::Pose => SuccessCurve::new(pairs, Angle::Pose).auc(),
        Model::Homography => corner_auc(pairs, HEADLINE_PX),
    }
}

const SP: &str = "SP(k): share of all listed pairs with a pose error below k degrees, strictly. Pairs \
                  that failed or have no result count as wrong.";
const ONE_ANGLE: &str =
    "The AUC of one angle alone: of the rotation error, and of the translation error.";
const EXACT_AUC: &str = "Area under recall over the pose error up to so many degrees, as SuperGlue and its \
                         followers report it; a translation and its opposite count as the same.";

const CORNER_AUC: &str = "AUC k px: area under recall over the corner error up to k pixels, exact, as SuperGlue and its \
                          followers report it of homographies: the error is the mean distance at which the estimated \
                          and the true homography see the four corners of the first image.";
const MMA: &str = "MMA k px: share of the selected matches within k pixels of where the true homography takes them, the mean \
                   over all pairs that have one; a pair without matches has 0.";
const FOUND_AGAIN: &str = "Repeatability: of the keypoints in the part of the scene that both images show (the smaller number of \
                           both), the share with one of the other image within 3 pixels of where the true homography takes \
                           them, one to one; matching score: the share that was matched within 3 pixels; means over pairs.";

/// The entry of a score.
///
/// # Panics
/// If the list has no score with this id.
pub fn score_kind(id: &str) -> &'static ScoreKind {
    &SCORES[place(id)]
}

fn place(id: &str) -> usize {
    let place = SCORES.iter().position(|kind| kind.id == id);
    place.unwrap_or_else(|| panic!("no score is called `{id}`"))
}

/// A score and how far it would move with other images.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Score {
    /// The score; `None` where it is undefined (no pairs, or no right pair for AP) or the results do not tell.
    pub value: Option<f64>,
    /// Its 95 % interval, where there is enough evidence for one.
    pub interval: Option<Interval>,
}

/// One value for each entry of [`SCORES`].
#[derive(Clone, Debug, PartialEq)]
pub struct Scores(Vec<Score>);

impl Scores {
    /// Computes all of them.
    pub fn new(pairs: &[PairResult]) -> Self {
        let score = |kind: &ScoreKind| {
            let value = (kind.value)(pairs).filter(|value| value.is_finite());
            // Of what is not known nothing is certain.
            let interval = value.and_then(|_| kind.interval([pairs]));
            Score { value, interval }
        };
        Self(SCORES.iter().map(score).collect())
    }

    /// The score with this id.
    ///
    /// # Panics
    /// If the list has no score with this id.
    pub fn get(&self, id: &str) -> Score {
        self.0[place(id)]
    }

    /// To change one by hand, which only tests do.
    #[cfg(test)]
    pub(crate) fn get_mut(&mut self, id: &str) -> &mut Score {
        &mut self.0[place(id)]
    }

    /// Every entry with its score, in the order of the list.
    pub fn iter(&self) -> impl Iterator<Item = (&'static ScoreKind, Score)> {
        SCORES.iter().zip(self.0.iter().copied())
    }
}

/// A map from ids to scores: an object with value and interval, or a number where there is never
/// an interval.
impl Serialize for Scores {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (kind, score) in self.iter() {
            if kind.has_interval() {
                map.serialize_entry(kind.id, &score)?;
            } else {
                map.serialize_entry(kind.id, &score.value)?;
            }
        }
        map.end()
    }
}

fn auc(pairs: &[PairResult], angle: Angle) -> Option<f64> {
    Some(SuccessCurve::new(pairs, angle).auc())
}

fn auc_term(pair: &PairResult, angle: Angle) -> Term {
    Term {
        images: (pair.a, pair.b),
        numerator: share_of_thresholds(pair.error(angle)),
        denominator: f64::from(u8::from(pair.model == Model::Pose)),
    }
}

/// The share of the pair's matches that are correct within so many pixels.
fn accuracy_term(pair: &PairResult, pixels: usize) -> Term {
    let selected = pair.counts.map_or(0, |counts| counts.selected);
    let share = |correct: [u32; 10]| f64::from(correct[pixels - 1]) / f64::from(selected.max(1));
    Term {
        images: (pair.a, pair.b),
        numerator: pair.correct.map_or(0.0, share),
        denominator: f64::from(u8::from(pair.correct.is_some())),
    }
}

/// The share of the keypoints that both images can show which were found in both.
fn repeatability_term(pair: &PairResult) -> Term {
    share_of_visible(pair, |pair| Some(pair.found_again?.1))
}

/// The share of the same keypoints that were matched correctly.
fn matching_term(pair: &PairResult) -> Term {
    share_of_visible(pair, |pair| Some(pair.correct?[FOUND_PX - 1]))
}

fn share_of_visible(pair: &PairResult, found: fn(&PairResult) -> Option<u32>) -> Term {
    let known = pair.found_again.zip(found(pair));
    share_term(pair, known.map(|((visible, _), found)| (found, visible)))
}

fn ap_term(pair: &PairResult) -> Term {
    let correspondences = (pair.correspondences).filter(|_| is_right(pair, AP_THRESHOLD));
    Term {
        images: (pair.a, pair.b),
        numerator: correspondences.unwrap_or(0).into(),
        denominator: if correspondences.is_some() { 1.0 } else { 0.0 },
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::super::pair_result::tests::{solved, transferred};
    use super::super::{Deviation, Failure};
    use super::*;
    use crate::records::{ByDepth, Counts, Repeated};

    fn pairs() -> Vec<PairResult> {
        vec![
            solved(0, 0.2, 0.9, 300),
            solved(0, 4.5, 1.0, 100),
            solved(1, 0.1, 12.0, 900),
            PairResult::failed(1, 5, Failure::TooFewMatches),
        ]
    }

    fn transfers() -> Vec<PairResult> {
        let failed = PairResult {
            model: Model::Homography,
            correct: Some([0; 10]),
            ..PairResult::failed(1, 5, Failure::TooFewMatches)
        };
        vec![
            transferred(0, 0.5, 100),
            transferred(0, 2.5, 60),
            transferred(1, 7.0, 30),
            failed,
        ]
    }

    #[test]
    fn scores_of_homographies_by_hand() {
        let scores = Scores::new(&transfers());
        let value = |id| scores.get(id).value.expect("there are pairs");
        // Up to 3 pixels, in units of pairs: 0.5 * 0.5, 2 * 1.5, 0.5 * 2, of 3 * 4.
        assert!((value("auc_h3") - 4.25 / 12.0).abs() < 1e-12);
        // Of four pairs one has no matches; of the others half is within 1 pixel, all within 2.
        assert!((value("mma1") - 1.5 / 4.0).abs() < 1e-12);
        assert!((value("mma2") - 0.75).abs() < 1e-12);
        // Half of the visible keypoints were found again, a quarter of them matched; nothing is known of the pair that failed.
        assert!((value("repeatability") - 0.5).abs() < 1e-12);
        assert!((value("matching_score") - 0.25).abs() < 1e-12);
        assert_eq!(scores.get("auc_h3").interval, None);
        let many: Vec<PairResult> = (0..9)
            .map(|a| transferred(a, 0.4 * f64::from(a), 60))
            .collect();
        let auc = Scores::new(&many).get("auc_h3");
        let interval = auc.interval.expect("nine images");
        assert!((interval.low..interval.high).contains(&auc.value.expect("there are pairs")));
    }

    #[test]
    fn every_score_has_a_name_of_its_own_and_says_what_it_is() {
        let ids: BTreeSet<_> = SCORES.iter().map(|kind| kind.id).collect();
        let heads: BTreeSet<_> = SCORES.iter().map(|kind| kind.heading).collect();
        assert_eq!((ids.len(), heads.len()), (SCORES.len(), SCORES.len()));
        for kind in SCORES {
            let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
            assert!(kind.id.chars().all(plain), "{}", kind.id);
            assert!(kind.definition.ends_with('.'), "{}", kind.id);
        }
        assert_eq!(SCORES[0].id, "auc");
    }

    #[test]
    fn every_score_is_defined_on_results_of_its_model_and_unknown_without() {
        let none = Scores::new(&[]);
        let poses = Scores::new(&pairs());
        let homographies = Scores::new(&transfers());
        for ((kind, pose), (_, homography)) in poses.iter().zip(homographies.iter()) {
            let (score, other) = match kind.about {
                // The pairs with poses have depth here, the others have none.
                Subject::Poses | Subject::Depth => (pose, homography),
                Subject::Homographies => (homography, pose),
            };
            assert_eq!(other, Score::default(), "{}", kind.id);
            let value = score.value.unwrap_or_else(|| panic!("{}", kind.id));
            assert!(value > 0.0, "{}", kind.id);
            assert_eq!(none.get(kind.id), Score::default(), "{}", kind.id);
            if kind.notation == Notation::Ratio {
                assert!(value <= 1.0, "{}", kind.id);
            }
        }
    }

    /// A pair of which `step` more matches and keypoints count with every pixel.
    fn graded(step: u32) -> PairResult {
        let within = |step: u32| std::array::from_fn(|i| step * (i as u32 + 1));
        PairResult {
            correct: Some(within(step)),
            found_again: Some((200, 12)),
            by_depth: Some(Box::new(ByDepth {
                overlap: None,
                judged: 100,
                within: within(step),
                repeated: Some(Repeated {
                    visible: [60, 50],
                    within: within(4),
                }),
            })),
            counts: Some(Counts {
                selected: 80,
                ..Counts::default()
            }),
            ..solved(0, 1.0, 1.0, 30)
        }
    }

    #[test]
    fn scores_of_matches_are_those_within_their_pixels() {
        let pose = Scores::new(&[graded(7)]);
        let homography = Scores::new(&[PairResult {
            model: Model::Homography,
            outcome: Ok(Deviation::Corners(Some(1.0))),
            by_depth: None,
            ..graded(7)
        }]);
        let value = |scores: &Scores, id: &str| scores.get(id).value.expect("there is a pair");
        for (id, expected) in [
            // 7, 21 and 35 of 100 matches.
            ("precision_1px", 7.0 / 100.0),
            ("precision_3px", 21.0 / 100.0),
            ("precision_5px", 35.0 / 100.0),
            // Within 3 pixels: 12 keypoints, and 21 matches, of 50 keypoints.
            ("depth_repeatability", 12.0 / 50.0),
            ("depth_matching_score", 21.0 / 50.0),
        ] {
            assert_eq!(value(&pose, id), expected, "{id}");
        }
        for pixels in 1..=10_u32 {
            let id = format!("mma{pixels}");
            let expected = f64::from(7 * pixels) / 80.0;
            assert_eq!(value(&homography, &id), expected, "{id}");
        }
        assert_eq!(value(&homography, "repeatability"), 12.0 / 200.0);
        assert_eq!(value(&homography, "matching_score"), 21.0 / 200.0);
    }

    /// What stands before and after the number in an id, the pairs, and the score at a number.
    type Limited<'a> = (&'a str, &'a str, &'a [PairResult], &'a dyn Fn(usize) -> f64);

    #[test]
    fn the_number_in_an_id_is_the_limit_of_its_score() {
        // One pair for every half degree, or half pixel.
        let errors = || (0..20).map(|i| f64::from(i) + 0.5);
        let poses: Vec<PairResult> = (errors().map(|error| PairResult {
            by_depth: graded(7).by_depth,
            ..solved(0, 0.1, error, 30)
        }))
        .collect();
        let homographies: Vec<PairResult> = (errors().map(|error| PairResult {
            model: Model::Homography,
            outcome: Ok(Deviation::Corners(Some(error))),
            ..graded(7)
        }))
        .collect();
        let families: [Limited<'_>; 6] = [
            ("sp", "", &poses, &|n| n as f64 / 20.0),
            ("exact_auc_", "", &poses, &|n| exact_auc(&poses, n as f64)),
            ("maa_", "", &poses, &|n| maa(&poses, n as u32)),
            ("auc_h", "", &homographies, &|n| {
                corner_auc(&homographies, n as f64)
            }),
            ("mma", "", &homographies, &|n| (7 * n) as f64 / 80.0),
            ("precision_", "px", &poses, &|n| (7 * n) as f64 / 100.0),
        ];
        let mut limited = 0;
        for (before, after, pairs, expected) in families {
            let mut seen: Vec<f64> = Vec::new();
            for kind in SCORES {
                let number = (kind.id.strip_prefix(before)).and_then(|id| id.strip_suffix(after));
                let Some(number) = number.and_then(|number| number.parse().ok()) else {
                    continue;
                };
                let value = (kind.value)(pairs).expect("there are pairs");
                assert!((value - expected(number)).abs() < 1e-12, "{}", kind.id);
                let is_new = seen.iter().all(|other| (value - other).abs() > 1e-6);
                assert!(is_new, "{}", kind.id);
                // What pairs add has the same limit.
                let added: f64 = kind.terms(pairs).iter().map(|term| term.numerator).sum();
                let agrees = (added / 20.0 - value).abs() < 1e-12;
                assert!(agrees || !kind.has_interval(), "{}", kind.id);
                seen.push(value);
                limited += 1;
            }
        }
        let with_number = |kind: &&ScoreKind| kind.id.contains(|c: char| c.is_ascii_digit());
        // All but the mean number of matches of right pairs.
        assert_eq!(limited, SCORES.iter().filter(with_number).count() - 1);
    }

    #[test]
    fn what_pairs_add_makes_the_score() {
        for kind in SCORES {
            if !kind.has_interval() {
                continue;
            }
            let pairs = match kind.about {
                Subject::Poses | Subject::Depth => pairs(),
                Subject::Homographies => transfers(),
            };
            let terms = kind.terms(&pairs);
            let sum = |part: fn(&Term) -> f64| terms.iter().map(part).sum::<f64>();
            let ratio = sum(|term| term.numerator) / sum(|term| term.denominator);
            let value = (kind.value)(&pairs).expect("there are pairs");
            assert!((ratio - value).abs() < 1e-12, "{}", kind.id);
        }
    }

    #[test]
    fn scores_of_the_paper_by_hand() {
        let scores = Scores::new(&pairs());
        // Errors 0.9, 4.5, 12 and none: below all of 1 ... 15, below 5 ... 15, below 13, 14, 15.
        let auc = scores.get("auc").value.expect("there are pairs");
        assert!((auc - (15.0 + 11.0 + 3.0) / 60.0).abs() < 1e-15);
        let rotation = scores.get("rotation_auc").value.expect("there are pairs");
        assert!((rotation - 41.0 / 60.0).abs() < 1e-15);
        assert_eq!(scores.get("sp5").value, Some(0.5));
        assert_eq!(scores.get("ap5").value, Some(200.0));
    }
}
