//! The program `matchbench`: parses arguments, shows progress, returns exit codes. It contains no algorithm.
//!
//! The program is one function, [`run`], so that other programs can call it: the Python package installs a
//! command that does.

// `eprintln` ends the program if standard error is closed; `say` does not.
#![deny(clippy::print_stderr, clippy::print_stdout)]

mod args;
mod commands;
mod output;
mod paths;
mod progress;
mod stop;
mod threads;

use std::ffi::OsString;
use std::num::{NonZeroU64, NonZeroUsize};
use std::thread::available_parallelism;

use anyhow::Context;
use clap::Parser;
use matchbench::memory::STACK;
use rayon::{ThreadPool, ThreadPoolBuilder};

use args::{Cli, Command};
pub use output::plain;

use output::{print_help, say};
use stop::STOPPED;
use threads::Threads;

/// More threads per core than this take memory and gain nothing.
const MAX_THREADS_PER_CORE: usize = 4;

/// How a command ended that did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// Everything was done.
    Done,
    /// Everything was tried, but some tasks failed; or problems were found.
    SomeFailed,
    /// A matcher gave up before everything was tried; the same command tries the rest again.
    Unfinished,
    /// The user stopped it; finished work is kept.
    Stopped,
}

impl Ending {
    /// This ending, after what there is to tell was `printed`: it stays the same if the reader has gone.
    pub(crate) fn after(
        self,
        printed: Result<(), impl Into<anyhow::Error>>,
    ) -> anyhow::Result<Self> {
        match printed.map_err(Into::into) {
            Err(error) if !is_broken_pipe(&error) => Err(error),
            _ => Ok(self),
        }
    }
}

/// Executes the command in `arguments`, the first of which is the name of the program, and returns the exit
/// code: 0 if everything was done, 1 after an error, which is printed, or if a matcher gave up and left tasks, 2 if some
/// tasks failed, 130 if the user stopped it. Handles the signals by which users stop it.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let ending = match Cli::try_parse_from(arguments) {
        Ok(cli) => environment()
            .and_then(|()| stop::report_files_too_large())
            .and_then(|()| in_pool(&cli.command)),
        Err(error) if error.use_stderr() => {
            let _ = error.print();
            return 1;
        }
        // Help and version are errors here too; they go to standard output and are not a failure.
        Err(help) => Ending::Done.after(print_help(&help)),
    };
    stop::wait_if_ending();
    match ending {
        Ok(Ending::Done) => 0,
        Ok(Ending::SomeFailed) => 2,
        Ok(Ending::Unfinished) => 1,
        Ok(Ending::Stopped) => STOPPED,
        Err(error) if is_broken_pipe(&error) => 0,
        Err(error) => {
            say!("error: {error:#}");
            1
        }
    }
}

/// Sets the limits that environment variables ask for ([`run`] does that itself).
///
/// # Errors
/// If a variable has an invalid value; the error names it. If the processor lacks the instruction set that is
/// asked for.
pub fn environment() -> anyhow::Result<()> {
    if let Some(most) = asked("MATCHBENCH_MAX_PIXELS", |text| text.parse().ok())? {
        matchbench::datasets::limit_pixels(most);
    }
    if let Some(most) = asked("MATCHBENCH_MAX_MEMORY", bytes)? {
        matchbench::memory::limit_memory(most);
    }
    matchbench::InstructionSet::asked_for()?;
    Ok(())
}

/// The value of a variable, if it is set and not empty.
fn asked<T>(variable: &str, parse: impl Fn(&str) -> Option<T>) -> anyhow::Result<Option<T>> {
    let Some(text) = std::env::var_os(variable).filter(|text| !text.is_empty()) else {
        return Ok(None);
    };
    let number = text.to_str().and_then(parse);
    number.map(Some).with_context(|| {
        let text = text.display();
        format!(
            "{variable} is `{text}`, but must be a whole number from 1, of bytes also 800M or 8G"
        )
    })
}

