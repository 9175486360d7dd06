//! `matchbench report`: writes the report of a run, `RUN/report/index.html` and its other files, or that of
//! result files of anybody.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Result, ensure};
use matchbench::records::RunFolder;
use matchbench::report::{
    Content, ReportOptions, bundled, content_of_run, of_results, of_run, write_bundle,
    write_inner_report, write_report,
};

use super::eval::choice;
use crate::Ending;
use crate::args::ReportArgs;
use crate::output::{is_standard_output, say, stdout, write_result};

pub(crate) fn run(args: &ReportArgs) -> Result<Ending> {
    let scored = &args.scored;
    let is_run = RunFolder::is_at(&args.run);
    ensure!(
        !is_run || scored.datasets.is_none() && scored.pairs.is_none() && scored.preset.is_none(),
        "the report of a run scores all pairs of its own datasets; leave out --datasets, --pairs \
         and --preset"
    );
    ensure!(
        is_run || args.pictures.is_none() && args.cache.is_none(),
        "the report of result files has no pictures of pairs, since they hold no matches; leave out --pictures and --cache"
    );
    let options = ReportOptions {
        out: args.out.as_deref(),
        bundle: args.bundle.as_deref(),
        cache: args.cache.as_deref(),
        pictures: args.pictures.unwrap_or(ReportOptions::default().pictures),
    };
    if let Some(file) = args
        .bundle
        .as_deref()
        .filter(|file| is_standard_output(file))
    {
        let content = if is_run {
            let (content, notes) = content_of_run(&RunFolder::open(&args.run)?, &options)?;
            tell(&notes);
            content
        } else {
            content_of_results(args)?
        };
        write_result(file, bundled(&content)?.as_bytes())?;
        return Ok(Ending::Done);
    }
    let page = if is_run {
        write(&args.run, &options)?
    } else {
        write_of_results(args)?
    };
    writeln!(stdout(), "{}", page.display())?;
    Ok(Ending::Done)
}

/// Writes the report of the run in `folder` and returns the path of its page.
pub(crate) fn write(folder: &Path, options: &ReportOptions<'_>) -> Result<PathBuf> {
    let reported = of_run(&RunFolder::open(folder)?, options)?;
    tell(&reported.notes);
    Ok(reported.page)
}

fn tell(notes: &[String]) {
    for note in notes {
        say!("note: {note}");
    }
}

/// Writes the report of result files and returns the path of its page.
fn write_of_results(args: &ReportArgs) -> Result<PathBuf> {
    let content = content_of_results(args)?;
    Ok(match (&args.bundle, &args.out) {
        (Some(file), _) => write_bundle(file, &content)?,
        (None, Some(folder)) => write_report(folder, &content)?,
        (None, None) => write_inner_report(&args.run.join("report"), &content)?,
    })
}

fn content_of_results(args: &ReportArgs) -> Result<Content> {
    let note = |note| say!("note: {note}");
    let choice = choice(&args.scored)?;
    let datasets = args.scored.datasets.as_deref();
    Ok(of_results(&args.run, datasets, &choice, note)?)
}
