//! `matchbench eval`: prints the scores of a run, or of results in the authors' layout.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use matchbench::counted::counted;
use matchbench::datasets::{DatasetError, Frame, PairRule};
use matchbench::exchange::is_of_absent_pairs;
use matchbench::metrics::{
    Failure, PairChoice, ResultSet, Unfinished, doubts, frames_at_hand, is_without_sign, load,
    load_chosen, load_errors, load_run, under_protocols,
};
use matchbench::protocols;
use matchbench::records::{MatcherPlan, Plan, RunFolder};
use matchbench::report::{
    Content, Format, RunFacts, render_protocols, render_protocols_with_intervals, render_with_mean,
    verdicts,
};

use crate::Ending;
use crate::args::{EvalArgs, FormatArg, PresetArg, ScoredArgs};
use crate::output::{harmless, say, stdout, typed, write_result};

pub(crate) fn run(args: &EvalArgs) -> Result<Ending> {
    let text = match (&args.errors, &args.results) {
        _ if !args.protocol.is_empty() => by_protocols(args)?,
        (Some(errors), _) => {
            let sets = load_errors(errors)?;
            warn_of_lost_signs(&sets);
            let content = content(sets);
            if args.intervals {
                with_intervals(args, &content)?
            } else {
                render_with_mean(args.format.into(), &content.summaries)
            }
        }
        (None, Some(results)) => {
            let Loaded {
                sets,
                run,
                unfinished,
            } = loaded(&args.scored, results)?;
            let mut content = content(sets);
            if let Some(run) = &run {
                content.take_lacking(run, unfinished);
            }
            match args.format {
                _ if args.intervals => with_intervals(args, &content)?,
                FormatArg::Table => {
                    let mut text = table(&content);
                    if run.is_some() {
                        let next = format!("\nNext: matchbench report {}\n", typed(results));
                        text.push_str(&next);
                    }
                    text
                }
                other => content.render(other.into()),
            }
        }
        (None, None) => unreachable!("one of the two is required"),
    };
    let mut out = stdout();
    match &args.out {
        Some(path) => write_result(path, text.as_bytes())?,
        None => out.write_all(text.as_bytes()).and_then(|()| out.flush())?,
    }
    Ok(Ending::Done)
}

/// Results that were asked for.
struct Loaded {
    sets: Vec<ResultSet>,
    /// The run that they are of, unless they are in the authors' format, and what it has not recorded yet.
    run: Option<RunFolder>,
    unfinished: Option<Unfinished>,
}

/// Loads results; warns of what is missing or looks wrong in them.
fn loaded(args: &ScoredArgs, results: &Path) -> Result<Loaded> {
    let choice = choice(args)?;
    let sets = load_chosen(results, args.datasets.as_deref(), &choice)?;
    let run = run_at(results)?;
    let unfinished = warn_of_unfinished(results, run.as_ref(), &sets)?;
    warn_of_ignored(results, &sets, &choice);
    warn_of_strangers(&sets, &choice, |dataset| {
        frames_at_hand(dataset, args.datasets.as_deref(), run.as_ref())
    })?;
    if let Some(run) = &run {
        warn_of_doubts(run, &sets)?;
    }
    Ok(Loaded {
        sets,
        run,
        unfinished,
    })
}

/// The run that results are of, unless they are in the authors' format.
pub(super) fn run_at(results: &Path) -> Result<Option<RunFolder>> {
    let run = RunFolder::is_at(results).then(|| RunFolder::open(results));
    Ok(run.transpose()?)
}

/// The table with an interval behind each AUC.
fn with_intervals(args: &EvalArgs, content: &Content) -> Result<String> {
    content.render_with_intervals(args.format.into()).context(
        "--intervals is for --format latex and markdown; csv and json have intervals without it",
    )
}

