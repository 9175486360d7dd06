//! Two sets of results of the same pairs, compared pair by pair.
//!
//! Hard pairs are hard for both, so the interval of the difference is much narrower than the two separate
//! intervals suggest. What matters is whether it contains 0.

use std::collections::BTreeMap;

use super::average_matches::is_right;
use super::gains::gains;
use super::scores::AP_THRESHOLD;
use super::success::HEADLINE_PX;
use super::{Angle, Difference, Groups, Model, PairResult, ResultSet, Term, is_above, ranking_auc};

/// What changed from one set of results to another on the pairs that both have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// How many pairs (and repetitions) both have.
    pub pairs: usize,
    /// The score that methods are ranked by ([`ranking_auc`]) before, on these pairs; `None` where there are none.
    pub before: Option<f64>,
    /// The same after.
    pub after: Option<f64>,
    /// Difference of this score, after minus before, with its paired interval.
    pub auc: Difference,
    /// The same of the rotation alone.
    pub rotation_auc: Difference,
    /// The same of the translation alone.
    pub translation_auc: Difference,
    /// Pairs below 5 degrees, or a homography's 3 pixels, now that were not before.
    pub gained: usize,
    /// Pairs below that before that are not now.
    pub lost: usize,
    /// Pairs with another error, or another reason for having none.
    pub changed: usize,
}

/// Compares two sets of results of one dataset.
pub fn compare(before: &ResultSet, after: &ResultSet) -> Comparison {
    let twins = twins(before, after);
    let (pairs_before, pairs_after): (Vec<PairResult>, Vec<PairResult>) = (twins.iter())
        .map(|&(before, after)| (before.clone(), after.clone()))
        .unzip();
    let score = |pairs: &[PairResult]| Some(ranking_auc(pairs)).filter(|score| !score.is_nan());
    let right = |pair: &PairResult| match pair.model {
        Model::Pose => is_right(pair, AP_THRESHOLD),
        Model::Homography => pair.corner_error().is_some_and(|error| error < HEADLINE_PX),
    };
    Comparison {
        pairs: twins.len(),
        before: score(&pairs_before),
        after: score(&pairs_after),
        auc: difference(&twins, Angle::Pose),
        rotation_auc: difference(&twins, Angle::Rotation),
        translation_auc: difference(&twins, Angle::Translation),
        gained: (twins.iter())
            .filter(|(before, after)| !right(before) && right(after))
            .count(),
        lost: (twins.iter())
            .filter(|(before, after)| right(before) && !right(after))
            .count(),
        changed: (twins.iter())
            .filter(|(before, after)| before.outcome != after.outcome)
            .count(),
    }
}

/// How much better `this` is than `other` on the pairs that both have, in the score that methods are ranked by
/// ([`ranking_auc`]): the difference and its paired interval. Both must come from the same dataset.
pub fn auc_difference(this: &ResultSet, other: &ResultSet) -> Difference {
    difference(&twins(other, this), Angle::Pose)
}

/// The best method of a dataset against one of the others.
#[derive(Clone, Debug, PartialEq)]
pub struct Lead {
    /// Name of the dataset.
    pub dataset: String,
    /// What both estimate: poses and homographies of one dataset are not compared.
    pub model: Model,
    /// Matcher and estimator with the highest AUC; of equal ones ([`is_above`]) the first by name.
    pub best: (String, String),
    /// Matcher and estimator that they are compared with.
    pub other: (String, String),
    /// How much better the best are, with the paired interval; certain if the best share no letter with the others
    /// (see [`groups`](super::groups())).
    pub difference: Difference,
}

/// The best of each dataset against each of the others, in the order of `sets`, whose `groups` say what is certain. Sets that
/// [lack](ResultSet::lacking) results are left out.
pub fn leads(sets: &[ResultSet], groups: &Groups) -> Vec<Lead> {
    let auc = |set: &ResultSet| ranking_auc(&set.pairs);
    let method = |set: &ResultSet| (set.matcher.clone(), set.estimator.clone());
    let key = |set: &ResultSet| (set.dataset.clone(), set.model());
    let mut best = BTreeMap::<(String, Model), (usize, f64)>::new();
    for (i, set) in sets.iter().enumerate() {
        if set.pairs.is_empty() || set.lacking > 0 {
            continue;
        }
        let leader = best.entry(key(set)).or_insert((i, auc(set)));
        let is_higher = is_above(Some(auc(set)), Some(leader.1));
        let is_equal = !is_higher && !is_above(Some(leader.1), Some(auc(set)));
        if is_higher || is_equal && method(set) < method(&sets[leader.0]) {
            *leader = (i, auc(set));
        }
    }
    let comparisons = |set: &ResultSet| {
        let is_rival = |other: &&ResultSet| key(other) == key(set) && other.lacking == 0;
        let rivals = sets.iter().filter(is_rival).count();
        rivals * (rivals - 1) / 2
    };
    (sets.iter().enumerate())
        .filter(|(_, set)| set.lacking == 0)
        .filter_map(|(i, set)| Some((best.get(&key(set))?.0, i, set)))
        .filter(|&(best, _, set)| method(&sets[best]) != method(set))
        .map(|(best, i, set)| Lead {
            dataset: set.dataset.clone(),
            model: set.model(),
            best: method(&sets[best]),
            other: method(set),
            difference: Difference {
                is_certain: groups.differ(best, i),
                together: Some(comparisons(set)),
                ..auc_difference(&sets[best], set)
            },
        })
        .collect()
}

