//! The folder of a run, which holds all that a run leaves: with `parts`, which has their names, the only place that knows its
//! files.
//!
//! | file | what |
//! | --- | --- |
//! | `plan.json` | the [`Plan`], with the version of this format |
//! | `records/<dataset>/<matcher>+<estimator>.jsonl` | a [`RunRecord`] a line, see [`store`] |
//! | `earlier/<dataset>/<matcher>+<estimator>.jsonl` | records of before the run grew that are not taken over yet, see `earlier` |
//! | `matches/<dataset>/<matcher>.bin` | selected matches, see [`matches`]; absent if they were not kept |
//! | `inliers/<dataset>/<matcher>+<estimator>.bin` | their inliers, where these alone were kept |
//! | `images/<dataset>.txt` | the content of the images that the records are of, see `images` |
//! | `depth/<dataset>.txt` | that of their depth, where records are judged by depth |
//! | `tuning.json` | a list of [`Tuned`], if settings were taken over from tuning |
//! | `tuned.json` | a [`Tuned`], in the folder of a tuning |
//! | `logs/<matcher>.log` | what a matcher from outside printed |
//! | `.lock` | held by the process that writes; a lock ends with its process, however that ends |
//! | `cache/`, `report/` | where features and the report go unless another place is asked for; can be deleted |
//!
//! One process writes ([`RunWriter`]), for one plan. Anybody may read ([`RunFolder`]), also while it
//! writes. A run folder may come from somebody else, so nothing in it is written through a link.
//!
//! # Versions of the format
//! | `format` | since | what changed |
//! | --- | --- | --- |
//! | absent, or 1 | the first | |
//! | 2 | 0.1.0 | records end with a checksum and say whether a failure may pass; images are noted |
//!
//! Folders of the first format are read. When a run goes on with one, its records are first given
//! checksums, its images may be without notes, and it becomes a folder of the second format.
//!
//! A folder of a later format is refused, and the message names its number. A field that is left out where
//! it is not needed may be added without a change of the number, if older programs need not know it.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::growth::{difference, moves_tasks};
use super::images::ImageNotes;
use super::parts::{CACHE, LOCK, LOGS, PLAN, REPORT, TUNED, TUNING, has_plan, in_the_way};
use super::store::{Place, RecordWriter};
use super::{
    FORMAT, FolderError, MatchesFile, Plan, RunRecord, StoreError, Task, Tuned, earlier, images,
    matches, store,
};
use crate::files::{
    link_in, make_folder, open_file, read_file, read_text, regular, remove_leftovers,
    remove_leftovers_below, sync_folder_of, write_unnamed,
};

/// The folder of a run, to be read.
#[derive(Clone, Debug)]
pub struct RunFolder {
    path: PathBuf,
    plan: Plan,
}

impl RunFolder {
    /// The folder at `path`.
    ///
    /// # Errors
    /// If there is no plan, or it cannot be read, is of a later format or is not what a run writes.
    pub fn open(path: &Path) -> Result<Self, FolderError> {
        let plan = read_plan(&path.join(PLAN))?.ok_or_else(|| FolderError::NotARun {
            folder: path.into(),
        })?;
        Ok(Self {
            path: path.into(),
            plan,
        })
    }

    /// Whether there is a run at `path`, readable or not.
    pub fn is_at(path: &Path) -> bool {
        has_plan(path)
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What is run.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// What is run, as it stands in the folder.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn plan_text(&self) -> Result<String, FolderError> {
        let path = self.path.join(PLAN);
        read_text(&path).map_err(FolderError::io("read", &path))
    }

    /// All records, ordered by dataset, then by matcher and estimator, then as they were written.
    ///
    /// # Errors
    /// If a file cannot be read or has a line that is not a record. Without records it has none.
    pub fn records(&self) -> Result<Vec<RunRecord>, StoreError> {
        let mut records = Vec::new();
        self.for_each(|record| records.push(record))?;
        Ok(records)
    }

