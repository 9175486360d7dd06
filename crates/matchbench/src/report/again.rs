//! How a reader can compute the results of a report again: the data of each dataset, identified by its
//! fingerprint, and the commands for all methods together and for each method alone.

use super::command_line::{self, CommandLine, Origin, folder};
use super::content::Content;
use super::dataset_facts::DatasetFacts;
use super::file_names::file_names;
use crate::counted::counted;
use crate::datasets::RENDERED;
use crate::datasets::rendered::{REVISION, Scene, scenes};
use crate::metrics::method;
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
    /// What the commands do not compute, and why.
    pub(super) missing: Vec<String>,
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
    /// What the commands need that this program does not have, one for each matcher that is not built in.
    pub(super) needs: Vec<String>,
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
        let all = command_line::whole(&plan, &datasets, ALL).filter(|_| datasets.len() > 1);
        let datasets: Vec<DatasetAgain> = (plan.datasets.iter().zip(file_names(&names)))
            .map(|(dataset, file)| DatasetAgain::of(content, &plan, dataset, &file))
            .collect();
        let missing = match &all {
            Some(_) => Vec::new(),
            None => missing(&datasets, why_apart(&plan)),
        };
        Self {
            datasets,
            missing,
            all: all.map(|line| line.to_string()),
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
        let what = if self.missing.is_empty() {
            "the report"
        } else {
            "results of the report"
        };
        line(&format!(
            "# Computes {what} again, with matchbench {}: {same}.",
            self.version
        ));
        for missing in &self.missing {
            line(&format!("# Not computed: {missing}."));
        }
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
            for need in &dataset.needs {
                line(&format!("# Needs {need}."));
            }
            if self.all.is_none() {
                dataset.whole.iter().for_each(|command| line(command));
            }
        }
        line("");
        let of_all: Vec<String> = self.all.iter().cloned().chain(self.finish()).collect();
        for command in &of_all {
            line(command);
        }
        if !of_all.is_empty() {
            line("");
        }
        line("# One method alone; each in a folder of its own:");
        for dataset in &self.datasets {
            for cell in &dataset.cells {
                let CellAgain { method, run, note } = cell;
                let what = match run {
                    None => format!(": {note}"),
                    Some(run) if note.is_empty() => format!(": {run}"),
                    Some(run) => format!("  ({note}): {run}"),
                };
                line(&format!("# {}, {method}{what}", dataset.name));
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
            [] => rendered(facts).map(|scene| vec![RENDERED.to_owned(), scene.name.to_owned()]),
            words => Some(words.to_vec()),
        });
        let import = words.filter(|words| words.len() > 1).map(|mut words| {
            let out = folder(&dataset.name);
            // The published data cannot lie where the dataset goes.
            if words[0] != RENDERED && words[1] == out {
                words[1] = format!("original/{out}");
            }
            words.insert(2, out);
            words.insert(0, "import".to_owned());
            CommandLine::new(words).to_string()
        });
        let out = format!("{ALL}-{file}");
        let whole = command_line::whole(plan, &[dataset], &out);
        let of_matchers = (plan.matchers_on(dataset)).filter_map(|matcher| needs(matcher, dataset));
        let of_scene = facts.and_then(rendered_in_part);
        let needs = of_scene.into_iter().chain(of_matchers).collect();
        let cells = (plan.matchers_on(dataset))
            .flat_map(|matcher| matcher.estimators.iter().map(move |e| (matcher, e)))
            .map(|planned| CellAgain::of(plan, dataset, planned));
        Self {
            name: dataset.name.clone(),
            pairs: dataset.pairs,
            fingerprint: dataset.fingerprint.clone(),
            origin,
            import,
            needs,
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
        let note = match run {
            None if Origin::of(matcher) != Origin::Python => {
                "no command asks for this part of the run; the plan says what it was".to_owned()
            }
            _ => needs(matcher, dataset).map_or_else(String::new, |need| format!("needs {need}")),
        };
        Self {
            method: method(&matcher.id, &estimator.id),
            run: run.map(|line| line.to_string()),
            note,
        }
    }
}

/// What a matcher needs that is not built in.
fn needs(matcher: &MatcherPlan, dataset: &DatasetPlan) -> Option<String> {
    match Origin::of(matcher) {
        Origin::Native => None,
        Origin::Files => Some(format!(
            "the files with the matches of {} in {}; their hashes are in the plan",
            matcher.id,
            command_line::place_of(matcher, dataset)
        )),
        Origin::Outside => Some(format!(
            "the program {} and its manifest, {}.toml",
            matcher.version.as_deref().unwrap_or_default(),
            matcher.id
        )),
        Origin::Python => Some(format!(
            "the code of {} in Python ({}), which `matchbench.run` runs",
            matcher.id,
            matcher.version.as_deref().unwrap_or_default()
        )),
    }
}

