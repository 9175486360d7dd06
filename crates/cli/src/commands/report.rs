//! `matchbench report`: the report of a run, `RUN/report/index.html` and what belongs to it, or that of
//! anybody's results.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Result, ensure};
use matchbench::records::RunFolder;
use matchbench::report::{ReportOptions, of_results, of_run, write_bundle, write_report};

use super::eval::choice;
use crate::Ending;
use crate::args::ReportArgs;
use crate::output::say;

pub(crate) fn run(args: &ReportArgs) -> Result<Ending> {
    let page = if RunFolder::is_at(&args.run) {
        let scored = &args.scored;
        ensure!(
            scored.datasets.is_none() && scored.pairs.is_none() && scored.preset.is_none(),
            "the report of a run scores all pairs of its own datasets; leave out --datasets, --pairs \
             and --preset"
        );
        let options = ReportOptions {
            out: args.out.as_deref(),
            bundle: args.bundle.as_deref(),
            cache: args.cache.as_deref(),
            pictures: args.pictures,
        };
        write(&args.run, &options)?
    } else {
        write_of_results(args)?
    };
    writeln!(std::io::stdout(), "{}", page.display())?;
    Ok(Ending::Done)
}

/// Writes the report of the run in `folder` and returns its page.
pub(crate) fn write(folder: &Path, options: &ReportOptions<'_>) -> Result<PathBuf> {
    let reported = of_run(&RunFolder::open(folder)?, options)?;
    for note in &reported.notes {
        say!("note: {note}");
    }
    Ok(reported.page)
}

/// Writes the report of result files and returns its page.
fn write_of_results(args: &ReportArgs) -> Result<PathBuf> {
    let note = |note| say!("note: {note}");
    let choice = choice(&args.scored)?;
    let content = of_results(&args.run, args.scored.datasets.as_deref(), &choice, note)?;
    Ok(match (&args.bundle, &args.out) {
        (Some(file), _) => write_bundle(file, &content)?,
        (None, Some(folder)) => write_report(folder, &content)?,
        (None, None) => write_report(&args.run.join("report"), &content)?,
    })
}
