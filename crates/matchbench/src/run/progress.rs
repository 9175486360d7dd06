//! The progress of one matcher with its estimators on one dataset: what is recorded, and what is left to
//! do.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::mem;
use std::path::{Path, PathBuf};

use super::earlier::{Earlier, InOrder, earlier};
use super::{Contender, RunError, RunSummary};
use crate::datasets::{Pair, Sequence};
use crate::records::matches::MatchesKey;
use crate::records::store::RecordLine;
use crate::records::{
    Counts, MatchesFile, Outcome, RunFolder, RunRecord, RunSettings, RunWriter, StoreError, Task,
    store,
};

/// Most repetitions of a pair that are done together, with one search for all of them.
const MAX_REPETITIONS: u32 = 128;

/// One matcher on one dataset, and how far it has come.
pub(super) struct MatcherProgress<'a> {
    pub(super) sequence: &'a Sequence,
    pub(super) contender: &'a Contender,
    pairs: Vec<&'a Pair>,
    repetitions: u32,
    /// One file of records for each estimator.
    estimators: Vec<EstimatorProgress>,
    lost: Lost,
}

/// Matches that should be on disk and are not.
#[derive(Default)]
struct Lost {
    /// The pairs, by their indices, that are recorded and lack them.
    pairs: BTreeSet<usize>,
    /// Matches on disk that are not those that any record of their pair follows from.
    foreign: BTreeMap<MatchesKey, Foreign>,
    /// Of a source that may vary, the numbers of what records follow from that is not on disk. It is not asked for these again,
    /// but may be for other estimators.
    unkept: BTreeMap<MatchesKey, Counts>,
}

impl Lost {
    /// Notes what is missing of the matches that the `record` of a pair follows from.
    fn note(&mut self, record: &RunRecord, pair: usize, stored: Stored<'_>) {
        match stored.of(record) {
            State::There => return,
            State::Absent if stored.are_made_again() => {
                self.pairs.insert(pair);
            }
            State::Absent => {}
            State::Other(counts) => {
                let pair = Some(pair);
                self.foreign.insert(key(record), Foreign { counts, pair });
            }
        }
        if stored.may_vary {
            self.unkept.insert(key(record), record.counts);
        }
    }

    /// The same of a record of before the run grew; whether it is taken over.
    fn note_earlier(&mut self, record: &RunRecord, stored: Stored<'_>) -> bool {
        let state = stored.of(record);
        if let State::Other(counts) = state {
            let foreign = Foreign { counts, pair: None };
            self.foreign.entry(key(record)).or_insert(foreign);
        }
        if state != State::There && stored.may_vary {
            self.unkept.insert(key(record), record.counts);
        }
        state == State::There || !stored.are_made_again()
    }
}

/// Matches of another matcher, or of another time.
#[derive(Clone, Copy)]
struct Foreign {
    counts: Counts,
    /// Its pair, by its index, if that is recorded.
    pair: Option<usize>,
}

/// The records of one estimator, and how many there are. They stand in the order of the tasks (pair by pair, repetition by
/// repetition), so their number says which are done.
struct EstimatorProgress {
    file: PathBuf,
    done: usize,
    failed: usize,
    /// Tasks that failed and are tried again, by their indices among the records.
    retried: BTreeSet<usize>,
    /// What was recorded before the run grew, of tasks that are not recorded since.
    earlier: Earlier,
}

/// A pair with what is left to be done of it.
#[derive(Debug)]
pub(super) struct PairTasks<'a> {
    pub(super) pair: &'a Pair,
    pub(super) due: Vec<PendingTask>,
}

/// A task of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PendingTask {
    pub(super) repetition: u32,
    /// Index among the contender's estimators.
    pub(super) estimator: usize,
}

