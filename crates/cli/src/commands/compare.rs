//! `matchbench compare`: what changed between two runs, or how two methods of one run differ.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail, ensure};
use matchbench::counted::counted;
use matchbench::metrics::{
    Comparison, Difference, MIN_IMAGES, ResultSet, compare, load, load_each,
};
use matchbench::records::{DatasetPlan, RunFolder};
use matchbench::report::{Duel, Side, advantage, fixed, p_value, signed, units, write_differences};

use super::eval::{run_at, warn_of_missing, warn_of_unfinished};
use crate::Ending;
use crate::args::CompareArgs;
use crate::output::{is_standard_output, say, stdout};

pub(crate) fn run(args: &CompareArgs) -> Result<Ending> {
    ensure!(
        args.after.is_some() || !args.matchers.is_empty(),
        "one run alone: give another as well, or two of its methods with --matchers FIRST,SECOND"
    );
    let after = args.after.as_ref().unwrap_or(&args.before);
    let sets = [load(&args.before, None)?, load(after, None)?];
    for (run, sets) in [&args.before, after].into_iter().zip(&sets) {
        ensure!(!sets.is_empty(), "{} has no results yet", run.display());
    }
    same_truth(&args.before, after)?;
    let (matches, alone) = match &args.matchers[..] {
        [] => same_methods(&sets),
        [first, second] => (
            methods(&sets, [first, second], args.before == *after)?,
            Vec::new(),
        ),
        _ => bail!("--matchers takes two methods, separated by a comma"),
    };
    ensure!(
        !matches.is_empty(),
        "{} and {} have no matcher with the same estimator on the same dataset in common",
        args.before.display(),
        after.display()
    );
    let rows: Vec<Row<'_>> = (matches.into_iter())
        .map(|[before, after]| Row {
            sets: [before, after],
            comparison: compare(before, after),
        })
        .collect();
    let runs = [&args.before, after];
    let sides = if args.matchers.is_empty() {
        ["before", "after"]
    } else {
        ["first", "second"]
    };
    let mut text = table(&rows, sides);
    text.push('\n');
    for (run, sets) in runs
        .into_iter()
        .zip(&sets)
        .take(if runs[0] == runs[1] { 1 } else { 2 })
    {
        // What is missing of other methods is reported below.
        if sets.iter().all(|set| set.missing() == 0) {
            warn_of_unfinished(run, run_at(run)?.as_ref(), sets)?;
        }
    }
    for (set, run) in rows.iter().flat_map(|row| row.sets.into_iter().zip(runs)) {
        warn_of_missing(run, set);
    }
    for row in &rows {
        warn_of_repetitions(runs, row);
    }
    let by_method = !args.matchers.is_empty();
    for row in &rows {
        let [before, after] = row.names(runs, by_method);
        let (on, auc) = (row.on(by_method), &row.comparison.auc);
        let _ = writeln!(text, "{}", advantage(&after, &before, &on, auc));
    }
    for (set, side) in alone {
        let _ = writeln!(
            text,
            "{} with {} on {} is only in {}",
            set.matcher,
            set.estimator,
            set.dataset,
            runs[side].display()
        );
    }
    stdout().write_all(text.as_bytes())?;
    if let Some(out) = &args.out {
        ensure!(
            !is_standard_output(out),
            "--out takes a folder: a comparison is a page with its pictures"
        );
        write_page(out, args, runs, &rows)?;
    }
    Ok(Ending::Done)
}

/// Says how many repetitions each side has, if they have not the same.
fn warn_of_repetitions(runs: [&PathBuf; 2], row: &Row<'_>) {
    let [before, after] = row.sets;
    if before.repetitions == after.repetitions {
        return;
    }
    let called =
        |set: &ResultSet| format!("{} with {} on {}", set.matcher, set.estimator, set.dataset);
    let has = |side: usize| {
        let times = counted(row.sets[side].repetitions, "repetition");
        format!("{times} in {}", runs[side].display())
    };
    let first = format!("{} has {}", called(before), has(0));
    let second = if called(before) == called(after) {
        has(1)
    } else {
        format!("{} has {}", called(after), has(1))
    };
    say!("note: {first} and {second}; those that both have are compared");
}

