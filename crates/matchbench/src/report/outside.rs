//! Facts about matchers that are not built in, so that nobody mistakes their rows for those of built-in ones.
//!
//! Some facts decide their scores and times as much as the method does. They are shown beside the name: where
//! the matches come from, the device that a program says it computed on, and the size to which images were
//! reduced.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use crate::records::{MatcherPlan, RunFolder, StoreError};

/// The matchers of a run that are not built in, each with what a reader must know about it, in a few words.
///
/// # Errors
/// If records cannot be read.
pub(super) fn outside(run: &RunFolder) -> Result<BTreeMap<String, String>, StoreError> {
    let mut found = BTreeMap::new();
    for matcher in &run.plan().matchers {
        if matcher.extraction.is_none() {
            let devices = devices(run, matcher)?;
            found.insert(matcher.id.clone(), in_words(matcher, &devices));
        }
    }
    Ok(found)
}

/// The devices that a matcher says it computed on.
fn devices(run: &RunFolder, matcher: &MatcherPlan) -> Result<BTreeSet<String>, StoreError> {
    let mut devices = BTreeSet::new();
    for dataset in &run.plan().datasets {
        for estimator in &matcher.estimators {
            let records = run.records_of(&dataset.name, &matcher.id, &estimator.id)?;
            devices.extend(records.into_iter().filter_map(|record| record.device));
        }
    }
    Ok(devices)
}

fn in_words(matcher: &MatcherPlan, devices: &BTreeSet<String>) -> String {
    let source = match matcher.version {
        Some(_) => "from outside",
        None => "from files",
    };
    let mut parts = vec![source.to_owned()];
    parts.extend(devices.iter().cloned());
    if let Some(size) = matcher.params.get("max_size").and_then(Value::as_u64) {
        parts.push(format!("{size} pixels"));
    }
    parts.join(", ")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn source_device_and_size_are_named() {
        let plan = |version: Option<&str>, params| MatcherPlan {
            id: "x".into(),
            version: version.map(str::to_owned),
            command: None,
            params,
            extraction: None,
            notes: Vec::new(),
            estimators: Vec::new(),
        };
        let devices = BTreeSet::from(["cuda:0".to_owned()]);
        let program = plan(Some("1"), json!({"max_size": 1024}));
        assert_eq!(
            in_words(&program, &devices),
            "from outside, cuda:0, 1024 pixels"
        );
        let files = plan(None, json!({"tum": {"format": "npz"}}));
        assert_eq!(in_words(&files, &BTreeSet::new()), "from files");
    }
}
