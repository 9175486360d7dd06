//! `matchbench run`: matchers on datasets, resumable.

use std::io::Write;
use std::num::NonZeroUsize;
use std::path::Path;
use std::thread::available_parallelism;

use anyhow::{Context, Result};
use matchbench::datasets::{Sequence, decode_gray};
use matchbench::run::{
    Cancel, Contender, Dataset, FeatureCache, Observer, Plan, Run, RunSummary, Settings, Silent,
};

use super::tune::Tuned;
use super::{eval, report};
use crate::Ending;
use crate::args::RunArgs;
use crate::contenders::contenders;
use crate::progress::{Bar, cancel_on_ctrl_c};

pub(crate) fn run(args: &RunArgs) -> Result<Ending> {
    let tuned = (args.tuned.iter().map(|path| Tuned::read(path))).collect::<Result<Vec<_>>>()?;
    // What is set by hand comes last and wins.
    let settings = tuned.iter().map(|tuned| tuned.setting.clone());
    let settings: Vec<String> = settings.chain(args.set.iter().cloned()).collect();
    let contenders = contenders(&args.matchers, &args.estimator, &settings)?;
    let datasets = open(&args.datasets)?;
    let job = Job {
        datasets: &datasets,
        contenders: &contenders,
        settings: Settings {
            seed: args.seed,
            repetitions: args.repeat,
            limit: args.limit,
            time_budget_ms: args.time_budget,
        },
        folder: &args.out,
        cache: args.cache.as_deref(),
        threads: args.threads,
        keep_matches: !args.no_matches,
    };
    let plan = Plan::new(&datasets, &contenders, job.settings)?;
    tuned.iter().try_for_each(|tuned| tuned.check(&plan))?;
    let ending = job.execute()?;
    if ending != Ending::Stopped {
        eval::print(&args.out, None)?;
        if args.report {
            let page = report::write(&args.out, None, report::PICTURES)?;
            writeln!(std::io::stdout(), "\nreport: {}", page.display())?;
        }
    }
    Ok(ending)
}

/// Opens dataset folders.
pub(crate) fn open(folders: &[impl AsRef<Path>]) -> Result<Vec<Dataset>> {
    folders
        .iter()
        .map(|folder| {
            let path = std::path::absolute(folder.as_ref())?;
            Ok(Dataset {
                sequence: Sequence::open(&path)?,
                path,
            })
        })
        .collect()
}

/// A run as it is asked for on the command line.
pub(crate) struct Job<'a> {
    pub(crate) datasets: &'a [Dataset],
    pub(crate) contenders: &'a [Contender],
    pub(crate) settings: Settings,
    pub(crate) folder: &'a Path,
    /// Folder of the feature cache, if not the usual one in the folder of the run.
    pub(crate) cache: Option<&'a Path>,
    pub(crate) threads: Option<usize>,
    pub(crate) keep_matches: bool,
}

impl Job<'_> {
    /// Does what is left, with a progress bar, until it is done or stopped.
    pub(crate) fn execute(&self) -> Result<Ending> {
        let cancel = cancel_on_ctrl_c()?;
        let bar = Bar::new();
        let summary = self.go(&bar, &cancel);
        bar.finish();
        Ok(tell(&summary?, self.folder))
    }

    /// Does all of it without a word. Nothing is kept, so Ctrl-C just ends the process.
    pub(crate) fn execute_quietly(&self) -> Result<()> {
        self.go(&Silent, &Cancel::default())?;
        Ok(())
    }

    fn go(&self, observer: &dyn Observer, cancel: &Cancel) -> Result<RunSummary> {
        let cache = (self.cache).map_or_else(|| self.folder.join("cache"), Path::to_path_buf);
        let run = Run {
            datasets: self.datasets,
            contenders: self.contenders,
            settings: self.settings,
            folder: self.folder,
            cache: FeatureCache::new(cache),
            decode: |bytes| decode_gray(bytes).map_err(|error| error.to_string()),
            threads: number_of_threads(self.threads)?,
            keep_matches: self.keep_matches,
            feature_memory: Run::FEATURE_MEMORY,
        };
        Ok(run.execute(observer, cancel)?)
    }
}

fn number_of_threads(asked: Option<usize>) -> Result<NonZeroUsize> {
    match asked {
        None => Ok(available_parallelism().unwrap_or(NonZeroUsize::MIN)),
        Some(threads) => NonZeroUsize::new(threads).context("--threads must be at least 1"),
    }
}

/// Says how a run ended.
fn tell(summary: &RunSummary, folder: &Path) -> Ending {
    if !summary.is_complete() {
        let done = summary.before + summary.now;
        eprintln!(
            "stopped after {done} of {} tasks; the same command goes on from there",
            summary.total
        );
        return Ending::Stopped;
    }
    let before = match summary.before {
        0 => String::new(),
        before => format!(", {before} of them earlier"),
    };
    eprintln!(
        "{} tasks done{before}; records in {}",
        summary.total,
        folder.display()
    );
    if summary.failed > 0 {
        eprintln!(
            "{} tasks FAILED and count as wrong; their records say why (\"kind\":\"failed\")",
            summary.failed
        );
        return Ending::SomeFailed;
    }
    Ending::Done
}