/// The results of the pairs (and repetitions) that both have, in the order of `after`.
pub fn twins<'a>(
    before: &'a ResultSet,
    after: &'a ResultSet,
) -> Vec<(&'a PairResult, &'a PairResult)> {
    let key = |pair: &PairResult| (pair.a, pair.b, pair.repetition);
    let before: BTreeMap<_, _> = before.pairs.iter().map(|pair| (key(pair), pair)).collect();
    (after.pairs.iter())
        .filter_map(|pair| Some((*before.get(&key(pair))?, pair)))
        .collect()
}

/// Of one angle of the error; of homographies, which have no angles, that of the corner error for [`Angle::Pose`].
fn difference(twins: &[(&PairResult, &PairResult)], angle: Angle) -> Difference {
    let (before, after): (Vec<&PairResult>, Vec<&PairResult>) = twins.iter().copied().unzip();
    let gained = gains(&before, angle).into_iter().zip(gains(&after, angle));
    let terms: Vec<Term> = (after.iter().zip(gained))
        .filter_map(|(pair, (before, after))| {
            Some(Term {
                images: (pair.a, pair.b),
                numerator: after? - before?,
                denominator: 1.0,
            })
        })
        .collect();
    Difference::new(&terms)
}

#[cfg(test)]
mod tests {
    use super::super::pair_result::tests::solved;
    use super::super::{Deviation, Failure, groups};
    use super::*;

    fn results(pairs: Vec<PairResult>) -> ResultSet {
        ResultSet {
            dataset: "street".into(),
            matcher: "sift".into(),
            estimator: "ransac-e".into(),
            repetitions: 1,
            pairs,
            ignored: 0,
            lacking: 0,
        }
    }

    #[test]
    fn difference_pairs_the_pairs() {
        let better = results(vec![solved(0, 0.1, 0.1, 50), solved(3, 0.1, 4.0, 50)]);
        let worse = results(vec![solved(3, 0.1, 7.0, 50), solved(0, 0.1, 3.0, 50)]);
        // The same on three times as many images.
        let thrice = |set: &ResultSet| {
            let images = (0..3).flat_map(|turn| {
                let moved = move |pair: &PairResult| PairResult {
                    a: pair.a + 10 * turn,
                    b: pair.b + 10 * turn,
                    ..pair.clone()
                };
                set.pairs.iter().map(moved)
            });
            results(images.collect())
        };
        let many = auc_difference(&thrice(&better), &thrice(&worse));
        assert!((many.value.expect("pairs in common") - 0.2).abs() < 1e-15);
        let interval = many.interval.expect("six images");
        assert!((interval.high - interval.low).abs() < 1e-12);
        assert!(many.is_certain);
        // Image 0: 15 - 12 thresholds; image 3: 11 - 8. Three of fifteen each time.
        let score = auc_difference(&better, &worse);
        assert!((score.value.expect("two pairs in common") - 0.2).abs() < 1e-15);
        let comparison = compare(&worse, &better);
        assert_eq!(comparison.auc, score);
        // Of two images, on which one is better by as much, nothing is certain.
        assert!(!comparison.auc.is_certain && comparison.auc.has_few_images());
        assert_eq!(score.interval, None);
        assert_eq!(
            (comparison.gained, comparison.lost, comparison.changed),
            (1, 0, 2)
        );
    }

    #[test]
    fn equal_results_have_no_difference_and_others_no_pairs() {
        let one = results(vec![
            solved(0, 0.1, 0.1, 50),
            PairResult::failed(1, 2, Failure::NoSupport),
        ]);
        let same = compare(&one, &one);
        assert_eq!((same.auc.value, same.changed), (Some(0.0), 0));
        assert!(!same.auc.is_certain);
        let none = compare(&results(vec![]), &one);
        assert_eq!((none.pairs, none.before, none.auc.value), (0, None, None));
    }

