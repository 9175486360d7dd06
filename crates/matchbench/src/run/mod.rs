//! A run: every matcher and estimator on every pair of every dataset, recorded as it goes.
//!
//! [`Run::execute`] and `Run::finish` follow the way of the data:
//!
//! 1. Frames are decoded, and features extracted (`frame`).
//! 2. Pairs are searched and selected (`matching`), or matched by a source outside (`sourcing`).
//! 3. Poses are estimated from matched points and compared with the truth (`trial`).
//! 4. The results of all tasks of a pair together (`pair`) are appended to the [folder of the
//!    run](crate::records::RunFolder).
//!
//! Around these steps: [`plan`] says what is run, `progress` what is left to do, and `work` in which
//! portions; `kept` writes what stays beside the records, `resident` holds features in memory, `detections`
//! shares keypoints among matchers, [`pair_seed`] gives a task its seed, [`Observer`] is told how the run
//! goes, and [`Cancel`] stops it. [`evaluate`] does the same for one pair, without a disk.
//!
//! Threads are used in one place of a run (`ordered`): over the frames, then over the pairs of a window.
//! They are those of the rayon pool of the caller; to set their number, call from `ThreadPool::install`.
//! Whatever their number, records are the same and stand in the same order.

mod contender;
mod depth;
mod detections;
mod earlier;
mod error;
mod evaluate;
mod frame;
mod guard;
mod kept;
mod matching;
mod observer;
mod ordered;
mod pair;
mod plan;
mod progress;
mod repeatability;
mod resident;
mod seeds;
mod shards;
mod sourcing;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod trial;
mod tuned;
mod work;

pub use crate::matchers::Cancel;
pub use contender::{
    Contender, ContenderError, Outside, Variant, built_in, default_estimators, manifest,
};
pub use error::RunError;
pub use evaluate::{Evaluation, EvaluationError, ImagePair, evaluate};
pub use frame::Decode;
pub use observer::{Observer, RunSummary, Silent};
pub use plan::{check_truth, check_turns, plan};
pub use seeds::{estimation_seed, pair_seed, selection_seed};
pub use shards::{Shard, images_of_one, plan_shards};

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::mem;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize};
use std::time::Duration;

use crate::cache::FeatureCache;
use crate::datasets::{DatasetError, Sequence, Unpaired, Whole, decode_gray, is_dataset};
use crate::matchers::Source;
use crate::records::images::ImageNotes;
use crate::records::{
    FolderError, KeepMatches, RunFolder, RunRecord, RunSettings, RunWriter, Tuned,
};
use depth::DepthMaps;
use earlier::InOrder;
use kept::{Kept, Retried};
use pair::PairStages;
use progress::{MatcherProgress, Stored};
use tuned::{all_tuned, refuse_tuned};
use work::Work;

/// A dataset and where it came from.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// Its folder, for the reader of `plan.json`.
    pub path: PathBuf,
    /// Its frames and pairs.
    pub sequence: Sequence,
    /// Ids of the contenders that are run on it; all of them where absent.
    pub matchers: Option<BTreeSet<String>>,
    /// What it is a part of, where few of its pairs are held, see [`Shard::part`] and [`Dataset::survey`].
    pub whole: Option<Whole>,
    /// The frames of all its pairs, where [`Dataset::survey`] holds few of them with their truth.
    pub pair_frames: Option<Vec<(u32, u32)>>,
}

impl Dataset {
    /// The dataset in a folder.
    ///
    /// # Errors
    /// If it cannot be read, see [`Sequence::open`].
    pub fn open(folder: &Path) -> Result<Self, DatasetError> {
        // Where the working directory is gone, the relative path is as good.
        let path = std::path::absolute(folder).unwrap_or_else(|_| folder.to_path_buf());
        Ok(Self {
            sequence: Sequence::open(&path)?,
            path,
            matchers: None,
            whole: None,
            pair_frames: None,
        })
    }

    /// The dataset in a folder as [`plan_shards`] needs it, where a list of pairs may be long: the frames of
    /// every pair, and with its truth the first pair alone that has a pose, a homography, or both.
    ///
    /// # Errors
    /// If it cannot be read, see [`Unpaired::part`].
    pub fn survey(folder: &Path) -> Result<Self, DatasetError> {
        let unpaired = Unpaired::open(folder)?;
        let (mut pair_frames, mut kinds) = (Vec::new(), Vec::new());
        let (sequence, whole) = unpaired.part(|pair| {
            pair_frames.push((pair.a, pair.b));
            let kind = mem::discriminant(&pair.truth);
            let is_first = !kinds.contains(&kind);
            kinds.extend(is_first.then_some(kind));
            is_first
        })?;
        Ok(Self {
            path: std::path::absolute(folder).unwrap_or_else(|_| folder.to_path_buf()),
            sequence,
            matchers: None,
            whole: Some(whole),
            pair_frames: Some(pair_frames),
        })
    }