    /// Hands over what [`RunFolder::records`] returns, one record after the other.
    ///
    /// # Errors
    /// As [`RunFolder::records`].
    pub(super) fn for_each(&self, mut each: impl FnMut(RunRecord)) -> Result<(), StoreError> {
        for file in self.record_files()? {
            self.for_each_in(&file, |_, record| {
                each(record);
                Ok::<_, StoreError>(())
            })?;
        }
        Ok(())
    }

    /// The records of one matcher with one estimator on one dataset, as they were written; none
    /// where nothing has been recorded yet.
    ///
    /// # Errors
    /// As [`RunFolder::records`].
    pub fn records_of(
        &self,
        dataset: &str,
        matcher: &str,
        estimator: &str,
    ) -> Result<Vec<RunRecord>, StoreError> {
        let mut records = Vec::new();
        self.for_each_of([dataset, matcher, estimator], |record| records.push(record))?;
        Ok(records)
    }

    /// Hands over what [`RunFolder::records_of`] returns, one record after the other.
    ///
    /// # Errors
    /// As [`RunFolder::records`].
    pub(crate) fn for_each_of(
        &self,
        [dataset, matcher, estimator]: [&str; 3],
        mut each: impl FnMut(RunRecord),
    ) -> Result<(), StoreError> {
        let file = store::path(&self.path, dataset, matcher, estimator);
        if file.exists() {
            self.for_each_in(&file, |_, record| {
                each(record);
                Ok::<_, StoreError>(())
            })?;
        }
        Ok(())
    }

    /// Hands over the records of one of its [files](Self::record_files), each with the number of its line.
    ///
    /// # Errors
    /// As [`RunFolder::records`], also if an outcome is not one of the planned estimator, and whatever `each` does not
    /// want.
    pub(crate) fn for_each_in<E: From<StoreError>>(
        &self,
        file: &Path,
        mut each: impl FnMut(usize, RunRecord) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut names_of_file: Option<[String; 3]> = None;
        let mut planned = None;
        store::for_each(file, self.plan.format, |line, record| {
            let Task {
                dataset,
                matcher,
                estimator,
                ..
            } = &record.task;
            let names = [dataset, matcher, estimator];
            if !(names_of_file.iter()).any(|known| known.each_ref() == names) {
                let names = names.map(Clone::clone);
                if store::path(&self.path, dataset, matcher, estimator) != file {
                    return Err(E::from(StoreError::Foreign {
                        path: file.into(),
                        line,
                        names,
                    }));
                }
                planned = self.plan.is_of_homographies(matcher, estimator);
                names_of_file = Some(names);
            }
            let found = record.outcome.is_of_homographies();
            if found.is_some() && planned.is_some() && found != planned {
                let kind = if found == Some(true) {
                    "homography"
                } else {
                    "pose"
                };
                return Err(E::from(StoreError::Corrupt {
                    path: file.into(),
                    line,
                    reason: format!(
                        "its outcome is of a {kind}, which {estimator} does not estimate"
                    ),
                }));
            }
            each(line, record)
        })
        .map(drop)
    }

    /// The files of records, in the order of [`RunFolder::records`].
    ///
    /// # Errors
    /// If a folder cannot be listed.
    pub(crate) fn record_files(&self) -> Result<Vec<PathBuf>, StoreError> {
        store::files(&self.path)
    }

    /// How many results of before the run grew wait until their turn has come again; they are not among its records.
    ///
    /// # Errors
    /// As [`RunFolder::records`].
    pub fn waiting(&self) -> Result<usize, StoreError> {
        earlier::waiting(&self.path, self.plan.format)
    }

    /// The selected matches of one matcher on one dataset; none where they were not kept.
    ///
    /// # Errors
    /// If the file cannot be read, or is something else.
    pub fn matches_of(&self, dataset: &str, matcher: &str) -> Result<MatchesFile, StoreError> {
        MatchesFile::open(&matches::path(&self.path, dataset, matcher))
    }