    #[test]
    fn homographies_differ_by_the_score_of_tables() {
        // The mean of 1 - error / 3 is 0.5 of both, the area under recall is not.
        let corners = |errors: [f64; 2]| {
            let pair = |a: u32| PairResult {
                model: Model::Homography,
                outcome: Ok(Deviation::Corners(Some(errors[a as usize % 2]))),
                ..solved(a, 0.0, 0.0, 50)
            };
            results((0..8).map(pair).collect())
        };
        let (one, other) = (corners([1.5, 1.5]), corners([0.0, 4.0]));
        let comparison = compare(&one, &other);
        let scores = [&one, &other].map(|set| ranking_auc(&set.pairs));
        assert_eq!([comparison.before, comparison.after], scores.map(Some));
        let by = comparison.auc.value.expect("the same pairs");
        assert!((by - (scores[1] - scores[0])).abs() < 1e-15);
        let interval = comparison.auc.interval.expect("eight images");
        assert!(interval.low < interval.high && !comparison.auc.is_zero());
        assert!(!comparison.auc.is_certain);
        let same = compare(&one, &one).auc;
        assert!(same.is_zero() && same.interval.is_some_and(|i| i.low == 0.0 && i.high == 0.0));
        let better = compare(&one, &corners([0.2, 0.3])).auc;
        assert!(better.is_certain && better.value > Some(0.0));
    }

    #[test]
    fn the_best_of_each_dataset_leads_the_others() {
        let named = |matcher: &str, error| ResultSet {
            matcher: matcher.into(),
            // Of ten images in a row, eight are in two pairs. Eight signs are enough where all differences are alike.
            ..results((0..9).map(|a| solved(a, 0.1, error, 50)).collect())
        };
        let elsewhere = ResultSet {
            dataset: "room".into(),
            ..named("orb", 0.1)
        };
        let sets = [
            named("sift", 4.5),
            named("orb", 0.1),
            named("surf", 0.1),
            elsewhere,
        ];
        let leads = leads(&sets, &groups(&sets));
        let found: Vec<_> = (leads.iter())
            .map(|lead| (&*lead.best.0, &*lead.other.0, lead.difference.is_certain))
            .collect();
        assert_eq!(found, [("orb", "sift", true), ("orb", "surf", false)]);
        let by = leads[0].difference.value.expect("the same pairs");
        assert!((by - 4.0 / 15.0).abs() < 1e-15);
        // All three methods are compared with each other, and decided together.
        assert_eq!(leads[0].difference.together, Some(3));
    }

    #[test]
    fn each_angle_is_compared_with_itself() {
        // The rotation is below 15 and then 10 of 15 thresholds, the translation below 8 and then 11, the larger of both below 8
        // and then 10.
        let before = results(vec![solved(0, 0.5, 7.5, 50)]);
        let after = results(vec![solved(0, 5.5, 4.5, 50)]);
        let comparison = compare(&before, &after);
        for (difference, expected) in [
            (comparison.auc, 2.0 / 15.0),
            (comparison.rotation_auc, -5.0 / 15.0),
            (comparison.translation_auc, 3.0 / 15.0),
        ] {
            let value = difference.value.expect("a pair in common");
            assert!((value - expected).abs() < 1e-15, "{value} {expected}");
        }
    }

    #[test]
    fn a_repetition_is_compared_with_the_same_one() {
        let repeated = |repetition, error| PairResult {
            repetition,
            ..solved(0, 0.1, error, 50)
        };
        let before = results(vec![repeated(0, 0.5), repeated(1, 9.5)]);
        let after = results(vec![repeated(1, 9.5), repeated(0, 0.5), repeated(2, 3.0)]);
        let same = compare(&before, &after);
        assert_eq!((same.pairs, same.changed), (2, 0));
        assert_eq!((same.gained, same.lost), (0, 0));
    }

    #[test]
    fn a_homography_is_right_below_three_pixels() {
        let corners = |errors: [f64; 4]| {
            let pairs = (0..).zip(errors).map(|(a, error)| PairResult {
                model: Model::Homography,
                outcome: Ok(Deviation::Corners(Some(error))),
                ..solved(a, 0.0, 0.0, 50)
            });
            results(pairs.collect())
        };
        let (before, after) = ([2.9, 3.5, 3.1, 2.0], [3.0, 2.99, 4.5, 0.1]);
        let comparison = compare(&corners(before), &corners(after));
        assert_eq!((comparison.gained, comparison.lost), (1, 1));
    }

    #[test]
    fn what_is_not_finished_does_not_lead_and_is_not_compared() {
        let named = |matcher: &str, error, lacking| ResultSet {
            matcher: matcher.into(),
            lacking,
            ..results((0..9).map(|a| solved(a, 0.1, error, 50)).collect())
        };
        let sets = [
            named("sift", 4.5, 0),
            named("orb", 0.1, 1),
            named("surf", 1.5, 0),
        ];
        let leads = leads(&sets, &groups(&sets));
        let found: Vec<_> = (leads.iter())
            .map(|lead| (&*lead.best.0, &*lead.other.0, lead.difference.together))
            .collect();
        assert_eq!(found, [("surf", "sift", Some(1))]);
    }
}
