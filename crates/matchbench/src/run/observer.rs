//! Who is told how a run goes.

use std::iter::Sum;

use crate::records::{Plan, RunRecord};

/// Is told how a run goes: a progress bar, a log. Calls come one at a time, from any thread, and
/// the run waits for them.
pub trait Observer: Sync {
    /// The run begins, or goes on after `summary.before` tasks of earlier processes.
    fn on_plan(&self, plan: &Plan, summary: RunSummary) {
        let _ = (plan, summary);
    }

    /// A matcher begins with a dataset.
    fn on_matcher(&self, dataset: &str, matcher: &str) {
        let _ = (dataset, matcher);
    }

    /// The features of a frame of this dataset are there, or it is known why there are none. They
    /// were `extracted`, or were in the cache.
    fn on_frame(&self, frame: u32, extracted: bool) {
        let _ = (frame, extracted);
    }

    /// The cache of features cannot be written, for this `reason`, which names a file. The run goes on, and extracts what it
    /// needs again; it tells this once, and counts on, see [`RunSummary::unkept`].
    fn on_unkept(&self, reason: &str) {
        let _ = reason;
    }

    /// The kept matches of so many `pairs` are lost or damaged, though their records are there: they are matched again.
    fn on_lost_matches(&self, dataset: &str, matcher: &str, pairs: usize) {
        let _ = (dataset, matcher, pairs);
    }

    /// A source outside was asked again for pairs whose matches are not there any more, for other estimators, and finds
    /// others now. So not all its estimators got the same.
    fn on_other_matches(&self, dataset: &str, matcher: &str) {
        let _ = (dataset, matcher);
    }

    /// A source outside will give no more matches, for this `reason`; the run of the others goes on.
    fn on_ended(&self, matcher: &str, reason: &str) {
        let _ = (matcher, reason);
    }

    /// A task is done and its record is in the file.
    fn on_record(&self, record: &RunRecord) {
        let _ = record;
    }
}

/// Tells nobody.
#[derive(Clone, Copy, Debug)]
pub struct Silent;

impl Observer for Silent {}

/// How far a run has come, in tasks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RunSummary {
    /// Tasks of the plan.
    pub total: usize,
    /// Tasks that were recorded by earlier processes.
    pub before: usize,
    /// Tasks that were recorded by this one.
    pub now: usize,
    /// Recorded tasks that failed (not those that came to no pose), whoever did them.
    pub failed: usize,
    /// Sources outside that ended before they had been asked for all.
    pub ended: usize,
    /// Files of features that the cache could not keep.
    pub unkept: usize,
    /// Recorded pairs whose kept matches are lost, and were not made again yet.
    pub lost: usize,
}

impl RunSummary {
    /// Whether all tasks are recorded and all matches that were lost are there again; if not, the run was stopped.
    pub fn is_complete(self) -> bool {
        self.before + self.now == self.total && self.lost == 0
    }

    /// Counts a task that was done now.
    pub(super) fn add(&mut self, record: &RunRecord) {
        self.now += 1;
        self.failed += usize::from(record.outcome.has_failed());
    }
}

impl Sum for RunSummary {
    fn sum<I: Iterator<Item = Self>>(parts: I) -> Self {
        parts.fold(Self::default(), |sum, part| Self {
            total: sum.total + part.total,
            before: sum.before + part.before,
            now: sum.now + part.now,
            failed: sum.failed + part.failed,
            ended: sum.ended + part.ended,
            unkept: sum.unkept + part.unkept,
            lost: sum.lost + part.lost,
        })
    }
}
