//! `matchbench eval`: scores of a run, or of results in the authors' layout.

use std::io::Write;
use std::path::Path;

use anyhow::Result;
use matchbench::files::write_whole;
use matchbench::metrics::{Bootstrap, ResultSet, load};
use matchbench::records::RunFolder;
use matchbench::report::{Content, Format, RunFacts, render, verdicts};

use crate::Ending;
use crate::args::{EvalArgs, FormatArg};

pub(crate) fn run(args: &EvalArgs) -> Result<Ending> {
    let sets = load(&args.results, args.datasets.as_deref())?;
    let text = match args.format {
        FormatArg::Table => {
            let mut text = table(sets);
            if RunFolder::is_at(&args.results) {
                let next = format!("\nNext: matchbench report {}\n", args.results.display());
                text.push_str(&next);
            }
            text
        }
        other => render(other.into(), &content(sets).summaries),
    };
    match &args.out {
        Some(path) => write_whole(path, text.as_bytes())?,
        None => std::io::stdout().write_all(text.as_bytes())?,
    }
    Ok(Ending::Done)
}

/// Prints the table of scores of a run, and who is best on each dataset.
pub(crate) fn print(run: &Path) -> Result<()> {
    let text = table(load(run, None)?);
    std::io::stdout().write_all(text.as_bytes())?;
    Ok(())
}

/// The table of scores, and below it a sentence for each dataset: who is best, how certainly.
fn table(sets: Vec<ResultSet>) -> String {
    let Content {
        summaries, leads, ..
    } = content(sets);
    let mut text = render(Format::Table, &summaries);
    let verdicts = verdicts(&leads);
    if !verdicts.is_empty() {
        text.push('\n');
        text.push_str(&verdicts.join("\n"));
        text.push('\n');
    }
    text
}

fn content(sets: Vec<ResultSet>) -> Content {
    Content::new(sets, &Bootstrap::default(), RunFacts::default())
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
