//! A run: every matcher and estimator on every pair of every dataset, recorded as it goes.
//!
//! [`Run::execute`] and `Run::go_on` follow the way of the data: frames are decoded and extracted
//! (`frame`); pairs are searched and selected (`matching`), or matched by a source outside
//! (`sourcing`); matched points are estimated and compared with the truth (`judging`); all tasks of a
//! pair together (`pair`) are appended to the [folder of the run](crate::records::RunFolder). Around
//! them: what is run ([`plan`]), what is left to do (`part`), which features are in memory
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
mod judging;
mod matching;
mod observer;
mod ordered;
mod pair;
mod part;
mod plan;
mod resident;
mod seeds;
mod sourcing;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

pub use contender::{Contender, ContenderError, Outside, Variant, manifest};
pub use error::RunError;
pub use evaluate::{Evaluation, EvaluationError, ImagePair, evaluate};
pub use frame::Decode;
pub use observer::{Cancel, Observer, RunSummary, Silent};
pub use plan::plan;
pub use seeds::{estimation_seed, pair_seed, selection_seed};

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Duration;

use crate::cache::FeatureCache;
use crate::datasets::{DatasetError, Sequence, decode_gray};
use crate::matchers::{BuiltMatcher, Source};
use crate::records::images::ImageNotes;
use crate::records::{MatchesFile, RunRecord, RunWriter, Settings, Tuned};
use frame::FrameStage;
use ordered::in_order;
use pair::{PairDone, PairStages};
use part::{Part, Unit};
use resident::Resident;

/// A dataset and where it came from.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// Its folder, for the reader of `plan.json`.
    pub path: PathBuf,
    /// Its frames and pairs.
    pub sequence: Sequence,
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
        })
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
    /// Whether the selected matches are written into the folder, so that other estimators can
    /// start from them and reports can draw them.
    pub keep_matches: bool,
    /// How many bytes of features are kept in memory; [`Run::FEATURE_MEMORY`] serves well.
    pub feature_memory: usize,
    /// Whether all that failed is done again, and not only what another try may do better.
    pub retry_failed: bool,
}

/// Pairs that are listed at a time: enough to keep what is in memory in use, few enough that millions
/// of pairs take no more of it.
const UNITS_AT_ONCE: usize = 1 << 16;

impl Run<'_> {
    /// 512 MiB. The 30 images of castle at full resolution take 160 MB with SIFT; what does not
    /// fit comes from the cache again when it is needed.
    pub const FEATURE_MEMORY: usize = 512 << 20;

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
        let plan = plan(self.datasets, self.contenders, self.settings)?;
        (self.tuned.iter()).try_for_each(|tuned| tuned.check(&plan))?;
        let folder = RunWriter::start(self.folder, plan)?;
        if !self.tuned.is_empty() {
            folder.note_tuned(self.tuned)?;
        }
        let parts = self.parts(&folder)?;
        let images = self.images(&parts, &folder)?;

        let mut summary: RunSummary = parts.iter().map(Part::summary).sum();
        observer.on_plan(folder.folder().plan(), summary);
        let mut ended = BTreeSet::new();
        for part in parts.iter().filter(|part| !part.is_done()) {
            let id = part.contender.source.id();
            if cancel.is_set() {
                break;
            }
            if ended.contains(id) {
                continue;
            }
            observer.on_part(&part.sequence.name, id);
            let images = &images[&*part.sequence.name];
            match self.go_on(part, images, &folder, observer, cancel, &mut summary) {
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
    fn parts(&self, folder: &RunWriter) -> Result<Vec<Part<'_>>, RunError> {
        let mut parts = Vec::new();
        for dataset in self.datasets {
            let sequence = &dataset.sequence;
            for contender in self.contenders {
                let retry = self.retry_failed;
                let part = Part::recover(folder, sequence, contender, self.settings, retry)?;
                parts.push(part);
            }
        }
        Ok(parts)
    }

    /// The images that earlier processes worked with on each dataset of which something is left to be
    /// done; they must be the same still.
    fn images(
        &self,
        parts: &[Part<'_>],
        folder: &RunWriter,
    ) -> Result<BTreeMap<&str, Mutex<ImageNotes>>, RunError> {
        let mut images = BTreeMap::new();
        for dataset in self.datasets {
            let Sequence { name, frames, .. } = &dataset.sequence;
            let is_left = |part: &Part<'_>| part.sequence.name == *name && !part.is_done();
            if parts.iter().any(is_left) {
                let notes = folder.images_of(name)?;
                notes.verify(|frame| Some(&*frames.get(frame as usize)?.image))?;
                images.insert(&**name, Mutex::new(notes));
            }
        }
        Ok(images)
    }

    /// Does what is left of one part: first, what failed and may do better now, whose records take the
    /// place of the earlier ones; then what was never done.
    fn go_on(
        &self,
        part: &Part<'_>,
        images: &Mutex<ImageNotes>,
        folder: &RunWriter,
        observer: &dyn Observer,
        cancel: &Cancel,
        summary: &mut RunSummary,
    ) -> Result<(), RunError> {
        let matches_of =
            || (folder.folder()).matches_of(&part.sequence.name, part.contender.source.id());
        let mut matches_file = matches_of()?;
        let mut told = |record: &RunRecord| {
            summary.add(record);
            observer.on_record(record);
        };
        let mut keep = |done: &PairDone| -> Result<(), RunError> {
            if self.keep_matches {
                for (key, matches) in &done.matches {
                    matches_file.append(*key, matches)?;
                }
            }
            Ok(())
        };
        let work = Work {
            run: self,
            stages: PairStages {
                part,
                decode: self.decode,
                root: self.settings.seed,
                time_budget: self.time_budget(),
                images,
            },
            stored: matches_of()?,
            observer,
            cancel,
        };

        let mut replacements = part.replacements();
        let again = work.all(part.units_again(), |done| {
            keep(&done)?;
            for (estimator, record) in done.records {
                told(&record);
                replacements[estimator].put(record)?;
            }
            Ok(())
        });
        for replacement in &mut replacements {
            replacement.write()?;
        }
        again?;
        drop(replacements);

        let (dataset, matcher) = (&part.sequence.name, part.contender.source.id());
        let mut writers = (part.contender.estimators.iter())
            .map(|variant| folder.append_to(dataset, matcher, &variant.name))
            .collect::<Result<Vec<_>, _>>()?;
        work.all(part.units(), |done| {
            keep(&done)?;
            for (estimator, record) in done.records {
                writers[estimator].append(&record)?;
                told(&record);
            }
            Ok(())
        })
    }

    fn time_budget(&self) -> Option<Duration> {
        let milliseconds = self.settings.time_budget_ms?;
        Some(Duration::from_millis(milliseconds.get().into()))
    }
}

/// Work on one part.
struct Work<'a> {
    run: &'a Run<'a>,
    stages: PairStages<'a>,
    /// Matches that were there before.
    stored: MatchesFile,
    observer: &'a dyn Observer,
    cancel: &'a Cancel,
}