    /// The images of a dataset that the records are of.
    ///
    /// # Errors
    /// If the file that notes them cannot be read or is damaged.
    pub(crate) fn images_of(&self, dataset: &str) -> Result<ImageNotes, FolderError> {
        ImageNotes::open(&self.path, dataset)
    }

    /// The depth of these images, by which the records are judged.
    ///
    /// # Errors
    /// As [`RunFolder::images_of`].
    pub(crate) fn depth_of(&self, dataset: &str) -> Result<ImageNotes, FolderError> {
        ImageNotes::open_depth(&self.path, dataset)
    }

    /// The inliers of one matcher with one estimator on one dataset; none where they were not kept.
    ///
    /// # Errors
    /// As [`RunFolder::matches_of`].
    pub fn inliers_of(
        &self,
        dataset: &str,
        matcher: &str,
        estimator: &str,
    ) -> Result<MatchesFile, StoreError> {
        let path = matches::inliers_path(&self.path, dataset, matcher, estimator);
        MatchesFile::open(&path)
    }

    /// The settings that the run took over from tuning.
    ///
    /// # Errors
    /// If the file that lists them cannot be read or is not what a run writes.
    pub fn tuned(&self) -> Result<Vec<Tuned>, FolderError> {
        let path = self.path.join(TUNING);
        let text = match read_file(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            text => text.map_err(FolderError::io("read", &path))?,
        };
        serde_json::from_slice(&text).map_err(|error| FolderError::Damaged {
            path,
            reason: format!("not what a run writes ({error})"),
        })
    }

    /// Where features are kept unless another place is asked for.
    pub fn default_cache(&self) -> PathBuf {
        Self::default_cache_at(&self.path)
    }

    /// [`RunFolder::default_cache`] of a folder that need not be there yet.
    pub fn default_cache_at(folder: &Path) -> PathBuf {
        folder.join(CACHE)
    }

    /// Where matchers from outside leave what they print, of a run in a folder that need not be there yet.
    pub fn logs_at(folder: &Path) -> PathBuf {
        folder.join(LOGS)
    }

    /// Where the report is written unless another place is asked for.
    pub fn default_report(&self) -> PathBuf {
        self.path.join(REPORT)
    }

    /// Where a tuning writes what it chose.
    pub fn tuned_file(&self) -> PathBuf {
        self.path.join(TUNED)
    }
}

/// The folder of a run that this process writes into, as long as this value lives.
#[derive(Debug)]
pub struct RunWriter {
    folder: RunFolder,
    _locks: Locks,
}

impl RunWriter {
    /// The folder at `path`: a new one, which is given the `plan`, or one that has it already.
    ///
    /// # Errors
    /// If it has another plan, is in use, damaged, or cannot be written to.
    pub fn start(path: &Path, plan: Plan) -> Result<Self, FolderError> {
        Ok(Self::start_checked(path, plan, |_| Ok(()))?.0)
    }

