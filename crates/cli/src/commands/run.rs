//! `matchbench run`: runs matchers on datasets, as arguments or a run file say; can be resumed.

use std::io::Write;
use std::path::Path;

use anyhow::Result;
use matchbench::protocols::{self, Protocol};
use matchbench::records::RunFolder;
use matchbench::report::ReportOptions;
use matchbench::study::Study;

use super::job::{execute, named, replace};
use super::{eval, report};
use crate::Ending;
use crate::args::RunArgs;
use crate::output::{stdout, typed};

pub(crate) fn run(args: &RunArgs) -> Result<Ending> {
    let study = study(args)?;
    let (ending, folder) = execute(&study)?;
    if ending == Ending::Stopped {
        return Ok(ending);
    }
    // The report says by itself where the truth looks wrong.
    let printed = if study.report {
        eval::print(&folder)
    } else {
        eval::print_with_doubts(&folder)
    };
    let next = if study.report {
        let options = ReportOptions {
            cache: study.cache.as_deref(),
            ..ReportOptions::default()
        };
        // Written even if the table could not be printed: a closed pipe, a full disk.
        let page = report::write(&folder, &options)?;
        format!("report: {}", page.display())
    } else {
        format!("Next: matchbench report {}", typed(&folder))
    };
    let next = by_its_rules(&study.protocols, &folder)? + &next;
    ending.after(printed.and_then(|()| Ok(writeln!(stdout(), "\n{next}")?)))
}

/// How the scores of the protocols that poses of a run were estimated under are shown, a line; nothing where that was the
/// paper's alone.
fn by_its_rules(names: &[String], folder: &Path) -> Result<String> {
    let run = RunFolder::open(folder)?;
    let plan = run.plan();
    let has_poses = |protocol: &Protocol| {
        plan.matchers.iter().any(|matcher| {
            let mut under = (matcher.estimators.iter().map(|estimator| &*estimator.id))
                .filter(|name| protocols::of_estimator(name).id == protocol.id);
            under.any(|name| plan.is_of_homographies(&matcher.id, name) != Some(true))
        })
    };
    let others: Vec<&str> = (protocols::find_all(names)?.iter())
        .filter(|protocol| !protocol.is_ours() && has_poses(protocol))
        .map(|protocol| protocol.id)
        .collect();
    Ok(if others.is_empty() {
        String::new()
    } else {
        let (run, others) = (typed(folder), others.join(","));
        format!("Scores as published: matchbench eval {run} --protocol {others}\n")
    })
}

/// What is asked for: the run file, if there is one, with the arguments replacing its settings.
fn study(args: &RunArgs) -> Result<Study> {
    let mut study = named(&args.datasets)?;
    replace(&mut study, &args.matchers, &args.choices, &args.files)?;
    study.out = args.out.clone().or(study.out);
    study.cache = args.cache.clone().or(study.cache);
    study.sample = args.sample.or(study.sample);
    study.retry_failed = args.retry_failed;
    study.report |= args.report;
    Ok(study)
}
