//! `matchbench run`: matchers on datasets, resumable.

use std::io::Write;
use std::num::NonZeroUsize;
use std::path::Path;
use std::thread::available_parallelism;

use anyhow::{Context, Result};
use matchbench::datasets::{Sequence, decode_gray};
use matchbench::run::{Contender, Dataset, FeatureCache, Run, RunSummary, Settings};

use super::{eval, report};
use crate::Ending;
use crate::args::RunArgs;
use crate::contenders::contenders;
use crate::progress::{Bar, cancel_on_ctrl_c};

pub(crate) fn run(args: &RunArgs) -> Result<Ending> {
    let contenders = contenders(&args.matchers, &args.estimator, &args.set)?;
    let datasets = open(&args.datasets)?;
    let settings = Settings {
        seed: args.seed,
        limit: args.limit,
        ..Settings::default()
    };
    let cache = args.cache.clone().unwrap_or_else(|| args.out.join("cache"));
    let ending = execute(
        &datasets,
        &contenders,
        settings,
        &args.out,
        &cache,
        args.threads,
    )?;
    if ending != Ending::Stopped {
        eval::print(&args.out, None)?;
        if args.report {
            let page = report::write(&args.out)?;
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

/// Does what is left of a run, with a progress bar, until it is done or stopped.
pub(crate) fn execute(
    datasets: &[Dataset],
    contenders: &[Contender],
    settings: Settings,
    folder: &Path,
    cache: &Path,
    threads: Option<usize>,
) -> Result<Ending> {
    let run = Run {
        datasets,
        contenders,
        settings,
        folder,
        cache: FeatureCache::new(cache),
        decode: |bytes| decode_gray(bytes).map_err(|error| error.to_string()),
        threads: number_of_threads(threads)?,
        keep_matches: true,
        feature_memory: Run::FEATURE_MEMORY,
    };
    let cancel = cancel_on_ctrl_c()?;
    let bar = Bar::new();
    let summary = run.execute(&bar, &cancel);
    bar.finish();
    Ok(tell(&summary?, folder))
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
