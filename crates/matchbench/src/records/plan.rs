//! What a run is going to do, and nothing else: `plan.json` in its folder.
//!
//! Two runs of the same plan give the same records. So the plan holds everything that the records depend
//! on, and nothing else (no threads, no caches). A field that not every run needs is left out where it is
//! not needed, so that older plans stay what they were.

use std::collections::BTreeSet;
use std::iter;
use std::num::NonZeroU32;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::earlier_plans::modernized;
use crate::counted::counted;
use crate::estimators;
use crate::files::check_name;
use crate::matchers::Extraction;

/// Version of the format of run folders that this program writes, and the last that it reads, see [`RunFolder`](super::RunFolder).
pub const FORMAT: u32 = 2;

/// Everything that the records of a run depend on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Version of the format of the run folder, see [`FORMAT`](super::FORMAT). Plans without the
    /// number were written before it and are of the first.
    #[serde(default = "first_format")]
    pub format: u32,
    /// Version of matchbench.
    pub version: String,
    /// What else decides.
    pub settings: RunSettings,
    /// The datasets, in the order in which they are run.
    pub datasets: Vec<DatasetPlan>,
    /// The matchers, in the order in which they are run on each dataset.
    pub matchers: Vec<MatcherPlan>,
    /// Which part of a larger run this is, if it is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shard: Option<ShardOf>,
}

/// One part of a run that many machines share, see [`ShardPlan`](super::ShardPlan).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShardOf {
    /// Hash of the plan of all shards.
    pub plan: String,
    /// Its number, from 1.
    pub number: u32,
}

/// The most methods, each on one dataset, of a plan: many more than a run could ever do, but few enough to be gone through.
const MAX_METHODS: usize = 1_000_000;

impl Plan {
    /// Why it is refused, if it is: a plan may come from others, its names become paths, and each of its methods is looked
    /// for on each dataset.
    pub(super) fn refusal(&self) -> Option<String> {
        self.too_many_methods()
            .or_else(|| self.wrong_name())
            .or_else(|| self.name_twice())
    }

    /// What is wrong if it has too many methods to be read again.
    pub(super) fn too_many_methods(&self) -> Option<String> {
        let of_matcher = |matcher: &MatcherPlan| matcher.estimators.len().max(1);
        let methods: usize = self.matchers.iter().map(of_matcher).sum();
        let all = self.datasets.len().saturating_mul(methods);
        (all > MAX_METHODS).then(|| {
            format!(
                "{} with {}, which are {all} files of records; {MAX_METHODS} are the most of one run",
                counted(methods, "method"),
                counted(self.datasets.len(), "dataset")
            )
        })
    }

    /// What is wrong with a name in it.
    fn wrong_name(&self) -> Option<String> {
        let datasets = self.datasets.iter().map(|dataset| &dataset.name);
        let methods = self.matchers.iter().flat_map(|matcher| {
            let estimators = matcher.estimators.iter().map(|estimator| &estimator.id);
            iter::once(&matcher.id).chain(estimators)
        });
        datasets.chain(methods).find_map(|name| {
            let wrong = check_name(name).err()?;
            Some(format!("the name `{name}` {wrong}"))
        })
    }

    /// What is wrong if a name in it stands for two things: each has files of its own, which are called by it.
    fn name_twice(&self) -> Option<String> {
        let datasets = twice(self.datasets.iter().map(|dataset| &*dataset.name))
            .map(|name| format!("two of its datasets are called `{name}`"));
        let matchers = || {
            twice(self.matchers.iter().map(|matcher| &*matcher.id))
                .map(|id| format!("two of its matchers are called `{id}`"))
        };
        let matchers_of = |dataset: &DatasetPlan| {
            let id = twice(dataset.matchers.iter().flatten().map(|id| &**id))?;
            Some(format!(
                "its dataset `{}` names the matcher `{id}` twice",
                dataset.name
            ))
        };
        let estimators_of = |matcher: &MatcherPlan| {
            let id = twice(matcher.estimators.iter().map(|estimator| &*estimator.id))?;
            Some(format!(
                "two estimators of its matcher `{}` are called `{id}`",
                matcher.id
            ))
        };
        datasets
            .or_else(matchers)
            .or_else(|| self.datasets.iter().find_map(matchers_of))
            .or_else(|| self.matchers.iter().find_map(estimators_of))
    }

