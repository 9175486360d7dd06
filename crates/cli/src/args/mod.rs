//! The arguments of the command line. Parsing only; the work of each subcommand is in `commands/`.

mod data;
mod results;
mod runs;

use std::num::NonZeroU64;
use std::path::PathBuf;

use clap::builder::{PathBufValueParser, PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{ArgGroup, Args, Parser, Subcommand, ValueEnum};
use matchbench::estimators::ESTIMATORS;
use matchbench::matchers::MATCHERS;
use matchbench::protocols::PROTOCOLS;

pub(crate) use data::{ConvertArgs, Images, ImportArgs, ValidateArgs};
pub(crate) use results::{
    CompareArgs, EvalArgs, ExportArgs, FormatArg, LeaderboardArgs, PresetArg, ReportArgs,
    ScoredArgs,
};
pub(crate) use runs::{
    CheckArgs, ChoiceArgs, DemoArgs, JoinArgs, MatchesArgs, MergeArgs, PaperArgs, PlanArgs,
    RunArgs, ShowArgs, TimeArgs, TuneArgs, WorkArgs,
};

/// Which feature matcher should I use?
///
/// matchbench runs feature matchers on pairs of images with known cameras, estimates the relative pose from the
/// matches, and compares it with the truth. It shows how many right poses each matcher leads to, with how many
/// matches, and in what time.
#[derive(Debug, Parser)]
#[command(name = "matchbench", version, arg_required_else_help = true, after_help = FIRST_STEPS)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

const FIRST_STEPS: &str = "\
First steps:
  matchbench demo                                        a first report, on built-in data
  matchbench import tum rgbd_dataset_freiburg3_... office --pairs window:9,stride:15
  matchbench validate office                             are the data sound?
  matchbench run office --matchers sift --out runs/first
  matchbench eval runs/first                             the scores

Exit codes: 0 done; 1 error; 2 some tasks failed, or problems were found; 130 stopped by Ctrl-C.";

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run five matchers on built-in scenes and write a report: the quickest way to see what this program does
    Demo(DemoArgs),
    /// Make a dataset from published data sets and pair lists, a COLMAP model or your own data
    Import(ImportArgs),
    /// Write a dataset in the layout of another tool
    Convert(ConvertArgs),
    /// Run matchers on datasets; can be stopped and resumed at any time
    Run(RunArgs),
    /// Reproduce the paper: its sequences and matchers, its tables and figures
    Paper(PaperArgs),
    /// Split a run into shards, for many machines
    Plan(PlanArgs),
    /// Run one shard of a plan; can be stopped and resumed at any time
    Work(WorkArgs),
    /// Merge all shards of a plan into one run
    Merge(MergeArgs),
    /// Join runs of different matchers, estimators or datasets, from one machine or several, into one run
    Join(JoinArgs),
    /// Choose a parameter of an estimator, on other scenes than those that will be reported
    Tune(TuneArgs),
    /// Score a run, or results in the format of the paper's authors
    Eval(EvalArgs),
    /// Write the report of a run: a page to look at, figures and tables
    Report(ReportArgs),
    /// Rank the runs and results of many people on one page, with intervals
    Leaderboard(LeaderboardArgs),
    /// Draw one pair: both images, the matches by their true error, epipolar lines
    Show(ShowArgs),
    /// Measure how long matchers take, by the paper's protocol
    Time(TimeArgs),
    /// Say what changed between two runs, or how two methods differ, with intervals and pictures
    Compare(CompareArgs),
    /// Write a run's poses in the format of the paper's authors, or its matches for other tools
    Export(ExportArgs),
    /// Show what is available, with its parameters
    List(ListArgs),
    /// Check a dataset; report problems by file and line, and say how to correct them
    Validate(ValidateArgs),
    /// Try out a matcher from outside; report in words what is wrong with it
    Check(CheckArgs),
    /// Print the completion script for a shell
    Completions(CompletionsArgs),
    /// Print the manual page, or write the manual pages of all commands
    Man(ManArgs),
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  matchbench list estimators
  matchbench list sift          # what each parameter of SIFT means
  matchbench list superglue     # how this protocol evaluates")]
pub(crate) struct ListArgs {
    /// `matchers`, `estimators`, `protocols`, `datasets` (built-in ones, and the kinds that can be imported) or
    /// `formats` (of files of matches) [default: all]; or the id of a matcher, an estimator or a protocol, to read
    /// what it does and what each of its parameters means
    #[arg(value_parser = listed(), hide_possible_values = true)]
    pub what: Option<String>,
}

/// What can be listed: whole lists, and the matchers, estimators and protocols in them.
fn listed() -> PossibleValuesParser {
    let lists = (Listed::value_variants().iter()).filter_map(ValueEnum::to_possible_value);
    let ids = (MATCHERS.iter().map(|matcher| matcher.id()))
        .chain(ESTIMATORS.iter().map(|estimator| estimator.id()))
        .chain(PROTOCOLS.iter().map(|protocol| protocol.id));
    lists.chain(ids.map(PossibleValue::new)).into()
}

/// The lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Listed {
    Matchers,
    Estimators,
    Protocols,
    Datasets,
    Formats,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  matchbench completions bash > ~/.local/share/bash-completion/completions/matchbench
  matchbench completions zsh > ~/.zfunc/_matchbench")]
pub(crate) struct CompletionsArgs {
    /// The shell
    #[arg(value_enum, value_name = "SHELL")]
    pub shell: clap_complete::Shell,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  matchbench man | man -l -
  matchbench man --out ~/.local/share/man/man1")]
pub(crate) struct ManArgs {
    /// Folder for matchbench.1 and a page for each command [default: matchbench.1 to standard output]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Arguments of which one must be given: the message names all if none is.
fn one_of(group: &'static str, arguments: [&'static str; 2]) -> ArgGroup {
    let group = ArgGroup::new(group).args(arguments);
    group.required(true).multiple(true)
}

/// The folder of a run, which may be named by its `plan.json` too, as that of a plan of shards may.
fn run_folder() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().map(|path: PathBuf| match path.parent() {
        Some(folder) if path.ends_with("plan.json") && path.is_file() => {
            if folder.as_os_str().is_empty() {
                ".".into()
            } else {
                folder.to_owned()
            }
        }
        _ => path,
    })
}

/// A number that must be at least 1.
fn from_one<N: TryFrom<NonZeroU64>>(text: &str) -> Result<N, String> {
    let number: Result<NonZeroU64, _> = text.parse();
    let number = number.map_err(|_| "give a whole number from 1 on")?;
    N::try_from(number).map_err(|_| "give a smaller number".to_owned())
}

/// A part of a list without the blanks that stand beside commas.
fn trimmed(text: &str) -> Result<String, &'static str> {
    match text.trim() {
        "" => Err(
            "commas separate nothing here; write a,b without blanks, or put all of it in quotes",
        ),
        part => Ok(part.to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use std::ffi::OsStr;

    use clap::CommandFactory;

    use super::*;

    #[test]
    fn arguments_are_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn a_run_may_be_named_by_its_plan() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let plan = folder.path().join("plan.json");
        let asked = |path: &std::path::Path| {
            let words = [
                OsStr::new("matchbench"),
                OsStr::new("eval"),
                path.as_os_str(),
            ];
            match Cli::try_parse_from(words).expect("a path").command {
                Command::Eval(args) => args.results,
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(asked(&plan).as_deref(), Some(&*plan), "it is not there");
        std::fs::write(&plan, "{}").expect("writable");
        assert_eq!(asked(&plan).as_deref(), Some(folder.path()));
    }

    /// Parses every line of `text` that begins with the name of the program; each must be valid.
    fn assert_understood(text: &str, place: &str) -> usize {
        let commands = text
            .lines()
            .map(str::trim)
            .filter(|line| line.starts_with("matchbench "));
        commands
            .map(|line| {
                let words = line
                    .split_whitespace()
                    .take_while(|word| !word.starts_with(['#', '>', '|']));
                if let Err(error) = Cli::try_parse_from(words) {
                    assert!(!error.use_stderr(), "{place}: {line}\n{error}");
                }
            })
            .count()
    }

    /// Splits a line into words as a shell does; only single quotes are supported.
    fn words(line: &str) -> Vec<String> {
        let mut words = vec![String::new()];
        let (mut quoted, mut characters) = (false, line.chars());
        while let Some(c) = characters.next() {
            let word = words.last_mut().expect("there is one from the start");
            match c {
                '\'' => quoted = !quoted,
                '\\' if !quoted => word.extend(characters.next()),
                ' ' if !quoted => words.push(String::new()),
                c => word.push(c),
            }
        }
        assert!(!quoted, "{line}");
        words
    }

    #[test]
    fn commands_that_a_report_prints_are_understood() {
        use matchbench::report::{Content, DatasetFacts, RunFacts, bundled, write_report};
        let folder = tempfile::tempdir().expect("a temporary folder");
        let plan = include_str!("../../tests/plans/every_origin.json");
        let facts = |plan: Option<&str>, results: &[&str]| RunFacts {
            plan: plan.map(str::to_owned),
            results: results.iter().map(|word| (*word).to_owned()).collect(),
            ..RunFacts::default()
        };
        for (facts, least) in [
            (facts(Some(plan), &[]), 12),
            (
                facts(
                    None,
                    &["my results", "--datasets", "it's", "--pairs", "window:9"],
                ),
                2,
            ),
        ] {
            let mut content = Content::new(Vec::new(), facts);
            content.datasets.push(DatasetFacts {
                name: "it's; rm x".into(),
                portion: matchbench::metrics::Portion::Other,
                frames: 3,
                pairs: 3,
                resolution: None,
                origin: "a\nmatchbench nonsense".into(),
                property: String::new(),
                import: ["tum", "my desk", "--pairs", "all"]
                    .map(String::from)
                    .to_vec(),
                thumbnail: None,
            });
            write_report(folder.path(), &content).expect("it is ours");
            let script = std::fs::read_to_string(folder.path().join("cite/commands.sh"));
            let script = script.expect("it was written");
            let mut found = Vec::new();
            for line in script.lines() {
                let Some(at) = line
                    .find("matchbench ")
                    .filter(|_| !line.contains("fingerprint"))
                else {
                    continue;
                };
                let is_command = !line.starts_with('#') || line[..at].ends_with(": ");
                if is_command {
                    let words = words(&line[at..]);
                    if let Err(error) = Cli::try_parse_from(&words) {
                        panic!("{line}\n{words:?}\n{error}");
                    }
                    found.push(line[at..].to_owned());
                }
            }
            assert!(found.len() >= least, "{script}");
            // The page prints the same.
            let page = bundled(&content).expect("it is small");
            let page = page
                .replace("&#x27;", "'")
                .replace("&#x2f;", "/")
                .replace("&quot;", "\"");
            for command in found {
                assert!(page.contains(&command), "{command}");
            }
        }
    }

    #[test]
    fn commands_in_the_readme_and_in_the_book_are_understood() {
        let repository = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
        for (page, least) in [
            ("README.md", 2),
            ("crates/cli/README.md", 2),
            ("docs/tutorial.md", 8),
            ("docs/matchers.md", 9),
            ("docs/estimators.md", 2),
            ("docs/paper.md", 4),
            ("docs/scale.md", 5),
            ("docs/protocol.md", 4),
            ("docs/report.md", 5),
            ("docs/leaderboard.md", 2),
            ("docs/formats.md", 2),
            ("docs/results.md", 6),
            ("adapters/README.md", 3),
        ] {
            let text = std::fs::read_to_string(format!("{repository}/{page}"));
            let text = text.expect("it is part of the repository");
            let blocks = text.split("```").skip(1).step_by(2);
            let shell = blocks.filter_map(|block| block.strip_prefix("sh\n"));
            let count: usize = shell.map(|block| assert_understood(block, page)).sum();
            assert!(count >= least, "{page}: {count} commands");
        }
    }

    #[test]
    fn help_fits_the_lines_that_it_is_written_in() {
        for command in Cli::command().get_subcommands() {
            let notes = command.get_after_help().map(ToString::to_string);
            for line in notes.unwrap_or_default().lines() {
                let width = line.chars().count();
                // Where it is wider, lines are broken again, each after its first words.
                assert!(width <= 100, "{}: {width}: {line}", command.get_name());
            }
        }
    }

    #[test]
    fn options_of_files_stand_under_their_heading_alone() {
        for (name, other) in [
            ("run", "estimator"),
            ("plan", "estimator"),
            ("tune", "values"),
        ] {
            let command = Cli::command();
            let command = command.find_subcommand(name).expect("it is one");
            let under = |id: &str| {
                let mut all = command.get_arguments();
                let argument = all.find(|argument| argument.get_id() == id);
                argument.expect("it is one").get_help_heading().is_some()
            };
            assert!(under("matches") && under("note"), "{name}");
            assert!(!under("out") && !under(other), "{name}");
        }
    }

    #[test]
    fn examples_in_the_help_are_understood() {
        let mut count = 0;
        for command in Cli::command().get_subcommands() {
            let mut command = command.clone().term_width(0);
            let help = command.render_long_help().to_string();
            let examples = help
                .split_once("Examples:")
                .map_or("", |(_, examples)| examples);
            count += assert_understood(examples, command.get_name());
        }
        assert!(count >= 10, "{count} examples");
    }
}