/// A number of bytes, of millions (`M`) or of billions (`G`) of bytes.
fn bytes(text: &str) -> Option<NonZeroU64> {
    let (number, unit) = match text.as_bytes() {
        [.., b'M'] => (&text[..text.len() - 1], 1_000_000),
        [.., b'G'] => (&text[..text.len() - 1], 1_000_000_000),
        _ => (text, 1),
    };
    NonZeroU64::new(number.parse::<u64>().ok()?.checked_mul(unit)?)
}

/// Executes the command in the one thread pool that all its parts share: decoding, extraction, scoring,
/// figures.
fn in_pool(command: &Command) -> anyhow::Result<Ending> {
    let pool = pool(threads(command))?;
    matchbench::memory::keep_freed(pool.current_num_threads());
    pool.install(|| dispatch(command))
}

/// A thread pool for a run, with stacks that are large enough. It has as many threads as `asked` for, but not
/// more than are useful for the number of cores; without a number, one thread per core.
///
/// # Errors
/// If the system cannot start them.
pub fn pool(asked: Option<NonZeroUsize>) -> anyhow::Result<ThreadPool> {
    let cores = available_parallelism().map_or(1, usize::from);
    let useful = MAX_THREADS_PER_CORE * cores;
    // Results do not depend on the number of threads, so fewer threads than asked for change nothing.
    let threads = asked.map_or(0, |asked| asked.get().min(useful));
    ThreadPoolBuilder::new()
        .num_threads(threads)
        .stack_size(STACK)
        .build()
        .context("cannot start the threads; ask for fewer")
}

/// The value of `--threads`, if the command has this option.
fn threads(command: &Command) -> Option<NonZeroUsize> {
    let threads = match command {
        Command::Demo(args) => args.threads,
        Command::Run(args) => args.threads,
        Command::Paper(args) => args.threads,
        Command::Work(args) => args.threads,
        Command::Tune(args) => args.threads,
        Command::Eval(args) => args.threads,
        Command::Report(args) => args.threads,
        Command::Leaderboard(args) => args.threads,
        Command::Compare(args) => args.threads,
        Command::Validate(args) => args.threads,
        // One pair, one thread, or nothing that could be divided.
        Command::Import(_)
        | Command::Plan(_)
        | Command::Merge(_)
        | Command::Join(_)
        | Command::Show(_)
        | Command::Time(_)
        | Command::Export(_)
        | Command::Convert(_)
        | Command::Check(_)
        | Command::List(_)
        | Command::Completions(_)
        | Command::Man(_) => Threads::default(),
    };
    threads.number
}

fn dispatch(command: &Command) -> anyhow::Result<Ending> {
    match command {
        Command::Demo(args) => commands::demo::run(args),
        Command::Import(args) => commands::import::run(args),
        Command::Convert(args) => commands::convert::run(args),
        Command::Run(args) => commands::run::run(args),
        Command::Paper(args) => commands::paper::run(args),
        Command::Plan(args) => commands::plan::run(args),
        Command::Work(args) => commands::work::run(args),
        Command::Merge(args) => commands::merge::run(args),
        Command::Join(args) => commands::join::run(args),
        Command::Tune(args) => commands::tune::run(args),
        Command::Eval(args) => commands::eval::run(args),
        Command::Report(args) => commands::report::run(args),
        Command::Leaderboard(args) => commands::leaderboard::run(args),
        Command::Show(args) => commands::show::run(args),
        Command::Time(args) => commands::time::run(args),
        Command::Compare(args) => commands::compare::run(args),
        Command::Export(args) => commands::export::run(args),
        Command::List(args) => commands::list::run(args),
        Command::Validate(args) => commands::validate::run(args),
        Command::Check(args) => commands::check::run(args),
        Command::Completions(args) => commands::completions::run(args),
        Command::Man(args) => commands::man::run(args),
    }
}

/// Whether the reader of our output has gone, as `head` does; this is not a failure.
fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| {
        cause
            .downcast_ref::<std::io::Error>()
            .is_some_and(|error| error.kind() == std::io::ErrorKind::BrokenPipe)
    })
}
