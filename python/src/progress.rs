//! The progress of a run, for a caller that looks at it from time to time.

use std::sync::{Mutex, PoisonError};

use matchbench::records::{Plan, RunRecord};
use matchbench::run::{Observer, RunSummary};

/// The progress of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct State {
    /// Number of recorded tasks.
    pub(crate) done: usize,
    /// Number of tasks in the plan.
    pub(crate) total: usize,
    /// The current dataset and matcher.
    pub(crate) part: (String, String),
    /// Matchers from outside that gave up, and why.
    pub(crate) ended: Vec<String>,
    /// Matchers from outside whose estimators did not get the same matches.
    pub(crate) others: Vec<String>,
    /// Why the cache of features cannot be written, if so.
    pub(crate) unkept: Option<String>,
}

/// Keeps the last [`State`]. The run never waits for a reader, since Python's display is slow.
#[derive(Debug, Default)]
pub(crate) struct Progress(Mutex<State>);

impl Progress {
    pub(crate) fn state(&self) -> State {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    fn change(&self, change: impl FnOnce(&mut State)) {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

impl Observer for Progress {
    fn on_plan(&self, _: &Plan, summary: RunSummary) {
        self.change(|state| (state.done, state.total) = (summary.before, summary.total));
    }

    fn on_matcher(&self, dataset: &str, matcher: &str) {
        self.change(|state| state.part = (dataset.into(), matcher.into()));
    }

    fn on_unkept(&self, reason: &str) {
        self.change(|state| state.unkept = Some(reason.into()));
    }

    fn on_other_matches(&self, dataset: &str, matcher: &str) {
        let told = format!(
            "{matcher} finds other matches on {dataset} than before, which were not kept: not all its estimators got the same; \
             to compare them, run all of them in another folder"
        );
        self.change(|state| state.others.push(told));
    }

    fn on_ended(&self, matcher: &str, reason: &str) {
        self.change(|state| state.ended.push(format!("{matcher} has ended: {reason}")));
    }

    fn on_record(&self, _: &RunRecord) {
        self.change(|state| state.done += 1);
    }
}