/// Writes the page of the pairs where they differ most.
fn write_page(out: &Path, args: &CompareArgs, runs: [&PathBuf; 2], rows: &[Row<'_>]) -> Result<()> {
    let [before, after] = runs.map(|run| RunFolder::open(run));
    let folders = [before?, after?];
    let by_method = !args.matchers.is_empty();
    let names: Vec<([String; 2], String)> = (rows.iter())
        .map(|row| (row.names(runs, by_method), row.on(by_method)))
        .collect();
    let duels: Vec<Duel<'_>> = (rows.iter().zip(&names))
        .map(|(row, (names, on))| Duel {
            sides: [0, 1].map(|side| Side {
                name: &names[side],
                run: &folders[side],
                results: row.sets[side],
            }),
            on,
            comparison: row.comparison,
        })
        .collect();
    let written = write_differences(out, &duels, args.pairs.get())?;
    for note in &written.notes {
        say!("note: {note}");
    }
    writeln!(stdout(), "{}", written.page.display())?;
    Ok(())
}

/// Two sets of results on one dataset.
struct Row<'a> {
    sets: [&'a ResultSet; 2],
    comparison: Comparison,
}

impl Row<'_> {
    /// The names of the two: their methods, their runs, or both, as far as these differ.
    fn names(&self, runs: [&PathBuf; 2], by_method: bool) -> [String; 2] {
        [0, 1].map(|side| {
            let (set, run) = (self.sets[side], runs[side].display());
            match (by_method, runs[0] == runs[1]) {
                (false, _) => run.to_string(),
                (true, true) => set.method(),
                (true, false) => format!("{} of {run}", set.method()),
            }
        })
    }

    /// What the two are compared on: their dataset, and their method unless their names are of methods.
    fn on(&self, by_method: bool) -> String {
        let set = self.sets[1];
        if by_method {
            set.dataset.clone()
        } else {
            format!("{} with {}", set.dataset, set.method())
        }
    }
}

/// The sets that both runs have, before and after, and those that only one run has, with the number of this
/// run.
fn same_methods(sets: &[Vec<ResultSet>; 2]) -> (Vec<[&ResultSet; 2]>, Vec<(&ResultSet, usize)>) {
    let name = |set: &ResultSet| {
        (
            set.dataset.clone(),
            set.matcher.clone(),
            set.estimator.clone(),
        )
    };
    let [before, after] = sets;
    let twin = |set: &ResultSet, others: &'_ [ResultSet]| {
        others.iter().position(|other| name(other) == name(set))
    };
    let mut both = Vec::new();
    let mut alone = Vec::new();
    for set in after {
        match twin(set, before) {
            Some(i) => both.push([&before[i], set]),
            None => alone.push((set, 1)),
        }
    }
    alone.extend(
        (before.iter())
            .filter(|set| twin(set, after).is_none())
            .map(|set| (set, 0)),
    );
    (both, alone)
}

