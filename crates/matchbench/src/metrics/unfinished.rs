//! What a run has planned but not recorded yet.

use std::collections::HashMap;

use super::ResultSet;
use crate::counted::counted;
use crate::records::{Plan, RunFolder, StoreError};

/// Methods that are named one by one.
const NAMED: usize = 4;

/// What a run that was stopped, or has lost records, lacks: its scores are not those of all its pairs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Unfinished {
    /// How many planned results have no record.
    pub missing: usize,
    /// How many results are planned, of all methods.
    pub planned: usize,
    /// How many results of pairs that the datasets list stand among those that were read as failures. They do if folders of
    /// datasets were named; otherwise only what is recorded was read.
    pub wrong: usize,
    /// Of each method of the plan whose records are not as many as its tasks, a sentence; of many, of the first.
    pub sentences: Vec<String>,
}

impl Unfinished {
    /// Of a run, of which these results were read; `None` if every method has its records, or if it is a shard, which has a
    /// part of the pairs.
    ///
    /// # Errors
    /// If what waits in the folder until the run goes on cannot be read.
    pub fn of(run: &RunFolder, sets: &[ResultSet]) -> Result<Option<Self>, StoreError> {
        let Some(mut unfinished) = Self::of_plan(run.plan(), sets) else {
            return Ok(None);
        };
        let waiting = run.waiting()?;
        if waiting > 0 {
            let results = counted(waiting, "result");
            unfinished.sentences.push(format!(
                "{results} of before the run grew are set aside until the same command goes on"
            ));
        }
        Ok(Some(unfinished))
    }

    fn of_plan(plan: &Plan, sets: &[ResultSet]) -> Option<Self> {
        let mut all = Self::default();
        if plan.shard.is_some() {
            return None;
        }
        let sets: HashMap<_, _> = (sets.iter())
            .map(|set| ([&set.dataset, &set.matcher, &set.estimator], set))
            .collect();
        // A plan may have many thousands of methods, so only those that may be named get a sentence.
        let mut unfinished = 0;
        for dataset in &plan.datasets {
            let planned = plan.tasks_on(dataset);
            for matcher in plan.matchers_on(dataset) {
                for estimator in &matcher.estimators {
                    let set = sets.get(&[&dataset.name, &matcher.id, &estimator.id]);
                    let done = set.map_or(0, |set| recorded(set));
                    all.planned = all.planned.saturating_add(planned);
                    all.missing = all.missing.saturating_add(planned.saturating_sub(done));
                    if done == planned {
                        continue;
                    }
                    unfinished += 1;
                    if unfinished <= NAMED + 1 {
                        all.sentences.push(format!(
                            "{} with {} on {}: {done} of {} recorded",
                            matcher.id,
                            estimator.id,
                            dataset.name,
                            counted(planned, "planned task")
                        ));
                    }
                }
            }
        }
        all.wrong = sets.values().map(|set| set.missing()).sum();
        if unfinished > NAMED + 1 {
            all.sentences.truncate(NAMED);
            all.sentences.push(format!(
                "not finished either: {}",
                counted(unfinished - NAMED, "more method")
            ));
        }
        (unfinished > 0).then_some(all)
    }
}

