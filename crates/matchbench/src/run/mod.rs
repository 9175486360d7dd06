//! A run: every matcher and estimator on every pair of every dataset, recorded as it goes.
//!
//! [`Run::execute`] and `Run::finish` follow the way of the data: frames are decoded and extracted
//! (`frame`); pairs are searched and selected (`matching`), or matched by a source outside
//! (`sourcing`); matched points are estimated and compared with the truth (`trial`); all tasks of a
//! pair together (`pair`) are appended to the [folder of the run](crate::records::RunFolder). Around
//! them: what is run ([`plan`]), what is left to do (`progress`), which features are in memory
//! (`resident`), which keypoints are shared by matchers (`detections`), which seed a task has
//! ([`pair_seed`]), who is told ([`Observer`]) and who may stop it ([`Cancel`]). [`evaluate`] does the
//! same for one pair, without a disk.
//!
//! Threads are used in one place of a run (`ordered`): over the frames, then over the pairs of a
//! window. They are those of the rayon pool that the caller is in: whoever wants so many threads
//! calls from `ThreadPool::install`. Whatever their number, records are the same and stand in the
//! same order.

mod contender;
mod detections;

mod error;
mod evaluate;
mod frame;
mod guard;
mod matching;
mod observer;
mod ordered;
mod pair;
mod plan;
mod progress;
mod resident;
mod seeds;
mod shards;
mod sourcing;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod trial;

pub use contender::{Contender, ContenderError, Outside, Variant, manifest};
pub use error::RunError;
pub use evaluate::{Evaluation, EvaluationError, ImagePair, evaluate};
pub use frame::Decode;
pub use observer::{Cancel, Observer, RunSummary, Silent};
pub use plan::{check_turns, plan};
pub use seeds::{estimation_seed, pair_seed, selection_seed};
pub use shards::{Shard, images_of_one, plan_shards};

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use crate::cache::FeatureCache;
use crate::datasets::{DatasetError, Frame, Sequence, decode_gray};
use crate::matchers::{BuiltMatcher, Source};
use crate::memory;
use crate::records::images::ImageNotes;
use crate::records::store::{self, RecordWriter};
use crate::records::{
    KeepMatches, MatchesFile, RunFolder, RunRecord, RunWriter, Settings, StoreError, Tuned,
};
use frame::{FrameStage, lock};
use ordered::each_in_order;
use pair::{PairDone, PairStages};
use progress::{MatcherProgress, PairTasks, Replacement};
use resident::Resident;

/// A dataset and where it came from.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// Its folder, for the reader of `plan.json`.
    pub path: PathBuf,
    /// Its frames and pairs.
    pub sequence: Sequence,
    /// Ids of the contenders that are run on it; all of them where absent.
    pub matchers: Option<BTreeSet<String>>,
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
        })
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
pub struct Run<'a> {
    /// The datasets.
    pub datasets: &'a [Dataset],
    /// The matchers, each with its estimators.
    pub contenders: &'a [Contender],
    /// What else decides about the records.
    pub settings: Settings,
    /// Choices that settings of the contenders were taken over from; the scenes that they were made
    /// on are refused, and the folder notes them for its report.
    pub tuned: &'a [Tuned],
    /// The folder that the run is written into.
    pub folder: &'a Path,
    /// Features that were extracted before; may be shared by runs.
    pub cache: FeatureCache,
    /// How an image file becomes pixels; [`decode`] serves well.
    pub decode: Decode,
    /// Which matches are written into the folder.
    pub keep_matches: KeepMatches,
    /// How many bytes of features are kept in memory; [`Run::FEATURE_MEMORY`] serves well.
    pub feature_memory: usize,
    /// Whether all that failed is done again, and not only what another try may do better.
    pub retry_failed: bool,
    /// The part that is done, where many machines share the run.
    pub shard: Option<Shard<'a>>,
}

