//! Scores of matches and detectors by the depth of both images: precision, repeatability, matching score.
//!
//! Mikolajczyk, Schmid, "A Performance Evaluation of Local Descriptors", PAMI 27(10), 2005; DeTone, Malisiewicz,
//! Rabinovich, "SuperPoint: Self-Supervised Interest Point Detection and Description", CVPRW 2018. What a pair
//! counts is a run's part, see [`ByDepth`](crate::records::ByDepth).

use super::pair_result::FOUND_PX;
use super::score_kind::{Detail, Notation, ScoreKind, Spread, Subject, mean_of_terms, share_term};
use super::{PairResult, Term};

const PRECISION: &str = "Precision k px: share of the selected matches within k pixels of where the depth of one image and the \
                         true pose take them in the other; matches without depth at either end do not count; the mean over all \
                         pairs with depth, of which one without matches that count has 0.";
const FOUND_BY_DEPTH: &str = "Repeatability and matching score by depth: of the keypoints that the other image shows by the depth of \
                              both (not hidden, consistent within 5 %; the smaller number of both), the share with one of the \
                              other image within 3 pixels, one to one, and the share that was matched within 3 pixels (matches that \
                              precision counts as correct, hidden or not, at most all); means over pairs (Mikolajczyk and Schmid, PAMI 2005; DeTone et al., \"SuperPoint\", CVPRW 2018).";

/// The precision of matches within so many pixels, by depth.
pub(super) const fn precision<const PX: usize>(
    id: &'static str,
    heading: &'static str,
    detail: Detail,
) -> ScoreKind {
    ScoreKind {
        id,
        about: Subject::Depth,
        heading,
        definition: PRECISION,
        value: |pairs| Some(mean_of_terms(pairs, |pair| precision_term(pair, PX))),
        spread: Spread::Terms(|pair| precision_term(pair, PX)),
        notation: Notation::Ratio,
        detail,
    }
}

/// Keypoints that were found again, of those that both images show.
pub(super) const REPEATABILITY: ScoreKind = ScoreKind {
    id: "depth_repeatability",
    about: Subject::Depth,
    heading: "Repeatability (depth)",
    definition: FOUND_BY_DEPTH,
    value: |pairs| Some(mean_of_terms(pairs, repeatability_term)),
    spread: Spread::Terms(repeatability_term),
    notation: Notation::Ratio,
    detail: Detail::Complete,
};

/// Correct matches, of the same keypoints.
pub(super) const MATCHING_SCORE: ScoreKind = ScoreKind {
    id: "depth_matching_score",
    about: Subject::Depth,
    heading: "Matching score (depth)",
    definition: FOUND_BY_DEPTH,
    value: |pairs| Some(mean_of_terms(pairs, matching_term)),
    spread: Spread::Terms(matching_term),
    notation: Notation::Ratio,
    detail: Detail::Glance,
};

/// The share of the pair's matches with depth that are correct within so many pixels.
fn precision_term(pair: &PairResult, pixels: usize) -> Term {
    // A pair none of whose matches has depth counts too: else one match in the sky would spare a matcher the pair.
    let by_depth = pair.by_depth.as_ref();
    share_term(
        pair,
        by_depth.map(|by_depth| (by_depth.within[pixels - 1], by_depth.judged)),
    )
}

/// The share of the keypoints that both images show by depth which were found in both.
fn repeatability_term(pair: &PairResult) -> Term {
    let repeated = (pair.by_depth.as_ref()).and_then(|by_depth| by_depth.repeated);
    let found = repeated.map(|repeated| (repeated.within[FOUND_PX - 1], repeated.least_visible()));
    share_term(pair, found)
}

/// The share of the same keypoints that were matched correctly.
fn matching_term(pair: &PairResult) -> Term {
    let found = pair.by_depth.as_ref().and_then(|by_depth| {
        let visible = by_depth.repeated?.least_visible();
        Some((by_depth.within[FOUND_PX - 1], visible))
    });
    share_term(pair, found)
}

#[cfg(test)]
mod tests {
    use super::super::Scores;
    use super::super::pair_result::tests::solved;
    use super::*;
    use crate::records::Counts;

    #[test]
    fn scores_by_depth_by_hand() {
        let scores = Scores::new(&[solved(0, 0.2, 0.9, 300), solved(1, 0.1, 12.0, 900)]);
        let value = |id| scores.get(id).value.expect("there are pairs");
        // Half of the matches are right; a quarter as many matches as keypoints that both see, half of which were found.
        assert!((value("precision_3px") - 0.5).abs() < 1e-12);
        assert!((value("depth_repeatability") - 0.5).abs() < 1e-12);
        assert!((value("depth_matching_score") - 0.125).abs() < 1e-12);
        // Nothing is right without matches, and no better if there are some without depth.
        let [mut none, mut undecided] = [solved(0, 1.0, 1.0, 0), solved(0, 1.0, 1.0, 0)];
        let precision = |pair: PairResult| mean_of_terms(&[pair], |pair| precision_term(pair, 3));
        none.counts = Some(Counts::default());
        assert_eq!(precision(none), 0.0);
        undecided.counts.as_mut().expect("counted").selected = 7;
        assert_eq!(precision(undecided), 0.0);
    }

    #[test]
    fn no_pair_has_more_than_all() {
        // Several matches of one place, with other orientations: 90 correct matches of 40 keypoints.
        let mut pair = solved(0, 1.0, 1.0, 180);
        let by_depth = pair.by_depth.as_mut().expect("by depth");
        by_depth.repeated.as_mut().expect("repeated").visible = [40, 60];
        let scores = Scores::new(&[pair]);
        assert_eq!(scores.get("depth_matching_score").value, Some(1.0));
    }
}