impl<'a> MatcherProgress<'a> {
    /// What earlier processes left; a torn last line is cut off. Tasks that failed are due
    /// again if their records say that another try may do better, or all of them with `retry_failed`. Matches that
    /// records follow from are in `stored`, if they are kept; those that are not are made again, unless they are of a
    /// source that need not find the same twice.
    ///
    /// # Errors
    /// If records cannot be read or are not those of this matcher and dataset.
    pub(super) fn recover(
        folder: &RunWriter,
        sequence: &'a Sequence,
        contender: &'a Contender,
        settings: RunSettings,
        retry_failed: bool,
        stored: Stored<'_>,
    ) -> Result<Self, RunError> {
        let chosen = settings.chosen(sequence.pairs.len());
        let mut progress = Self {
            sequence,
            contender,
            pairs: chosen.map(|index| &sequence.pairs[index]).collect(),
            repetitions: settings.repetitions.get(),
            estimators: Vec::new(),
            lost: Lost::default(),
        };
        for variant in &contender.estimators {
            let names = [&*sequence.name, contender.source.id(), &*variant.name];
            let (estimator, mut lost) = progress.recorded(folder, names, retry_failed, stored)?;
            progress.lost.pairs.append(&mut lost.pairs);
            progress.lost.foreign.append(&mut lost.foreign);
            progress.lost.unkept.append(&mut lost.unkept);
            progress.estimators.push(estimator);
        }
        progress.claim_foreign(folder, stored)?;
        if contender.estimators.len() == 1 || progress.summary().is_complete() {
            // Nobody asks.
            progress.lost.unkept.clear();
        }
        Ok(progress)
    }

    /// Takes what a record of another estimator follows from as the matches of its pair, and all else for lost.
    fn claim_foreign(&mut self, folder: &RunWriter, stored: Stored<'_>) -> Result<(), StoreError> {
        if self.lost.foreign.is_empty() {
            return Ok(());
        }
        let foreign = &mut self.lost.foreign;
        for variant in &self.contender.estimators {
            let names = [
                &*self.sequence.name,
                self.contender.source.id(),
                &*variant.name,
            ];
            (folder.folder()).for_each_of(names, |record| {
                if stored.of(&record) == State::There && !record.outcome.has_failed() {
                    foreign.remove(&key(&record));
                }
            })?;
        }
        if stored.are_made_again() {
            let pairs = foreign.values().filter_map(|foreign| foreign.pair);
            self.lost.pairs.extend(pairs);
        }
        Ok(())
    }

    /// What is recorded of the estimator of these `names`; each record must be that of the task whose turn
    /// it was.
    fn recorded(
        &self,
        folder: &RunWriter,
        names: [&str; 3],
        retry_failed: bool,
        stored: Stored<'_>,
    ) -> Result<(EstimatorProgress, Lost), StoreError> {
        let (mut done, mut failed, mut retried) = (0, 0, BTreeSet::new());
        let mut lost = Lost::default();
        let mut other_task = None;
        let mut tasks = (self.pairs.iter())
            .flat_map(|pair| (0..self.repetitions).map(move |repetition| (pair, repetition)));
        let file = folder.recover(names, |line, record| {
            let is_next = tasks.next().is_some_and(|(pair, repetition)| {
                let RunRecord { task, .. } = &record;
                (task.a, task.b, task.repetition) == (pair.a, pair.b, repetition)
                    && [&*task.dataset, &*task.matcher, &*task.estimator] == names
            });
            if !is_next {
                other_task.get_or_insert(line);
            }
            match record.outcome {
                Outcome::Failed { may_pass, .. } if may_pass || retry_failed => {
                    retried.insert(done);
                }
                Outcome::Failed { .. } => failed += 1,
                _ => lost.note(&record, done / self.repetitions as usize, stored),
            }
            done += 1;
            Ok::<_, StoreError>(())
        })?;
        if let Some(line) = other_task {
            return Err(StoreError::Corrupt {
                path: file,
                line,
                reason: "the plan has another task here".into(),
            });
        }
        let wanted = |record: &RunRecord| match record.outcome {
            Outcome::Failed { may_pass, .. } => {
                let stays = !may_pass && !retry_failed;
                failed += usize::from(stays);
                stays
            }
            _ => lost.note_earlier(record, stored),
        };
        let earlier = earlier(folder, names, &self.pairs, self.repetitions, done, wanted)?;
        let progress = EstimatorProgress {
            file,
            done,
            failed,
            retried,
            earlier,
        };
        Ok((progress, lost))
    }

    /// The names of its dataset and its matcher, by which a run knows it from all others.
    pub(super) fn names(&self) -> [&str; 2] {
        [&self.sequence.name, self.contender.source.id()]
    }

    /// A file of records that there were at first, and that there must be if the run has gone `on` with this matcher, but
    /// is not any more.
    pub(super) fn removed(&self, on: bool) -> Option<PathBuf> {
        let mut files = (self.estimators.iter())
            .filter(|estimator| on || estimator.done > 0)
            .map(|estimator| &estimator.file);
        files.find(|file| !file.exists()).cloned()
    }

    /// The matches of this matcher that are on disk, but for those that are not of its records.
    pub(super) fn own_matches(&self, folder: &RunFolder) -> Result<MatchesFile, StoreError> {
        let mut file = folder.matches_of(&self.sequence.name, self.contender.source.id())?;
        for (&key, foreign) in &self.lost.foreign {
            file.forget(key, foreign.counts);
        }
        Ok(file)
    }

