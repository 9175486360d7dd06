//! Results as a protocol of the field scores them, and what their run did otherwise.
//!
//! A protocol pools a certain number of repetitions of every pair. Where a run has more of them, each such
//! group is a score of its own, and their mean is shown, with the standard deviation. A run with fewer
//! repetitions is scored all the same, and the output says so.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;
use serde_json::Value;

use super::quantiles::{deviation, mean};
use super::{Model, PairResult, ResultSet, Score, ScoreKind, score_kind};
use crate::counted::counted;
use crate::estimators;
use crate::matchers::SIZES;
use crate::protocols::{self, Centres, EstimatorRule, PROTOCOLS, Protocol, SizeRule};
use crate::records::{EstimatorPlan, MatcherPlan, Plan};

/// One set of results by the scores of a protocol.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProtocolScores {
    /// Id of the protocol.
    pub protocol: &'static str,
    /// Name of the dataset, or `mean`: that of the scores over all datasets.
    pub dataset: String,
    /// Id of the matcher.
    pub matcher: String,
    /// Name of the estimator; empty where the results do not tell.
    pub estimator: String,
    /// Pairs that are scored, once per repetition.
    pub pairs: usize,
    /// Those of them without a pose.
    pub failed: usize,
    /// The scores of the protocol, in its order.
    pub scores: Vec<ProtocolScore>,
    /// How the run departs from the protocol, in sentences without a full stop.
    pub otherwise: Vec<String>,
}

/// A score of a protocol.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ProtocolScore {
    /// Its id, one of [`SCORES`](super::SCORES).
    pub id: &'static str,
    /// The score, in `[0, 1]`, and its interval over images; a mean over datasets has none.
    #[serde(flatten)]
    pub score: Score,
    /// Sample standard deviation over groups of repetitions, where there are several.
    pub deviation: Option<f64>,
}

impl ProtocolScore {
    /// Its entry in the list of all scores.
    pub fn kind(&self) -> &'static ScoreKind {
        score_kind(self.id)
    }
}