    /// Tasks of each method on one of its datasets: its pairs up to the limit, in every repetition.
    pub fn tasks_on(&self, dataset: &DatasetPlan) -> usize {
        let RunSettings { limit, sample, .. } = self.settings;
        let pairs = [limit, sample]
            .into_iter()
            .flatten()
            .fold(dataset.pairs, usize::min);
        pairs.saturating_mul(self.settings.repetitions.get() as usize)
    }

    /// The plan as `plan.json` holds it.
    pub fn to_json(&self) -> Value {
        serde_json::to_value(self).expect("a plan is plain JSON")
    }

    /// The plan as this version writes it: parameters of earlier versions that had no effect are left out.
    pub(crate) fn modernized(&self) -> Self {
        let plan = modernized(self.to_json());
        serde_json::from_value(plan)
            .expect("what is written for earlier parameters is what this version writes")
    }

    /// Whether the estimator of a planned method is one of homographies, else of poses; `None` where the plan does not
    /// tell, because it is none of the list.
    pub fn is_of_homographies(&self, matcher: &str, estimator: &str) -> Option<bool> {
        let planned = &self.matcher(matcher)?.estimators;
        let planned = planned.iter().find(|planned| planned.id == estimator)?;
        // What it is compared with goes by its name, whatever it is a variant of.
        let id = planned.id.split('@').next().unwrap_or_default();
        let variant_of = planned.variant_of.as_deref();
        (iter::once(id).chain(variant_of)).find_map(estimators::is_of_homographies)
    }

    /// The matchers that are run on one of its datasets.
    pub fn matchers_on(&self, dataset: &DatasetPlan) -> impl Iterator<Item = &MatcherPlan> {
        (self.matchers.iter()).filter(|matcher| dataset.runs(&matcher.id))
    }

    /// The matcher with this id, if it is planned.
    pub fn matcher(&self, id: &str) -> Option<&MatcherPlan> {
        self.matchers.iter().find(|matcher| matcher.id == id)
    }
}

/// The first of these names that was there before.
fn twice<'n>(mut names: impl Iterator<Item = &'n str>) -> Option<&'n str> {
    let mut seen = BTreeSet::new();
    names.find(|name| !seen.insert(*name))
}

/// Choices that concern all tasks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunSettings {
    /// Root of all random choices. Default: 0.
    pub seed: u64,
    /// How often each pair is done, each time with another seed. Default: 1.
    pub repetitions: NonZeroU32,
    /// Only so many pairs of each dataset, from the first. Default: all.
    pub limit: Option<usize>,
    /// Of these only so many, evenly spread over the list. Default: all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sample: Option<usize>,
    /// How long an estimator may draw samples for a pair, in milliseconds. Default: as long as its
    /// own rules say. What is found within a time differs from machine to machine, and from run to
    /// run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_budget_ms: Option<NonZeroU32>,
}

impl Default for RunSettings {
    fn default() -> Self {
        Self {
            seed: 0,
            repetitions: NonZeroU32::MIN,
            limit: None,
            sample: None,
            time_budget_ms: None,
        }
    }
}

impl RunSettings {
    /// Those of so many things in a list that take part, by their places, in order.
    pub fn chosen(&self, listed: usize) -> impl Iterator<Item = usize> + use<> {
        let listed = self.limit.unwrap_or(usize::MAX).min(listed);
        let count = self.sample.unwrap_or(usize::MAX).min(listed);
        (0..count).map(move |i| (i as u128 * listed as u128 / count as u128) as usize)
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
    /// Ids of the matchers that are run on it, in the order of the plan; absent where all are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub matchers: Option<Vec<String>>,
}

impl DatasetPlan {
    /// Whether the matcher with this id is run on it, if it is planned.
    pub fn runs(&self, id: &str) -> bool {
        (self.matchers.as_ref()).is_none_or(|ids| ids.iter().any(|own| own == id))
    }
}

/// The note of a matcher that is code in Python, in the process of the run: no command starts it.
pub const IN_PYTHON: &str = "a matcher written in Python, in the process of the run";

/// A matcher, or whatever else the matches come from, with its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MatcherPlan {
    /// Its id.
    pub id: String,
    /// Its version, where it is no part of matchbench.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub version: Option<String>,
    /// How it is started, where it is a program from outside. Plans that were written before this field lack it too.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command: Option<Vec<String>>,
    /// Every parameter.
    pub params: Value,
    /// How its features are extracted; absent where matches come without features.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub extraction: Option<Extraction>,
    /// What a reader should know of it, in sentences.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// The estimators that it is run with.
    pub estimators: Vec<EstimatorPlan>,
}