/// The scores by evaluation protocols.
fn by_protocols(args: &EvalArgs) -> Result<String> {
    let asked = protocols::find_all(&args.protocol)?;
    let mut content = Content::default();
    let (sets, run) = match (&args.errors, &args.results) {
        (Some(errors), _) => {
            let sets = load_errors(errors)?;
            // The scores of all other protocols take an opposite direction as right.
            if asked.iter().any(|protocol| protocol.is_ours()) {
                warn_of_lost_signs(&sets);
            }
            (sets, None)
        }
        (None, Some(results)) => {
            let Loaded {
                sets,
                run,
                unfinished,
            } = loaded(&args.scored, results)?;
            if let Some(run) = &run {
                content.take_lacking(run, unfinished);
            }
            (sets, run)
        }
        (None, None) => unreachable!("one of the two is required"),
    };
    let plan = run.as_ref().map(RunFolder::plan);
    let scores = under_protocols(&sets, plan, &asked);
    let format = args.format.into();
    let table = if args.intervals {
        render_protocols_with_intervals(format, &scores).context(
            "--intervals is for --format table, markdown and latex of protocols; csv and json have intervals without it",
        )?
    } else {
        render_protocols(format, &scores)
    };
    Ok(content.noted(format, table))
}

/// Warns of tables of errors in which an opposite direction counts as right, since the paper's scores know the sign.
fn warn_of_lost_signs(sets: &[ResultSet]) {
    let lost: Vec<&str> = (sets.iter())
        .filter(|set| is_without_sign(set))
        .map(|set| &*set.dataset)
        .collect();
    if !lost.is_empty() {
        say!(
            "warning: {}: many poses are wrong, but no direction by more than 90 degrees, so an opposite one seems to count as \
             right; compare exact AUC and mAA with those of others, not AUC and SP",
            lost.join(", ")
        );
    }
}

/// Warns if a run has fewer or more records than it planned, or if there are fewer results than listed pairs. `run` is the one
/// that the `results` are of, if they are of one; returns what it lacks.
pub(super) fn warn_of_unfinished(
    results: &Path,
    run: Option<&RunFolder>,
    sets: &[ResultSet],
) -> Result<Option<Unfinished>> {
    let mut unfinished = None;
    if let Some(run) = run {
        warn_of_absent(results, run.plan(), sets);
        unfinished = warn_of_unrecorded(run, sets)?;
    }
    for set in sets {
        warn_of_missing(results, set);
    }
    Ok(unfinished)
}

/// Warns if a run has fewer or more records than it planned; returns what it lacks.
pub(super) fn warn_of_unrecorded(
    run: &RunFolder,
    sets: &[ResultSet],
) -> Result<Option<Unfinished>> {
    let unfinished = Unfinished::of(run, sets)?;
    for sentence in unfinished.iter().flat_map(|lacks| &lacks.sentences) {
        say!("warning: {}: {sentence}", run.path().display());
    }
    Ok(unfinished)
}

/// Warns if files of matches lack pairs that were run, which count as wrong.
fn warn_of_absent(results: &Path, plan: &Plan, sets: &[ResultSet]) {
    let has_broken = |matcher: &MatcherPlan| {
        let own = sets.iter().filter(|set| set.matcher == matcher.id);
        own.flat_map(|set| &set.pairs)
            .any(|pair| pair.outcome == Err(Failure::Broken))
    };
    for matcher in plan.matchers.iter().filter(|matcher| has_broken(matcher)) {
        for note in matcher.notes.iter().filter(|note| is_of_absent_pairs(note)) {
            say!("warning: {}: {}: {note}", results.display(), matcher.id);
        }
    }
}

/// Warns if listed pairs have no result.
pub(super) fn warn_of_missing(results: &Path, set: &ResultSet) {
    match set.missing() {
        0 => {}
        missing => say!(
            "warning: {}: no result with {} for {missing} of {} of {}, counted as wrong",
            results.display(),
            set.method(),
            counted(set.pairs.len(), "pair"),
            set.dataset
        ),
    }
}