    /// The frames of every pair, in their order.
    pub(crate) fn pair_frames(&self) -> Box<dyn Iterator<Item = (u32, u32)> + '_> {
        match &self.pair_frames {
            Some(frames) => Box::new(frames.iter().copied()),
            None => Box::new(self.sequence.pairs.iter().map(|pair| (pair.a, pair.b))),
        }
    }

    /// Whether the contender `id` is run on it.
    pub fn runs(&self, id: &str) -> bool {
        (self.matchers.as_ref()).is_none_or(|matchers| matchers.contains(id))
    }
}

/// Decodes image files as every command does.
///
/// # Errors
/// If the bytes are no image that is understood.
pub fn decode(file: &[u8]) -> Result<matchbench_vision::image::GrayImage, String> {
    decode_gray(file).map_err(|error| error.to_string())
}

/// Everything that a run needs.
#[derive(Debug)]
pub struct Run<'a> {
    /// The datasets.
    pub datasets: &'a [Dataset],
    /// The matchers, each with its estimators.
    pub contenders: &'a [Contender],
    /// Seed, repetitions and limits.
    pub settings: RunSettings,
    /// Results of tuning that settings of the contenders come from. Datasets that they were tuned on are refused,
    /// and the folder notes them for its report.
    pub tuned: &'a [Tuned],
    /// The folder that the run is written into.
    pub folder: &'a Path,
    /// Features that were extracted before; may be shared by runs.
    pub cache: FeatureCache,
    /// How an image file becomes pixels; [`decode`] serves well. Neither the plan nor the keys of `cache` say which
    /// function it is: whoever gives another needs a folder and a cache of its own, or features of the pixels of one
    /// are taken for those of the other.
    pub decode: Decode,
    /// Which matches are written into the folder.
    pub keep_matches: KeepMatches,
    /// How many bytes of features, and of pixels where matchers use them, are kept in memory; [`Run::FEATURE_MEMORY`] serves
    /// well.
    pub feature_memory: usize,
    /// Whether all that failed is done again, and not only what another try may do better.
    pub retry_failed: bool,
    /// The part that is done, where many machines share the run.
    pub shard: Option<Shard<'a>>,
}

