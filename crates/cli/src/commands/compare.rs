//! `matchbench compare`: what changed between two runs.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use anyhow::{Result, ensure};
use matchbench::metrics::{Bootstrap, Comparison, ResultSet, Score, compare, load};
use matchbench::records::{DatasetPlan, RunFolder};
use matchbench::report::advantage;

use crate::Ending;
use crate::args::CompareArgs;
use crate::output::harmless;

pub(crate) fn run(args: &CompareArgs) -> Result<Ending> {
    let before = load(&args.before, None)?;
    let after = load(&args.after, None)?;
    same_truth(&args.before, &args.after)?;
    let name = |set: &ResultSet| {
        (
            set.dataset.clone(),
            set.matcher.clone(),
            set.estimator.clone(),
        )
    };
    let mut rows = Vec::new();
    let mut alone = Vec::new();
    for set in &after {
        match before.iter().find(|other| name(other) == name(set)) {
            Some(other) => rows.push((set, compare(other, set, &Bootstrap::default()))),
            None => alone.push((set, &args.after)),
        }
    }
    for set in &before {
        if !after.iter().any(|other| name(other) == name(set)) {
            alone.push((set, &args.before));
        }
    }
    ensure!(
        !rows.is_empty(),
        "{} and {} have no matcher with the same estimator on the same dataset in common",
        args.before.display(),
        args.after.display()
    );
    let mut text = table(&rows);
    text.push('\n');
    let [before, after] = [&args.before, &args.after].map(|run| run.display().to_string());
    for (set, comparison) in &rows {
        let on = format!("{} with {} + {}", set.dataset, set.matcher, set.estimator);
        let _ = writeln!(text, "{}", advantage(&after, &before, &on, &comparison.auc));
    }
    for (set, run) in alone {
        let _ = writeln!(
            text,
            "{} with {} on {} is only in {}",
            set.matcher,
            set.estimator,
            set.dataset,
            run.display()
        );
    }
    std::io::stdout().write_all(harmless(&text).as_bytes())?;
    Ok(Ending::Done)
}

/// Errors about other truths are not compared: datasets of one name must be one dataset.
fn same_truth(before: &Path, after: &Path) -> Result<()> {
    if !(RunFolder::is_at(before) && RunFolder::is_at(after)) {
        return Ok(());
    }
    let [of_before, of_after] = [RunFolder::open(before)?, RunFolder::open(after)?];
    for dataset in &of_after.plan().datasets {
        let same_name = |other: &&DatasetPlan| other.name == dataset.name;
        if let Some(other) = of_before.plan().datasets.iter().find(same_name) {
            ensure!(
                other.fingerprint == dataset.fingerprint,
                "{} and {} ran on different datasets called {}: cameras, pairs or true poses differ",
                before.display(),
                after.display(),
                dataset.name
            );
        }
    }
    Ok(())
}

/// One line for each matcher, estimator and dataset that both runs have.
fn table(rows: &[(&ResultSet, Comparison)]) -> String {
    let heads = [
        "dataset",
        "matcher",
        "estimator",
        "pairs",
        "before",
        "after",
        "change",
        "95 % interval",
        "rotation",
        "translation",
        "gained",
        "lost",
        "changed",
        "",
    ];
    let mut lines = vec![heads.map(str::to_owned)];
    lines.extend(rows.iter().map(|(set, c)| {
        let number = |value: Option<f64>| value.map_or_else(|| "–".into(), |v| format!("{v:.3}"));
        [
            set.dataset.clone(),
            set.matcher.clone(),
            set.estimator.clone(),
            c.pairs.to_string(),
            number(c.before),
            number(c.after),
            signed(c.auc.value),
            interval(&c.auc),
            signed(c.rotation_auc.value),
            signed(c.translation_auc.value),
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
                0..=2 | 13 => format!("{cell:<width$}"),
                _ => format!("{cell:>width$}"),
            })
            .collect();
        let _ = writeln!(text, "{}", cells.join("  ").trim_end());
    }
    text.push_str(
        "\nchange: of the AUC, on the pairs that both runs have, with the paired interval (reference \
         images resampled);\ngained and lost: pairs below 5 degrees after but not before, and the \
         reverse; changed: pairs with another result.\nOf homographies it is the area under recall up \
         to 3 pixels of corner error, and pairs are below these.\n",
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
        Some(0.0) if never_moves => "same AUC",
        Some(change) if comparison.is_certain() && change > 0.0 => "better",
        Some(_) if comparison.is_certain() => "worse",
        _ => "not certain",
    }
}

fn signed(value: Option<f64>) -> String {
    value.map_or_else(|| "–".into(), |value| format!("{value:+.3}"))
}

fn interval(score: &Score) -> String {
    score.interval.map_or_else(
        || "–".into(),
        |interval| format!("{:+.3} to {:+.3}", interval.low, interval.high),
    )
}
