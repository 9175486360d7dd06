//! What a run is going to do, and nothing else: `plan.json` in its folder.
//!
//! Two runs of the same plan give the same records. Everything that the records depend on is
//! therefore in it; what they do not depend on (threads, caches) is not.

use std::collections::BTreeSet;
use std::num::NonZeroU32;
use std::path::PathBuf;

use matchbench_vision::geometry::Camera;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::earlier_plans::modernized;
use super::{Contender, Dataset, RunError};
use crate::datasets::Sequence;
use crate::matchers::Extraction;

/// Everything that the records of a run depend on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Version of matchbench.
    pub version: String,
    /// What else decides.
    pub settings: Settings,
    /// The datasets, in the order in which they are run.
    pub datasets: Vec<DatasetPlan>,
    /// The matchers, in the order in which they are run on each dataset.
    pub matchers: Vec<MatcherPlan>,
}

/// Choices that concern all tasks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Root of all random choices. Default: 0.
    pub seed: u64,
    /// How often each pair is done, each time with another seed. Default: 1.
    pub repetitions: NonZeroU32,
    /// Only so many pairs of each dataset, from the first. Default: all.
    pub limit: Option<usize>,
    /// How long an estimator may draw samples for a pair, in milliseconds. Default: as long as its
    /// own rules say. What is found within a time differs from machine to machine, and from run to
    /// run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_budget_ms: Option<NonZeroU32>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            seed: 0,
            repetitions: NonZeroU32::MIN,
            limit: None,
            time_budget_ms: None,
        }
    }
}

/// A dataset, told from others.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DatasetPlan {
    /// Its name.
    pub name: String,
    /// Its folder. It may move: another path alone is no other plan.
    pub path: PathBuf,
    /// Number of images.
    pub frames: usize,
    /// Number of pairs, before any limit.
    pub pairs: usize,
    /// Hash of all cameras and of all pairs with their true poses.
    pub fingerprint: String,
}

/// A matcher with its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MatcherPlan {
    /// Its id.
    pub id: String,
    /// Every parameter.
    pub params: Value,
    /// How its features are extracted.
    pub extraction: Extraction,
    /// The estimators that it is run with.
    pub estimators: Vec<EstimatorPlan>,
}

/// An estimator with its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EstimatorPlan {
    /// Its id.
    pub id: String,
    /// Every parameter.
    pub params: Value,
}

impl Plan {
    /// The plan to run all `contenders` on all `datasets`.
    ///
    /// # Errors
    /// [`RunError::Contradiction`] if two datasets, matchers or estimators of a matcher have one
    /// name, a name cannot be that of a file, a matcher has no estimator, or a pair names a frame
    /// that is not there.
    pub fn new(
        datasets: &[Dataset],
        contenders: &[Contender],
        settings: Settings,
    ) -> Result<Self, RunError> {
        let matchers = || contenders.iter().map(|contender| &contender.matcher);
        check_names(
            "dataset",
            datasets.iter().map(|dataset| &*dataset.sequence.name),
        )?;
        check_names("matcher", matchers().map(|matcher| &*matcher.id))?;
        for contender in contenders {
            if contender.estimators.is_empty() {
                let id = &contender.matcher.id;
                return contradiction(format!("matcher `{id}` is given no estimator"));
            }
            check_names(
                "estimator",
                contender.estimators.iter().map(|estimator| &*estimator.id),
            )?;
        }
        for dataset in datasets {
            check_pairs(&dataset.sequence)?;
        }
        Ok(Self {
            version: env!("CARGO_PKG_VERSION").into(),
            settings,
            datasets: datasets.iter().map(DatasetPlan::new).collect(),
            matchers: contenders.iter().map(MatcherPlan::new).collect(),
        })
    }
}

impl DatasetPlan {
    fn new(dataset: &Dataset) -> Self {
        let sequence = &dataset.sequence;
        Self {
            name: sequence.name.clone(),
            path: dataset.path.clone(),
            frames: sequence.frames.len(),
            pairs: sequence.pairs.len(),
            fingerprint: fingerprint(sequence),
        }
    }
}

impl MatcherPlan {
    fn new(contender: &Contender) -> Self {
        let estimators = contender.estimators.iter().map(|estimator| EstimatorPlan {
            id: estimator.id.clone(),
            params: estimator.params.clone(),
        });
        Self {
            id: contender.matcher.id.clone(),
            params: contender.matcher.params.clone(),
            extraction: contender.matcher.extraction.clone(),
            estimators: estimators.collect(),
        }
    }
}