    /// The same. A run that is there and is to grow on its datasets is shown to `check` before its results are set aside
    /// and its plan is another; what comes of that is handed on.
    ///
    /// # Errors
    /// As [`RunWriter::start`], and what `check` does not want.
    pub(crate) fn start_checked<T>(
        path: &Path,
        plan: Plan,
        check: impl FnOnce(&RunFolder) -> Result<T, FolderError>,
    ) -> Result<(Self, Option<T>), FolderError> {
        // Where there are records too, it is their plan that is missing.
        if let Some(place) = in_the_way(path)
            && !path.join(store::FOLDER).exists()
        {
            return Err(FolderError::Occupied { path: place });
        }
        make_folder(path).map_err(FolderError::io("make the folder", path))?;
        refuse_links(path)?;
        let locks = lock(path)?;
        // Nobody else writes here now: records that were rewritten and what was merged, two folders down.
        remove_leftovers(path);
        for folder in [
            store::FOLDER,
            earlier::FOLDER,
            matches::FOLDER,
            matches::INLIERS,
        ] {
            remove_leftovers_below(&path.join(folder), 1);
        }
        let plan_file = path.join(PLAN);
        if let Some(reason) = plan.too_many_methods() {
            // It could never be read again.
            let what = format!("{}: {reason}; make several runs of it", plan_file.display());
            return Err(io::Error::other(what).into());
        }
        let written = read_plan(&plan_file)?.map(|plan| RunFolder {
            path: path.into(),
            plan,
        });
        match &written {
            Some(RunFolder { plan: written, .. }) => {
                if let Some(difference) = difference(written, &plan) {
                    return Err(FolderError::OtherPlan {
                        folder: path.into(),
                        difference,
                    });
                }
            }
            None if path.join(store::FOLDER).exists() => {
                return Err(FolderError::Damaged {
                    path: plan_file,
                    reason: "there are records, but not the plan that they belong to".into(),
                });
            }
            None => {}
        }
        let mut checked = None;
        if written.as_ref().map(|before| &before.plan) != Some(&plan) {
            if let Some(before @ RunFolder { plan: written, .. }) = &written {
                store::add_checksums(path, written.format)?;
                if written.format < images::FIRST_WITH_NOTES {
                    for dataset in &written.datasets {
                        ImageNotes::open(path, &dataset.name)?.begin()?;
                    }
                }
                if (written.settings, &written.matchers) != (plan.settings, &plan.matchers) {
                    checked = Some(check(before)?);
                }
                if moves_tasks(written, &plan) {
                    earlier::set_aside(path)?;
                }
            }
            write_json(&plan_file, &plan)?;
        }
        let path = path.into();
        let writer = Self {
            folder: RunFolder { path, plan },
            _locks: locks,
        };
        Ok((writer, checked))
    }

    /// The folder, to be read.
    pub fn folder(&self) -> &RunFolder {
        &self.folder
    }

    /// Notes which settings were taken over from tuning, for the report.
    ///
    /// # Errors
    /// If the file cannot be written; the error names it.
    pub fn note_tuned(&self, tuned: &[Tuned]) -> Result<(), FolderError> {
        write_json(&self.folder.path.join(TUNING), &tuned)
    }

    /// The file of what earlier processes recorded of one matcher with one estimator on one dataset; a torn
    /// last line is cut off, and each record is handed over with the number of its line.
    ///
    /// # Errors
    /// If the file cannot be read or cut, or has a line that is not a record; whatever `each` does not want.
    pub(crate) fn recover<E: From<StoreError>>(
        &self,
        [dataset, matcher, estimator]: [&str; 3],
        each: impl FnMut(usize, RunRecord) -> Result<(), E>,
    ) -> Result<PathBuf, E> {
        let file = store::path(&self.folder.path, dataset, matcher, estimator);
        store::recover_each(&file, each)?;
        Ok(file)
    }

    /// Hands over what was recorded of one matcher with one estimator on one dataset before the run grew, and was not
    /// taken over yet, each record with the number and the place of its line. Returns the file, if there is one.
    ///
    /// # Errors
    /// If it cannot be read, or has a line that is not a record; whatever `each` does not want.
    pub(crate) fn for_each_earlier<E: From<StoreError>>(
        &self,
        names: [&str; 3],
        each: impl FnMut(usize, Place, RunRecord) -> Result<(), E>,
    ) -> Result<Option<PathBuf>, E> {
        earlier::for_each(&self.folder.path, names, each)
    }

    /// Deletes what was recorded of them before the run grew: all of it was taken over.
    ///
    /// # Errors
    /// If it cannot be deleted.
    pub(crate) fn remove_earlier(&self, names: [&str; 3]) -> Result<(), StoreError> {
        earlier::remove(&self.folder.path, names)
    }

    /// Appends to the records of one matcher with one estimator on one dataset; recover them first.
    ///
    /// # Errors
    /// If the file cannot be opened.
    pub(crate) fn append_to(
        &self,
        dataset: &str,
        matcher: &str,
        estimator: &str,
    ) -> Result<RecordWriter, StoreError> {
        let file = store::path(&self.folder.path, dataset, matcher, estimator);
        RecordWriter::open(&file)
    }
}

