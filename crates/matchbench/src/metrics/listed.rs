//! Which pairs of a run count: those that its datasets list, where they are at hand, or those that it has recorded.

use std::collections::{BTreeMap, BTreeSet};
use std::mem;
use std::path::Path;

use crate::counted::counted;
use crate::datasets::{Pair, Unpaired, read_dataset_pairs};
use crate::records::{RunFolder, RunRecord};

use super::broken::count_broken;
use super::judge::Judge;
use super::pair_choice::{FramesOf, PairChoice};
use super::results_error::ResultsError;
use super::{Failure, PairResult, ResultSet};

/// The pairs of a dataset in the folder `datasets`, with their truth.
pub(super) fn listed_pairs(datasets: &Path, dataset: &str) -> Result<Vec<Pair>, ResultsError> {
    let dir = datasets.join(dataset);
    if !["pairs.txt", "homographies.txt"]
        .iter()
        .any(|list| dir.join(list).is_file())
    {
        return Err(ResultsError::Layout {
            path: dir,
            problem: format!(
                "neither pairs.txt nor homographies.txt is there, which the results for {dataset} are scored by; name \
                 the folder that holds {dataset}/pairs.txt with --datasets"
            ),
        });
    }
    Ok(read_dataset_pairs(&dir)?)
}

/// The truths of the datasets in a folder, each read when it is first needed.
pub(super) struct Truths<'a> {
    datasets: &'a Path,
    known: BTreeMap<String, Judge>,
}

impl<'a> Truths<'a> {
    pub(super) fn new(datasets: &'a Path) -> Self {
        Self {
            datasets,
            known: BTreeMap::new(),
        }
    }

    /// That of a dataset, by which homographies are judged too where its images are there.
    fn of(&mut self, dataset: &str) -> Result<&Judge, ResultsError> {
        if !self.known.contains_key(dataset) {
            let pairs = listed_pairs(self.datasets, dataset)?;
            let frames = if pairs.iter().any(|pair| pair.homography().is_some()) {
                // Pairs are scored without any images too.
                let images = Unpaired::open(&self.datasets.join(dataset));
                images.map_or_else(|_| Vec::new(), Unpaired::into_frames)
            } else {
                Vec::new()
            };
            let judge = Judge::new(pairs, frames);
            self.known.insert(dataset.to_owned(), judge);
        }
        Ok(&self.known[dataset])
    }

    /// Checks that the estimate of a record of a `run` has the error that the record states. The truth may be another one
    /// by now, and records may have been edited. What cannot be judged by it counts as it is stated.
    ///
    /// # Errors
    /// If it has another error; or that the truth cannot be read.
    pub(super) fn check(
        &mut self,
        run: &RunFolder,
        record: &RunRecord,
    ) -> Result<(), ResultsError> {
        let dataset = &record.task.dataset;
        let judged = self.of(dataset)?.judge(record).ok().flatten();
        let wrong = judged.and_then(|judged| record.contradiction(&judged));
        wrong.map_or(Ok(()), |wrong| {
            Err(ResultsError::Layout {
                path: self.datasets.join(dataset),
                problem: format!(
                    "{wrong} by the truth here; {} was judged by another, or its records were changed; run it anew, or leave \
                     --datasets out",
                    run.path().display()
                ),
            })
        })
    }
}

/// Which task of a method a result is of.
pub(super) fn task(pair: &PairResult) -> (u32, u32, u32) {
    (pair.a, pair.b, pair.repetition)
}

/// Missing results that are always made: those of 316 files with a record each of another pair, which are compared with
/// each other within seconds. A thousand such files take minutes.
const MISSING: u64 = 100_000;
/// More of them are made if there are no more than so many to each record. A run finishes one matcher after the other,
/// so there are few, but thousands of files with a line each would stand for millions.
const MISSING_FOR_EACH: u64 = 20;

/// Whether so many missing results are not made beside those that were `found`.
fn are_too_many(missing: u64, found: u64) -> bool {
    missing > MISSING.max(found.saturating_mul(MISSING_FOR_EACH))
}

