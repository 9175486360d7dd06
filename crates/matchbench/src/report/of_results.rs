//! The report of result files from any program. There is no run, no plan, and no pictures of matches.

use std::path::Path;

use crate::datasets::Sequence;
use crate::metrics::{PairChoice, PairGeometry, ResultsError, load_chosen};

use super::{Content, DatasetFacts, RunFacts};

/// All that a report can say about a folder of results: scores, and facts and the difficulty of pairs for those
/// `datasets` whose images are available. If a dataset cannot be opened, `note` is called with the reason, and
/// the report is made without it.
///
/// # Errors
/// As [`load_chosen`].
pub fn of_results(
    results: &Path,
    datasets: Option<&Path>,
    choice: &PairChoice,
    note: impl Fn(String),
) -> Result<Content, ResultsError> {
    let sets = load_chosen(results, datasets, choice)?;
    let mut facts = vec![
        ("results".to_owned(), results.display().to_string()),
        (
            "scored by".to_owned(),
            format!("matchbench {}", env!("CARGO_PKG_VERSION")),
        ),
    ];
    if let Some(datasets) = datasets {
        facts.insert(1, ("datasets".to_owned(), datasets.display().to_string()));
    }
    let run = RunFacts {
        title: "matchbench report".to_owned(),
        facts,
        plan: None,
        results: arguments(results, datasets, choice),
    };
    let mut content = Content::new(sets, run);
    let mut names: Vec<String> = content
        .results
        .iter()
        .map(|set| set.dataset.clone())
        .collect();
    names.dedup();
    for name in names {
        let Some(dir) = datasets.map(|datasets| datasets.join(&name)) else {
            continue;
        };
        match Sequence::open(&dir) {
            Ok(sequence) => {
                content
                    .geometry
                    .insert(name, PairGeometry::of_sequence(&sequence));
                content
                    .datasets
                    .push(DatasetFacts::of_sequence(&dir, &sequence));
            }
            Err(error) => note(format!(
                "no baselines and no picture of {name} in the report: {error}"
            )),
        }
    }
    content.take_portions();
    Ok(content)
}

/// The arguments with which these results are scored.
fn arguments(results: &Path, datasets: Option<&Path>, choice: &PairChoice) -> Vec<String> {
    let mut words = vec![results.display().to_string()];
    if let Some(datasets) = datasets {
        words.extend(["--datasets".to_owned(), datasets.display().to_string()]);
    }
    match choice {
        PairChoice::Listed => {}
        PairChoice::Rule(rule) => words.extend(["--pairs".to_owned(), rule.to_string()]),
        PairChoice::Paper => words.extend(["--preset".to_owned(), "paper".to_owned()]),
    }
    words
}
