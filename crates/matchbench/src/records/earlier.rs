//! What was recorded before a run grew, until it is taken over.
//!
//! The records of a file stand in the order of the tasks: pair by pair, repetition by repetition. Where a run gets more
//! repetitions, or more pairs than a sample of them, new tasks come between those that are done. So the files of
//! records are set aside first, as `earlier/<dataset>/<matcher>+<estimator>.jsonl`. The run writes its records anew, and
//! takes over what it finds there when the turn of its task has come. When all is taken over, the file is deleted.
//!
//! So the records of a run are complete pairs in order at all times, as they are where it was never grown. Whenever a
//! process is killed, every record is in one file or the other, or in both; then that of the run counts.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::store::{self, Place, StoreError};
use super::{FORMAT, RunRecord};
use crate::files::{move_file, sync_folder_of};

/// The folder within the folder of a run.
pub(super) const FOLDER: &str = "earlier";

/// Where the records of one dataset, matcher and estimator are set aside in the folder of a `run`.
pub(super) fn path(run: &Path, names: [&str; 3]) -> PathBuf {
    let [dataset, matcher, estimator] = names;
    beside(run, &store::path(run, dataset, matcher, estimator))
}

/// Where a file of records of a `run` is set aside.
fn beside(run: &Path, file: &Path) -> PathBuf {
    let inner = file.strip_prefix(run.join(store::FOLDER));
    run.join(FOLDER).join(inner.expect("a file of records"))
}

/// Sets aside all records of a `run` of the present format; what was set aside before and not taken over stays.
///
/// # Errors
/// If a file cannot be read, moved or written; no record is lost then.
pub(super) fn set_aside(run: &Path) -> Result<(), StoreError> {
    for file in store::files(run)? {
        let earlier = beside(run, &file);
        if earlier.exists() {
            store::put_behind(&earlier, &file)?;
            sync_folder_of(&earlier);
            fs::remove_file(&file).map_err(StoreError::io("delete", &file))?;
            sync_folder_of(&file);
        } else {
            move_file(&file, &earlier).map_err(StoreError::io("move", &file))?;
        }
    }
    Ok(())
}

/// Hands over the records of these names that were set aside, each with the number and the place of its line, and returns
/// where they are; nothing if there are none.
///
/// # Errors
/// If the file cannot be read or has a line that is not a record; whatever `each` does not want.
pub(super) fn for_each<E: From<StoreError>>(
    run: &Path,
    names: [&str; 3],
    each: impl FnMut(usize, Place, RunRecord) -> Result<(), E>,
) -> Result<Option<PathBuf>, E> {
    in_file(run, names, |file| {
        store::for_each_placed(file, FORMAT, each)
    })
}

/// Where the records of these names are that were set aside, once `read` has read them; nothing if there are none.
fn in_file<T, E>(
    run: &Path,
    names: [&str; 3],
    read: impl FnOnce(&Path) -> Result<T, E>,
) -> Result<Option<PathBuf>, E> {
    let file = Some(path(run, names)).filter(|file| file.exists());
    file.as_deref().map(read).transpose()?;
    Ok(file)
}

/// How many records were set aside and are not taken over yet.
///
/// # Errors
/// If a file cannot be read or has a line that is not a record.
pub(super) fn waiting(run: &Path, format: u32) -> Result<usize, StoreError> {
    let mut waiting = 0;
    for earlier in store::files_in(&run.join(FOLDER))? {
        let inner = earlier
            .strip_prefix(run.join(FOLDER))
            .expect("it was listed there");
        let file = run.join(store::FOLDER).join(inner);
        each_waiting(&earlier, &file, format, |_, _| {
            waiting += 1;
            Ok::<_, StoreError>(())
        })?;
    }
    Ok(waiting)
}

/// Hands over the records of these names that were set aside in a `run` of this `format` and are not taken over yet, each
/// with the number of its line, and returns where they are; nothing if there are none.
///
/// # Errors
/// If a file cannot be read or has a line that is not a record; whatever `each` does not want.
pub(super) fn for_each_waiting<E: From<StoreError>>(
    run: &Path,
    format: u32,
    names: [&str; 3],
    each: impl FnMut(usize, RunRecord) -> Result<(), E>,
) -> Result<Option<PathBuf>, E> {
    let [dataset, matcher, estimator] = names;
    let file = store::path(run, dataset, matcher, estimator);
    in_file(run, names, |earlier| {
        each_waiting(earlier, &file, format, each)
    })
}

/// Hands over the records of the file `earlier` that are not in the `file` of the run.
fn each_waiting<E: From<StoreError>>(
    earlier: &Path,
    file: &Path,
    format: u32,
    mut each: impl FnMut(usize, RunRecord) -> Result<(), E>,
) -> Result<(), E> {
    let key = |record: &RunRecord| (record.task.a, record.task.b, record.task.repetition);
    let mut taken = BTreeSet::new();
    if file.exists() {
        store::for_each(file, format, |_, record| {
            taken.insert(key(&record));
            Ok::<_, StoreError>(())
        })?;
    }
    store::for_each(earlier, FORMAT, |line, record| {
        if taken.contains(&key(&record)) {
            return Ok(());
        }
        each(line, record)
    })?;
    Ok(())
}

/// Deletes the records of these names that were set aside, and the folders that get empty.
///
/// # Errors
/// If the file cannot be deleted.
pub(super) fn remove(run: &Path, names: [&str; 3]) -> Result<(), StoreError> {
    let file = path(run, names);
    match fs::remove_file(&file) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            return Err(StoreError::io("delete", &file)(error));
        }
        _ => {}
    }
    // Only empty ones go.
    for folder in file.ancestors().skip(1).take(2) {
        let _ = fs::remove_dir(folder);
    }
    Ok(())
}
