//! How a reader computes again what a report shows: the data of each dataset, known by their fingerprint, and
//! the commands for all methods on them and for each alone.

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

/// How everything is computed again.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Again {
    /// The version that ran.
    pub(super) version: String,
    /// Each dataset that was run; none where results came from files.
    pub(super) datasets: Vec<DatasetAgain>,
    /// What runs all methods on all datasets, where one command can ask for them.
    pub(super) all: Option<String>,
    /// How result files are scored again, where results came from them: their table, and their report.
    pub(super) scoring: Vec<String>,
    /// Whether other runs of the same come to other numbers.
    pub(super) varies: bool,
}

/// How what is known of one dataset is computed again.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct DatasetAgain {
    /// Its name.
    pub(super) name: String,
    /// How many pairs it lists.
    pub(super) pairs: usize,
    /// Hash of its cameras and pairs with their truth.
    pub(super) fingerprint: String,
    /// Where it comes from, in words; empty where it does not say.
    pub(super) origin: String,
    /// What makes it of the data as they are published, where it is known.
    pub(super) import: Option<String>,
    /// What runs all methods on it, where one command can ask for them, and what shows that.
    pub(super) whole: Vec<String>,
    /// What measures times without other work beside it.
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
    /// What else it needs, or why there is none; empty where nothing is to be said.
    pub(super) note: String,
}

impl Again {
    /// Of what was run or read for `content`; nothing where that is not known.
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

    /// Whether nothing can be said.
    pub(super) fn is_empty(&self) -> bool {
        self.datasets.is_empty() && self.scoring.is_empty()
    }

    /// All of it for a shell.
    pub(super) fn script(&self) -> String {
        let mut text = String::from("#!/bin/sh\n");
        let mut line = |line: &str| text += &(line.replace(char::is_control, " ") + "\n");
        if !self.scoring.is_empty() {
            line("# Scores the result files again.");
            self.scoring.iter().for_each(|command| line(command));
            return text;
        }
        line(&format!(
            "# Computes the report again, with matchbench {}: every number but times, to the last digit.",
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

    /// What shows the scores of the runs of all datasets: their table, and their report.
    pub(super) fn finish(&self) -> Vec<String> {
        match &self.all {
            Some(_) => vec![eval(ALL), report(ALL)],
            None => Vec::new(),
        }
    }

    /// What shows the scores of one method.
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

/// What makes a built-in scene that was rendered for a demo.
fn rendered(name: &str, origin: &str) -> Option<Vec<String>> {
    let by_this_renderer = format!("rendered by matchbench, revision {REVISION}:");
    let is_it =
        origin.starts_with(&by_this_renderer) && scenes().iter().any(|scene| scene.name == name);
    is_it.then(|| vec!["rendered".to_owned(), name.to_owned()])
}

/// What prints the scores of a run with all their digits.
fn eval(run: &str) -> String {
    CommandLine::new(["eval", run, "--format", "csv"]).to_string()
}

/// What writes the report of a run.
fn report(run: &str) -> String {
    CommandLine::new(["report", run]).to_string()
}