/// Names become names of folders and files, one for each.
fn check_names<'a>(what: &str, names: impl Iterator<Item = &'a str>) -> Result<(), RunError> {
    let mut seen = BTreeSet::new();
    for name in names {
        if name.is_empty() || name.starts_with('.') || name.contains(['/', '\\', '\0']) {
            return contradiction(format!(
                "`{name}` cannot be the name of a {what}: it is to be the name of a file"
            ));
        }
        if !seen.insert(name) {
            return contradiction(format!(
                "two of the {what}s are called `{name}`; rename one"
            ));
        }
    }
    Ok(())
}

fn check_pairs(sequence: &Sequence) -> Result<(), RunError> {
    let frames = sequence.frames.len();
    let missing = |frame: u32| frame as usize >= frames;
    match (sequence.pairs.iter()).find(|pair| missing(pair.a) || missing(pair.b)) {
        None => Ok(()),
        Some(pair) => contradiction(format!(
            "dataset `{}` has {frames} frames, but a pair of frames {} and {}; frames are counted from 0",
            sequence.name, pair.a, pair.b
        )),
    }
}

fn contradiction<T>(reason: String) -> Result<T, RunError> {
    Err(RunError::Contradiction(reason))
}

/// Hash of what a dataset asks and of its truth. The images are not in it: reading them all would
/// delay every start, and their features are found by their content.
fn fingerprint(sequence: &Sequence) -> String {
    let mut hasher = blake3::Hasher::new();
    let mut numbers = |numbers: &[f64]| {
        for number in numbers {
            hasher.update(&number.to_le_bytes());
        }
    };
    for frame in &sequence.frames {
        let Camera {
            fx,
            fy,
            cx,
            cy,
            distortion,
        } = frame.camera;
        numbers(&[fx, fy, cx, cy]);
        match distortion {
            None => numbers(&[0.0; 5]),
            Some(lens) => numbers(&[lens.k1, lens.k2, lens.p1, lens.p2, lens.k3]),
        }
    }
    for pair in &sequence.pairs {
        numbers(&[f64::from(pair.a), f64::from(pair.b)]);
        numbers(pair.b_from_a.rotation.coords.as_slice());
        numbers(pair.b_from_a.translation.vector.as_slice());
    }
    hasher.finalize().to_hex().to_string()
}

/// Where `plan` first differs from the plan that was `written` before, in words; `None` if a run of
/// one goes on with a run of the other. A run may grow: by datasets, matchers and estimators of a
/// matcher, and by a higher limit. It cannot lose any.
pub(super) fn difference(written: &Value, plan: &Value) -> Option<String> {
    let (written, mut plan) = (modernized(without_paths(written)), without_paths(plan));
    keep_known(&written, &mut plan);
    first_difference(&written, &plan, "")
}

/// Takes out of `plan` that by which it outgrows what was `written`.
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
        }
    }
    let limit = |plan: &Value| Some(plan.get("settings")?.get("limit")?.as_u64());
    if let (Some(Some(before)), Some(now)) = (limit(written), limit(plan))
        && now.is_none_or(|now| now > before)
    {
        plan["settings"]["limit"] = before.into();
    }
}

fn without_paths(plan: &Value) -> Value {
    let mut plan = plan.clone();
    if let Some(datasets) = plan.get_mut("datasets").and_then(Value::as_array_mut) {
        for dataset in datasets.iter_mut().filter_map(Value::as_object_mut) {
            dataset.remove("path");
        }
    }
    plan
}

fn first_difference(written: &Value, plan: &Value, at: &str) -> Option<String> {
    match (written, plan) {
        (Value::Object(written), Value::Object(plan)) => {
            let names: BTreeSet<&String> = written.keys().chain(plan.keys()).collect();
            names.into_iter().find_map(|name| {
                let dot = if at.is_empty() { "" } else { "." };
                let at = format!("{at}{dot}{name}");
                missing_or_different(written.get(name), plan.get(name), &at)
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
        _ => (written != plan).then(|| format!("`{at}` is {written} there and {plan} here")),
    }
}

fn missing_or_different(written: Option<&Value>, plan: Option<&Value>, at: &str) -> Option<String> {
    match (written, plan) {
        (Some(written), Some(plan)) => first_difference(written, plan, at),
        (Some(written), None) => Some(format!(
            "`{at}` is {} there and absent here",
            brief(written)
        )),
        (None, Some(plan)) => Some(format!("`{at}` is absent there and {} here", brief(plan))),
        (None, None) => None,
    }
}

/// A value, or for something large the name that it has.
fn brief(value: &Value) -> String {
    name(value).map_or_else(|| value.to_string(), |name| format!("`{name}`"))
}

/// By what a dataset, matcher or estimator is called.
fn name(value: &Value) -> Option<&str> {
    ["id", "name"]
        .iter()
        .find_map(|name| value.get(name)?.as_str())
}
