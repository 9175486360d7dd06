//! The plan of joined runs: what each of them planned, where they agree.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Value, json};

use super::super::growth::first_difference;
use super::super::{DatasetPlan, FORMAT, MatcherPlan, Plan, RunFolder};
use super::JoinError;

/// The plan of all these runs: the datasets, matchers and estimators of each.
///
/// # Errors
/// If one is a shard, or they differ in what both have.
pub(super) fn joined(folders: &[RunFolder]) -> Result<Plan, JoinError> {
    let mut plan: Option<Plan> = None;
    // The matchers of each dataset.
    let mut run_on: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for folder in folders {
        let other = Plan {
            format: FORMAT,
            ..folder.plan().modernized()
        };
        if other.shard.is_some() {
            return Err(JoinError::Shard {
                run: folder.path().into(),
            });
        }
        let own = folder.plan();
        for dataset in &own.datasets {
            let run = run_on.entry(&dataset.name).or_default();
            match &dataset.matchers {
                Some(ids) => run.extend(ids.iter().map(|id| &**id)),
                None => run.extend(own.matchers.iter().map(|matcher| &*matcher.id)),
            }
        }
        match &mut plan {
            None => plan = Some(other),
            Some(plan) => add(plan, other).map_err(|difference| JoinError::Differ {
                first: folders[0].path().into(),
                run: folder.path().into(),
                difference,
            })?,
        }
    }
    let mut plan = plan.ok_or_else(|| JoinError::Io(std::io::Error::other("no run is given")))?;
    let ids: Vec<String> = plan
        .matchers
        .iter()
        .map(|matcher| matcher.id.clone())
        .collect();
    let own = |dataset: &DatasetPlan| -> Vec<String> {
        let run = &run_on[&*dataset.name];
        (ids.iter().filter(|id| run.contains(&***id)).cloned()).collect()
    };
    let has_all = |dataset: &DatasetPlan| own(dataset) == ids;
    let all_have_all = plan.datasets.iter().all(has_all);
    for dataset in &mut plan.datasets {
        dataset.matchers = (!all_have_all).then(|| own(dataset));
    }
    check_truths(&plan, folders)?;
    Ok(plan)
}

/// Whether on each dataset of the joined `plan` all that is estimated, poses or homographies, was estimated there in one of
/// the runs. Else nobody knows whether the dataset has the truth of it, and most have not: the run could never be finished.
fn check_truths(plan: &Plan, folders: &[RunFolder]) -> Result<(), JoinError> {
    let mut estimated: BTreeMap<&str, BTreeSet<bool>> = BTreeMap::new();
    for folder in folders {
        let kinds = kinds(folder.plan());
        for dataset in &folder.plan().datasets {
            let there = folder.plan().matchers_on(dataset);
            let there = there.flat_map(|matcher| &kinds[&*matcher.id]);
            let known = estimated.entry(&dataset.name).or_default();
            known.extend(there.map(|(of_homographies, _)| of_homographies));
        }
    }
    let kinds = kinds(plan);
    for dataset in &plan.datasets {
        let known = &estimated[&*dataset.name];
        for matcher in plan.matchers_on(dataset) {
            let mut planned = kinds[&*matcher.id].iter();
            if let Some((of_homographies, estimator)) =
                planned.find(|(of_homographies, _)| !known.contains(of_homographies))
            {
                return Err(JoinError::NoTruth {
                    matcher: matcher.id.clone(),
                    estimator: (*estimator).to_owned(),
                    dataset: dataset.name.clone(),
                    of_homographies: *of_homographies,
                });
            }
        }
    }
    Ok(())
}

/// Whether the estimators of each matcher are of homographies, else of poses, with one of each kind.
fn kinds(plan: &Plan) -> BTreeMap<&str, BTreeMap<bool, &str>> {
    // Of many matchers with few estimators.
    let mut known: BTreeMap<&str, Option<bool>> = BTreeMap::new();
    let mut kinds = BTreeMap::new();
    for matcher in &plan.matchers {
        let of: &mut BTreeMap<bool, &str> = kinds.entry(&*matcher.id).or_default();
        for estimator in &matcher.estimators {
            let id = &*estimator.id;
            let kind = known.entry(id);
            let kind = kind.or_insert_with(|| plan.is_of_homographies(&matcher.id, id));
            if let Some(kind) = *kind {
                of.entry(kind).or_insert(id);
            }
        }
    }
    kinds
}

/// Adds to a `plan` what `other` has more, or says in words in what both differ.
fn add(plan: &mut Plan, other: Plan) -> Result<(), String> {
    let decides = |plan: &Plan| json!({"version": plan.version, "settings": plan.settings});
    same(&decides(plan), &decides(&other), "")?;
    for dataset in other.datasets {
        match plan
            .datasets
            .iter()
            .find(|known| known.name == dataset.name)
        {
            None => plan.datasets.push(dataset),
            Some(known) if known.fingerprint != dataset.fingerprint => {
                return Err(format!(
                    "the cameras, pairs or true poses of the dataset `{}` are others there",
                    dataset.name
                ));
            }
            Some(_) => {}
        }
    }
    for matcher in other.matchers {
        match plan
            .matchers
            .iter_mut()
            .find(|known| known.id == matcher.id)
        {
            None => plan.matchers.push(matcher),
            Some(known) => add_estimators(known, matcher)?,
        }
    }
    Ok(())
}

/// Adds the estimators that `other`, the same matcher, has more.
fn add_estimators(known: &mut MatcherPlan, other: MatcherPlan) -> Result<(), String> {
    let at = format!("matchers.{}", known.id);
    if let (Some(ours), Some(theirs)) = (
        known.params.get_mut("datasets"),
        other.params.get("datasets"),
    ) {
        add_files(ours, theirs, &at)?;
        // The rest must be the same.
        let (mut a, mut b) = (known.params.clone(), other.params.clone());
        (a["datasets"], b["datasets"]) = (Value::Null, Value::Null);
        same(&a, &b, &format!("{at}.params"))?;
    } else {
        same(&known.params, &other.params, &format!("{at}.params"))?;
    }
    let decides = |matcher: &MatcherPlan| json!({"version": matcher.version, "extraction": matcher.extraction});
    same(&decides(known), &decides(&other), &at)?;
    // Earlier plans did not say how a program is started.
    known.command = known.command.take().or(other.command);
    for note in other.notes {
        if !known.notes.contains(&note) {
            known.notes.push(note);
        }
    }
    for estimator in other.estimators {
        match known
            .estimators
            .iter()
            .find(|known| known.id == estimator.id)
        {
            None => known.estimators.push(estimator),
            Some(known) => {
                let json = |plan| serde_json::to_value(plan).expect("a plan is plain JSON");
                same(
                    &json(known),
                    &json(&estimator),
                    &format!("{at}.estimators.{}", estimator.id),
                )?;
            }
        }
    }
    Ok(())
}

/// Matches from files say for each dataset where they are from: adds the datasets that `theirs` have more.
fn add_files(ours: &mut Value, theirs: &Value, at: &str) -> Result<(), String> {
    let (Some(ours), Some(theirs)) = (ours.as_array_mut(), theirs.as_array()) else {
        return same(ours, theirs, at);
    };
    for files in theirs {
        match ours
            .iter()
            .find(|known| known.get("name") == files.get("name"))
        {
            None => ours.push(files.clone()),
            Some(known) => same(known, files, &format!("{at}.params.datasets"))?,
        }
    }
    Ok(())
}

fn same(ours: &Value, theirs: &Value, at: &str) -> Result<(), String> {
    first_difference(theirs, ours, at).map_or(Ok(()), Err)
}
