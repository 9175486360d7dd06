//! Matches from files as a source that a run asks for matched points.

use std::collections::BTreeMap;
use std::path::PathBuf;

use matchbench_vision::seed::Seed;
use serde_json::{Value, json};

use super::{ExchangeError, MatchFiles, ReadOptions, Understood};
use crate::config::to_json;
use crate::counted::counted;
use crate::datasets::Sequence;
use crate::matchers::{BuiltPointSource, ImageFiles, PointSource, SourceError, SourcedMatches};

/// Matches of several datasets in files.
#[derive(Debug)]
pub struct MatchSource {
    /// By name of the dataset.
    datasets: BTreeMap<String, MatchFiles>,
}

impl MatchSource {
    /// The matches at `paths` for each of the datasets; for several, `paths` must be one folder that
    /// has a folder for each. Where datasets have but some of their pairs, `planned` are the parameters of the source of
    /// all of them.
    ///
    /// # Errors
    /// As [`MatchFiles::open`]; or if several datasets would share files.
    pub fn open(
        paths: &[PathBuf],
        datasets: &[&Sequence],
        options: &ReadOptions,
        planned: Option<&Value>,
    ) -> Result<Self, ExchangeError> {
        let mut found = BTreeMap::new();
        for sequence in datasets {
            let has_own = |path: &PathBuf| path.join(&sequence.name).is_dir();
            if let (true, [path, ..]) = (datasets.len() > 1, paths)
                && !(paths.len() == 1 && has_own(path))
            {
                return Err(ExchangeError::new(
                    path,
                    format!("there is no folder `{}` in it", sequence.name),
                    "for several datasets name one folder that has a folder of files for each",
                ));
            }
            let known = planned.and_then(|params| understood(params, &sequence.name));
            let files = match known {
                Some(known) => MatchFiles::open_part(paths, sequence, options, &known)?,
                None => MatchFiles::open(paths, sequence, options)?,
            };
            found.insert(sequence.name.clone(), files);
        }
        Ok(Self { datasets: found })
    }

    /// The files of each dataset, by its name.
    pub fn datasets(&self) -> impl Iterator<Item = (&str, &MatchFiles)> {
        self.datasets.iter().map(|(name, files)| (&**name, files))
    }

    /// The source under the name that it has in tables. Its parameters are how the files of each
    /// dataset were understood, hashes included: other files are another plan.
    pub fn build(self, id: &str) -> BuiltPointSource {
        let mut notes = Vec::new();
        let mut params = Vec::new();
        for (name, files) in self.datasets() {
            notes.push(format!(
                "{name}: matches from files, {}",
                files.understood()
            ));
            let absent = files.survey().absent.len();
            if absent > 0 {
                notes.push(format!(
                    "{name}: {ABSENT}{}; what is run of them counts as failed. Score the others alone by \
                     `matchbench eval RUN --pairs list:FILE`",
                    counted(absent, "pair")
                ));
            }
            let warnings = files.survey().warnings.iter();
            notes.extend(warnings.map(|warning| format!("{name}: {warning}")));
            let mut understood = to_json(files.understood());
            understood["name"] = name.into();
            params.push(understood);
        }
        BuiltPointSource {
            id: id.into(),
            version: None,
            command: None,
            params: json!({ "datasets": params }),
            notes,
            source: Box::new(self),
        }
    }
}

/// What a note begins with that says how many pairs the files do not have, after the name of the dataset.
const ABSENT: &str = "absent: ";

/// Whether a note of a matcher in a plan says that its files do not have all pairs.
pub fn is_of_absent_pairs(note: &str) -> bool {
    note.split_once(": ")
        .is_some_and(|(_, said)| said.starts_with(ABSENT))
}

/// How the files of a dataset were understood, by the parameters of their source.
fn understood(params: &Value, dataset: &str) -> Option<Understood> {
    let datasets = params.get("datasets")?.as_array()?.iter();
    let mut named = datasets.filter(|files| files["name"] == dataset);
    let mut files = named.next()?.as_object()?.clone();
    files.remove("name");
    serde_json::from_value(files.into()).ok()
}

impl PointSource for MatchSource {
    fn repeats(&self) -> bool {
        true
    }

    fn matches(&self, pair: &ImageFiles<'_>, _: Seed) -> Result<SourcedMatches, SourceError> {
        let [a, b] = pair.frames;
        let files = self.datasets.get(pair.dataset).ok_or_else(|| {
            SourceError::Ended(format!("no files were named for `{}`", pair.dataset))
        })?;
        let found = files
            .matches(a, b)
            .map_err(|error| SourceError::Pair(error.to_string()))?;
        let found = found.ok_or_else(|| {
            // A plan has the hashes of the files: with that pair in them they are those of another plan.
            SourceError::Lacking(format!("the files have no matches of the pair {a} {b}"))
        })?;
        let keypoints = found.keypoints.unwrap_or_default();
        Ok(SourcedMatches {
            points: found.points,
            features: keypoints.map(|count| u32::try_from(count).unwrap_or(u32::MAX)),
            ..SourcedMatches::default()
        })
    }
}
