//! `matchbench eval`: scores of a run, or of results in the authors' layout.

use std::io::Write;
use std::path::Path;

use anyhow::Result;
use matchbench::files::write_whole;
use matchbench::metrics::{Bootstrap, ResultSet, Summary, load};
use matchbench::report::{Content, Format, RunFacts, leads_in_words, render};

use crate::Ending;
use crate::args::{EvalArgs, FormatArg};

pub(crate) fn run(args: &EvalArgs) -> Result<Ending> {
    let sets = load(&args.results, args.datasets.as_deref())?;
    let text = match args.format {
        FormatArg::Table => table(sets),
        other => render(other.into(), &content(sets).summaries),
    };
    match &args.out {
        Some(path) => write_whole(path, text.as_bytes())?,
        None => std::io::stdout().write_all(text.as_bytes())?,
    }
    Ok(Ending::Done)
}

/// Scores the results in a folder.
pub(crate) fn summaries(results: &Path, datasets: Option<&Path>) -> Result<Vec<Summary>> {
    Ok(content(load(results, datasets)?).summaries)
}

fn content(sets: Vec<ResultSet>) -> Content {
    Content::new(sets, &Bootstrap::default(), RunFacts::default())
}

/// The table of scores, and below it the best of each dataset against the others.
fn table(sets: Vec<ResultSet>) -> String {
    let Content {
        summaries, leads, ..
    } = content(sets);
    let mut text = render(Format::Table, &summaries);
    if !leads.is_empty() {
        text.push_str("\nAUC of the best on each dataset against the others, on the same pairs [95 % interval]:\n");
        text.push_str(&leads_in_words(&leads));
    }
    text
}

/// Prints the table of scores.
pub(crate) fn print(results: &Path, datasets: Option<&Path>) -> Result<()> {
    let text = table(load(results, datasets)?);
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
