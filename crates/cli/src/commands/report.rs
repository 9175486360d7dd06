//! `matchbench report`: the report of a run, `RUN/report/index.html` and what belongs to it.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Result;
use matchbench::records::RunFolder;
use matchbench::report::{ReportOptions, of_run};

use crate::Ending;
use crate::args::ReportArgs;

pub(crate) fn run(args: &ReportArgs) -> Result<Ending> {
    let options = ReportOptions {
        out: args.out.as_deref(),
        cache: args.cache.as_deref(),
        pictures: args.pictures,
    };
    let page = write(&args.run, &options)?;
    writeln!(std::io::stdout(), "{}", page.display())?;
    Ok(Ending::Done)
}

/// Writes the report of the run in `folder` and returns its page.
pub(crate) fn write(folder: &Path, options: &ReportOptions<'_>) -> Result<PathBuf> {
    let reported = of_run(&RunFolder::open(folder)?, options)?;
    for note in &reported.notes {
        eprintln!("note: {note}");
    }
    Ok(reported.page)
}
