//! What may change in the plan of a run: it may grow, and nothing else. This finds where a plan differs
//! from the one that a folder was written for.

use std::collections::BTreeSet;

use serde_json::Value;

use super::earlier_plans::modernized;
use super::{Plan, RunSettings};
use crate::front_door::PROTOCOLS;

/// How the version of a matcher begins that is a digest of its code in Python.
const DIGEST: &str = "code ";
/// How a program is started, in the plan of a matcher.
const COMMAND: &str = "command";

/// Where `plan` first differs from the plan that was `written` before, in words; `None` if a run of
/// one goes on with a run of the other. A run may grow: by datasets, matchers (of a dataset too) and
/// estimators of a matcher, by repetitions, and by pairs. It cannot lose any. They may come in another order, a dataset may
/// move, and notes, which say in words what other fields hold, may be worded otherwise.
pub(super) fn difference(written: &Plan, plan: &Plan) -> Option<String> {
    let has_own = |plan: &Plan| {
        plan.datasets
            .iter()
            .any(|dataset| dataset.matchers.is_some())
    };
    let names_matchers = has_own(written) || has_own(plan);
    let as_if = Plan {
        settings: without_growth(written, plan),
        ..plan.clone()
    };
    let (old, new) = (written, plan);
    let mut written = modernized(what_decides(written, names_matchers));
    let mut plan = what_decides(&as_if, names_matchers);
    keep_known(&written, &mut plan);
    forget_commands(&mut written, &mut plan);
    // Without these, items of both have the same places.
    lost(&written, &plan, &["datasets", "matchers"], "")
        .or_else(|| another_dataset(&written, &plan))
        .or_else(|| other_code(&written, &plan))
        .or_else(|| another_sample(old, new))
        .or_else(|| another_protocol(old, new))
        .or_else(|| lost_of_items(&written, &plan))
        .or_else(|| first_difference(&written, &plan, ""))
}

/// Which item of these lists in what was `written` has no twin in `plan`, in words. Items are known by their names: what
/// follows a lost one has another place.
fn lost(written: &Value, plan: &Value, lists: &[&str], at: &str) -> Option<String> {
    lists.iter().find_map(|list| {
        let [known, planned] = [written, plan].map(|plan| plan.get(list)?.as_array());
        let (mut known, planned) = (known?.iter().enumerate(), planned?);
        let (index, lost) =
            known.find(|(_, known)| planned.iter().all(|item| name(item) != name(known)))?;
        Some(absent_here(&format!("{at}{list}[{index}]"), lost))
    })
}

/// The same of the matchers of each dataset and the estimators of each matcher.
fn lost_of_items(written: &Value, plan: &Value) -> Option<String> {
    [("datasets", "matchers"), ("matchers", "estimators")]
        .into_iter()
        .find_map(|(list, inner)| {
            let [known, planned] = [written, plan].map(|plan| plan.get(list)?.as_array());
            let mut items = known?.iter().zip(planned?).enumerate();
            items.find_map(|(index, (known, planned))| {
                lost(known, planned, &[inner], &format!("{list}[{index}]."))
            })
        })
}

/// Whether tasks of `plan` come between those of the plan that was `written` and that grew to it.
pub(super) fn moves_tasks(written: &Plan, plan: &Plan) -> bool {
    let [before, now] = [written.settings, plan.settings];
    before.repetitions != now.repetitions
        || before != now
            && pairs_of_known(written, plan).any(|listed| {
                let mut now = now.chosen(listed);
                !before.chosen(listed).all(|pair| now.next() == Some(pair))
            })
}

/// The settings of `plan`; where it has all tasks of the plan that was `written`, and more by them, those of that.
fn without_growth(written: &Plan, plan: &Plan) -> RunSettings {
    let [before, now] = [written.settings, plan.settings];
    let mut settings = now;
    if now.repetitions > before.repetitions {
        settings.repetitions = before.repetitions;
    }
    if pairs_may_grow(before, now) && keeps_pairs(written, plan) {
        (settings.limit, settings.sample) = (before.limit, before.sample);
    }
    settings
}

/// Whether the pairs of a plan may be more than before, by their limits.
fn pairs_may_grow(before: RunSettings, now: RunSettings) -> bool {
    let [limit, sample] = [(before.limit, now.limit), (before.sample, now.sample)];
    [limit, sample]
        .into_iter()
        .all(|(before, now)| now.is_none_or(|now| before.is_some_and(|before| now >= before)))
}

/// Whether all pairs of the plan that was `written` are pairs of `plan`, on the datasets of both.
fn keeps_pairs(written: &Plan, plan: &Plan) -> bool {
    let [before, now] = [written.settings, plan.settings];
    pairs_of_known(written, plan).all(|listed| {
        // Both in the order of the list.
        let mut now = now.chosen(listed);
        (before.chosen(listed)).all(|pair| now.any(|other| other == pair))
    })
}