impl Run<'_> {
    /// 512 MiB. The 30 images of castle at full resolution take 160 MB with SIFT; what does not
    /// fit comes from the cache again when it is needed.
    pub const FEATURE_MEMORY: usize = 512 << 20;

    /// These matchers on these datasets into `folder`, everything else as the program has it: one repetition
    /// of all pairs, features cached in the folder, matches kept.
    pub fn new<'a>(
        datasets: &'a [Dataset],
        contenders: &'a [Contender],
        folder: &'a Path,
    ) -> Run<'a> {
        Run {
            datasets,
            contenders,
            settings: RunSettings::default(),
            tuned: &[],
            folder,
            cache: FeatureCache::new(RunFolder::default_cache_at(folder)),
            decode,
            keep_matches: KeepMatches::All,
            feature_memory: Run::FEATURE_MEMORY,
            retry_failed: false,
            shard: None,
        }
    }

    /// Does what is not yet recorded in the folder, until all is done or `cancel` is set.
    ///
    /// # Errors
    /// If the run contradicts itself (see [`plan`]), or its folder holds another plan, is
    /// damaged, in use or cannot be written to. What was recorded stays recorded. A task that
    /// fails is not an error: it is recorded and counted, and tried again at the next start where its
    /// record says that it may do better then. No errors either are a source that ends, since the others go on, and a
    /// cache of features that cannot be written. It is an error if an image has changed since its records were made, or if
    /// that cannot be told.
    pub fn execute(
        &self,
        observer: &dyn Observer,
        cancel: &Cancel,
    ) -> Result<RunSummary, RunError> {
        refuse_dataset(self.folder)?;
        let mut plan = plan(self.datasets, self.contenders, self.settings)?;
        let tuned = all_tuned(self.folder, self.tuned)?;
        refuse_tuned(&tuned, &plan, self.datasets)?;
        let part;
        let mut datasets = self.datasets;
        if let Some(shard) = self.shard {
            (plan, part) = shard.of(plan, self.datasets)?;
            datasets = &part;
        }
        // A run that grows is refused here where its images have changed or their notes are lost, while its results are in
        // their place still: it could not go on, and had no results that are scored.
        let (folder, verified) =
            RunWriter::start_checked(self.folder, plan, |before| all_verified(datasets, before))?;
        self.cache.remove_leftovers();
        if !tuned.is_empty() {
            folder.note_tuned(&tuned)?;
        }
        let progresses = self.progresses(datasets, &folder)?;
        let images = images(datasets, &progresses, &folder, verified.unwrap_or_default())?;

        for contender in self.contenders {
            if let Source::Points(source) = &contender.source {
                source.source.heed(cancel);
            }
        }
        let mut summary: RunSummary = progresses.iter().map(MatcherProgress::summary).sum();
        observer.on_plan(folder.folder().plan(), summary);
        let (mut ended, mut finished) = (BTreeSet::new(), BTreeSet::new());
        for progress in progresses.iter().filter(|progress| !progress.is_done()) {
            let id = progress.contender.source.id();
            if cancel.is_set() {
                break;
            }
            if ended.contains(id) {
                continue;
            }
            observer.on_matcher(&progress.sequence.name, id);
            let images = &images[&*progress.sequence.name];
            match self.finish(progress, images, &folder, observer, cancel, &mut summary) {
                Err(RunError::SourceEnded { reason, .. }) => {
                    observer.on_ended(id, &reason);
                    ended.insert(id);
                    summary.ended += 1;
                }
                Err(RunError::Stopped) => {}
                Err(error) => {
                    self.refuse_removed(None)?;
                    return Err(error);
                }
                Ok(()) => {
                    finished.insert(progress.names());
                }
            }
        }
        let removed = (progresses.iter())
            .find_map(|progress| progress.removed(finished.contains(&progress.names())));
        self.refuse_removed(removed)?;
        Ok(summary)
    }

    /// The error that the folder, or this file of records in it, was removed while the run wrote: files that are open are
    /// written to even if nobody can find them any more.
    fn refuse_removed(&self, file: Option<PathBuf>) -> io::Result<()> {
        let (path, what) = match file {
            _ if !RunFolder::is_at(self.folder) => {
                let what =
                    "the folder of the run was removed while it ran, and its records with it";
                (self.folder.to_path_buf(), what)
            }
            Some(file) => (file, "it was removed while the run wrote records into it"),
            None => return Ok(()),
        };
        let what = format!("{}: {what}; run it again", path.display());
        Err(io::Error::new(io::ErrorKind::NotFound, what))
    }

    /// Each matcher on each dataset, and how far it has come.
    fn progresses<'p>(
        &'p self,
        datasets: &'p [Dataset],
        folder: &RunWriter,
    ) -> Result<Vec<MatcherProgress<'p>>, RunError> {
        let mut progresses = Vec::new();
        for dataset in datasets {
            let sequence = &dataset.sequence;
            for contender in self.contenders {
                if !dataset.runs(contender.source.id()) {
                    continue;
                }
                let retry = self.retry_failed;
                let matches =
                    (folder.folder()).matches_of(&sequence.name, contender.source.id())?;
                let stored = Stored {
                    file: &matches,
                    are_kept: self.keep_matches == KeepMatches::All,
                    may_vary: matches!(&contender.source, Source::Points(source) if !source.source.repeats()),
                };
                let progress = MatcherProgress::recover(
                    folder,
                    sequence,
                    contender,
                    self.settings,
                    retry,
                    stored,
                )?;
                progresses.push(progress);
            }
        }
        Ok(progresses)
    }

    /// Does what is left of one matcher on one dataset: first, matches that were lost; then what was never done; then what
    /// failed and may do better now, whose records take the place of the earlier ones. So whatever fails at every start
    /// keeps none of the rest from being done.
    fn finish(
        &self,
        progress: &MatcherProgress<'_>,
        images: &Mutex<ImageNotes>,
        folder: &RunWriter,
        observer: &dyn Observer,
        cancel: &Cancel,
        summary: &mut RunSummary,
    ) -> Result<(), RunError> {
        let (dataset, matcher) = (&progress.sequence.name, progress.contender.source.id());
        let unkept = AtomicUsize::new(summary.unkept);
        let mut kept = Kept::open(self.keep_matches, progress, folder, images)?;
        let mut work = Work {
            run: self,
            stages: PairStages {
                progress,
                root: self.settings.seed,
                time_budget: self.time_budget(),
                images,
                keep: self.keep_matches,
                depth: DepthMaps::default(),
            },
            stored: progress.own_matches(folder.folder())?,
            observer,
            cancel,
            unkept,
            has_told_other: AtomicBool::new(false),
        };

        if progress.lost() > 0 {
            observer.on_lost_matches(dataset, matcher, progress.lost());
        }
        let last = self.settings.repetitions.get() - 1;
        work.all(progress.lost_pairs(), |done| {
            kept.keep(&done)?;
            // All repetitions of such a pair are done.
            let is_whole = (done.records.last()).is_some_and(|(_, r)| r.task.repetition == last);
            summary.lost -= usize::from(is_whole);
            if kept.is_time() {
                kept.sync(|| Ok(()))?;
            }
            Ok(())
        })?;
        let mut told = |record: &RunRecord| {
            summary.add(record);
            observer.on_record(record);
        };
        let mut writers = progress.writers(folder)?;
        let done = work.all(progress.pending_pairs(), |done| {
            kept.keep(&done)?;
            for ((estimator, record), line) in done.records.iter().zip(&done.lines) {
                writers[*estimator].append_line(line)?;
                told(record);
            }
            if kept.is_time() {
                kept.sync(|| writers.iter_mut().try_for_each(InOrder::sync))?;
            }
            Ok(())
        });
        kept.sync(|| writers.iter_mut().try_for_each(InOrder::sync))?;
        progress.forget_earlier(folder, &writers)?;
        drop(writers);
        let done = done.and_then(|()| {
            if cancel.is_set() || progress.failed_pairs().next().is_none() {
                return Ok(());
            }
            // Other estimators of these pairs may have matches since.
            work.stored = progress.own_matches(folder.folder())?;
            let mut retried = Retried::new(progress.replacements(), kept);
            let done = work.all(progress.failed_pairs(), |done| retried.put(done, &mut told));
            retried.write()?;
            done
        });
        summary.unkept = work.unkept.into_inner();
        done
    }

    fn time_budget(&self) -> Option<Duration> {
        let milliseconds = self.settings.time_budget_ms?;
        Some(Duration::from_millis(milliseconds.get().into()))
    }
}