/// Pairs that are listed at a time: enough to keep what is in memory in use, few enough that millions
/// of pairs take no more of it.
const PAIRS_AT_ONCE: usize = 1 << 16;

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
            settings: Settings::default(),
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
    /// record says that it may do better then. A source that ends is no error either: the run of the
    /// others goes on. An image that is another than the records are of is an error.
    pub fn execute(
        &self,
        observer: &dyn Observer,
        cancel: &Cancel,
    ) -> Result<RunSummary, RunError> {
        let mut plan = plan(self.datasets, self.contenders, self.settings)?;
        (self.tuned.iter()).try_for_each(|tuned| tuned.check(&plan))?;
        let part;
        let mut datasets = self.datasets;
        if let Some(shard) = self.shard {
            (plan, part) = shard.of(plan, self.datasets)?;
            datasets = &part;
        }
        let folder = RunWriter::start(self.folder, plan)?;
        self.cache.remove_leftovers();
        if !self.tuned.is_empty() {
            folder.note_tuned(self.tuned)?;
        }
        let progresses = self.progresses(datasets, &folder)?;
        let images = images(datasets, &progresses, &folder)?;

        let mut summary: RunSummary = progresses.iter().map(MatcherProgress::summary).sum();
        observer.on_plan(folder.folder().plan(), summary);
        let mut ended = BTreeSet::new();
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
                done => done?,
            }
        }
        Ok(summary)
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
                let progress =
                    MatcherProgress::recover(folder, sequence, contender, self.settings, retry)?;
                progresses.push(progress);
            }
        }
        Ok(progresses)
    }

    /// Does what is left of one matcher on one dataset: first, what failed and may do better now, whose records take the
    /// place of the earlier ones; then what was never done.
    fn finish(
        &self,
        progress: &MatcherProgress<'_>,
        images: &Mutex<ImageNotes>,
        folder: &RunWriter,
        observer: &dyn Observer,
        cancel: &Cancel,
        summary: &mut RunSummary,
    ) -> Result<(), RunError> {
        let matches_of = || {
            (folder.folder()).matches_of(&progress.sequence.name, progress.contender.source.id())
        };
        let mut told = |record: &RunRecord| {
            summary.add(record);
            observer.on_record(record);
        };
        let kept = Kept {
            matches: (self.keep_matches == KeepMatches::All)
                .then(&matches_of)
                .transpose()?,
            inliers: self.inliers_files(progress, folder)?,
            frames: &progress.sequence.frames,
            images,
            synced: Instant::now(),
        };
        let work = Work {
            run: self,
            stages: PairStages {
                progress,
                decode: self.decode,
                root: self.settings.seed,
                time_budget: self.time_budget(),
                images,
                keep: self.keep_matches,
            },
            stored: matches_of()?,
            observer,
            cancel,
        };

        let mut retried = Retried {
            replacements: progress.replacements(),
            kept,
        };
        let done = work.all(progress.failed_pairs(), |done| {
            retried.kept.keep(&done)?;
            for (estimator, record) in done.records {
                told(&record);
                retried.replacements[estimator].put(record);
            }
            if retried.kept.is_time() {
                retried.write()?;
            }
            Ok(())
        });
        retried.write()?;
        done?;

        let (dataset, matcher) = (&progress.sequence.name, progress.contender.source.id());
        let mut kept = retried.kept;
        let mut writers = (progress.contender.estimators.iter())
            .map(|variant| folder.append_to(dataset, matcher, &variant.name))
            .collect::<Result<Vec<_>, _>>()?;
        let done = work.all(progress.pending_pairs(), |done| {
            kept.keep(&done)?;
            for (estimator, record) in done.records {
                writers[estimator].append(&record)?;
                told(&record);
            }
            if kept.is_time() {
                kept.sync()?;
                writers.iter_mut().try_for_each(RecordWriter::sync)?;
            }
            Ok(())
        });
        kept.sync()?;
        writers.iter_mut().try_for_each(RecordWriter::sync)?;
        done
    }

    /// The files of inliers, one for each estimator, if these are kept.
    fn inliers_files(
        &self,
        progress: &MatcherProgress<'_>,
        folder: &RunWriter,
    ) -> Result<Vec<MatchesFile>, RunError> {
        if self.keep_matches != KeepMatches::Inliers {
            return Ok(Vec::new());
        }
        let (dataset, matcher) = (&progress.sequence.name, progress.contender.source.id());
        let estimators = progress.contender.estimators.iter();
        let open =
            |variant: &Variant| (folder.folder()).inliers_of(dataset, matcher, &variant.name);
        Ok(estimators.map(open).collect::<Result<_, _>>()?)
    }

    fn time_budget(&self) -> Option<Duration> {
        let milliseconds = self.settings.time_budget_ms?;
        Some(Duration::from_millis(milliseconds.get().into()))
    }
}

/// What records refer to, which is brought to the disk before them.
struct Kept<'a> {
    /// The selected matches, if they are kept.
    matches: Option<MatchesFile>,
    /// The inliers of each estimator, if these are kept.
    inliers: Vec<MatchesFile>,
    frames: &'a [Frame],
    images: &'a Mutex<ImageNotes>,
    synced: Instant,
}

impl Kept<'_> {
    /// Keeps what records follow from that are written next.
    fn keep(&mut self, done: &PairDone) -> Result<(), RunError> {
        for &(frame, hash) in &done.images {
            lock(self.images).note(frame, &self.frames[frame as usize].image, hash)?;
        }
        // Seldom: once for each image.
        lock(self.images).sync()?;
        for (estimator, key, inliers) in &done.inliers {
            self.inliers[*estimator].append(*key, inliers)?;
        }
        if let Some(file) = &mut self.matches {
            for (key, matches) in &done.matches {
                file.append(*key, matches)?;
            }
        }
        Ok(())
    }

    /// Whether records have been known to the operating system alone for long enough.
    fn is_time(&self) -> bool {
        self.synced.elapsed() >= store::UNSYNCED
    }

    /// To be followed by the records.
    fn sync(&mut self) -> Result<(), StoreError> {
        self.synced = Instant::now();
        (self.matches.iter_mut().chain(&mut self.inliers)).try_for_each(MatchesFile::sync)
    }
}