/// Tasks of a method that have a record.
fn recorded(set: &ResultSet) -> usize {
    set.ignored + set.pairs.len() - set.missing()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::pair_result::tests::solved;
    use super::super::{Failure, PairResult};
    use super::*;

    fn unfinished(plan: &Plan, sets: &[ResultSet]) -> Vec<String> {
        Unfinished::of_plan(plan, sets).map_or_else(Vec::new, |unfinished| unfinished.sentences)
    }

    /// A plan of two repetitions of three pairs of each of these datasets, by these matchers with two estimators.
    fn plan(datasets: &[&str], matchers: &[&str]) -> Plan {
        let datasets: Vec<_> = (datasets.iter())
            .map(|name| json!({"name": name, "path": name, "frames": 4, "pairs": 3, "fingerprint": ""}))
            .collect();
        let estimator = |id: &str| json!({"id": id, "params": {}});
        let matchers: Vec<_> = (matchers.iter())
            .map(|id| json!({"id": id, "params": {}, "estimators": [estimator("best"), estimator("rich")]}))
            .collect();
        serde_json::from_value(json!({
            "version": "0.1.0",
            "settings": {"seed": 0, "repetitions": 2, "limit": null},
            "datasets": datasets,
            "matchers": matchers
        }))
        .expect("a plan")
    }

    /// Results of so many tasks, and of one more that has none.
    fn set(matcher: &str, estimator: &str, done: u32) -> ResultSet {
        let mut pairs: Vec<PairResult> = (0..done).map(|a| solved(a, 0.5, 0.5, 50)).collect();
        pairs.push(PairResult::failed(9, 10, Failure::Missing));
        ResultSet {
            dataset: "room".into(),
            matcher: matcher.into(),
            estimator: estimator.into(),
            repetitions: 2,
            pairs,
            ignored: 0,
            lacking: 0,
        }
    }

    #[test]
    fn methods_without_all_their_records_are_named() {
        let plan = plan(&["room"], &["sift"]);
        let done = [set("sift", "best", 6), set("sift", "rich", 6)];
        assert_eq!(unfinished(&plan, &done), [""; 0]);
        let mut stopped = [set("sift", "best", 6), set("sift", "rich", 4)];
        let expected = ["sift with rich on room: 4 of 6 planned tasks recorded"];
        assert_eq!(unfinished(&plan, &stopped), expected);
        // A record of a pair that is not listed any more is one all the same.
        stopped[1].ignored = 2;
        assert_eq!(unfinished(&plan, &stopped), [""; 0]);
        let none = unfinished(&plan, &stopped[..1]);
        let expected = ["sift with rich on room: 0 of 6 planned tasks recorded"];
        assert_eq!(none, expected);
    }

    #[test]
    fn a_matcher_is_not_missed_on_datasets_that_it_takes_no_part_in() {
        let mut plan = plan(&["room", "hall"], &["sift", "orb"]);
        plan.datasets[0].matchers = Some(vec!["sift".into()]);
        plan.datasets[1].matchers = Some(vec!["orb".into()]);
        let expected = [
            "sift with best on room",
            "sift with rich on room",
            "orb with best on hall",
            "orb with rich on hall",
        ];
        let expected = expected.map(|method| format!("{method}: 0 of 6 planned tasks recorded"));
        assert_eq!(unfinished(&plan, &[]), expected);
    }

    #[test]
    fn four_methods_are_named_and_the_others_counted() {
        let mut five = plan(&["room"], &["sift", "orb", "kaze"]);
        five.matchers[2].estimators.pop();
        let named = unfinished(&five, &[]);
        assert_eq!(named.len(), 5);
        assert_eq!(
            named[4],
            "kaze with best on room: 0 of 6 planned tasks recorded"
        );
        let six = unfinished(&plan(&["room"], &["sift", "orb", "kaze"]), &[]);
        assert_eq!(six.len(), 5);
        assert_eq!(six[4], "not finished either: 2 more methods");
    }

    /// Results are looked up by their names, not searched for each method.
    #[test]
    fn many_methods_are_counted_at_once() {
        let names: Vec<String> = (0..300).map(|i| format!("m{i}")).collect();
        let names: Vec<&str> = names.iter().map(|name| &**name).collect();
        let plan = plan(&names, &names);
        let sets: Vec<ResultSet> = (names
            .iter()
            .flat_map(|of| names.iter().map(move |id| (of, id))))
        .map(|(dataset, matcher)| ResultSet {
            dataset: (*dataset).into(),
            ..set(matcher, "rich", 6)
        })
        .collect();
        let named = unfinished(&plan, &sets);
        assert_eq!(named.len(), 5);
        assert_eq!(named[4], "not finished either: 89996 more methods");
    }
}
