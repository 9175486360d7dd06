//! Results from disk, whichever form they have: a run folder or the authors' layout.

use std::path::Path;

use crate::records::RunFolder;

use super::ResultSet;
use super::pair_choice::PairChoice;
use super::published::{each_published, load_published};
use super::results::{self, FileResults};
use super::results_error::ResultsError;

/// Reads every set of results in a folder, with all pairs that are listed: see [`load_chosen`].
///
/// # Errors
/// A file that cannot be read or a line that makes no sense, named by file and line.
pub fn load(folder: &Path, datasets: Option<&Path>) -> Result<Vec<ResultSet>, ResultsError> {
    load_chosen(folder, datasets, &PairChoice::Listed)
}

/// Reads every set of results in a folder: those of a run in the order of its plan, others sorted
/// by dataset, matcher and estimator.
///
/// `datasets` is the folder that holds `<sequence>/pairs.txt`; a run folder can do without, and so
/// can results that have their `groundtruth.txt` beside them.
///
/// # Errors
/// A file that cannot be read or a line that makes no sense, named by file and line; a choice that
/// leaves no pair of a dataset.
pub fn load_chosen(
    folder: &Path,
    datasets: Option<&Path>,
    choice: &PairChoice,
) -> Result<Vec<ResultSet>, ResultsError> {
    if matches!(folder.try_exists(), Ok(false)) {
        return Err(ResultsError::Layout {
            path: folder.to_path_buf(),
            problem: "there is no such folder; give that of a run (its --out), or one of results, which holds \
                      <sequence>/<matcher>.txt"
                .to_owned(),
        });
    }
    let sets = if RunFolder::is_at(folder) {
        results::of_run(&RunFolder::open(folder)?, datasets, choice)?
    } else {
        load_published(folder, datasets, choice)?
    };
    if let Some(empty) = sets
        .iter()
        .find(|set| set.pairs.is_empty() && *choice != PairChoice::Listed)
    {
        return Err(ResultsError::Layout {
            path: folder.to_path_buf(),
            problem: format!(
                "no pair of {} is left; choose another rule with --pairs",
                empty.dataset
            ),
        });
    }
    Ok(sets)
}

/// Reads every file of results in a folder by itself, so that one that is damaged stops no other. Files
/// without any record are left out.
///
/// # Errors
/// If the folder is neither that of a run nor one in the authors' layout, or cannot be listed.
pub fn load_each(folder: &Path, datasets: Option<&Path>) -> Result<Vec<FileResults>, ResultsError> {
    if RunFolder::is_at(folder) {
        results::each_of_run(&RunFolder::open(folder)?)
    } else {
        each_published(folder, datasets)
    }
}

/// Every set of results of a run, in the order of its plan; what the plan does not name comes last.
///
/// `datasets` is the folder that holds `<sequence>/pairs.txt`, which then say which pairs count.
///
/// # Errors
/// As [`load`].
pub fn load_run(run: &RunFolder, datasets: Option<&Path>) -> Result<Vec<ResultSet>, ResultsError> {
    results::of_run(run, datasets, &PairChoice::Listed)
}