/// Records that take the place of earlier ones.
struct Retried<'a> {
    replacements: Vec<Replacement>,
    kept: Kept<'a>,
}

impl Retried<'_> {
    fn write(&mut self) -> Result<(), StoreError> {
        self.kept.sync()?;
        (self.replacements.iter_mut()).try_for_each(Replacement::write)
    }
}

/// The images that earlier processes worked with on each dataset of which something is left to be
/// done; they must be the same still.
fn images<'d>(
    datasets: &'d [Dataset],
    progresses: &[MatcherProgress<'_>],
    folder: &RunWriter,
) -> Result<BTreeMap<&'d str, Mutex<ImageNotes>>, RunError> {
    let mut images = BTreeMap::new();
    for dataset in datasets {
        let Sequence { name, frames, .. } = &dataset.sequence;
        let is_left =
            |progress: &MatcherProgress<'_>| progress.sequence.name == *name && !progress.is_done();
        if progresses.iter().any(is_left) {
            let notes = folder.images_of(name)?;
            notes.verify(|frame| Some(&*frames.get(frame as usize)?.image))?;
            images.insert(&**name, Mutex::new(notes));
        }
    }
    Ok(images)
}

/// Work of one matcher on one dataset.
struct Work<'a> {
    run: &'a Run<'a>,
    stages: PairStages<'a>,
    /// Matches that were there before.
    stored: MatchesFile,
    observer: &'a dyn Observer,
    cancel: &'a Cancel,
}

impl Work<'_> {
    /// Does `pairs`, as many at a time as memory should hold, and hands over what came of each in their
    /// order.
    fn all<'u>(
        &self,
        mut pairs: impl Iterator<Item = PairTasks<'u>>,
        mut append: impl FnMut(PairDone) -> Result<(), RunError> + Send,
    ) -> Result<(), RunError> {
        let left = memory::left().map_or(u64::MAX, |left| left.bytes);
        let half = usize::try_from(left / 2).unwrap_or(usize::MAX);
        let mut resident = Resident::new(self.run.feature_memory.min(half));
        loop {
            let some: Vec<PairTasks<'u>> = pairs.by_ref().take(PAIRS_AT_ONCE).collect();
            if some.is_empty() || self.cancel.is_set() {
                return Ok(());
            }
            let (matched, unmatched) = some.split_at(selected_before(&some, &self.stored));
            let estimate = |tasks: &PairTasks<'_>| Ok(self.stages.estimate(tasks, &self.stored)?);
            each_in_order(self.cancel, matched, estimate, &mut append)?;
            match &self.stages.progress.contender.source {
                Source::Matcher(matcher) => {
                    self.extract_and_match(matcher, unmatched, &mut resident, &mut append)?;
                }
                Source::Points(source) => {
                    let matched = |tasks: &PairTasks<'_>| self.stages.source(source, tasks);
                    each_in_order(self.cancel, unmatched, matched, &mut append)?;
                }
            }
        }
    }

    /// Does these `pairs` from their images on, window by window.
    fn extract_and_match(
        &self,
        matcher: &BuiltMatcher,
        mut pairs: &[PairTasks<'_>],
        resident: &mut Resident,
        append: &mut (impl FnMut(PairDone) -> Result<(), RunError> + Send),
    ) -> Result<(), RunError> {
        let frame_stage = FrameStage {
            matcher,
            cache: &self.run.cache,
            decode: self.run.decode,
            images: self.stages.images,
        };
        let frames = &self.stages.progress.sequence.frames;
        while !pairs.is_empty() && !self.cancel.is_set() {
            let (window, later) = pairs.split_at(resident.window(pairs));
            let missing = resident.make_room(window);
            each_in_order(
                self.cancel,
                &missing,
                |&frame| Ok((frame, frame_stage.extract(frame, &frames[frame as usize])?)),
                |(frame, features)| {
                    // In order, so that the notes are the same for any number of threads.
                    if let Some(hash) = features.hash {
                        let image = &frames[frame as usize].image;
                        lock(self.stages.images).note(frame, image, hash)?;
                    }
                    self.observer.on_frame(frame, features.seconds.is_some());
                    resident.insert(frame, features);
                    Ok(())
                },
            )?;
            if self.cancel.is_set() {
                break;
            }
            let jobs = resident.jobs(window);
            each_in_order(
                self.cancel,
                &jobs,
                |job| Ok(self.stages.run(matcher, job)),
                &mut *append,
            )?;
            pairs = later;
        }
        Ok(())
    }
}

/// How many of the first `pairs` need an estimation alone, since their matches are `stored`.
fn selected_before(pairs: &[PairTasks<'_>], stored: &MatchesFile) -> usize {
    let is_stored = |tasks: &&PairTasks<'_>| {
        let mut repetitions = tasks.due.iter().map(|due| due.repetition);
        repetitions.all(|repetition| stored.contains((tasks.pair.a, tasks.pair.b, repetition)))
    };
    pairs.iter().take_while(is_stored).count()
}