impl Work<'_> {
    /// Does `units`, as many at a time as memory should hold, and hands over what came of each in their
    /// order.
    fn all<'u>(
        &self,
        mut units: impl Iterator<Item = Unit<'u>>,
        mut append: impl FnMut(PairDone) -> Result<(), RunError> + Send,
    ) -> Result<(), RunError> {
        let mut resident = Resident::new(self.run.feature_memory);
        loop {
            let some: Vec<Unit<'u>> = units.by_ref().take(UNITS_AT_ONCE).collect();
            if some.is_empty() || self.cancel.is_set() {
                return Ok(());
            }
            let (again, rest) = some.split_at(selected_before(&some, &self.stored));
            let estimate = |unit: &Unit<'_>| Ok(self.stages.estimate(unit, &self.stored)?);
            in_order(self.cancel, again, estimate, &mut append)?;
            match &self.stages.part.contender.source {
                Source::Matcher(matcher) => {
                    self.extract_and_match(matcher, rest, &mut resident, &mut append)?;
                }
                Source::Points(source) => {
                    let matched = |unit: &Unit<'_>| self.stages.source(source, unit);
                    in_order(self.cancel, rest, matched, &mut append)?;
                }
            }
        }
    }

    /// Does these `units` from their images on, window by window.
    fn extract_and_match(
        &self,
        matcher: &BuiltMatcher,
        mut units: &[Unit<'_>],
        resident: &mut Resident,
        append: &mut (impl FnMut(PairDone) -> Result<(), RunError> + Send),
    ) -> Result<(), RunError> {
        let frame_stage = FrameStage {
            matcher,
            cache: &self.run.cache,
            decode: self.run.decode,
            images: self.stages.images,
        };
        let frames = &self.stages.part.sequence.frames;
        while !units.is_empty() && !self.cancel.is_set() {
            let (window, later) = units.split_at(resident.window(units));
            let missing = resident.make_room(window);
            in_order(
                self.cancel,
                &missing,
                |&frame| Ok((frame, frame_stage.extract(frame, &frames[frame as usize])?)),
                |(frame, features)| {
                    self.observer.on_frame(frame, features.seconds.is_some());
                    resident.insert(frame, features);
                    Ok(())
                },
            )?;
            if self.cancel.is_set() {
                break;
            }
            let jobs = resident.jobs(window);
            in_order(
                self.cancel,
                &jobs,
                |job| Ok(self.stages.run(matcher, job)),
                &mut *append,
            )?;
            units = later;
        }
        Ok(())
    }
}

/// How many of the first `units` need an estimation alone, since their matches are `stored`.
fn selected_before(units: &[Unit<'_>], stored: &MatchesFile) -> usize {
    let is_stored = |unit: &&Unit<'_>| {
        let mut repetitions = unit.due.iter().map(|due| due.repetition);
        repetitions.all(|repetition| stored.contains((unit.pair.a, unit.pair.b, repetition)))
    };
    units.iter().take_while(is_stored).count()
}