/// The numbers of pairs of the datasets that are in both plans. A dataset that has other pairs now is another one, and
/// is found elsewhere; the number in a file may be anything.
fn pairs_of_known<'p>(written: &'p Plan, plan: &'p Plan) -> impl Iterator<Item = usize> {
    let is_known = |name: &str, pairs: usize| {
        let mut known = written.datasets.iter();
        known.any(|known| known.name == name && known.pairs == pairs)
    };
    let datasets = plan.datasets.iter();
    let known = datasets.filter(move |dataset| is_known(&dataset.name, dataset.pairs));
    known.map(|dataset| dataset.pairs)
}

/// Whether `plan` is under other protocols alone, where the paper's was `written`: estimators under another are called
/// `ID@PROTOCOL`.
fn another_protocol(written: &Plan, plan: &Plan) -> Option<String> {
    let under = |plan: &Plan| -> BTreeSet<String> {
        let estimators = plan.matchers.iter().flat_map(|matcher| &matcher.estimators);
        let protocol = |id: &str| {
            id.split_once('@')
                .map_or("", |(_, protocol)| protocol)
                .to_owned()
        };
        estimators.map(|planned| protocol(&planned.id)).collect()
    };
    let (before, now) = (under(written), under(plan));
    (before.contains("") && !now.contains("") && !now.is_empty()).then(|| {
        let others: Vec<String> = now.into_iter().collect();
        let both = PROTOCOLS.with(&format!("matchbench,{}", others.join(",")));
        format!(
            "it is under the paper's protocol, which is not among those that are asked for; `{both}` has both"
        )
    })
}

/// Which sample has not the pairs of the sample that was `written`, in words that say which would.
fn another_sample(written: &Plan, plan: &Plan) -> Option<String> {
    let [before, now] = [written.settings, plan.settings];
    let (sample, larger) = before.sample.zip(now.sample)?;
    let leaves_out = before.limit == now.limit && sample < larger && !keeps_pairs(written, plan);
    leaves_out.then(|| {
        format!(
            "a sample of {larger} pairs (`settings.sample`) leaves out some of the sample of {sample} that is there; one \
             of {}, or all pairs, has them all",
            sample.saturating_mul(2)
        )
    })
}

/// Which dataset of the same name is another one, in words: two hashes tell a reader nothing.
fn another_dataset(written: &Value, plan: &Value) -> Option<String> {
    let [written, plan] = [written, plan].map(|plan| plan["datasets"].as_array());
    let mut pairs = written?.iter().zip(plan?).enumerate();
    pairs.find_map(|(index, (written, plan))| {
        let is_another =
            name(written) == name(plan) && written.get("fingerprint") != plan.get("fingerprint");
        let name = name(plan)?;
        is_another.then(|| {
            format!(
                "the cameras, pairs or true poses of the dataset `{name}` were others \
                 (`datasets[{index}].fingerprint`)"
            )
        })
    })
}

/// Which matcher written in Python had other code, in words.
fn other_code(written: &Value, plan: &Value) -> Option<String> {
    let [written, plan] = [written, plan].map(|plan| plan["matchers"].as_array());
    let mut pairs = written?.iter().zip(plan?);
    pairs.find_map(|(written, plan)| {
        let [before, now] = [written, plan].map(|matcher| matcher.get("version")?.as_str());
        let (name, before, now) = (name(plan)?, before?, now?);
        let is_code = [before, now].iter().any(|version| version.starts_with(DIGEST));
        (is_code && before != now).then(|| {
            format!(
                "the code of the matcher `{name}` was another, `{before}` and not `{now}`; if its results are the \
                 same, give it the `version` \"{before}\""
            )
        })
    })
}

/// Takes out of `plan` that by which it outgrows what was `written`, and puts the rest in the order of that.
fn keep_known(written: &Value, plan: &mut Value) {
    for list in ["datasets", "matchers", "estimators"] {
        let Some(known) = written.get(list).and_then(Value::as_array) else {
            continue;
        };
        if let Some(planned) = plan.get_mut(list).and_then(Value::as_array_mut) {
            planned.retain_mut(|item| {
                let twin = known.iter().find(|known| name(known) == name(item));
                twin.map(|twin| keep_known(twin, item)).is_some()
            });
            planned.sort_by_key(|item| known.iter().position(|known| name(known) == name(item)));
        }
    }
    // Matches from files have parameters for each dataset.
    if let (Some(known), Some(planned)) = (written.get("params"), plan.get_mut("params")) {
        keep_known(known, planned);
    }
}