/// The images that earlier processes worked with on each dataset of which something is left to be
/// done; they must be the same still, and so must their depth. Those of the datasets that are `verified` were looked at.
fn images<'d>(
    datasets: &'d [Dataset],
    progresses: &[MatcherProgress<'_>],
    folder: &RunWriter,
    mut verified: BTreeMap<&str, ImageNotes>,
) -> Result<BTreeMap<&'d str, Mutex<ImageNotes>>, RunError> {
    let mut images = BTreeMap::new();
    for dataset in datasets {
        let name = &dataset.sequence.name;
        let is_left =
            |progress: &MatcherProgress<'_>| progress.sequence.name == *name && !progress.is_done();
        if progresses.iter().any(is_left) {
            let notes = match verified.remove(&**name) {
                Some(notes) => notes,
                None => verified_notes(&dataset.sequence, folder.folder())?,
            };
            images.insert(&**name, Mutex::new(notes));
        }
    }
    Ok(images)
}

/// Refuses the folder of a dataset for that of a run, unless a run is in it already.
///
/// # Errors
/// [`FolderError::IsDataset`] if it is one.
pub fn refuse_dataset(folder: &Path) -> Result<(), FolderError> {
    if is_dataset(folder) && !RunFolder::is_at(folder) {
        let folder = folder.into();
        return Err(FolderError::IsDataset { folder });
    }
    Ok(())
}

/// The notes of each dataset, by its name, see [`verified_notes`].
fn all_verified<'d>(
    datasets: &'d [Dataset],
    run: &RunFolder,
) -> Result<BTreeMap<&'d str, ImageNotes>, FolderError> {
    (datasets.iter())
        .map(|Dataset { sequence, .. }| Ok((&*sequence.name, verified_notes(sequence, run)?)))
        .collect()
}

/// The notes of the images that a run has worked with on a dataset, which must be the same still, and so must their depth.
///
/// # Errors
/// If they are others, or if that cannot be told.
fn verified_notes(sequence: &Sequence, run: &RunFolder) -> Result<ImageNotes, FolderError> {
    let Sequence { name, frames, .. } = sequence;
    let notes = run.images_of(name)?;
    // Images that are not there are not verified anyway.
    if frames.iter().any(|frame| frame.image.is_file()) {
        run.refuse_lost(&notes)?;
    }
    notes.verify(|frame| Some(&*frames.get(frame as usize)?.image))?;
    let depth = |frame: u32| Some(&*frames.get(frame as usize)?.depth.as_ref()?.path);
    run.depth_of(name)?.verify(depth)?;
    Ok(notes)
}
