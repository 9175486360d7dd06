//! Two methods side by side on the pairs where they differ most. The methods are two matchers of one run, or
//! one matcher before and after a change.
//!
//! The difference of a pair is the difference of the two errors, each limited to what the AUC sees: 15
//! degrees, or 3 pixels for homographies. A pair without an estimate gets the largest error. For each method, the
//! pairs are shown on which it wins by the largest difference.

use crate::metrics::{Comparison, HEADLINE_PX, Model, PairResult, ResultSet, twins as all_twins};
use crate::records::RunFolder;

/// The error of a pair without an estimate.
const WORST: f64 = 180.0;

/// One of two methods that are compared.
#[derive(Clone, Copy, Debug)]
pub struct Side<'a> {
    /// Its name on the page.
    pub name: &'a str,
    /// The run that it belongs to.
    pub run: &'a RunFolder,
    /// Its results.
    pub results: &'a ResultSet,
}

/// Two methods on the same dataset.
#[derive(Clone, Copy, Debug)]
pub struct Duel<'a> {
    /// The first and the second.
    pub sides: [Side<'a>; 2],
    /// What they are compared on: the dataset, and the method of both where their names do not say it.
    pub on: &'a str,
    /// The change of the scores from the first to the second.
    pub comparison: Comparison,
}

/// A pair with the results of both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Twin<'a> {
    pub(super) frames: (u32, u32),
    pub(super) results: [&'a PairResult; 2],
}

impl Twin<'_> {
    /// Which of the repetitions of the pair it is.
    pub(super) fn repetition(&self) -> u32 {
        self.results[0].repetition
    }

    /// The errors of both: degrees of the pose, pixels of the corners.
    pub(super) fn errors(&self) -> [Option<f64>; 2] {
        self.results.map(PairResult::judged_error)
    }

    /// By how much the first is worse than the second: first with errors limited as in the AUC, then without a
    /// limit.
    fn lead(&self) -> [f64; 2] {
        let seen_below = match self.results[0].model {
            Model::Pose => 15.0,
            Model::Homography => HEADLINE_PX,
        };
        [seen_below, WORST].map(|most| {
            let [first, second] = self.errors().map(|error| error.unwrap_or(WORST).min(most));
            first - second
        })
    }
}

/// The pairs for which both have a result, once for each repetition, in the order of the first.
pub(super) fn twins<'a>(duel: &Duel<'a>) -> Vec<Twin<'a>> {
    let [first, second] = duel.sides.map(|side| side.results);
    let twins = all_twins(second, first).into_iter();
    twins
        .map(|(second, first)| Twin {
            frames: (first.a, first.b),
            results: [first, second],
        })
        .collect()
}

/// For each method, at most so many pairs on which it wins in the first repetition, the largest difference first.
pub(super) fn won<'a>(twins: &[Twin<'a>], most: usize) -> [Vec<Twin<'a>>; 2] {
    [-1.0, 1.0].map(|sign| {
        let lead = |twin: &Twin<'_>| twin.lead().map(|lead| sign * lead);
        let mut won: Vec<Twin<'a>> = (twins.iter())
            .filter(|twin| twin.repetition() == 0 && lead(twin)[0] > 0.0)
            .copied()
            .collect();
        won.sort_by(|one, other| {
            let [seen, all] = lead(other);
            let [own_seen, own_all] = lead(one);
            (seen.total_cmp(&own_seen))
                .then(all.total_cmp(&own_all))
                .then(one.frames.cmp(&other.frames))
        });
        won.truncate(most);
        won
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::{AngularError, Deviation, Failure};

    fn result(b: u32, error: Option<f64>) -> PairResult {
        let mut pair = PairResult::failed(0, b, Failure::NoSupport);
        if let Some(error) = error {
            pair.outcome = Ok(Deviation::Pose(AngularError {
                rotation: error,
                translation: Some(0.0),
            }));
        }
        pair
    }

    #[test]
    fn what_the_auc_of_homographies_does_not_see_is_no_win() {
        let corner = |error| PairResult {
            model: Model::Homography,
            outcome: Ok(Deviation::Corners(Some(error))),
            ..result(1, None)
        };
        let wins = |first, second| {
            let results = [corner(first), corner(second)];
            let twin = Twin {
                frames: (0, 1),
                results: results.each_ref(),
            };
            won(&[twin], 9).map(|won| won.len())
        };
        assert_eq!(wins(5.0, 14.0), [0, 0]);
        assert_eq!(wins(2.0, 14.0), [1, 0]);
        assert_eq!(wins(2.5, 1.0), [0, 1]);
    }

    #[test]
    fn each_side_shows_the_pairs_that_it_wins_by_most() {
        let cases = [
            (1, Some(1.0), Some(2.0)),
            (2, Some(1.0), None),
            (3, Some(1.0), Some(20.0)),
            (4, Some(9.0), Some(1.0)),
            // Both errors are above the limit of the AUC.
            (5, Some(20.0), Some(90.0)),
            (6, Some(3.0), Some(3.0)),
        ];
        let pairs = cases.map(|(b, first, second)| [result(b, first), result(b, second)]);
        let twins: Vec<Twin<'_>> = (pairs.iter())
            .map(|[first, second]| Twin {
                frames: (first.a, first.b),
                results: [first, second],
            })
            .collect();
        let frames =
            |won: &[Twin<'_>]| -> Vec<u32> { won.iter().map(|twin| twin.frames.1).collect() };
        let [first, second] = won(&twins, 9);
        assert_eq!(
            frames(&first),
            [2, 3, 1],
            "of equal leads the larger at all"
        );
        assert_eq!(frames(&second), [4]);
        assert_eq!(frames(&won(&twins, 2)[0]), [2, 3]);
    }
}