/// Why no single command computes all methods of a dataset.
fn why_apart(plan: &Plan) -> &'static str {
    let in_python = |matcher: &MatcherPlan| Origin::of(matcher) == Origin::Python;
    if plan.shard.is_some() {
        "the plan is that of a shard, for which there is no command"
    } else if plan.matchers.iter().any(in_python) {
        "a matcher is written in Python, where `matchbench.run` runs it; each other method alone has a command"
    } else {
        "its methods have options that one command can give only once; each method alone has a command"
    }
}

/// What the commands of single datasets do not compute, and `why` not.
fn missing(datasets: &[DatasetAgain], why: &str) -> Vec<String> {
    let apart = datasets.iter().filter(|dataset| dataset.whole.is_empty());
    let mut missing: Vec<String> = apart
        .map(|DatasetAgain { name, .. }| {
            format!("the run of all methods on {name} with its table and its report, since {why}")
        })
        .collect();
    if missing.is_empty() && datasets.len() > 1 {
        missing.push(
            "the table and the report of all datasets together, since no single command runs all of them; each has its own"
                .to_owned(),
        );
    }
    missing
}

/// The built-in scene that a dataset without an import is, all frames of it in their size.
fn rendered(facts: &DatasetFacts) -> Option<&'static Scene> {
    scene_of(facts).filter(|scene| {
        let size = (scene.size.width, scene.size.height);
        scene.frames as usize == facts.frames && facts.resolution == Some(size)
    })
}

/// How to make a dataset that is fewer frames of a built-in scene, or has another size, which no command makes.
fn rendered_in_part(facts: &DatasetFacts) -> Option<String> {
    if !facts.import.is_empty() || rendered(facts).is_some() {
        return None;
    }
    let (name, frames) = (scene_of(facts)?.name, facts.frames);
    let (width, height) = facts.resolution?;
    Some(format!(
        "the dataset {name}, which Python makes: \
         matchbench.rendered_scene(\"{name}\", FOLDER, frames={frames}, size=({width}, {height}))"
    ))
}

