//! Checks that records state the errors that their poses and homographies really have, see [`Judge`].
//!
//! The error of a homography depends on the size of the first image. Images among the entries do not count: nothing says
//! of what size an image was, so that whoever hands in a dataset could choose it.
//!
//! Where a run had its dataset, only its plan says. So such a dataset is opened only if it is no larger than those that
//! are known; otherwise one entry could take the memory that all need.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use crate::counted::counted;
use crate::datasets::Sequence;
use crate::metrics::{Judge, PairResult, ResultSet};
use crate::records::{DatasetPlan, RunFolder, RunSettings};

/// Most frames of a dataset that is opened where the plan of an entry says.
const MAX_FRAMES: usize = 1_000_000;
/// Most bytes of its `dataset.toml`: that of 100,000 frames with a camera each.
const LONGEST_MANIFEST: u64 = 16 << 20;
/// Most bytes of the path of its folder, which stands before that of every image.
const LONGEST_FOLDER: usize = 1024;

/// What is known of the pairs of a dataset.
#[derive(Debug)]
pub(super) struct Truth {
    /// The pairs, in the order of the list.
    listed: Vec<(u32, u32)>,
    judge: Judge,
}

/// The truth of the datasets that are available, by their fingerprints.
#[derive(Debug, Default)]
pub(super) struct Truths {
    /// Where the datasets may be: in the folder of datasets that was given, where runs had them, and of these last
    /// what lies among the entries.
    places: BTreeMap<String, [BTreeSet<PathBuf>; 3]>,
    known: BTreeMap<String, Option<Truth>>,
}

impl Truths {
    /// Notes that a planned dataset may be in the folder `datasets`, or where the run had it, which may be below the
    /// folder of `entries`.
    pub(super) fn expect(
        &mut self,
        dataset: &DatasetPlan,
        datasets: Option<&Path>,
        entries: &Path,
    ) {
        let places = self.places.entry(dataset.fingerprint.clone());
        let [named, had, handed_in] = places.or_default();
        named.extend(datasets.map(|datasets| datasets.join(&dataset.name)));
        let had = match (dataset.path.canonicalize(), entries.canonicalize()) {
            (Ok(path), Ok(entries)) if path.starts_with(&entries) => handed_in,
            _ => had,
        };
        had.insert(dataset.path.clone());
    }

    /// The truth of a planned dataset. It is looked for wherever any run had this dataset, so a plan with no
    /// place or a wrong one does not hide it from the others.
    pub(super) fn of(&mut self, dataset: &DatasetPlan) -> Option<&Truth> {
        let find = || {
            let places = self.places.get(&dataset.fingerprint)?;
            let open = |path: &PathBuf| Sequence::open_same(path, &dataset.fingerprint);
            let (sequence, is_handed_in) =
                places.iter().enumerate().find_map(|(kind, paths)| {
                    let mut paths =
                        (paths.iter()).filter(|path| kind == 0 || is_usual(path, dataset.frames));
                    let sequence = paths.find_map(open)?;
                    Some((sequence, kind == 2))
                })?;
            let Sequence { frames, pairs, .. } = sequence;
            let frames = if is_handed_in { Vec::new() } else { frames };
            Some(Truth {
                listed: pairs.iter().map(|pair| (pair.a, pair.b)).collect(),
                judge: Judge::new(pairs, frames),
            })
        };
        let known = self.known.entry(dataset.fingerprint.clone());
        known.or_insert_with(find).as_ref()
    }
}

/// Whether the dataset in a folder, planned with so many frames, is no larger than those that are known.
fn is_usual(folder: &Path, frames: usize) -> bool {
    let manifest = fs::metadata(folder.join("dataset.toml"));
    frames <= MAX_FRAMES
        && folder.as_os_str().len() <= LONGEST_FOLDER
        && manifest.map_or(true, |manifest| manifest.len() <= LONGEST_MANIFEST)
}

impl Truth {
    /// Refuses other `pairs` than those that these settings choose from the list of the dataset.
    ///
    /// # Errors
    /// A pair that was not to be chosen, or the numbers of pairs, in words.
    pub(super) fn has_chosen(
        &self,
        settings: &RunSettings,
        pairs: &BTreeSet<(u32, u32)>,
        dataset: &DatasetPlan,
    ) -> Result<(), String> {
        let listed = &self.listed;
        let chosen: BTreeSet<_> = settings.chosen(listed.len()).map(|i| listed[i]).collect();
        if let Some((a, b)) = pairs.difference(&chosen).next() {
            return Err(format!(
                "its plan does not choose the pair {a} {b} of the {} that the dataset lists",
                listed.len()
            ));
        }
        if pairs.len() != chosen.len() {
            return Err(format!(
                "its plan says that the dataset lists {}, which has {}",
                counted(dataset.pairs, "pair"),
                listed.len()
            ));
        }
        Ok(())
    }
}

/// Computes the errors of all records of one method again, and returns whether this was possible for each of
/// them. Its results `set`, in the order of the pairs, get the computed errors: a stated one may be just below a
/// threshold that the computed one is above.
///
/// # Errors
/// The first record that states a different error, in words; or that records cannot be read.
pub(super) fn check(run: &RunFolder, set: &mut ResultSet, truth: &Truth) -> Result<bool, String> {
    let ResultSet {
        dataset,
        matcher,
        estimator,
        pairs,
        ..
    } = set;
    let names = [&**dataset, &**matcher, &**estimator];
    let (mut wrong, mut all) = (None, true);
    let read = run.for_each_of(names, |record| {
        if wrong.is_some() {
            return;
        }
        match truth.judge.judge(&record) {
            Err(reason) => wrong = Some(reason),
            Ok(None) => all = false,
            Ok(Some(judged)) => {
                wrong = record.contradiction(&judged);
                let (a, b) = (record.task.a, record.task.b);
                let task = (a, b, record.task.repetition);
                let place = pairs.binary_search_by_key(&task, |it| (it.a, it.b, it.repetition));
                if let Ok(place) = place {
                    pairs[place].outcome = PairResult::of(a, b, &judged).outcome;
                }
            }
        }
    });
    read.map_err(|error| error.to_string())?;
    wrong.map_or(Ok(all), Err)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dataset_that_an_entry_names_is_opened_up_to_a_size() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        assert!(is_usual(folder.path(), MAX_FRAMES) && !is_usual(folder.path(), MAX_FRAMES + 1));
        let manifest = fs::File::create(folder.path().join("dataset.toml")).expect("writable");
        manifest
            .set_len(LONGEST_MANIFEST)
            .expect("holes take no room");
        assert!(is_usual(folder.path(), 1));
        manifest
            .set_len(LONGEST_MANIFEST + 1)
            .expect("holes take no room");
        assert!(!is_usual(folder.path(), 1));
        assert!(is_usual(Path::new(&"./".repeat(512)), 1));
        assert!(!is_usual(Path::new(&"./".repeat(513)), 1));
    }
}
