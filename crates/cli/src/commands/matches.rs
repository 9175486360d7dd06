//! `--matches NAME=PATH`: reads matches from the files of another tool, and prints how they were understood.

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::{Context, Result, ensure};
use matchbench::counted::counted;
use matchbench::exchange::MatchSource;
use matchbench::study::MatchesFrom;

use crate::args::MatchesArgs;
use crate::output::say;
use crate::paths;

/// The matches that were asked for.
pub(crate) fn asked(args: &MatchesArgs) -> Result<Vec<MatchesFrom>> {
    let notes = notes(&args.note)?;
    (args.matches.iter())
        .map(|asked| {
            let (name, files) = named_files(asked)?;
            Ok(MatchesFrom {
                name,
                files,
                format: args.matches_format.clone(),
                pixel_center: args.pixel_center,
                resized: args.resized,
                verified: args.verified,
                notes: notes.clone(),
            })
        })
        .collect()
}

/// `NAME=PATH[,PATH]`; a path may have commas if it exists.
pub(crate) fn named_files(asked: &str) -> Result<(String, Vec<PathBuf>)> {
    let (name, files) = asked.split_once('=').unwrap_or_default();
    ensure!(
        !name.is_empty() && !files.is_empty(),
        "--matches {asked}: expected NAME=PATH or NAME=PATH,PATH"
    );
    Ok((name.to_owned(), paths::between_commas(files.as_ref())))
}

/// Prints what was read, and what is missing or looks wrong.
pub(crate) fn describe(name: &str, source: &MatchSource) {
    for (dataset, files) in source.datasets() {
        let survey = files.survey();
        say!("{name} on {dataset}: {}", files.understood());
        say!(
            "  {}, {}",
            counted(survey.found, "pair"),
            counted(survey.matches, "match")
        );
        for remark in survey.remarks() {
            say!("  {remark}");
        }
        for warning in &survey.warnings {
            say!("  warning: {warning}");
        }
    }
}

fn notes(notes: &[String]) -> Result<BTreeMap<String, String>> {
    (notes.iter())
        .map(|note| {
            let (key, value) = (note.split_once('='))
                .with_context(|| format!("--note {note}: expected KEY=VALUE"))?;
            Ok((key.to_owned(), value.to_owned()))
        })
        .collect()
}