/// Takes the command of a matcher out of one plan if the other does not have it: earlier plans did not say how
/// programs are started.
fn forget_commands(written: &mut Value, plan: &mut Value) {
    let [Some(written), Some(plan)] =
        [written, plan].map(|plan| plan.get_mut("matchers").and_then(Value::as_array_mut))
    else {
        return;
    };
    for matcher in written {
        let twin = plan.iter_mut().find(|twin| name(twin) == name(matcher));
        if let Some((matcher, twin)) = matcher
            .as_object_mut()
            .zip(twin.and_then(Value::as_object_mut))
            && matcher.contains_key(COMMAND) != twin.contains_key(COMMAND)
        {
            matcher.remove(COMMAND);
            twin.remove(COMMAND);
        }
    }
}

/// A plan without what no record depends on. Where one of two plans `names_matchers` of its datasets, so do
/// both.
fn what_decides(plan: &Plan, names_matchers: bool) -> Value {
    let all: Value = plan.matchers.iter().map(|matcher| &*matcher.id).collect();
    let mut plan = plan.to_json();
    if let Some(datasets) = plan.get_mut("datasets").and_then(Value::as_array_mut) {
        for dataset in datasets.iter_mut().filter_map(Value::as_object_mut) {
            dataset.remove("path");
            if names_matchers {
                dataset.entry("matchers").or_insert_with(|| all.clone());
            }
        }
    }
    if let Some(matchers) = plan.get_mut("matchers").and_then(Value::as_array_mut) {
        for matcher in matchers.iter_mut().filter_map(Value::as_object_mut) {
            matcher.remove("notes");
        }
    }
    // A folder of an earlier format goes on in that of today.
    if let Some(plan) = plan.as_object_mut() {
        plan.remove("format");
    }
    plan
}

/// Where two values first differ, in words: `written` is that of `there`, and `plan` that of `here`.
pub(super) fn first_difference(written: &Value, plan: &Value, at: &str) -> Option<String> {
    match (written, plan) {
        (Value::Object(written), Value::Object(plan)) => {
            // How features are extracted follows from parameters, which whoever gave them knows.
            let last = |name: &String| (name == "extraction", name.clone());
            let names = written.keys().chain(plan.keys()).map(last);
            let names: BTreeSet<(bool, String)> = names.collect();
            names.into_iter().find_map(|(_, name)| {
                let dot = if at.is_empty() { "" } else { "." };
                let at = format!("{at}{dot}{name}");
                missing_or_different(written.get(&name), plan.get(&name), &at)
            })
        }
        (Value::Array(written), Value::Array(plan)) => {
            (0..written.len().max(plan.len())).find_map(|index| {
                missing_or_different(
                    written.get(index),
                    plan.get(index),
                    &format!("{at}[{index}]"),
                )
            })
        }
        _ => (written != plan).then(|| {
            let [written, plan] = [written, plan].map(in_words);
            format!("`{at}` is {written} there and {plan} here")
        }),
    }
}

fn missing_or_different(written: Option<&Value>, plan: Option<&Value>, at: &str) -> Option<String> {
    match (written, plan) {
        (Some(written), Some(plan)) => first_difference(written, plan, at),
        (Some(written), None) => Some(absent_here(at, written)),
        (None, Some(plan)) => Some(format!("`{at}` is absent there and {} here", brief(plan))),
        (None, None) => None,
    }
}

fn absent_here(at: &str, written: &Value) -> String {
    format!("`{at}` is {} there and absent here", brief(written))
}

/// A value; what is null in a plan is no limit.
fn in_words(value: &Value) -> String {
    match value {
        Value::Null => "not set".to_owned(),
        value => value.to_string(),
    }
}

/// A value, or for something large the name that it has.
fn brief(value: &Value) -> String {
    name(value).map_or_else(|| value.to_string(), |name| format!("`{name}`"))
}

/// By what a dataset, matcher or estimator is called; a name is its own.
fn name(value: &Value) -> Option<&str> {
    let called = || (["id", "name"].iter()).find_map(|name| value.get(name)?.as_str());
    value.as_str().or_else(called)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn another_size_of_images_is_told_as_the_parameter_that_it_is() {
        let sized = json!({"id": "sift", "extraction": {"params": {"of": {}, "size": "640x480"}}, "params":
            {"extractor": {"size": "640x480"}}});
        let whole =
            json!({"id": "sift", "extraction": {"params": {}}, "params": {"extractor": {}}});
        assert_eq!(
            first_difference(&sized, &whole, "").as_deref(),
            Some("`params.extractor.size` is `640x480` there and absent here")
        );
        let other = json!({"id": "sift", "extraction": {"params": {}, "revision": 2}, "params": {"extractor": {}}});
        assert_eq!(
            first_difference(&whole, &other, "").as_deref(),
            Some("`extraction.revision` is absent there and 2 here")
        );
    }
}