/// Brings sets of results of a `run` into line with the pairs that count: those of the `truths` of its datasets, or what it
/// has recorded. The `frames` of a dataset are asked for if the choice is by names of images.
///
/// # Errors
/// If a list cannot be read, or a few records stand for very many missing ones.
pub(super) fn complete_all<'a>(
    run: &Path,
    sets: impl Iterator<Item = &'a mut ResultSet>,
    truths: Option<&mut Truths<'_>>,
    choice: &PairChoice,
    frames: &FramesOf<'_>,
) -> Result<(), ResultsError> {
    let mut sets: Vec<&mut ResultSet> = sets.collect();
    let Some(truths) = truths else {
        return as_recorded(&mut sets, choice, frames);
    };
    let mut listed = BTreeMap::<String, Vec<(u32, u32)>>::new();
    for set in &sets {
        if !listed.contains_key(&set.dataset) {
            let pairs = truths.of(&set.dataset)?.pairs();
            let chosen = choice.of(&set.dataset, || frames(&set.dataset))?;
            let pairs = pairs.filter(|&(a, b)| chosen(a, b)).collect();
            listed.insert(set.dataset.clone(), pairs);
        }
    }
    let expected = |set: &&mut ResultSet| {
        (listed[&set.dataset].len() as u64).saturating_mul(u64::from(set.repetitions))
    };
    let found: u64 = sets.iter().map(|set| set.pairs.len() as u64).sum();
    let missing = (sets.iter().map(expected))
        .fold(0, u64::saturating_add)
        .saturating_sub(found);
    if are_too_many(missing, found) {
        let files = counted(sets.len(), "file");
        return Err(ResultsError::Layout {
            path: run.to_path_buf(),
            problem: format!(
                "{files} with {found} records in all stand for {missing} missing ones; finish the run, choose fewer \
                 pairs, or delete the files of matchers that were hardly begun"
            ),
        });
    }
    for set in &mut sets {
        complete(set, &listed[&set.dataset]);
    }
    count_broken(&mut sets);
    Ok(())
}

/// Leaves the chosen pairs of what a run has recorded, and counts what each set lacks of what others have.
fn as_recorded(
    sets: &mut [&mut ResultSet],
    choice: &PairChoice,
    frames: &FramesOf<'_>,
) -> Result<(), ResultsError> {
    let mut recorded = BTreeMap::<String, BTreeSet<(u32, u32, u32)>>::new();
    let mut choices = BTreeMap::new();
    for set in &mut *sets {
        if !choices.contains_key(&set.dataset) {
            let chosen = choice.of(&set.dataset, || frames(&set.dataset))?;
            choices.insert(set.dataset.clone(), chosen);
        }
        let chosen = &choices[&set.dataset];
        let found = set.pairs.len();
        set.pairs.retain(|pair| chosen(pair.a, pair.b));
        set.ignored = found - set.pairs.len();
        set.pairs.sort_unstable_by_key(task);
        let known = recorded.entry(set.dataset.clone()).or_default();
        known.extend(set.pairs.iter().map(task));
    }
    for set in &mut *sets {
        // None stands in it twice.
        set.lacking = recorded[&set.dataset].len() - set.pairs.len();
    }
    count_broken(sets);
    Ok(())
}

/// Brings the pairs of a run into line with the listed ones, which are sorted: others out, missing ones in.
fn complete(set: &mut ResultSet, listed: &[(u32, u32)]) {
    set.pairs.sort_unstable_by_key(task);
    let repetitions = set.repetitions;
    let expected =
        || (listed.iter()).flat_map(move |&(a, b)| (0..repetitions).map(move |r| (a, b, r)));
    // Millions of pairs are not copied where none is missing.
    if expected().eq(set.pairs.iter().map(task)) {
        return;
    }
    let found = set.pairs.len();
    let mut results = mem::take(&mut set.pairs).into_iter().peekable();
    let mut scored = 0;
    for (a, b, repetition) in expected() {
        while results
            .next_if(|other| task(other) < (a, b, repetition))
            .is_some()
        {}
        let result = results.next_if(|result| task(result) == (a, b, repetition));
        scored += usize::from(result.is_some());
        set.pairs.push(result.unwrap_or_else(|| PairResult {
            repetition,
            ..PairResult::failed(a, b, Failure::Missing)
        }));
    }
    set.ignored = found - scored;
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn few_files_do_not_stand_for_many_missing_results() {
        // As many files as pairs, each with one of them.
        let sets = |count: u32| {
            let set = |i: u32| ResultSet {
                dataset: "room".into(),
                matcher: i.to_string(),
                estimator: "ransac-e".into(),
                repetitions: 1,
                pairs: vec![PairResult::failed(0, i + 1, Failure::NoSupport)],
                ignored: 0,
                lacking: 0,
            };
            (0..count).map(set).collect::<Vec<_>>()
        };
        let folder = tempfile::tempdir().expect("a temporary folder");
        let room = folder.path().join("room");
        fs::create_dir_all(&room).expect("writable");
        let complete = |sets: &mut [ResultSet]| {
            let pairs = (1..=sets.len()).map(|b| format!("0 {b} 1 0 0 0 0 1 0 0 0 0 1 1\n"));
            fs::write(room.join("pairs.txt"), pairs.collect::<String>()).expect("writable");
            complete_all(
                Path::new("run"),
                sets.iter_mut(),
                Some(&mut Truths::new(folder.path())),
                &PairChoice::Listed,
                &|_| Ok(None),
            )
        };
        let mut few = sets(30);
        complete(&mut few).expect("few are missing");
        assert!(few.iter().all(|set| set.pairs.len() == 30));
        let mut many = sets(320);
        let error = complete(&mut many).expect_err("too many").to_string();
        assert!(
            error.starts_with("run: 320 files with 320 records in all stand for 102080 missing"),
            "{error}"
        );
        assert!(many.iter().all(|set| set.pairs.len() == 1));
        // A large run may miss as many as it likes of what it has begun.
        assert!(!are_too_many(100_000_000, 5_000_000));
    }
}
