//! How a reader can compute the results of a report again: the data of each dataset, identified by its
//! fingerprint, and the commands for all methods together and for each method alone.

use super::command_line::{self, CommandLine, Origin, folder};
use super::content::Content;
use super::file_names::file_names;
use super::words::method;
use crate::counted::counted;
use crate::datasets::rendered::{REVISION, scenes};
use crate::records::{DatasetPlan, EstimatorPlan, MatcherPlan, Plan};

/// The folder that commands for all datasets write into.
const ALL: &str = "again";
/// The folder that commands for one method write into.
const CELL: &str = "cell";

/// All that is needed to compute the results again.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Again {
    /// The version that ran.
    pub(super) version: String,
    /// Each dataset that was run; empty if the results came from files.
    pub(super) datasets: Vec<DatasetAgain>,
    /// The command that runs all methods on all datasets, if one command can do it.
    pub(super) all: Option<String>,
    /// If results came from files: the commands that score them again, as a table and as a report.
    pub(super) scoring: Vec<String>,
    /// Whether another run of the same plan gives other numbers.
    pub(super) varies: bool,
}

/// How the results on one dataset are computed again.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct DatasetAgain {
    /// Its name.
    pub(super) name: String,
    /// How many pairs it lists.
    pub(super) pairs: usize,
    /// Hash of its cameras and pairs with their truth.
    pub(super) fingerprint: String,
    /// Where it comes from, in words; empty if the dataset does not say.
    pub(super) origin: String,
    /// The command that makes the dataset from the published data, if it is known.
    pub(super) import: Option<String>,
    /// The command that runs all methods on it, if one command can do it, and the commands that show the
    /// scores.
    pub(super) whole: Vec<String>,
    /// The command that measures times, with no other work at the same time.
    pub(super) time: Option<String>,
    /// Each method.
    pub(super) cells: Vec<CellAgain>,
}

/// How the results of one method on a dataset are computed again.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct CellAgain {
    /// Matcher and estimator.
    pub(super) method: String,
    /// The command, where there is one.
    pub(super) run: Option<String>,
    /// What else the command needs, or why there is none; may be empty.
    pub(super) note: String,
}

impl Again {
    /// Computed from what was run or read for `content`; empty if that is not known.
    pub(super) fn of(content: &Content) -> Self {
        let results = &content.facts.results;
        if !results.is_empty() {
            let line = |command: &str, more: &[&str]| {
                let words = [command]
                    .into_iter()
                    .chain(results.iter().map(String::as_str));
                CommandLine::new(words.chain(more.iter().copied())).to_string()
            };
            return Self {
                scoring: vec![
                    line("eval", &["--format", "csv"]),
                    line("report", &["--out", ALL]),
                ],
                ..Self::default()
            };
        }
        let Some(plan) = content.plan() else {
            return Self::default();
        };
        let names: Vec<&str> = plan.datasets.iter().map(|dataset| &*dataset.name).collect();
        let datasets: Vec<&DatasetPlan> = plan.datasets.iter().collect();
        let all = command_line::whole(&plan, &datasets, ALL);
        Self {
            datasets: (plan.datasets.iter().zip(file_names(&names)))
                .map(|(dataset, file)| DatasetAgain::of(content, &plan, dataset, &file))
                .collect(),
            all: all
                .filter(|_| datasets.len() > 1)
                .map(|line| line.to_string()),
            varies: plan.settings.time_budget_ms.is_some(),
            version: plan.version,
            scoring: Vec::new(),
        }
    }

    /// Whether there is nothing to say.
    pub(super) fn is_empty(&self) -> bool {
        self.datasets.is_empty() && self.scoring.is_empty()
    }

    /// All commands as a shell script.
    pub(super) fn script(&self) -> String {
        let mut text = String::from("#!/bin/sh\n");
        let mut line = |line: &str| text += &(line.replace(char::is_control, " ") + "\n");
        if !self.scoring.is_empty() {
            line("# Scores the result files again.");
            self.scoring.iter().for_each(|command| line(command));
            return text;
        }
        let same = if self.varies {
            "the same numbers only if machines are equally fast, since the time of estimators was limited"
        } else {
            "every number but times, to the last digit"
        };
        line(&format!(
            "# Computes the report again, with matchbench {}: {same}.",
            self.version
        ));
        for dataset in &self.datasets {
            let DatasetAgain {
                name,
                pairs,
                fingerprint,
                ..
            } = dataset;
            line("");
            let pairs = counted(*pairs, "pair");
            line(&format!(
                "# {name}: {pairs}, fingerprint {fingerprint} (as `matchbench validate` prints it)"
            ));
            if !dataset.origin.is_empty() {
                line(&format!("# {}", dataset.origin));
            }
            dataset.import.iter().for_each(|command| line(command));
            if self.all.is_none() {
                dataset.whole.iter().for_each(|command| line(command));
            }
        }
        line("");
        for command in self.all.iter().chain(&self.finish()) {
            line(command);
        }
        line("");
        line("# One method alone; each in a folder of its own:");
        for dataset in &self.datasets {
            for cell in &dataset.cells {
                let CellAgain { method, run, note } = cell;
                let what = run.as_deref().unwrap_or_default();
                let more = if note.is_empty() {
                    String::new()
                } else {
                    format!("  ({note})")
                };
                line(&format!("# {}, {method}{more}: {what}", dataset.name));
            }
        }
        text
    }

