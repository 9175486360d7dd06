//! A run: every matcher and estimator on every pair of every dataset, recorded as it goes.
//!
//! [`Run::execute`] and `Run::go_on` follow the way of the data: frames are decoded and extracted
//! (`frame`), pairs are searched, selected, estimated and judged (`pair`), records are appended
//! ([`crate::records`]). Around them: what is run ([`Plan`]), into which folder (`folder`), what is
//! left to do (`part`), which matches are there already ([`crate::records::matches`]), which features are kept in memory (`resident`) and on disk (`cache`), which
//! keypoints are shared by matchers (`detections`), who
//! is told ([`Observer`]) and who may stop it ([`Cancel`]).
//!
//! Threads are used in one place of a run (`ordered`): over the frames, then over the pairs of a
//! window. Whatever their number, records are the same and stand in the same order.

mod cache;
mod contender;
mod detections;
mod earlier_plans;
mod error;
mod feature_file;
mod folder;
mod frame;
mod guard;
mod keypoint_file;
mod observer;
mod ordered;
mod pair;
mod part;
mod plan;
mod resident;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

pub use cache::FeatureCache;
pub use contender::Contender;
pub use error::RunError;
pub use frame::Decode;
pub use observer::{Cancel, Observer, RunSummary, Silent};
pub use plan::{DatasetPlan, EstimatorPlan, MatcherPlan, Plan, Settings};

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::Duration;

use matchbench_vision::seed::Seed;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::datasets::Sequence;
use crate::records::store::RecordWriter;
use crate::records::{MatchesFile, matches};
use folder::RunFolder;
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

/// Everything that a run needs.
pub struct Run<'a> {
    /// The datasets.
    pub datasets: &'a [Dataset],
    /// The matchers, each with its estimators.
    pub contenders: &'a [Contender],
    /// What else decides about the records.
    pub settings: Settings,
    /// The folder that the run is written into.
    pub folder: &'a Path,
    /// Features that were extracted before; may be shared by runs.
    pub cache: FeatureCache,
    /// How an image file becomes pixels.
    pub decode: Decode,
    /// Number of threads; the records do not depend on it.
    pub threads: NonZeroUsize,
    /// Whether the selected matches are written into the folder, so that other estimators can
    /// start from them and reports can draw them.
    pub keep_matches: bool,
    /// How many bytes of features are kept in memory; [`Run::FEATURE_MEMORY`] serves well.
    pub feature_memory: usize,
}

impl Run<'_> {
    /// 512 MiB. The 30 images of castle at full resolution take 160 MB with SIFT; what does not
    /// fit comes from the cache again when it is needed.
    pub const FEATURE_MEMORY: usize = 512 << 20;

    /// Does what is not yet recorded in the folder, until all is done or `cancel` is set.
    ///
    /// # Errors
    /// If the run contradicts itself (see [`Plan::new`]), or its folder holds another plan, is
    /// damaged, in use or cannot be written to. What was recorded stays recorded. A task that
    /// fails is not an error: it is recorded and counted, and not tried again.
    pub fn execute(
        &self,
        observer: &dyn Observer,
        cancel: &Cancel,
    ) -> Result<RunSummary, RunError> {
        let plan = Plan::new(self.datasets, self.contenders, self.settings)?;
        let folder = RunFolder::open(self.folder, &plan)?;
        let parts = self.parts(&folder)?;
        let pool = (ThreadPoolBuilder::new().num_threads(self.threads.get()))
            .build()
            .map_err(|error| RunError::Threads(error.to_string()))?;

        let mut summary: RunSummary = parts.iter().map(Part::summary).sum();
        observer.on_plan(&plan, summary);
        for part in parts.iter().filter(|part| !part.is_done()) {
            if cancel.is_set() {
                break;
            }
            observer.on_part(&part.sequence.name, &part.contender.matcher.id);
            self.go_on(part, &pool, observer, cancel, &mut summary)?;
        }
        Ok(summary)
    }

    /// Each matcher on each dataset, and how far it has come.
    fn parts(&self, folder: &RunFolder) -> Result<Vec<Part<'_>>, RunError> {
        let mut parts = Vec::new();
        for dataset in self.datasets {
            for contender in self.contenders {
                let part = Part::recover(folder, &dataset.sequence, contender, self.settings)?;
                parts.push(part);
            }
        }
        Ok(parts)
    }

    /// Does what is left of one part.
    fn go_on(
        &self,
        part: &Part<'_>,
        pool: &ThreadPool,
        observer: &dyn Observer,
        cancel: &Cancel,
        summary: &mut RunSummary,
    ) -> Result<(), RunError> {
        let frame_stage = FrameStage {
            matcher: &part.contender.matcher,
            cache: &self.cache,
            decode: self.decode,
        };
        let pair_stages = PairStages {
            part,
            decode: self.decode,
            root: Seed(self.settings.seed),
            time_budget: (self.settings.time_budget_ms)
                .map(|milliseconds| Duration::from_millis(milliseconds.get().into())),
        };
        let mut writers = (part.files())
            .map(RecordWriter::open)
            .collect::<Result<Vec<_>, _>>()?;
        let path = matches::path(self.folder, &part.sequence.name, &part.contender.matcher.id);
        let stored = MatchesFile::open(&path)?;
        let mut matches_file = MatchesFile::open(&path)?;
        let mut append = |done: PairDone| {
            if self.keep_matches {
                for (key, matches) in &done.matches {
                    matches_file.append(*key, matches)?;
                }
            }
            for (estimator, record) in done.records {
                writers[estimator].append(&record)?;
                summary.add(&record);
                observer.on_record(&record);
            }
            Ok(())
        };

        let units = part.units();
        let (again, mut rest) = units.split_at(selected_before(&units, &stored));
        in_order(
            pool,
            cancel,
            again,
            |unit| Ok(pair_stages.estimate(unit, &stored)?),
            &mut append,
        )?;
        let mut resident = Resident::new(self.feature_memory);
        while !rest.is_empty() && !cancel.is_set() {
            let (window, later) = rest.split_at(resident.window(rest));
            let missing = resident.make_room(window);
            in_order(
                pool,
                cancel,
                &missing,
                |&frame| {
                    let features = frame_stage.extract(&part.sequence.frames[frame as usize])?;
                    Ok((frame, features))
                },
                |(frame, features)| {
                    observer.on_frame(frame, features.seconds.is_some());
                    resident.insert(frame, features);
                    Ok(())
                },
            )?;
            if cancel.is_set() {
                break;
            }
            let jobs = resident.jobs(window);
            in_order(
                pool,
                cancel,
                &jobs,
                |job| Ok(pair_stages.run(job)),
                &mut append,
            )?;
            rest = later;
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
