//! `matchbench eval`: scores of a run, or of results in the authors' layout.

use std::io::Write;
use std::path::Path;

use anyhow::Result;
use matchbench::files::write_whole;
use matchbench::metrics::{Bootstrap, Summary, load};
use matchbench::report::{Content, Format, RunFacts, render};

use crate::Ending;
use crate::args::{EvalArgs, FormatArg};

pub(crate) fn run(args: &EvalArgs) -> Result<Ending> {
    let summaries = summaries(&args.results, args.datasets.as_deref())?;
    let text = render(args.format.into(), &summaries);
    match &args.out {
        Some(path) => write_whole(path, text.as_bytes())?,
        None => std::io::stdout().write_all(text.as_bytes())?,
    }
    Ok(Ending::Done)
}

/// Scores the results in a folder.
pub(crate) fn summaries(results: &Path, datasets: Option<&Path>) -> Result<Vec<Summary>> {
    let sets = load(results, datasets)?;
    Ok(Content::new(sets, &Bootstrap::default(), RunFacts::default()).summaries)
}

/// Prints the table of scores.
pub(crate) fn print(results: &Path, datasets: Option<&Path>) -> Result<()> {
    let text = render(Format::Table, &summaries(results, datasets)?);
    std::io::stdout().write_all(text.as_bytes())?;
    Ok(())
}

impl From<FormatArg> for Format {
    fn from(format: FormatArg) -> Self {
        match format {
            FormatArg::Table => Self::Table,
            FormatArg::Csv => Self::Csv,
            FormatArg::Json => Self::Json,
            FormatArg::Markdown => Self::Markdown,
            FormatArg::Latex => Self::Latex,
        }
    }
}