    /// The commands that show the scores of the runs of all datasets, as a table and as a report.
    pub(super) fn finish(&self) -> Vec<String> {
        match &self.all {
            Some(_) => vec![eval(ALL), report(ALL)],
            None => Vec::new(),
        }
    }

    /// The command that shows the scores of one method.
    pub(super) fn finish_of_cell() -> String {
        eval(CELL)
    }
}

impl DatasetAgain {
    fn of(content: &Content, plan: &Plan, dataset: &DatasetPlan, file: &str) -> Self {
        let facts = content
            .datasets
            .iter()
            .find(|facts| facts.name == dataset.name);
        let origin = facts.map(|facts| facts.origin.clone()).unwrap_or_default();
        let words = facts.and_then(|facts| match &facts.import[..] {
            [] => rendered(&dataset.name, &facts.origin),
            words => Some(words.to_vec()),
        });
        let import = words.filter(|words| words.len() > 1).map(|mut words| {
            words.insert(2, folder(&dataset.name));
            words.insert(0, "import".to_owned());
            CommandLine::new(words).to_string()
        });
        let out = format!("{ALL}-{file}");
        let whole = command_line::whole(plan, &[dataset], &out);
        let cells = (command_line::matchers_on(plan, dataset).into_iter())
            .flat_map(|matcher| matcher.estimators.iter().map(move |e| (matcher, e)))
            .map(|planned| CellAgain::of(plan, dataset, planned));
        Self {
            name: dataset.name.clone(),
            pairs: dataset.pairs,
            fingerprint: dataset.fingerprint.clone(),
            origin,
            import,
            whole: whole.map_or(Vec::new(), |line| {
                vec![line.to_string(), eval(&out), report(&out)]
            }),
            time: command_line::time(plan, dataset).map(|line| line.to_string()),
            cells: cells.collect(),
        }
    }
}

impl CellAgain {
    fn of(
        plan: &Plan,
        dataset: &DatasetPlan,
        (matcher, estimator): (&MatcherPlan, &EstimatorPlan),
    ) -> Self {
        let run = command_line::cell(plan, dataset, (matcher, estimator), CELL);
        let note = match (&run, Origin::of(matcher)) {
            (None, _) => {
                "no command asks for this part of the run; the plan says what it was".to_owned()
            }
            (Some(_), Origin::Native) => String::new(),
            (Some(_), Origin::Files) => {
                "needs the files of these matches, whose hashes are in the plan".to_owned()
            }
            (Some(_), Origin::Outside) => format!(
                "needs the program {} and its manifest, {}.toml",
                matcher.version.as_deref().unwrap_or_default(),
                matcher.id
            ),
        };
        Self {
            method: method(&matcher.id, &estimator.id),
            run: run.map(|line| line.to_string()),
            note,
        }
    }
}

/// The commands that make a built-in scene that was rendered for a demo.
fn rendered(name: &str, origin: &str) -> Option<Vec<String>> {
    let by_this_renderer = format!("rendered by matchbench, revision {REVISION}:");
    let is_it =
        origin.starts_with(&by_this_renderer) && scenes().iter().any(|scene| scene.name == name);
    is_it.then(|| vec!["rendered".to_owned(), name.to_owned()])
}

/// The command that prints the scores of a run with all their digits.
fn eval(run: &str) -> String {
    CommandLine::new(["eval", run, "--format", "csv"]).to_string()
}

/// The command that writes the report of a run.
fn report(run: &str) -> String {
    CommandLine::new(["report", run]).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_script_promises_no_more_than_the_page() {
        let script = |varies| {
            Again {
                varies,
                ..Again::default()
            }
            .script()
        };
        assert!(script(false).contains("to the last digit"));
        let limited = script(true);
        assert!(!limited.contains("to the last digit"), "{limited}");
        assert!(limited.contains("only if machines are equally fast"));
    }
}