/// An estimator with its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EstimatorPlan {
    /// Its name in records and tables.
    pub id: String,
    /// Id of the estimator that this is a variant of, where its name is another. All variants of an
    /// estimator make the same random draws.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub variant_of: Option<String>,
    /// Every parameter.
    pub params: Value,
    /// The rules of the protocol that it is under; absent where that is the paper's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub protocol: Option<Value>,
}

fn first_format() -> u32 {
    1
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// The datasets d0, d1 ... with the matchers m0, m1 ..., each with one estimator.
    fn plan(datasets: usize, matchers: usize) -> Plan {
        let dataset = |i: usize| json!({"name": format!("d{i}"), "path": "d", "frames": 2, "pairs": 1, "fingerprint": ""});
        let matcher = |i: usize| {
            let best = json!({"id": "best", "params": {}});
            json!({"id": format!("m{i}"), "params": {}, "estimators": [best]})
        };
        serde_json::from_value(json!({
            "version": "0.1.0",
            "settings": {"seed": 0, "repetitions": 1, "limit": null},
            "datasets": (0..datasets).map(dataset).collect::<Vec<_>>(),
            "matchers": (0..matchers).map(matcher).collect::<Vec<_>>()
        }))
        .expect("a plan")
    }

    #[test]
    fn a_plan_of_endless_methods_is_refused() {
        assert_eq!(plan(1000, 1000).refusal(), None);
        let refusal = plan(1001, 1000).refusal().expect("more than a million");
        assert!(
            refusal.contains("1000 methods with 1001 datasets"),
            "{refusal}"
        );
        let mut wrong = plan(1, 1);
        wrong.matchers[0].id = "../m".into();
        assert!(wrong.refusal().is_some(), "names are checked too");
    }

    #[test]
    fn a_name_that_stands_for_two_things_is_refused() {
        type Change = fn(&mut Plan);
        let refusal = |change: Change| {
            let mut plan = plan(2, 2);
            change(&mut plan);
            plan.refusal()
        };
        assert_eq!(refusal(|_| {}), None);
        // Matchers share estimators, and a dataset may be called as a matcher is.
        assert_eq!(refusal(|plan| plan.datasets[0].name = "m0".into()), None);
        let cases: [(Change, &str); 4] = [
            (
                |plan| plan.datasets[1].name = "d0".into(),
                "two of its datasets are called `d0`",
            ),
            (
                |plan| plan.matchers[1].id = "m0".into(),
                "two of its matchers are called `m0`",
            ),
            (
                |plan| plan.datasets[1].matchers = Some(vec!["m1".into(), "m1".into()]),
                "its dataset `d1` names the matcher `m1` twice",
            ),
            (
                |plan| {
                    let estimator = plan.matchers[0].estimators[0].clone();
                    plan.matchers[0].estimators.push(estimator);
                },
                "two estimators of its matcher `m0` are called `best`",
            ),
        ];
        for (change, expected) in cases {
            assert_eq!(refusal(change).as_deref(), Some(expected));
        }
    }

    #[test]
    fn a_sample_is_spread_over_what_the_limit_leaves() {
        let chosen = |limit, sample| -> Vec<usize> {
            let settings = RunSettings {
                limit,
                sample,
                ..RunSettings::default()
            };
            settings.chosen(10).collect()
        };
        assert_eq!(chosen(None, None).len(), 10);
        assert_eq!(chosen(Some(3), None), [0, 1, 2]);
        assert_eq!(chosen(None, Some(4)), [0, 2, 5, 7]);
        assert_eq!(chosen(Some(4), Some(2)), [0, 2]);
        assert_eq!(chosen(None, Some(99)).len(), 10);
        assert_eq!(chosen(None, Some(0)), [0_usize; 0]);
    }
}
