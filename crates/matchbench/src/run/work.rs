//! The work of one matcher on one dataset: how many pairs are listed at a time, which features are in
//! memory, and how threads share the pairs.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use super::frame::{FrameStage, lock};
use super::ordered::each_in_order;
use super::pair::{PairDone, PairStages, is_stored};
use super::progress::PairTasks;
use super::resident::Resident;
use super::{Cancel, Observer, Run, RunError};
use crate::matchers::{BuiltMatcher, Source};
use crate::memory;
use crate::records::MatchesFile;

/// Pairs that are listed at a time: enough to keep what is in memory in use, few enough that millions
/// of pairs take no more of it.
const PAIRS_AT_ONCE: usize = 1 << 16;

/// Tasks of these pairs: with many repetitions and estimators, fewer pairs are listed.
const TASKS_AT_ONCE: usize = 1 << 20;

/// Work of one matcher on one dataset.
pub(super) struct Work<'a> {
    pub(super) run: &'a Run<'a>,
    pub(super) stages: PairStages<'a>,
    /// Matches that were there before; what is appended later is in it when it is opened again.
    pub(super) stored: MatchesFile,
    pub(super) observer: &'a dyn Observer,
    pub(super) cancel: &'a Cancel,
    /// How many files the cache could not keep in this run so far.
    pub(super) unkept: AtomicUsize,
    /// Whether it was told that a source finds other matches than before.
    pub(super) has_told_other: AtomicBool,
}

/// The next of these `pairs`, as many as are listed at a time.
fn listed<'u>(pairs: &mut impl Iterator<Item = PairTasks<'u>>) -> Vec<PairTasks<'u>> {
    let (mut some, mut tasks) = (Vec::new(), 0);
    while some.len() < PAIRS_AT_ONCE
        && tasks < TASKS_AT_ONCE
        && let Some(next) = pairs.next()
    {
        tasks += next.due.len();
        some.push(next);
    }
    some
}

impl Work<'_> {
    /// Does `pairs`, as many at a time as memory should hold, and hands over what came of each in their
    /// order.
    pub(super) fn all<'u>(
        &self,
        mut pairs: impl Iterator<Item = PairTasks<'u>>,
        mut append: impl FnMut(PairDone) -> Result<(), RunError> + Send,
    ) -> Result<(), RunError> {
        let left = memory::left().map_or(u64::MAX, |left| left.bytes);
        let half = usize::try_from(left / 2).unwrap_or(usize::MAX);
        let budget = self.run.feature_memory.min(half);
        let mut resident = Resident::new(budget, rayon::current_num_threads());
        loop {
            let some = listed(&mut pairs);
            if some.is_empty() || self.cancel.is_set() {
                return Ok(());
            }
            match &self.stages.progress.contender.source {
                Source::Matcher(matcher) => {
                    let (matched, unmatched) = some.split_at(self.selected_before(&some));
                    let estimate = |tasks: &PairTasks<'_>| {
                        Ok(self.stages.estimate(tasks, &self.stored)?.with_lines())
                    };
                    each_in_order(self.cancel, matched, estimate, &mut append)?;
                    self.extract_and_match(matcher, unmatched, &mut resident, &mut append)?;
                }
                Source::Points(source) => {
                    let matched = |tasks: &PairTasks<'_>| {
                        let done = self.stages.source(source, tasks, &self.stored)?;
                        Ok(done.with_lines())
                    };
                    each_in_order(self.cancel, &some, matched, |done| {
                        self.tell_unkept(&source.source.take_unkept());
                        if done.is_other && !self.has_told_other.swap(true, Ordering::Relaxed) {
                            let [dataset, matcher] = self.stages.progress.names();
                            self.observer.on_other_matches(dataset, matcher);
                        }
                        append(done)
                    })?;
                }
            }
        }
    }

    /// Counts the files that the cache could not keep, for these reasons, and tells the first one of the run.
    fn tell_unkept(&self, reasons: &[String]) {
        for reason in reasons {
            if self.unkept.fetch_add(1, Ordering::Relaxed) == 0 {
                self.observer.on_unkept(reason);
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
        let first = resident.first_frames(pairs);
        self.extract(&frame_stage, &first, resident)?;
        while !pairs.is_empty() && !self.cancel.is_set() {
            let (window, later) = pairs.split_at(resident.window(pairs));
            let missing = resident.make_room(window);
            self.extract(&frame_stage, &missing, resident)?;
            if self.cancel.is_set() {
                break;
            }
            let jobs = resident.jobs(window);
            each_in_order(
                self.cancel,
                &jobs,
                |job| Ok(self.stages.run(matcher, job, &self.stored)?.with_lines()),
                &mut *append,
            )?;
            pairs = later;
        }
        Ok(())
    }

    /// Extracts the features of some frames.
    fn extract(
        &self,
        stage: &FrameStage<'_>,
        frames: &[u32],
        resident: &mut Resident,
    ) -> Result<(), RunError> {
        let all = &self.stages.progress.sequence.frames;
        each_in_order(
            self.cancel,
            frames,
            |&frame| Ok((frame, stage.extract(frame, &all[frame as usize])?)),
            |(frame, features)| {
                // In order, so that the notes are the same for any number of threads.
                if let Some(hash) = features.hash {
                    let image = &all[frame as usize].image;
                    lock(self.stages.images).note(frame, image, hash)?;
                }
                self.tell_unkept(&features.unkept);
                self.observer.on_frame(frame, features.seconds.is_some());
                resident.insert(frame, features);
                Ok(())
            },
        )
    }

    /// How many of the first `pairs` need an estimation alone: their matches are stored, and nothing is to be said of
    /// their keypoints.
    fn selected_before(&self, pairs: &[PairTasks<'_>]) -> usize {
        let is_enough = |tasks: &&PairTasks<'_>| {
            is_stored(&self.stored, tasks.pair, &tasks.due)
                && !self.stages.judges_keypoints(tasks.pair)
        };
        pairs.iter().take_while(is_enough).count()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::super::progress::PendingTask;
    use super::*;
    use crate::datasets::Pair;

    #[test]
    fn the_list_of_work_grows_with_neither_pairs_nor_tasks() {
        let pair = Pair::with_pose(0, 1, Isometry3::translation(1.0, 0.0, 0.0));
        for (tasks, expected) in [(1, PAIRS_AT_ONCE), (1500, TASKS_AT_ONCE / 1500 + 1)] {
            let task = PendingTask {
                repetition: 0,
                estimator: 0,
            };
            let all = expected + 10;
            let mut pairs = (0..all).map(|_| PairTasks {
                pair: &pair,
                due: vec![task; tasks],
            });
            assert_eq!(listed(&mut pairs).len(), expected);
            assert_eq!(listed(&mut pairs).len(), 10);
            assert!(listed(&mut pairs).is_empty());
        }
    }
}