/// Refuses a folder in which a file of a run, of its logs or of its cache is a link, or a folder of them. Logs are
/// opened before, and refuse links by themselves, as files of a report do.
pub(super) fn refuse_links(folder: &Path) -> Result<(), FolderError> {
    let entries = fs::read_dir(folder).map_err(FolderError::io("read", folder))?;
    let link = entries.flatten().find_map(|entry| {
        let is_report = entry.file_name() == REPORT;
        link_in(&entry.path(), if is_report { 0 } else { 2 })
    });
    link.map_or(Ok(()), |path| Err(FolderError::Link { path }))
}

/// What one process holds of a folder: the file that all versions of this program lock, and, where the
/// system can lock folders, the folder itself, which nobody deletes by accident.
#[derive(Debug)]
pub(super) struct Locks {
    _file: File,
    _folder: Option<File>,
}

pub(super) fn lock(folder: &Path) -> Result<Locks, FolderError> {
    let path = folder.join(LOCK);
    if let Ok(there) = fs::metadata(&path) {
        regular(&there).map_err(FolderError::io("lock", &path))?;
    }
    let file = (File::options().write(true).create(true).truncate(false))
        .open(&path)
        .map_err(FolderError::io("open", &path))?;
    let in_use = || FolderError::InUse {
        folder: folder.into(),
    };
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => return Err(in_use()),
        Err(TryLockError::Error(error)) => return Err(FolderError::io("lock", &path)(error)),
    }
    // Not every system opens folders; there the file has to do.
    let itself = File::open(folder).ok();
    if let Some(folder) = &itself
        && let Err(TryLockError::WouldBlock) = folder.try_lock()
    {
        return Err(in_use());
    }
    Ok(Locks {
        _file: file,
        _folder: itself,
    })
}

/// Holds a folder that is read as a whole: as long as what is returned lives, no run writes into it. One that cannot be
/// locked, such as that of a disk that nobody may write to, is read all the same.
///
/// # Errors
/// If a process writes into it.
pub(super) fn hold(folder: &Path) -> Result<Vec<File>, FolderError> {
    let file = open_file(&folder.join(LOCK)).ok();
    // Whoever opens a pipe waits.
    let itself = (folder.is_dir()).then(|| File::open(folder).ok()).flatten();
    let mut held = Vec::new();
    for file in [file, itself].into_iter().flatten() {
        if let Err(TryLockError::WouldBlock) = file.try_lock_shared() {
            let folder = folder.into();
            return Err(FolderError::InUse { folder });
        }
        held.push(file);
    }
    Ok(held)
}

/// All that is read of a plan of any format.
#[derive(Deserialize)]
struct FormatOf {
    format: Option<u64>,
    /// What the plan of shards has and no other.
    cut: Option<serde::de::IgnoredAny>,
}

fn read_plan(path: &Path) -> Result<Option<Plan>, FolderError> {
    let text = match read_file(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        text => text.map_err(FolderError::io("read", path))?,
    };
    let damaged = |error: serde_json::Error| FolderError::Damaged {
        path: path.into(),
        reason: format!("not a plan ({error})"),
    };
    let FormatOf { format, cut } = serde_json::from_slice(&text).map_err(damaged)?;
    if cut.is_some() {
        return Err(FolderError::OfShards { path: path.into() });
    }
    match format {
        Some(format) if format > FORMAT.into() => Err(FolderError::Newer {
            path: path.into(),
            format,
            known: FORMAT,
        }),
        _ => {
            let plan: Plan = serde_json::from_slice(&text).map_err(damaged)?;
            plan.refusal().map_or(Ok(Some(plan)), |reason| {
                Err(FolderError::Damaged {
                    path: path.into(),
                    reason,
                })
            })
        }
    }
}

fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<(), FolderError> {
    let text = serde_json::to_string_pretty(value).expect("what a run writes is plain JSON");
    let written = write_unnamed(path, format!("{text}\n").as_bytes());
    written.map_err(FolderError::io("write", path))?;
    sync_folder_of(path);
    Ok(())
}
