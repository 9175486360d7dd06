//! `matchbench run`: matchers on datasets, resumable.

use std::io::Write;

use anyhow::Result;
use matchbench::records::{Settings, Tuned};
use matchbench::report::ReportOptions;

use super::job::{Job, cache, changes, check_names, contenders, open};
use super::{eval, matches, report};
use crate::Ending;
use crate::args::RunArgs;

pub(crate) fn run(args: &RunArgs) -> Result<Ending> {
    let tuned = (args.tuned.iter().map(|path| Tuned::read(path))).collect::<Result<Vec<_>, _>>()?;
    // What is set by hand comes last and wins.
    let settings = tuned.iter().map(|tuned| tuned.setting.clone());
    let settings: Vec<String> = settings.chain(args.set.iter().cloned()).collect();
    check_names(&args.matchers)?;
    let datasets = open(&args.datasets)?;
    let (contenders, all_started) = contenders(
        &args.matchers,
        matches::sources(&args.files, &datasets)?,
        &args.estimator,
        &changes(&settings)?,
        &args.out,
        &cache(args.cache.as_deref(), &args.out),
    )?;
    let ending = Job {
        datasets: &datasets,
        contenders: &contenders,
        settings: Settings {
            seed: args.seed,
            repetitions: args.repeat,
            limit: args.limit,
            time_budget_ms: args.time_budget,
        },
        tuned: &tuned,
        folder: &args.out,
        cache: args.cache.as_deref(),
        keep_matches: !args.no_matches,
        retry_failed: args.retry_failed,
    }
    .execute()?;
    if ending == Ending::Stopped {
        return Ok(ending);
    }
    eval::print(&args.out)?;
    let mut out = std::io::stdout();
    if args.report {
        let options = ReportOptions {
            cache: args.cache.as_deref(),
            ..ReportOptions::default()
        };
        let page = report::write(&args.out, &options)?;
        writeln!(out, "\nreport: {}", page.display())?;
    } else {
        writeln!(out, "\nNext: matchbench report {}", args.out.display())?;
    }
    Ok(ending.unless_absent(all_started))
}
