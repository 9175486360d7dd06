//! `matchbench`: arguments to plan, progress, exit codes. No algorithm lives here.
//!
//! The program is one function, [`run`], so that other programs can be it: the Python package installs a
//! command that calls it.

// `eprintln` ends the program where standard error is closed; `say` does not.
#![deny(clippy::print_stderr, clippy::print_stdout)]

mod args;
mod commands;
mod output;
mod progress;
mod threads;

use std::ffi::OsString;
use std::num::{NonZeroU64, NonZeroUsize};
use std::thread::available_parallelism;

use anyhow::Context;
use clap::Parser;
use rayon::{ThreadPool, ThreadPoolBuilder};

use args::{Cli, Command};
use output::say;
use threads::Threads;

/// Bytes of the stack of a thread: as much as the system gives the first one.
const STACK: usize = 8 << 20;

/// Threads beyond this many for each core take memory and give nothing back.
const MOST_THREADS_A_CORE: usize = 4;

/// What a command that did not break has to say to the shell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// Everything was done.
    Done,
    /// Everything was tried, and some tasks failed; or problems were found.
    SomeFailed,
    /// The user stopped it; what was done is kept.
    Stopped,
}

/// Does what `arguments` ask, the first of which is the name of the program, and returns the exit code: 0
/// when everything was done, 1 after an error, which is printed, 2 where some tasks failed, 130 where the
/// user stopped it. Takes over the signals by which users do that.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version arrive here too; they go to standard output and are no failure.
            let _ = error.print();
            return u8::from(error.use_stderr());
        }
    };
    let ending = environment().and_then(|()| in_pool(&cli.command));
    match ending {
        Ok(Ending::Done) => 0,
        Ok(Ending::SomeFailed) => 2,
        Ok(Ending::Stopped) => 130,
        Err(error) if is_broken_pipe(&error) => 0,
        Err(error) => {
            say!("error: {error:#}");
            1
        }
    }
}

/// Sets the limits that the environment asks for ([`run`] does that itself).
///
/// # Errors
/// If a variable is not what it must be; the error names it. If instructions are asked for that the processor lacks.
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

/// What a variable asks for, if it is set to something.
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

/// A number of bytes, of millions (`M`) or of billions (`G`) of them.
fn bytes(text: &str) -> Option<NonZeroU64> {
    let (number, unit) = match text.as_bytes() {
        [.., b'M'] => (&text[..text.len() - 1], 1_000_000),
        [.., b'G'] => (&text[..text.len() - 1], 1_000_000_000),
        _ => (text, 1),
    };
    NonZeroU64::new(number.parse::<u64>().ok()?.checked_mul(unit)?)
}

/// Does the command in the one pool of threads that all of it shares: decoding, extraction, scoring,
/// figures.
fn in_pool(command: &Command) -> anyhow::Result<Ending> {
    pool(threads(command))?.install(|| dispatch(command))
}

/// Threads for a run, with the stacks that they need: as many as `asked` for, but no more than the cores make
/// use of; without a number, one for each core.
///
/// # Errors
/// If the system does not give them.
pub fn pool(asked: Option<NonZeroUsize>) -> anyhow::Result<ThreadPool> {
    let cores = available_parallelism().map_or(1, usize::from);
    let useful = MOST_THREADS_A_CORE * cores;
    // Results do not depend on it, so that fewer threads than asked for are no other answer.
    let threads = asked.map_or(0, |asked| asked.get().min(useful));
    ThreadPoolBuilder::new()
        .num_threads(threads)
        .stack_size(STACK)
        .build()
        .context("cannot start the threads; ask for fewer")
}

/// What `--threads` says, where the command has that option.
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
        // One pair, one thread, or nothing to share out.
        Command::Import(_)
        | Command::Plan(_)
        | Command::Merge(_)
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

/// Whether the reader of our output went away, as `head` does: not our failure.
fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| {
        cause
            .downcast_ref::<std::io::Error>()
            .is_some_and(|error| error.kind() == std::io::ErrorKind::BrokenPipe)
    })
}