/// The sets of two methods on each dataset that both were run on. They are compared with each estimator that
/// both have; or, if each has one estimator, with these.
fn methods<'a>(
    sets: &'a [Vec<ResultSet>; 2],
    named: [&str; 2],
    same_run: bool,
) -> Result<Vec<[&'a ResultSet; 2]>> {
    let mut found = [Vec::new(), Vec::new()];
    for ((found, sets), name) in found.iter_mut().zip(sets).zip(named) {
        let is_it = |set: &&ResultSet| {
            set.matcher == name || format!("{}+{}", set.matcher, set.estimator) == name
        };
        found.extend(sets.iter().filter(is_it));
        ensure!(
            !found.is_empty(),
            "no results of `{name}`; {}",
            match &known(sets)[..] {
                [] => "nothing is recorded yet".to_owned(),
                known => format!("there are {}", known.join(", ")),
            }
        );
    }
    let [first, second] = &found;
    let is_shared = |one: &&ResultSet| (second.iter()).any(|other| other.dataset == one.dataset);
    ensure!(
        first.iter().any(is_shared),
        "{} and {} have no dataset in common",
        named[0],
        named[1]
    );
    let mut pairs = Vec::new();
    let mut datasets: Vec<&str> = first.iter().map(|set| &*set.dataset).collect();
    datasets.dedup();
    for dataset in datasets {
        let on = |sets: &[&'a ResultSet]| -> Vec<&'a ResultSet> {
            sets.iter()
                .filter(|set| set.dataset == dataset)
                .copied()
                .collect()
        };
        let (first, second) = (on(first), on(second));
        if let ([one], [other]) = (&first[..], &second[..]) {
            pairs.push([*one, *other]);
            continue;
        }
        for one in &first {
            let same = second.iter().find(|other| other.estimator == one.estimator);
            pairs.extend(same.map(|other| [*one, *other]));
        }
    }
    ensure!(
        !pairs.is_empty(),
        "{} and {} have no dataset with the same estimator in common; name their estimators, as in {}+ESTIMATOR",
        named[0],
        named[1],
        named[0]
    );
    let is_of_one_kind = |[one, other]: &[&ResultSet; 2]| one.model() == other.model();
    if let Some([one, other]) = pairs.iter().find(|sets| !is_of_one_kind(sets)) {
        bail!(
            "of {} and {} one estimates poses and the other homographies, which are scored by other errors; name two \
             methods that estimate the same",
            one.method(),
            other.method()
        );
    }
    ensure!(
        !same_run
            || pairs
                .iter()
                .all(|[one, other]| one.method() != other.method()),
        "{} is compared with itself; name two methods",
        named[0]
    );
    Ok(pairs)
}

/// The names of methods, without repetition.
fn known(sets: &[ResultSet]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for set in sets {
        let name = format!("{}+{}", set.matcher, set.estimator);
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

/// Errors for different truths must not be compared, so datasets of the same name must be the same.
fn same_truth(before: &Path, after: &Path) -> Result<()> {
    if RunFolder::is_at(before) != RunFolder::is_at(after) {
        say!(
            "note: {} and {} do not tell whether they were judged by the same true poses, since only one is a run",
            before.display(),
            after.display()
        );
        return Ok(());
    }
    let of_before = truths(before)?;
    for (dataset, truth) in truths(after)? {
        ensure!(
            of_before.get(&dataset).is_none_or(|other| *other == truth),
            "{} and {} were judged by different datasets called {dataset}: cameras, pairs or true poses differ",
            before.display(),
            after.display()
        );
    }
    Ok(())
}

/// A hash of each dataset's truth, by its name.
fn truths(folder: &Path) -> Result<BTreeMap<String, String>> {
    if RunFolder::is_at(folder) {
        let run = RunFolder::open(folder)?;
        let of = |dataset: &DatasetPlan| (dataset.name.clone(), dataset.fingerprint.clone());
        return Ok(run.plan().datasets.iter().map(of).collect());
    }
    let files = load_each(folder, None)?.into_iter();
    Ok(files
        .filter_map(|file| Some((file.results.ok()?.dataset, file.truth?)))
        .collect())
}

/// One line for each matcher, estimator and dataset that both sides have, which are called so.
fn table(rows: &[Row<'_>], [before, after]: [&str; 2]) -> String {
    let heads = [
        "dataset",
        "matcher",
        "estimator",
        "pairs",
        before,
        after,
        "change",
        "95 % interval",
        "p",
        "rotation",
        "translation",
        "gained",
        "lost",
        "changed",
        "",
    ];
    let mut lines = vec![heads.map(str::to_owned)];
    let both = |row: &Row<'_>, name: fn(&ResultSet) -> &String| {
        let [before, after] = row.sets.map(name);
        if before == after {
            before.clone()
        } else {
            format!("{before}, {after}")
        }
    };
    lines.extend(rows.iter().map(|row| {
        let c = &row.comparison;
        let number = |value: Option<f64>| value.map_or_else(|| "–".into(), |v| fixed(v, 3));
        [
            row.sets[1].dataset.clone(),
            both(row, |set| &set.matcher),
            both(row, |set| &set.estimator),
            c.pairs.to_string(),
            number(c.before),
            number(c.after),
            change(c.auc.value),
            interval(&c.auc),
            p_value(c.auc.p_value),
            change(c.rotation_auc.value),
            change(c.translation_auc.value),
            c.gained.to_string(),
            c.lost.to_string(),
            c.changed.to_string(),
            verdict(c).to_owned(),
        ]
    }));
    let width = |column: usize| lines.iter().map(|line| line[column].chars().count()).max();
    let widths: Vec<usize> = (0..heads.len())
        .map(|column| width(column).unwrap_or(0))
        .collect();
    let mut text = String::new();
    for line in &lines {
        let cells: Vec<String> = (line.iter().zip(&widths).enumerate())
            .map(|(column, (cell, width))| match column {
                0..=2 | 14 => format!("{cell:<width$}"),
                _ => format!("{cell:>width$}"),
            })
            .collect();
        let _ = writeln!(text, "{}", cells.join("  ").trim_end());
    }
    let _ = write!(
        text,
        "\nchange: of the AUC, on the pairs that both have, with the paired 95 % interval (pairs that \
         share an image are not independent);\nbetter and worse: of {after}, where the interval leaves out 0, which is decided for each comparison \
         alone; there is none with fewer than {};\np: of the two-sided paired t test of the same, also for each \
         comparison alone;\ngained and lost: pairs below 5 degrees in {after} but not in {before}, and the \
         reverse; changed: pairs with another result.\nOf homographies it is the AUC of the corner error at \
         3 px, and pairs are below 3 px.\n",
        units(MIN_IMAGES)
    );
    text
}

fn verdict(comparison: &Comparison) -> &'static str {
    let score = &comparison.auc;
    let never_moves = score
        .interval
        .is_some_and(|i| i.low == 0.0 && i.high == 0.0);
    match score.value {
        _ if comparison.changed == 0 => "same",
        Some(_) if score.is_zero() && never_moves => "same AUC",
        Some(change) if score.is_certain && change > 0.0 => "better",
        Some(_) if score.is_certain => "worse",
        Some(_) if score.has_few_images() => "few images",
        _ => "not certain",
    }
}

fn change(value: Option<f64>) -> String {
    value.map_or_else(|| "–".into(), |value| signed(value, 3))
}

fn interval(score: &Difference) -> String {
    score.interval.map_or_else(
        || "–".into(),
        |interval| {
            let [low, high] = [interval.low, interval.high].map(|end| signed(end, 3));
            format!("{low} to {high}")
        },
    )
}