    /// Whether records of a repetition of a pair follow from other matches of a source that may vary than those with these `counts`.
    pub(super) fn is_other(&self, key: MatchesKey, counts: Counts) -> bool {
        (self.lost.unkept.get(&key)).is_some_and(|&unkept| unkept != counts)
    }

    pub(super) fn task(&self, pair: &Pair, estimator: &str, repetition: u32) -> Task {
        Task {
            dataset: self.sequence.name.clone(),
            matcher: self.contender.source.id().into(),
            estimator: estimator.into(),
            a: pair.a,
            b: pair.b,
            repetition,
        }
    }

    pub(super) fn is_done(&self) -> bool {
        self.summary().is_complete()
            && (self.estimators.iter()).all(|estimator| estimator.earlier.len() == 0)
    }

    /// What appends the records of each estimator.
    ///
    /// # Errors
    /// If a file cannot be opened or written to.
    pub(super) fn writers(&self, folder: &RunWriter) -> Result<Vec<InOrder<'_>>, StoreError> {
        let variants = self.contender.estimators.iter().zip(&self.estimators);
        let (dataset, matcher) = (&self.sequence.name, self.contender.source.id());
        let writers = variants.map(|(variant, estimator)| {
            let writer = folder.append_to(dataset, matcher, &variant.name)?;
            InOrder::new(writer, &estimator.earlier, estimator.done)
        });
        writers.collect()
    }

    /// Forgets what was recorded before the run grew, where the `writers` have all records.
    ///
    /// # Errors
    /// If a file cannot be deleted.
    pub(super) fn forget_earlier(
        &self,
        folder: &RunWriter,
        writers: &[InOrder<'_>],
    ) -> Result<(), StoreError> {
        let tasks = self.pairs.len().saturating_mul(self.repetitions as usize);
        let (dataset, matcher) = (&self.sequence.name, self.contender.source.id());
        for (variant, writer) in self.contender.estimators.iter().zip(writers) {
            // A process that was killed may have taken over all that is there.
            if writer.recorded() == tasks {
                folder.remove_earlier([dataset, matcher, &variant.name])?;
            }
        }
        Ok(())
    }

    pub(super) fn summary(&self) -> RunSummary {
        RunSummary {
            total: (self.pairs.len().saturating_mul(self.repetitions as usize))
                .saturating_mul(self.estimators.len()),
            before: (self.estimators.iter())
                .map(|estimator| estimator.done - estimator.retried.len() + estimator.earlier.len())
                .sum(),
            now: 0,
            failed: self
                .estimators
                .iter()
                .map(|estimator| estimator.failed)
                .sum(),
            ended: 0,
            unkept: 0,
            lost: self.lost(),
        }
    }

    /// What failed and is tried again, in the same order.
    pub(super) fn failed_pairs(&self) -> impl Iterator<Item = PairTasks<'a>> {
        let any = self
            .estimators
            .iter()
            .any(|estimator| !estimator.retried.is_empty());
        let pairs = if any { &*self.pairs } else { &[] };
        self.pairs_where(pairs, 0, |estimator, task| {
            estimator.retried.contains(&task)
        })
    }

    /// Pairs of which all is recorded, and whose matches are made again for that: for one of the estimators, whose
    /// records are there.
    pub(super) fn lost_pairs(&self) -> impl Iterator<Item = PairTasks<'a>> {
        let first_pending = self.first_pending();
        let pairs = match self.lost.pairs.first() {
            Some(&first) if first < first_pending => &self.pairs[..first_pending],
            _ => &[],
        };
        self.pairs_where(pairs, 0, |estimator, task| {
            std::ptr::eq(estimator, &raw const self.estimators[0])
                && self
                    .lost
                    .pairs
                    .contains(&(task / self.repetitions as usize))
        })
    }

    /// How many pairs that is.
    pub(super) fn lost(&self) -> usize {
        self.lost.pairs.range(..self.first_pending()).count()
    }

    /// The index of the first pair of which something is left.
    fn first_pending(&self) -> usize {
        let done = self.estimators.iter().map(|estimator| estimator.done).min();
        done.unwrap_or(0) / self.repetitions as usize
    }

    /// What is left, pair by pair; within a pair repetition by repetition.
    pub(super) fn pending_pairs(&self) -> impl Iterator<Item = PairTasks<'a>> {
        let first = self.first_pending();
        let pairs = self.pairs.get(first..).unwrap_or_default();
        self.pairs_where(pairs, first, |estimator, task| {
            task >= estimator.done && !estimator.earlier.contains(task)
        })
    }

    /// The tasks of `pairs` that are due, as `is_due` says of an estimator and the index of a task among its
    /// records; `first` is the index of the first of these pairs. Nothing is listed before it is asked for,
    /// and at most [`MAX_REPETITIONS`] of a pair come at once: their number may be anything.
    fn pairs_where(
        &self,
        pairs: &[&'a Pair],
        first: usize,
        is_due: impl Fn(&EstimatorProgress, usize) -> bool,
    ) -> impl Iterator<Item = PairTasks<'a>> {
        let tasks = (pairs.iter().copied().zip(first..)).flat_map(move |(pair, index)| {
            (0..self.repetitions)
                .step_by(MAX_REPETITIONS as usize)
                .map(move |repetition| (pair, index, repetition))
        });
        tasks.filter_map(move |(pair, index, from)| {
            let first_task = index * self.repetitions as usize;
            let to = self.repetitions.min(from.saturating_add(MAX_REPETITIONS));
            let mut due = Vec::new();
            for repetition in from..to {
                let task = first_task + repetition as usize;
                for (estimator, progress) in self.estimators.iter().enumerate() {
                    if is_due(progress, task) {
                        due.push(PendingTask {
                            repetition,
                            estimator,
                        });
                    }
                }
            }
            (!due.is_empty()).then_some(PairTasks { pair, due })
        })
    }

    /// The records that are to be replaced, of each estimator; nothing may be appended to their files from here on.
    pub(super) fn replacements(&self) -> Vec<Replacement<'_>> {
        let replacement = |estimator| Replacement::of(self, estimator);
        self.estimators.iter().map(replacement).collect()
    }
}

