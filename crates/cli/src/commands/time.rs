//! `matchbench time`: measures how long matchers take, by the paper's protocol.

use std::io::Write;
use std::slice;

use anyhow::{Result, bail};
use matchbench::counted::counted;
use matchbench::external::Manifest;
use matchbench::metrics::Quartiles;
use matchbench::report::{MatcherTimes, times_as_csv, times_as_latex};
use matchbench::run::{Contender, Dataset, default_estimators};
use matchbench::time::{machine, time};

use crate::Ending;
use crate::args::TimeArgs;
use crate::commands::job::{changes, check_names};
use crate::output::{check_results, say, stdout, write_result};
use crate::stop::Stop;

pub(crate) fn run(args: &TimeArgs) -> Result<Ending> {
    check_results([&args.csv, &args.latex].into_iter().flatten())?;
    check_names(&args.matchers)?;
    if let Some(path) = args.matchers.iter().find(|name| Manifest::is_path(name)) {
        bail!(
            "{path}: a program from outside keeps to neither one thread nor the clock here; `matchbench \
             run` records its own times and what the host saw, and the report shows both"
        );
    }
    let dataset = Dataset::open(&args.dataset)?;
    let estimators = default_estimators(slice::from_ref(&dataset));
    let contenders = Contender::all_of(&args.matchers, &estimators, &changes(&args.set)?, None)?;
    let stop = Stop::on_ctrl_c("stopping")?;
    let cancel = stop.begin();
    let mut out = stdout();
    let about = format!(
        "matchbench {}, {}; 1 thread, no cache; first {} of {}",
        env!("CARGO_PKG_VERSION"),
        machine(),
        counted(args.pairs.get().min(dataset.sequence.pairs.len()), "pair"),
        dataset.sequence.name
    );
    writeln!(out, "{about}")?;
    writeln!(
        out,
        "median (quartiles) in milliseconds; detection per image, the rest per pair; \
         memory is the most that the process had meanwhile\n"
    )?;
    let heads = ["detection", "search", "selection", "pose"].map(|head| format!("{head:>24}"));
    writeln!(
        out,
        "{:<14} {:>8}  {}  {:>9}",
        "matcher",
        "features",
        heads.join("  "),
        "memory"
    )?;
    let (mut noisy, mut broken) = (false, false);
    let mut rows = Vec::new();
    for contender in &contenders {
        let id = contender.source.id();
        let Some(timing) = time(&dataset, contender, args.pairs.get(), cancel)? else {
            break;
        };
        let stages = &timing.stages;
        let times = [
            stages.extract,
            stages.search,
            stages.select,
            stages.estimate,
        ];
        writeln!(
            out,
            "{id:<14} {:>8}  {}  {:>9}",
            (stages.features).map_or_else(|| "–".into(), |s| format!("{:.0}", s.median)),
            times.map(|time| format!("{:>24}", shown(time))).join("  "),
            (timing.peak_memory).map_or_else(|| "–".into(), |b| format!("{:.0} MB", b * 1e-6))
        )?;
        rows.push(MatcherTimes {
            matcher: id.to_owned(),
            stages: timing.stages,
        });
        if let Some(breakage) = timing.breakage() {
            say!("warning: {id}: {breakage}");
            broken = true;
        }
        for warning in &timing.noise {
            say!("warning: {id}: {warning}");
            noisy = true;
        }
    }
    // What was measured before the user stopped it is kept.
    if !rows.is_empty() {
        write_files(args, &rows, &about)?;
    }
    if noisy {
        say!("the machine was not quiet; measure again without other programs");
    }
    Ok(if rows.len() < contenders.len() {
        say!(
            "stopped after {} of {}",
            rows.len(),
            counted(contenders.len(), "matcher")
        );
        Ending::Stopped
    } else if broken {
        Ending::SomeFailed
    } else {
        Ending::Done
    })
}

/// Writes the tables that were asked for.
fn write_files(args: &TimeArgs, rows: &[MatcherTimes], about: &str) -> Result<()> {
    if let Some(file) = &args.csv {
        write_result(file, times_as_csv(rows).as_bytes())?;
    }
    if let Some(file) = &args.latex {
        write_result(file, times_as_latex(rows, about).as_bytes())?;
    }
    Ok(())
}

fn shown(spread: Option<Quartiles>) -> String {
    spread.map_or_else(
        || "–".into(),
        |Quartiles {
             lower,
             median,
             upper,
             ..
         }| {
            format!(
                "{:.2} ({:.2}–{:.2})",
                median * 1e3,
                lower * 1e3,
                upper * 1e3
            )
        },
    )
}
