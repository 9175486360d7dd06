//! Shows the progress of a run.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use matchbench::counted::counted;
use matchbench::records::{Plan, RunRecord};
use matchbench::run::{Observer, RunSummary};

use crate::output::say;

/// A bar with pairs per second and the time left. It is drawn on standard error if that is a terminal,
/// otherwise not at all.
pub(crate) struct Bar(ProgressBar);

impl Bar {
    pub(crate) fn new() -> Self {
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr_with_hz(10));
        bar.enable_steady_tick(Duration::from_millis(200));
        Self(bar)
    }

    pub(crate) fn finish(&self) {
        self.0.finish_and_clear();
    }
}

impl Observer for Bar {
    fn on_plan(&self, _: &Plan, summary: RunSummary) {
        self.0.set_length(summary.total as u64);
        self.0.set_position(summary.before as u64);
        self.0.reset_eta();
        let style = ProgressStyle::with_template(
            "{prefix:<24} {bar:30} {pos}/{len} pairs  {per_sec}  {eta} left  {msg}",
        );
        self.0.set_style(style.expect("the template is a constant"));
    }

    fn on_matcher(&self, dataset: &str, matcher: &str) {
        self.0.set_prefix(format!("{dataset} {matcher}"));
        self.0.set_message("");
    }

    fn on_frame(&self, frame: u32, _extracted: bool) {
        self.0.set_message(format!("features of image {frame}"));
    }

    fn on_lost_matches(&self, dataset: &str, matcher: &str, pairs: usize) {
        self.0.suspend(|| {
            let pairs = counted(pairs, "pair");
            say!("the matches of {matcher} for {pairs} of {dataset} are gone, and are made again");
        });
    }

    fn on_ended(&self, matcher: &str, reason: &str) {
        self.0
            .suspend(|| say!("error: {matcher} has ended: {reason}"));
    }

    fn on_record(&self, _: &RunRecord) {
        self.0.set_message("");
        self.0.inc(1);
    }
}