/// The matches of a matcher on a dataset that are on disk.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stored<'m> {
    pub(super) file: &'m MatchesFile,
    /// Whether the run keeps all of them.
    pub(super) are_kept: bool,
    /// Whether they are of a source that need not find the same twice.
    pub(super) may_vary: bool,
}

/// What there is of the matches that a record follows from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    There,
    Absent,
    /// There are others in their place, of these numbers of features and matches.
    Other(Counts),
}

impl Stored<'_> {
    /// Whether those that records follow from, and that are not there, are made again.
    fn are_made_again(self) -> bool {
        self.are_kept && !self.may_vary
    }

    fn of(self, record: &RunRecord) -> State {
        match self.file.counts(key(record)) {
            None => State::Absent,
            Some(counts) if counts == record.counts => State::There,
            Some(counts) => State::Other(counts),
        }
    }
}

/// Whose matches a record follows from.
fn key(record: &RunRecord) -> MatchesKey {
    (record.task.a, record.task.b, record.task.repetition)
}

/// The records of one estimator, some of which are done again. Those that stay are not in memory.
pub(super) struct Replacement<'a> {
    progress: &'a MatcherProgress<'a>,
    file: &'a Path,
    /// The places of those that are still to come.
    due: VecDeque<usize>,
    /// The lines that are not yet written, by their places.
    new: BTreeMap<usize, RecordLine>,
}

impl<'a> Replacement<'a> {
    fn of(progress: &'a MatcherProgress<'a>, estimator: &'a EstimatorProgress) -> Self {
        Self {
            progress,
            file: &estimator.file,
            due: estimator.retried.iter().copied().collect(),
            new: BTreeMap::new(),
        }
    }

    /// Puts the line of a task in the place of that of one that failed; they come in the order of the tasks.
    pub(super) fn put(&mut self, task: &Task, line: RecordLine) {
        let MatcherProgress {
            pairs, repetitions, ..
        } = self.progress;
        let is_of = |place: &usize| {
            let repetitions = *repetitions as usize;
            let (pair, repetition) = (pairs[place / repetitions], place % repetitions);
            (task.a, task.b, task.repetition as usize) == (pair.a, pair.b, repetition)
        };
        let place = self.due.pop_front().filter(is_of);
        (self.new).insert(place.expect("tasks are done in their order"), line);
    }

    /// Writes the file anew, if something was replaced.
    ///
    /// # Errors
    /// If it cannot be read or written; the earlier records are then still there.
    pub(super) fn write(&mut self) -> Result<(), StoreError> {
        let new = mem::take(&mut self.new);
        if new.is_empty() {
            return Ok(());
        }
        store::replace(self.file, &new)
    }
}
