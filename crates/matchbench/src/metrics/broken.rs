//! How pairs that broke or are missing count: as nothing right, in every share that they would have been
//! in.
//!
//! Such a pair has no counts of its own. If it were left out of a share, a matcher that breaks where pairs
//! are hard would gain. The other results of the dataset tell which shares it belongs to: whether there is
//! a true homography or depth of the pair, and whether its matcher has keypoints at all.

use std::collections::{BTreeMap, BTreeSet};

use crate::estimators;
use crate::protocols::without_protocol;
use crate::records::{ByDepth, Repeated};

use super::{Failure, Model, PairResult, ResultSet};

/// Gives the pairs of all sets that broke or are missing the model and the counts that they have to have.
pub(super) fn count_broken(sets: &mut [&mut ResultSet]) {
    let models: BTreeMap<String, Model> = (sets.iter())
        .filter_map(|set| Some((set.estimator.clone(), said_model(set)?)))
        .collect();
    // Only of datasets with such pairs is anything collected: others may have millions of pairs.
    let mut datasets: BTreeMap<String, Judged> = (sets.iter())
        .filter(|set| set.pairs.iter().any(is_broken))
        .map(|set| (set.dataset.clone(), Judged::default()))
        .collect();
    for set in sets.iter() {
        let Some(judged) = datasets.get_mut(&set.dataset) else {
            continue;
        };
        for pair in set.pairs.iter().filter(|pair| !is_broken(pair)) {
            let key = (pair.a, pair.b);
            judged.by_homography.note(key, pair.correct.is_some());
            judged.by_depth.note(key, pair.by_depth.is_some());
        }
    }
    for set in sets {
        let model = said_model(set)
            .or_else(|| models.get(&set.estimator).copied())
            .or_else(|| model_of(&set.estimator))
            .unwrap_or_default();
        set.pairs.iter_mut().for_each(|pair| pair.model = model);
        let Some(judged) = datasets.get(&set.dataset) else {
            continue;
        };
        let has_keypoints = set.pairs.iter().any(|pair| pair.found_again.is_some());
        let repeats = |pair: &PairResult| pair.by_depth.as_ref()?.repeated;
        let repeats_by_depth = set.pairs.iter().any(|pair| repeats(pair).is_some());
        for pair in set.pairs.iter_mut().filter(|pair| is_broken(pair)) {
            let key = (pair.a, pair.b);
            if judged.by_homography.has(key) {
                pair.correct.get_or_insert([0; 10]);
                if has_keypoints {
                    pair.found_again.get_or_insert((0, 0));
                }
            }
            if judged.by_depth.has(key) {
                let repeated = Repeated {
                    visible: [0; 2],
                    within: [0; 10],
                };
                pair.by_depth.get_or_insert_with(|| {
                    Box::new(ByDepth {
                        overlap: None,
                        judged: 0,
                        within: [0; 10],
                        repeated: repeats_by_depth.then_some(repeated),
                    })
                });
            }
        }
    }
}

/// What the truth of a dataset's pairs allows to count.
#[derive(Default)]
struct Judged {
    by_homography: Known,
    by_depth: Known,
}

/// The pairs of which something is known by those results that did not break, and those of which it is not.
#[derive(Default)]
struct Known {
    of: BTreeSet<(u32, u32)>,
    not_of: BTreeSet<(u32, u32)>,
}

impl Known {
    fn note(&mut self, pair: (u32, u32), known: bool) {
        if known {
            self.of.insert(pair);
        } else {
            self.not_of.insert(pair);
        }
    }

    /// Whether it is known of the pair; of one that broke for everybody, whether it is of all others.
    fn has(&self, pair: (u32, u32)) -> bool {
        self.of.contains(&pair) || (!self.of.is_empty() && self.not_of.is_empty())
    }
}

/// Whether nobody knows what the pair would have come to.
fn is_broken(pair: &PairResult) -> bool {
    matches!(pair.outcome, Err(Failure::Broken | Failure::Missing))
}

/// What the results say that they are of, if one of them does.
fn said_model(set: &ResultSet) -> Option<Model> {
    let said = set.pairs.iter().find(|pair| !is_broken(pair));
    said.map(|pair| pair.model)
}

