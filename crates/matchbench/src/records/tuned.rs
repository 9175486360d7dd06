//! What `matchbench tune` chose, and on which scenes: `tuned.json` in the folder of the tuning, and in
//! `tuning.json` of every run that takes it over.
//!
//! A score on a scene that a parameter was tuned on is no test. So the scenes are named by their
//! fingerprints and by their images, and a run that uses the parameter on one of them is refused. The fingerprint tells a
//! scene without its images, and the images tell it with other pairs.

use std::collections::BTreeSet;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{FolderError, Plan};
use crate::config::{Changes, ConfigError};
use crate::files::{read_file, write_whole_file};
use crate::{estimators, matchers};

/// A setting that was chosen by its score.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tuned {
    /// The setting, `ID.NAME=VALUE`.
    pub setting: String,
    /// The datasets that it was chosen on.
    pub datasets: Vec<TunedOn>,
    /// The matchers whose matches were used.
    pub matchers: Vec<String>,
    /// Mean AUC with each value that was tried.
    pub auc: Vec<(Value, f64)>,
}

/// A dataset that something was tuned on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TunedOn {
    /// Its name.
    pub name: String,
    /// Its fingerprint, as in the [plan](super::DatasetPlan).
    pub fingerprint: String,
    /// The images that were used, each by the BLAKE3 hash of its file, so that the scene is known with other pairs too.
    #[serde(default, skip_serializing_if = "BTreeSet::is_empty")]
    pub images: BTreeSet<String>,
}

impl Tuned {
    /// What `matchbench tune` wrote.
    ///
    /// # Errors
    /// If the file cannot be read or holds something else.
    pub fn read(path: &Path) -> Result<Self, FolderError> {
        let text = read_file(path).map_err(FolderError::io("read", path))?;
        let wrong = |reason: String| FolderError::NotTuned {
            path: path.into(),
            reason,
        };
        let tuned: Self =
            serde_json::from_slice(&text).map_err(|error| wrong(error.to_string()))?;
        tuned.build().map_err(|error| wrong(error.to_string()))?;
        Ok(tuned)
    }

    /// Tries the setting out, where it is of something that is built here.
    fn build(&self) -> Result<(), ConfigError> {
        let changes = Changes::parse(std::slice::from_ref(&self.setting))?;
        for id in changes.ids() {
            if let Ok(entry) = estimators::find(id) {
                entry.build(changes.of(id))?;
            } else if let Ok(entry) = matchers::find(id) {
                entry.build(changes.of(id))?;
            }
        }
        Ok(())
    }

    /// These choices, each once.
    pub(crate) fn each_once(all: impl IntoIterator<Item = Self>) -> Vec<Self> {
        let mut once = Vec::new();
        for tuned in all {
            if !once.contains(&tuned) {
                once.push(tuned);
            }
        }
        once
    }

    /// Writes it for [`Tuned::read`].
    ///
    /// # Errors
    /// If the file cannot be written; the error names it.
    pub fn write(&self, path: &Path) -> Result<(), FolderError> {
        let text = serde_json::to_string_pretty(self).expect("a choice is plain JSON");
        Ok(write_whole_file(path, format!("{text}\n").as_bytes())?)
    }

    /// In words: the setting, where it was chosen, among what.
    pub fn in_words(&self) -> String {
        let names: Vec<&str> = self.datasets.iter().map(|on| &*on.name).collect();
        let values: Vec<String> = (self.auc.iter())
            .map(|(value, _)| value.to_string())
            .collect();
        format!(
            "{} was chosen on {} with the matches of {}, among {}; none of these datasets is reported here",
            self.setting,
            names.join(", "),
            self.matchers.join(", "),
            values.join(", ")
        )
    }

    /// Refuses a plan that reports on scenes that this was tuned on. `images` are the hashes of the images of each dataset of
    /// the plan, as in [`TunedOn::images`].
    ///
    /// # Errors
    /// If a dataset of the plan is one of them, whatever it is called and whatever its pairs are, or has an image of one.
    pub fn check(&self, plan: &Plan, images: &[BTreeSet<String>]) -> Result<(), FolderError> {
        for (dataset, images) in plan.datasets.iter().zip(images) {
            let seen = |on: &&TunedOn| {
                on.fingerprint == dataset.fingerprint || !on.images.is_disjoint(images)
            };
            if let Some(on) = self.datasets.iter().find(seen) {
                return Err(FolderError::TunedOn {
                    setting: self.setting.clone(),
                    tuned_on: on.name.clone(),
                    dataset: dataset.name.clone(),
                });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_setting_names_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tuned.json");
        let read = |setting: &str| {
            let tuned = Tuned {
                setting: setting.into(),
                datasets: Vec::new(),
                matchers: vec!["sift".into()],
                auc: Vec::new(),
            };
            tuned.write(&path).unwrap();
            Tuned::read(&path).map_err(|error| error.to_string())
        };
        assert!(read("best.threshold_px=2").is_ok() && read("mine.size=3").is_ok());
        for (setting, words) in [
            ("best", "ID.NAME=VALUE"),
            ("best.threshold_px=-2", "threshold_px"),
            ("sift.size=3", "size"),
        ] {
            let error = read(setting).unwrap_err();
            assert!(
                error.contains("tuned.json") && error.contains(words),
                "{error}"
            );
        }
    }
}