/// Scores the `sets` by each of the protocols `asked`: those that were made under it, or, where none was, all of
/// them. But if all protocols are asked for, sets that were made under several are scored by these alone. With `plan`, that
/// of their run, they also say what it did otherwise. Of several datasets the mean comes last, for each method and protocol;
/// one that [lacks](ResultSet::lacking) results has none.
pub fn under_protocols(
    sets: &[ResultSet],
    plan: Option<&Plan>,
    asked: &[&'static Protocol],
) -> Vec<ProtocolScores> {
    let made_under = |set: &ResultSet| protocols::of_estimator(&set.estimator);
    let is_asked = |protocol: &Protocol| asked.iter().any(|asked| asked.id == protocol.id);
    let are_all = PROTOCOLS.iter().all(|protocol| is_asked(protocol));
    let is_under_others = sets.iter().any(|set| !made_under(set).is_ours());
    let mut all = Vec::new();
    for &protocol in asked {
        let own = || sets.iter().filter(|set| made_under(set).id == protocol.id);
        if own().next().is_some() {
            all.extend(own().map(|set| score(set, plan, protocol)));
        } else if !(are_all && is_under_others) {
            all.extend(sets.iter().map(|set| score(set, plan, protocol)));
        }
    }
    let means = means(&all, sets);
    all.extend(means);
    all
}

fn score(set: &ResultSet, plan: Option<&Plan>, protocol: &'static Protocol) -> ProtocolScores {
    let groups = groups(set, protocol.shuffles);
    // Of a run that is not finished they may not be, and then the mean over pairs is another score.
    let are_alike = groups.windows(2).all(|two| two[0].len() == two[1].len());
    let scores = protocol.scores.iter().map(|id| {
        let kind = score_kind(id);
        let values: Option<Vec<f64>> = (groups.iter())
            .map(|pairs| (kind.value)(pairs).filter(|value| value.is_finite()))
            .collect();
        let values = values.unwrap_or_default();
        let value = (!values.is_empty()).then(|| mean(&values));
        ProtocolScore {
            id: kind.id,
            score: Score {
                value,
                interval: value
                    .filter(|_| are_alike)
                    .and_then(|_| kind.interval(groups.iter().map(Vec::as_slice))),
            },
            deviation: deviation(&values),
        }
    });
    ProtocolScores {
        protocol: protocol.id,
        dataset: set.dataset.clone(),
        matcher: set.matcher.clone(),
        estimator: set.estimator.clone(),
        scores: scores.collect(),
        pairs: groups.iter().map(Vec::len).sum(),
        failed: (groups.iter().flatten())
            .filter(|pair| pair.outcome.is_err())
            .count(),
        otherwise: otherwise(set, plan, protocol),
    }
}

/// The pairs of as many repetitions at a time as are pooled; what is left over at the end is left out.
fn groups(set: &ResultSet, pooled: u32) -> Vec<Vec<PairResult>> {
    let count = (set.repetitions / pooled).max(1);
    let mut groups = vec![Vec::new(); count as usize];
    for pair in &set.pairs {
        if let Some(group) = groups.get_mut((pair.repetition / pooled) as usize) {
            group.push(pair.clone());
        }
    }
    groups
}

/// The mean over datasets of each method under each protocol that has several. A method that lacks results on one of them
/// is not compared with others, so its mean is unknown.
fn means(all: &[ProtocolScores], results: &[ResultSet]) -> Vec<ProtocolScores> {
    let lacking: BTreeSet<[&str; 3]> = (results.iter().filter(|set| set.lacking > 0))
        .map(|set| [&*set.dataset, &*set.matcher, &*set.estimator])
        .collect();
    let lacks =
        |one: &ProtocolScores| lacking.contains(&[&*one.dataset, &*one.matcher, &*one.estimator]);
    // In the order in which they come first.
    let mut places = BTreeMap::new();
    let mut methods = Vec::<Vec<&ProtocolScores>>::new();
    for one in all {
        let method = (one.protocol, &one.matcher, &one.estimator);
        let place = *places.entry(method).or_insert(methods.len());
        if place == methods.len() {
            methods.push(Vec::new());
        }
        methods[place].push(one);
    }
    let several = methods.into_iter().filter(|sets| sets.len() > 1);
    let mean_of = |sets: Vec<&ProtocolScores>| {
        let unfinished: Vec<&str> = (sets.iter().filter(|one| lacks(one)))
            .map(|one| &*one.dataset)
            .collect();
        let is_known = unfinished.is_empty();
        let unfinished = (!is_known).then(|| {
            let names = unfinished.join(", ");
            format!("it lacks results of {names} that others have, so it has no mean")
        });
        let scores = (0..sets[0].scores.len()).map(|i| {
            let values = sets.iter().map(|set| set.scores[i].score.value);
            let values: Option<Vec<f64>> = values.collect();
            ProtocolScore {
                score: Score {
                    value: values.filter(|_| is_known).map(|values| mean(&values)),
                    interval: None,
                },
                deviation: None,
                ..sets[0].scores[i]
            }
        });
        ProtocolScores {
            dataset: "mean".to_owned(),
            pairs: sets.iter().map(|set| set.pairs).sum(),
            failed: sets.iter().map(|set| set.failed).sum(),
            scores: scores.collect(),
            otherwise: unfinished
                .or_else(|| alone(&sets, all))
                .into_iter()
                .collect(),
            ..sets[0].clone()
        }
    };
    several.map(mean_of).collect()
}

/// That a mean is over fewer datasets than others have under its protocol, if it is.
fn alone(sets: &[&ProtocolScores], all: &[ProtocolScores]) -> Option<String> {
    let its: BTreeSet<&str> = sets.iter().map(|set| &*set.dataset).collect();
    let others = all.iter().filter(|one| one.protocol == sets[0].protocol);
    let others: BTreeSet<&str> = others.map(|one| &*one.dataset).collect();
    let names: Vec<&str> = its.iter().copied().collect();
    (its != others).then(|| format!("its mean is over {} alone", names.join(", ")))
}

/// What the run of a set did otherwise than the protocol asks.
fn otherwise(set: &ResultSet, plan: Option<&Plan>, protocol: &Protocol) -> Vec<String> {
    if set.model() == Model::Homography {
        // Nothing else that it did otherwise matters.
        return vec!["homographies were estimated, and its scores are of poses".to_owned()];
    }
    let mut found = Vec::new();
    let made = protocols::of_estimator(&set.estimator);
    let matcher = plan.and_then(|plan| plan.matcher(&set.matcher));
    let estimator = matcher.and_then(|matcher| {
        let mut estimators = matcher.estimators.iter();
        estimators.find(|estimator| estimator.id == set.estimator)
    });
    match (matcher, estimator) {
        (Some(matcher), Some(estimator)) => {
            found.extend(other_size(matcher, protocol.size));
            found.extend(other_estimator(estimator, protocol.estimator));
        }
        _ => found.push("how its poses were estimated is not known here".to_owned()),
    }
    if estimator.is_some() {
        if (made.unit_in_words() != protocol.unit_in_words())
            && !matches!(protocol.estimator, EstimatorRule::Own)
        {
            let (theirs, ours) = (made.unit_in_words(), protocol.unit_in_words());
            found.push(format!("thresholds were in {theirs}, not in {ours}"));
        }
        if made.centres != protocol.centres {
            let how = match protocol.centres {
                Centres::Scaled => "points were kept where they are when sizes change",
                Centres::Kept => {
                    "points were multiplied by the ratio of the sizes when these change, not kept where they are"
                }
            };
            found.push(how.to_owned());
        }
        let [theirs, ours] = [made, protocol].map(Protocol::least_in_words);
        if theirs != ours {
            let [theirs, ours] = [theirs, ours].map(|least| least.join(" or "));
            found.push(format!("a pair failed below {theirs}, not below {ours}"));
        }
    }
    if set.repetitions < protocol.shuffles {
        let (theirs, ours) = (set.repetitions, protocol.shuffles);
        found.push(format!(
            "{} of each pair {} pooled, not {ours}",
            counted(theirs, "estimation"),
            if theirs == 1 { "was" } else { "were" }
        ));
    }
    let left_over = set.repetitions % protocol.shuffles;
    if left_over > 0 && set.repetitions > protocol.shuffles {
        let (all, pooled) = (counted(set.repetitions, "repetition"), protocol.shuffles);
        found.push(format!(
            "the last {left_over} of {all} {} not scored, since {pooled} at a time are pooled",
            if left_over == 1 { "is" } else { "are" }
        ));
    }
    found
}

fn other_size(matcher: &MatcherPlan, asked: SizeRule) -> Option<String> {
    if matcher.extraction.is_none() {
        let words = asked.in_words();
        return (asked != SizeRule::AsIs)
            .then(|| format!("matches came from elsewhere, perhaps not of images {words}"));
    }
    let extractor = &matcher.params["extractor"];
    let given = SIZES.map(|name| extractor.get(name).filter(|size| !size.is_null()));
    let asked_params = asked.params().unwrap_or_default();
    let wanted = SIZES.map(|name| asked_params["extractor"].get(name));
    let theirs = match given {
        _ if given == wanted => return None,
        [Some(most), _] => format!("of at most {most} pixels"),
        [_, Some(Value::String(size))] => format!("of {size} pixels"),
        _ => {
            let words = asked.in_words();
            return Some(format!(
                "images were as they are, not {words} unless that is their size"
            ));
        }
    };
    Some(format!("images were {theirs}, not {}", asked.in_words()))
}

fn other_estimator(planned: &EstimatorPlan, asked: EstimatorRule) -> Option<String> {
    let EstimatorRule::Of { id, params } = asked else {
        return None;
    };
    let theirs = planned.variant_of.as_deref().unwrap_or(&planned.id);
    if theirs != id {
        return Some(format!("poses are by {theirs}, not by {id}"));
    }
    let wanted = estimators::find(id)
        .ok()?
        .build(Some(&params()))
        .ok()?
        .params;
    let wanted = wanted.as_object().into_iter().flatten();
    let others = wanted.filter_map(|(name, ours)| {
        let theirs = planned.params.get(name).unwrap_or(&Value::Null);
        (theirs != ours).then(|| format!("{name} was {theirs}, not {ours}"))
    });
    let others: Vec<String> = others.collect();
    (!others.is_empty()).then(|| others.join(" and "))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::pair_result::tests::solved;
    use super::super::{SCORES, exact_auc};
    use super::*;
    use crate::protocols::{IMC, MATCHBENCH, ROMA, SUPERGLUE};

    fn set(estimator: &str, errors: &[&[f64]]) -> ResultSet {
        let pairs = (0..).zip(errors).flat_map(|(repetition, errors)| {
            (0..).zip(*errors).map(move |(a, error)| PairResult {
                repetition,
                ..solved(a, *error, 0.0, 30)
            })
        });
        ResultSet {
            dataset: "room".into(),
            matcher: "sift".into(),
            estimator: estimator.into(),
            repetitions: errors.len() as u32,
            pairs: pairs.collect(),
            ignored: 0,
            lacking: 0,
        }
    }

    /// The plan of a run of SIFT with one estimator.
    fn plan(estimator: Value, extractor: Value) -> Plan {
        serde_json::from_value(json!({
            "version": "0.1.0",
            "settings": {"seed": 0, "repetitions": 1, "limit": null},
            "datasets": [],
            "matchers": [{
                "id": "sift", "params": {"extractor": extractor}, "estimators": [estimator],
                "extraction": {"extractor": "sift", "params": {}, "revision": 1}
            }]
        }))
        .expect("a plan")
    }

    #[test]
    fn every_score_of_a_protocol_is_on_the_list() {
        for protocol in PROTOCOLS {
            for id in protocol.scores {
                assert!(
                    SCORES.iter().any(|kind| kind.id == *id),
                    "{}: {id}",
                    protocol.id
                );
            }
        }
    }

    #[test]
    fn repetitions_are_pooled_or_averaged_as_the_protocol_says() {
        let runs: [&[f64]; 5] = [
            &[1.0, 9.0],
            &[2.0, 8.0],
            &[3.0, 7.0],
            &[4.0, 6.0],
            &[0.5, 4.5],
        ];
        let set = set("ransac-e", &runs);
        let aucs: Vec<f64> = (0..5)
            .map(|repetition| {
                let pairs = set
                    .pairs
                    .iter()
                    .filter(|pair| pair.repetition == repetition);
                exact_auc(&pairs.cloned().collect::<Vec<_>>(), 10.0)
            })
            .collect();
        let [superglue, roma] =
            [&SUPERGLUE, &ROMA].map(|protocol| score(&set, None, protocol).scores[1]);
        assert!((superglue.score.value.unwrap() - mean(&aucs)).abs() < 1e-15);
        assert!(superglue.deviation.is_some());
        assert!((roma.score.value.unwrap() - exact_auc(&set.pairs, 10.0)).abs() < 1e-15);
        assert!(roma.deviation.is_none() && roma.score.value != superglue.score.value);
    }

    #[test]
    fn the_deviation_is_that_of_the_scores_of_repetitions() {
        // Three pairs, of errors e, f, g below 10 degrees: the area up to 10 is 30 - e - f - g / 2, or 20 - e - f / 2, or
        // 10 - e / 2, of 30.
        let runs: [&[f64]; 3] = [&[8.0, 50.0, 50.0], &[4.0, 8.0, 50.0], &[4.0, 4.0, 8.0]];
        let scores = score(&set("ransac-e", &runs), None, &SUPERGLUE).scores;
        assert_eq!(scores[1].id, "exact_auc_10");
        // The AUCs are 0.2, 0.4 and 0.6.
        assert!((scores[1].score.value.expect("there are pairs") - 0.4).abs() < 1e-12);
        assert_eq!(scores[1].score.interval, None, "three pairs tell little");
        let deviation = scores[1].deviation.expect("three repetitions");
        assert!((deviation - 0.2).abs() < 1e-12);
        // Repetitions of other pairs have a mean too, and no interval.
        let errors = [0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5];
        for (fewer, has_interval) in [(8, true), (7, false)] {
            let runs = set("ransac-e", &[&errors, &errors[..fewer]]);
            let auc = score(&runs, None, &SUPERGLUE).scores[1].score;
            assert!(auc.value.is_some() && auc.interval.is_some() == has_interval);
        }
    }

    #[test]
    fn sets_are_scored_by_the_protocol_that_they_were_made_under() {
        let sets = [
            set("ransac-e-inliers@superglue", &[&[1.0]]),
            set("ransac-e", &[&[2.0]]),
        ];
        let ids = |sets: &[ResultSet], asked: &[&'static Protocol]| -> Vec<(String, &str)> {
            let scores = under_protocols(sets, None, asked).into_iter();
            scores.map(|one| (one.estimator, one.protocol)).collect()
        };
        let own = [
            ("ransac-e".to_owned(), "matchbench"),
            ("ransac-e-inliers@superglue".to_owned(), "superglue"),
        ];
        assert_eq!(ids(&sets, PROTOCOLS), own);
        assert_eq!(ids(&sets, &[&SUPERGLUE]), own[1..]);
        // Poses of one run under all definitions.
        assert_eq!(ids(&sets[1..], PROTOCOLS).len(), PROTOCOLS.len());
        assert_eq!(ids(&sets, &[&ROMA]).len(), 2);
        // Several that are named are scored as each alone.
        for named in [
            [&SUPERGLUE, &ROMA],
            [&ROMA, &IMC],
            [&MATCHBENCH, &SUPERGLUE],
        ] {
            let each = named.map(|protocol| ids(&sets, &[protocol])).concat();
            assert_eq!(ids(&sets, &named), each);
        }
        assert_eq!(ids(&sets[..1], &[&ROMA, &IMC]).len(), 2);
    }

    #[test]
    fn that_homographies_have_none_of_the_scores_is_all_that_is_said_of_them() {
        let mut plane = set("best-h@superglue", &[&[1.0, 2.0]]);
        for pair in &mut plane.pairs {
            pair.model = Model::Homography;
        }
        let estimator = json!({"id": "best-h@superglue", "params": {}});
        let plan = plan(estimator, json!({}));
        for protocol in PROTOCOLS {
            let scored = score(&plane, Some(&plan), protocol);
            assert!(scored.scores.iter().all(|one| one.score.value.is_none()));
            let said = "homographies were estimated, and its scores are of poses";
            assert_eq!(scored.otherwise, [said], "{}", protocol.id);
        }
    }

    #[test]
    fn the_mean_is_over_datasets() {
        let mut sets = [
            set("ransac-e", &[&[0.5, 20.0]]),
            set("ransac-e", &[&[0.5, 0.5]]),
        ];
        sets[1].dataset = "hall".into();
        let scores = under_protocols(&sets, None, &[&MATCHBENCH]);
        assert_eq!(
            (scores.len(), &*scores[2].dataset, scores[2].pairs),
            (3, "mean", 4)
        );
        assert_eq!(scores[2].scores[0].score.value, Some(0.75));
        assert_eq!(scores[2].otherwise, [""; 0]);
        // The methods have the order that they have on the datasets.
        let mut others = sets.clone();
        for set in &mut others {
            set.matcher = "orb".into();
        }
        let both = under_protocols(&[&sets[..], &others].concat(), None, PROTOCOLS);
        let names = |of_mean: bool| -> Vec<(&str, &str)> {
            let rows = both.iter().filter(|one| (one.dataset == "mean") == of_mean);
            let mut names: Vec<_> = rows.map(|one| (one.protocol, &*one.matcher)).collect();
            names.dedup();
            names
        };
        assert_eq!(names(true), names(false));
        assert_eq!(
            names(true)[..2],
            [("matchbench", "sift"), ("matchbench", "orb")]
        );
        // Another method has a third dataset.
        let mut more = sets.clone();
        for (set, dataset) in more.iter_mut().zip(["room", "attic"]) {
            set.matcher = "orb".into();
            set.dataset = dataset.into();
        }
        let scores = under_protocols(&[&sets[..], &more].concat(), None, &[&MATCHBENCH]);
        let means = scores.iter().filter(|one| one.dataset == "mean");
        let said: Vec<String> = means.map(|one| one.otherwise.join("; ")).collect();
        assert_eq!(
            said,
            [
                "its mean is over hall, room alone",
                "its mean is over attic, room alone"
            ]
        );
    }

    #[test]
    fn a_method_that_lacks_results_has_no_mean() {
        let mut sets: Vec<ResultSet> = ["room", "hall"]
            .into_iter()
            .flat_map(|dataset| ["sift", "orb"].map(|matcher| (dataset, matcher)))
            .map(|(dataset, matcher)| ResultSet {
                dataset: dataset.into(),
                matcher: matcher.into(),
                ..set("ransac-e", &[&[0.5, 0.5]])
            })
            .collect();
        sets[3].pairs.pop();
        sets[3].lacking = 1;
        let scores = under_protocols(&sets, None, &[&MATCHBENCH]);
        let means: Vec<_> = (scores.iter().filter(|one| one.dataset == "mean"))
            .map(|one| (&*one.matcher, one.scores[0].score.value, &one.otherwise[..]))
            .collect();
        let why = ["it lacks results of hall that others have, so it has no mean".to_owned()];
        assert_eq!(
            means,
            [("sift", Some(1.0), &[][..]), ("orb", None, &why[..])]
        );
        // On the dataset it has the score of what is recorded.
        assert_eq!(scores[3].scores[0].score.value, Some(1.0));
    }

    #[test]
    fn repetitions_that_are_left_over_are_not_counted() {
        let results = set("ransac-e", &[&[1.0, 2.0][..]; 7]);
        let scores = score(&results, None, &ROMA);
        assert_eq!(scores.pairs, 10);
        let said = scores.otherwise.join("; ");
        assert!(
            said.contains("the last 2 of 7 repetitions are not scored"),
            "{said}"
        );
        let pooled = score(&set("ransac-e", &[&[1.0][..]; 10]), None, &ROMA);
        assert!(!pooled.otherwise.join("; ").contains("not scored"));
    }

    #[test]
    fn what_a_run_did_otherwise_is_said() {
        let results = set("ransac-e", &[&[1.0]]);
        let ours = plan(json!({"id": "ransac-e", "params": {}}), json!({}));
        assert_eq!(score(&results, Some(&ours), &MATCHBENCH).otherwise, [""; 0]);
        let said = score(&results, Some(&ours), &ROMA).otherwise.join("; ");
        for text in [
            "images were as they are, not of 1200 pixels along the longer side unless that is their size",
            "poses are by ransac-e, not by ransac-e-inliers",
            "thresholds were in pixels of the images as they are",
            "below 20 matches",
            "a pair failed below 20 matches or 10 in front of both cameras, not below 5 matches",
            "1 estimation of each pair was pooled, not 5",
        ] {
            assert!(said.contains(text), "{text}: {said}");
        }
        let results = set("ransac-e-inliers@superglue", &[&[1.0]]);
        let built = estimators::find("ransac-e-inliers").unwrap();
        let mut params = built.build(None).unwrap().params;
        let theirs = |params: &Value| json!({"id": "ransac-e-inliers@superglue", "variant_of": "ransac-e-inliers", "params": params});
        let under = plan(theirs(&params), json!({"size": "640x480"}));
        assert_eq!(score(&results, Some(&under), &SUPERGLUE).otherwise, [""; 0]);
        // Each of the two moves points, or keeps them, and the other does not.
        for (results, plan, protocol, said) in [
            (
                &set("ransac-e", &[&[1.0]]),
                &ours,
                &SUPERGLUE,
                "points were kept where they are",
            ),
            (
                &results,
                &under,
                &ROMA,
                "points were multiplied by the ratio",
            ),
            (
                &results,
                &under,
                &MATCHBENCH,
                "points were multiplied by the ratio",
            ),
        ] {
            let otherwise = score(results, Some(plan), protocol).otherwise.join("; ");
            assert!(otherwise.contains(said), "{}: {otherwise}", protocol.id);
        }
        params["threshold_px"] = json!(2.0);
        let under = plan(theirs(&params), json!({"size": "640x480"}));
        let said = score(&results, Some(&under), &SUPERGLUE).otherwise;
        assert_eq!(said, ["threshold_px was 2.0, not 1.0"]);
        let unknown = score(&results, None, &SUPERGLUE).otherwise.join("; ");
        assert!(unknown.contains("not known"), "{unknown}");
    }
}
