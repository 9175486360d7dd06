//! How the user stops the program: by Ctrl-C, by a signal to terminate, or by closing the terminal.
//!
//! Signals that were ignored when the program started stay ignored. `nohup` ignores the one that a closed terminal
//! sends, and a script ignores Ctrl-C for what it starts in the background.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use anyhow::{Context, Result};
use matchbench::external;
use matchbench::files::remove_temporary_folders;
use matchbench::run::Cancel;

use crate::output::say;

/// The exit code after the user stopped the program.
pub(crate) const STOPPED: u8 = 130;

/// Held while the user ends the process.
static ENDING: Mutex<()> = Mutex::new(());

/// Never returns while the user is ending the process. Pairs whose matcher was killed by that fail, and these failures
/// must not be reported.
pub(crate) fn wait_if_ending() {
    drop(ending());
}

fn ending() -> MutexGuard<'static, ()> {
    ENDING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What happens when the user stops the program: until work has [begun](Self::begin), after its [end](Self::end), and the
/// second time, the process ends at once; then at most the pairs in flight are lost. The first time after it has begun, a
/// token is set and a message printed.
#[derive(Clone, Default)]
pub(crate) struct Stop {
    cancel: Cancel,
    has_begun: Arc<AtomicBool>,
}

impl Stop {
    /// Listens from now on.
    pub(crate) fn on_ctrl_c(said: &'static str) -> Result<Self> {
        let stop = Self::default();
        let heard = stop.clone();
        listen(move || {
            if heard.cancel.is_set() || !heard.has_begun.load(Ordering::Relaxed) {
                end();
            }
            heard.cancel.set();
            say!("\n{said}");
        })?;
        Ok(stop)
    }

    /// From now on there is something to be finished first. Before that, a dataset may be imported or a program started,
    /// which takes long and leaves nothing half done.
    pub(crate) fn begin(&self) -> &Cancel {
        self.has_begun.store(true, Ordering::Relaxed);
        &self.cancel
    }

    /// From now on there is nothing to be finished first.
    pub(crate) fn end(&self) {
        self.has_begun.store(false, Ordering::Relaxed);
    }
}

/// Lets the user end the process at once, with the matchers from outside that it started: where there is nothing to
/// be finished first.
pub(crate) fn end_on_ctrl_c() -> Result<()> {
    listen(|| end())
}

/// Makes a file that would grow beyond the size that `ulimit -f` allows an error of whoever writes it, as on a full disk.
/// Otherwise the system ends the process without a word.
pub(crate) fn report_files_too_large() -> Result<()> {
    #[cfg(unix)]
    // What is registered does not matter: the system only ends a process that does not listen.
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default())
        .context("cannot listen for files that are too large")?;
    Ok(())
}

/// Ends the process, and the matchers from outside before it: they are no longer in the group that the terminal stops.
/// Temporary folders go too.
fn end() -> ! {
    let _ending = ending();
    // None is started while the process goes.
    let _ended = external::end_all();
    remove_temporary_folders();
    std::process::exit(STOPPED.into())
}

/// Calls `stop`, in a thread of its own, each time the user stops the program.
#[cfg(unix)]
fn listen(mut stop: impl FnMut() + Send + 'static) -> Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;

    let ignored = ignored();
    let heard = [SIGINT, SIGTERM, SIGHUP].into_iter();
    let heard = heard.filter(|signal| ignored >> (signal - 1) & 1 == 0);
    let what = "cannot listen for Ctrl-C";
    let mut signals = Signals::new(heard).context(what)?;
    let thread = std::thread::Builder::new().name("signals".into());
    let listening = thread.spawn(move || signals.forever().for_each(|_| stop()));
    listening.map(drop).context(what)
}

/// The signals that this process ignores: bit n - 1 for number n. Linux tells in a file; where there is none (elsewhere
/// only unsafe code could ask), none count as ignored.
#[cfg(unix)]
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok())
        .unwrap_or(0)
}

/// The same by what other systems have instead of signals.
#[cfg(not(unix))]
fn listen(stop: impl FnMut() + Send + 'static) -> Result<()> {
    ctrlc::set_handler(stop).context("cannot listen for Ctrl-C")
}