fn scene_of(facts: &DatasetFacts) -> Option<&'static Scene> {
    let by_this_renderer = format!("rendered by matchbench, revision {REVISION}:");
    let named = |scene: &&Scene| scene.name == facts.name;
    facts
        .origin
        .starts_with(&by_this_renderer)
        .then(|| scenes().iter().find(named))?
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
    use serde_json::json;

    use super::super::names::defaults;
    use super::super::tests;
    use super::*;
    use crate::metrics::Portion;
    use crate::records::IN_PYTHON;

    /// What is said of a run of two sources of files, where the second one's first pixel has its centre here.
    fn of_files(center: f64) -> Again {
        let best = json!([{"id": "best", "params": defaults("best")}]);
        let source = |id: &str, center: f64| {
            json!({"id": id, "estimators": best, "params": {"datasets": [{
                "name": "kitchen", "format": "npz", "pixel_center": center, "verified": false,
                "files": [{"name": "kitchen", "count": 9, "blake3": "00"}],
            }]}})
        };
        of_two(&json!([source("a", 0.0), source("b", center)]))
    }

    /// What is said of a run of the matchers `a` and `b`.
    fn of_two(matchers: &serde_json::Value) -> Again {
        let plan = json!({
            "version": "0.1.0",
            "settings": {"seed": 7, "repetitions": 1, "limit": null},
            "datasets": [
                {"name": "kitchen", "path": "/x/kitchen", "frames": 3, "pairs": 3, "fingerprint": "ab"},
            ],
            "matchers": matchers,
        });
        let mut content = tests::content(&[("kitchen", "a", 6), ("kitchen", "b", 2)]);
        content.facts.plan = Some(plan.to_string());
        Again::of(&content)
    }

    #[test]
    fn matches_from_files_have_a_place_that_the_script_names() {
        let script = of_files(0.0).script();
        let run = "\nmatchbench run kitchen --matches a=MATCHES/a/kitchen --matches b=MATCHES/b/kitchen --matches-format npz";
        for said in [
            "# Computes the report again",
            "\n# Needs the files with the matches of a in MATCHES/a/kitchen; their hashes are in the plan.\n",
            run,
            "\nmatchbench report again-kitchen\n",
        ] {
            assert!(script.contains(said), "{said}: {script}");
        }
        assert!(!script.contains("Not computed"), "{script}");
    }

    #[test]
    fn a_part_of_a_scene_and_data_of_the_same_name_are_no_wrong_command() {
        let script = |name: &str, frames, resolution, import: &[&str]| {
            let best = json!([{"id": "best", "params": defaults("best")}]);
            let plan = json!({
                "version": "0.1.0", "settings": {"seed": 7, "repetitions": 1, "limit": null},
                "datasets": [{"name": name, "path": "/x", "frames": 3, "pairs": 3, "fingerprint": "ab"}],
                "matchers": [{"id": "sift", "params": {}, "estimators": best}],
            });
            let mut content = tests::content(&[(name, "sift", 6)]);
            content.facts.plan = Some(plan.to_string());
            content.datasets = vec![DatasetFacts {
                name: name.into(),
                portion: Portion::Other,
                frames,
                pairs: 3,
                resolution: Some(resolution),
                origin: format!("rendered by matchbench, revision {REVISION}: a facade"),
                property: String::new(),
                import: import.iter().map(ToString::to_string).collect(),
                thumbnail: None,
            }];
            Again::of(&content).script()
        };
        let facade = scenes()
            .iter()
            .find(|scene| scene.name == "facade")
            .unwrap();
        let (frames, size) = (
            facade.frames as usize,
            (facade.size.width, facade.size.height),
        );
        let import = "\nmatchbench import rendered facade facade\n";
        assert!(script("facade", frames, size, &[]).contains(import));
        for (frames, size) in [(6, size), (frames, (320, 240))] {
            let text = script("facade", frames, size, &[]);
            assert!(!text.contains("import rendered"), "{text}");
            assert!(text.contains(
                "# Needs the dataset facade, which Python makes: matchbench.rendered_scene"
            ));
        }
        let text = script("boat", 6, size, &["oxford", "boat"]);
        assert!(
            text.contains("\nmatchbench import oxford original/boat boat\n"),
            "{text}"
        );
    }

    #[test]
    fn code_in_python_has_no_command() {
        let best = json!([{"id": "best", "params": defaults("best")}]);
        let in_python = json!({"id": "a", "version": "code 1f", "params": {}, "estimators": best, "notes": [IN_PYTHON]});
        let program = json!({"id": "b", "version": "1.2", "params": {}, "estimators": best});
        let script = of_two(&json!([in_python, program])).script();
        for said in [
            "\n# Needs the code of a in Python (code 1f), which `matchbench.run` runs.\n",
            "since a matcher is written in Python",
            "# kitchen, b + best  (needs the program 1.2 and its manifest, b.toml): matchbench run",
        ] {
            assert!(script.contains(said), "{said}: {script}");
        }
        assert!(!script.contains("a.toml"), "{script}");
    }

    #[test]
    fn the_script_says_what_it_does_not_compute() {
        let again = of_files(0.5);
        let script = again.script();
        let head = "# Computes results of the report again";
        let told = "# Not computed: the run of all methods on kitchen with its table and its report, since";
        assert!(script.contains(head) && script.contains(told), "{script}");
        assert!(!script.contains("\nmatchbench run"), "{script}");
        assert!(!script.contains("\n\n\n"), "{script}");
        let alone = again.datasets[0].cells[1].run.as_deref();
        assert!(alone.is_some_and(|run| run.contains("b=MATCHES/b/kitchen")));
        let dataset = |name: &str| DatasetAgain {
            name: name.into(),
            whole: vec!["a command".into()],
            ..DatasetAgain::default()
        };
        let both = missing(&[dataset("a"), dataset("b")], "it cannot");
        assert!(both[0].starts_with("the table and the report of all datasets together"));
        assert_eq!(missing(&[dataset("a")], "it cannot"), [""; 0]);
    }

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
        let mut coded = Again::default();
        coded.datasets.push(DatasetAgain {
            name: "room".into(),
            cells: vec![CellAgain {
                method: "mine + best".into(),
                run: None,
                note: "needs its code".into(),
            }],
            ..DatasetAgain::default()
        });
        let script_of_code = coded.script();
        assert!(
            script_of_code.ends_with("\n# room, mine + best: needs its code\n"),
            "{script_of_code}"
        );
        let limited = script(true);
        assert!(!limited.contains("to the last digit"), "{limited}");
        assert!(limited.contains("only if machines are equally fast"));
    }
}
