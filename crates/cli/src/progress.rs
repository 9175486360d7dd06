//! Shows the progress of a run.

use std::fmt;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use matchbench::counted::counted;
use matchbench::records::{Plan, RunRecord};
use matchbench::run::{Observer, RunSummary};

use crate::output::say;

/// A bar with tasks per second and the time left. It is drawn on standard error if that is a terminal; otherwise a
/// line is written now and then, for the log of a job.
pub(crate) struct Progress {
    bar: ProgressBar,
    /// Tasks that were done before this process began.
    before: Arc<AtomicU64>,
    /// Whether a task was done, so that the time left can be told.
    has_speed: AtomicBool,
    /// When the last line was written, where there is no terminal.
    last_line: Option<Mutex<Instant>>,
}

/// Time between two lines where there is no terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(60);

/// What is drawn before the first task is done: how long one takes is not known yet.
const WITHOUT_SPEED: &str = "{prefix:<24} {bar:30} {pos}/{len} tasks  {msg}";
const WITH_SPEED: &str = "{prefix:<24} {bar:30} {pos}/{len} tasks  {per_sec}  {left} left  {msg}";

impl Progress {
    pub(crate) fn new() -> Self {
        let target = ProgressDrawTarget::stderr_with_hz(10);
        let last_line = target.is_hidden().then(|| Mutex::new(Instant::now()));
        let bar = ProgressBar::with_draw_target(None, target);
        bar.enable_steady_tick(Duration::from_millis(200));
        Self {
            bar,
            before: Arc::default(),
            has_speed: AtomicBool::new(false),
            last_line,
        }
    }

    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn draw_as(&self, template: &str) {
        let style = ProgressStyle::with_template(template).expect("the template is a constant");
        let before = Arc::clone(&self.before);
        let left = move |state: &ProgressState, out: &mut dyn fmt::Write| {
            let (done, all) = (state.pos(), state.len().unwrap_or_default());
            let left = left(state.elapsed(), before.load(Ordering::Relaxed), done, all);
            let left = left.map_or_else(|| "-".to_owned(), |left| HumanDuration(left).to_string());
            // Nothing is drawn where this fails.
            let _ = out.write_str(&left);
        };
        self.bar.set_style(style.with_key("left", left));
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
        let before = self.before.load(Ordering::Relaxed);
        let left = left(self.bar.elapsed(), before, done, all);
        let left = left.map(|left| format!(", about {} left", HumanDuration(left)));
        say!(
            "{}: {done} of {all} tasks{}",
            self.bar.prefix(),
            left.unwrap_or_default()
        );
    }
}

/// The time left, if tasks take as long as those that were done in the time that has `elapsed`, after those of `before`;
/// `None` if none was done. It is the mean of all, since tasks come in bursts: the pairs of an image after its features.
fn left(elapsed: Duration, before: u64, done: u64, all: u64) -> Option<Duration> {
    let now = done.checked_sub(before).filter(|&now| now > 0)?;
    let each = elapsed.as_secs_f64() / now as f64;
    Duration::try_from_secs_f64(each * all.saturating_sub(done) as f64).ok()
}

impl Observer for Progress {
    fn on_plan(&self, _: &Plan, summary: RunSummary) {
        self.bar.set_length(summary.total as u64);
        self.bar.set_position(summary.before as u64);
        self.before.store(summary.before as u64, Ordering::Relaxed);
        self.bar.reset_elapsed();
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

    fn on_unkept(&self, reason: &str) {
        self.bar
            .suspend(|| say!("warning: {reason}; the run goes on without that file"));
    }

    fn on_lost_matches(&self, dataset: &str, matcher: &str, pairs: usize) {
        self.bar.suspend(|| {
            let pairs = counted(pairs, "pair");
            say!("the matches of {matcher} for {pairs} of {dataset} are gone, and are made again");
        });
    }

    fn on_other_matches(&self, dataset: &str, matcher: &str) {
        self.bar.suspend(|| {
            say!(
                "warning: {matcher} finds other matches on {dataset} than before, which were not kept: not all its estimators got \
                 the same. To compare them, run all of them in another folder"
            );
        });
    }

    fn on_ended(&self, matcher: &str, reason: &str) {
        self.bar
            .suspend(|| say!("error: {matcher} has ended: {reason}"));
    }

    fn on_record(&self, _: &RunRecord) {
        self.bar.set_message("");
        self.bar.inc(1);
        if !self.has_speed.swap(true, Ordering::Relaxed) {
            self.draw_as(WITH_SPEED);
        }
        self.write_line();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_that_of_the_tasks_of_this_process() {
        let minute = Duration::from_secs(60);
        assert_eq!(left(minute, 100, 100, 400), None);
        assert_eq!(left(minute, 100, 150, 400), Some(5 * minute));
        assert_eq!(left(minute, 0, 400, 400), Some(Duration::ZERO));
        assert_eq!(left(minute, 200, 100, 400), None);
    }
}
