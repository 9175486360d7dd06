//! Shows the progress of a run.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use matchbench::counted::counted;
use matchbench::records::{Plan, RunRecord};
use matchbench::run::{Observer, RunSummary};

use crate::output::say;

/// A bar with tasks per second and the time left. It is drawn on standard error if that is a terminal; otherwise a
/// line is written now and then, for the log of a job.
pub(crate) struct Progress {
    bar: ProgressBar,
    /// Whether a task was done, so that the time left can be told.
    has_speed: AtomicBool,
    /// When the last line was written, where there is no terminal.
    last_line: Option<Mutex<Instant>>,
}

/// Time between two lines where there is no terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(60);

/// What is drawn before the first task is done: how long one takes is not known yet.
const WITHOUT_SPEED: &str = "{prefix:<24} {bar:30} {pos}/{len} tasks  {msg}";
const WITH_SPEED: &str = "{prefix:<24} {bar:30} {pos}/{len} tasks  {per_sec}  {eta} left  {msg}";

impl Progress {
    pub(crate) fn new() -> Self {
        let target = ProgressDrawTarget::stderr_with_hz(10);
        let last_line = target.is_hidden().then(|| Mutex::new(Instant::now()));
        let bar = ProgressBar::with_draw_target(None, target);
        bar.enable_steady_tick(Duration::from_millis(200));
        Self {
            bar,
            has_speed: AtomicBool::new(false),
            last_line,
        }
    }

    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn draw_as(&self, template: &str) {
        let style = ProgressStyle::with_template(template);
        self.bar
            .set_style(style.expect("the template is a constant"));
    }

    /// Writes how far the run is, if nothing draws that and the last line was long ago.
    fn write_line(&self) {
        let Some(last) = &self.last_line else {
            return;
        };
        let mut last = last.lock().unwrap_or_else(PoisonError::into_inner);
        if last.elapsed() < BETWEEN_LINES {
            return;
        }
        *last = Instant::now();
        let (done, all) = (self.bar.position(), self.bar.length().unwrap_or_default());
        let left = HumanDuration(self.bar.eta());
        say!(
            "{}: {done} of {all} tasks, about {left} left",
            self.bar.prefix()
        );
    }
}

impl Observer for Progress {
    fn on_plan(&self, _: &Plan, summary: RunSummary) {
        self.bar.set_length(summary.total as u64);
        self.bar.set_position(summary.before as u64);
        self.bar.reset_eta();
        self.draw_as(WITHOUT_SPEED);
    }

    fn on_matcher(&self, dataset: &str, matcher: &str) {
        self.bar.set_prefix(format!("{dataset} {matcher}"));
        self.bar.set_message("");
    }

    fn on_frame(&self, frame: u32, _extracted: bool) {
        self.bar.set_message(format!("features of image {frame}"));
        self.write_line();
    }

    fn on_lost_matches(&self, dataset: &str, matcher: &str, pairs: usize) {
        self.bar.suspend(|| {
            let pairs = counted(pairs, "pair");
            say!("the matches of {matcher} for {pairs} of {dataset} are gone, and are made again");
        });
    }

    fn on_ended(&self, matcher: &str, reason: &str) {
        self.bar
            .suspend(|| say!("error: {matcher} has ended: {reason}"));
    }

    fn on_record(&self, _: &RunRecord) {
        if !self.has_speed.swap(true, Ordering::Relaxed) {
            self.draw_as(WITH_SPEED);
        }
        self.bar.set_message("");
        self.bar.inc(1);
        self.write_line();
    }
}