/// What the estimator of this name estimates, if it is one of the list.
fn model_of(estimator: &str) -> Option<Model> {
    let of_homographies = estimators::is_of_homographies(without_protocol(estimator))?;
    Some(if of_homographies {
        Model::Homography
    } else {
        Model::Pose
    })
}

#[cfg(test)]
mod tests {
    use super::super::Scores;
    use super::super::pair_result::tests::{solved, transferred};
    use super::*;

    fn set(matcher: &str, estimator: &str, pairs: Vec<PairResult>) -> ResultSet {
        ResultSet {
            dataset: "boat".into(),
            matcher: matcher.into(),
            estimator: estimator.into(),
            repetitions: 1,
            pairs,
            ignored: 0,
            lacking: 0,
        }
    }

    fn broken(a: u32) -> PairResult {
        PairResult::failed(a, a + 1, Failure::Broken)
    }

    fn counted(mut sets: Vec<ResultSet>) -> Vec<ResultSet> {
        count_broken(&mut sets.iter_mut().collect::<Vec<_>>());
        sets
    }

    fn score(set: &ResultSet, id: &str) -> Option<f64> {
        Scores::new(&set.pairs).get(id).value
    }

    #[test]
    fn who_breaks_on_a_hard_pair_is_not_better_than_who_finds_nothing() {
        let empty = PairResult {
            model: Model::Homography,
            correct: Some([0; 10]),
            found_again: Some((40, 0)),
            ..PairResult::failed(1, 2, Failure::TooFewMatches)
        };
        let sets = counted(vec![
            set(
                "finds-nothing",
                "best-h",
                vec![transferred(0, 0.5, 100), empty],
            ),
            set(
                "breaks",
                "best-h",
                vec![transferred(0, 0.5, 100), broken(1)],
            ),
        ]);
        for id in ["mma1", "mma3", "repeatability", "matching_score", "auc_h3"] {
            assert!(score(&sets[0], id).is_some(), "{id}");
            assert_eq!(score(&sets[1], id), score(&sets[0], id), "{id}");
        }
        assert_eq!(score(&sets[1], "mma3"), Some(0.5));
    }

    #[test]
    fn depth_counts_broken_pairs_too() {
        let sets = counted(vec![set(
            "breaks",
            "best",
            vec![solved(0, 0.2, 0.9, 300), broken(1)],
        )]);
        assert_eq!(score(&sets[0], "precision_3px"), Some(0.25));
        assert_eq!(score(&sets[0], "depth_repeatability"), Some(0.25));
        assert_eq!(score(&sets[0], "mma3"), None);
    }

    #[test]
    fn a_set_of_broken_pairs_is_of_what_its_estimator_estimates() {
        let sets = counted(vec![
            set("sift", "best-h", vec![transferred(0, 0.5, 100)]),
            set("breaks", "best-h", vec![broken(0)]),
            set("breaks", "ransac-h@superglue", vec![broken(0)]),
            set("breaks", "best", vec![broken(0)]),
        ]);
        let models: Vec<Model> = sets.iter().map(|set| set.pairs[0].model).collect();
        assert_eq!(models[..3], [Model::Homography; 3]);
        assert_eq!(models[3], Model::Pose);
        assert_eq!(score(&sets[1], "auc_h3"), Some(0.0));
        assert_eq!(score(&sets[1], "auc"), None);
    }

    #[test]
    fn where_other_pairs_lack_the_truth_nothing_is_supposed() {
        let [mut without, mut with] = [solved(0, 0.2, 0.9, 300), solved(1, 0.2, 0.9, 300)];
        without.by_depth = None;
        with.by_depth.as_mut().expect("it has depth").repeated = None;
        let sets = counted(vec![
            set("sift", "best", vec![without, with, broken(2)]),
            set("orb", "best", vec![broken(0), broken(1), broken(2)]),
        ]);
        assert!(sets[0].pairs[2].by_depth.is_none());
        let depth: Vec<bool> = (sets[1].pairs.iter())
            .map(|pair| pair.by_depth.is_some())
            .collect();
        assert_eq!(depth, [false, true, false]);
    }
}