/// Warns if there are results for pairs that are not listed, unless fewer pairs were asked for.
fn warn_of_ignored(results: &Path, sets: &[ResultSet], choice: &PairChoice) {
    let ignored = |set: &&ResultSet| set.ignored > 0 && *choice == PairChoice::Listed;
    for set in sets.iter().filter(ignored) {
        say!(
            "warning: {}: ignored: {} of {} for pairs that {} does not list in this order",
            results.display(),
            counted(set.ignored, "result"),
            set.method(),
            set.dataset
        );
    }
}

/// Warns if a list of pairs has some that no results are of. If it names images, the `frames` of each dataset have them.
fn warn_of_strangers(
    sets: &[ResultSet],
    choice: &PairChoice,
    frames: impl Fn(&str) -> Result<Option<Vec<Frame>>, DatasetError>,
) -> Result<()> {
    let PairChoice::Rule(rule) = choice else {
        return Ok(());
    };
    let mut scored = BTreeMap::<&str, BTreeSet<(u32, u32)>>::new();
    for set in sets {
        let pairs = set.pairs.iter().map(|pair| (pair.a, pair.b));
        scored.entry(&set.dataset).or_default().extend(pairs);
    }
    // By their lines, since one pair of names may have other numbers in each dataset.
    let mut strangers: Option<Vec<Option<(u32, u32)>>> = None;
    for (dataset, scored) in scored {
        let Some(listed) = rule.list(|| frames(dataset))? else {
            return Ok(());
        };
        let here = strangers.get_or_insert_with(|| listed.iter().copied().map(Some).collect());
        for (stranger, pair) in here.iter_mut().zip(&listed) {
            *stranger = stranger.filter(|_| !scored.contains(pair));
        }
    }
    let mut strangers = strangers.into_iter().flatten().flatten();
    if let Some((a, b)) = strangers.next() {
        let all = counted(1 + strangers.count(), "pair");
        say!("warning: --pairs {rule}: there are no results of {all} of it, the first {a} {b}");
    }
    Ok(())
}

/// Warns if the truth of a dataset of a run cannot be right, as far as its poses tell.
fn warn_of_doubts(run: &RunFolder, sets: &[ResultSet]) -> Result<()> {
    for sentence in doubts(run, sets)? {
        say!("warning: {}: {sentence}", run.path().display());
    }
    Ok(())
}

/// Which of the listed pairs are asked for.
pub(crate) fn choice(args: &ScoredArgs) -> Result<PairChoice> {
    Ok(match (args.preset, &args.pairs) {
        (Some(PresetArg::Paper), _) => PairChoice::Paper,
        (None, Some(rule)) => {
            let rule: PairRule = rule.parse()?;
            ensure!(
                rule.stride() == 1,
                "--pairs {rule}: the images of results are numbered after the stride; leave it out"
            );
            PairChoice::Rule(rule)
        }
        (None, None) => PairChoice::Listed,
    })
}

/// Prints the table of scores of a run, and which method is best on each dataset.
pub(crate) fn print(run: &Path) -> Result<()> {
    print_sets(load(run, None)?)
}

/// The same; first warns if the truth of a dataset looks wrong.
pub(super) fn print_with_doubts(run: &Path) -> Result<()> {
    let run = RunFolder::open(run)?;
    let sets = load_run(&run, None)?;
    warn_of_doubts(&run, &sets)?;
    print_sets(sets)
}

fn print_sets(sets: Vec<ResultSet>) -> Result<()> {
    let text = harmless(&table(&content(sets)));
    std::io::stdout().write_all(text.as_bytes())?;
    Ok(())
}

/// The table of scores, and below it a sentence for each dataset: which method is best, and whether that is
/// significant.
fn table(content: &Content) -> String {
    let mut text = content.render(Format::Table);
    let verdicts = verdicts(&content.leads);
    if !verdicts.is_empty() {
        text.push('\n');
        text.push_str(&verdicts.join("\n"));
        text.push('\n');
    }
    text
}

fn content(sets: Vec<ResultSet>) -> Content {
    Content::new(sets, RunFacts::default())
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
