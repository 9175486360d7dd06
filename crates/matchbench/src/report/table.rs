//! Aligned text for a terminal: one row per dataset, matcher and estimator.

use std::fmt::Write as _;

use crate::counted::counted;
use crate::metrics::{Detail, SCORES, ScoreKind, Summary, shown_scores};

use super::numbers::{interval, ratio, score};
use super::score_words::{definitions, protocol_notes};

/// A column: its head, whether it holds names (left-aligned), and its cells.
struct Column {
    head: &'static str,
    left: bool,
    cells: Vec<String>,
}

/// The table; below it the definitions of its scores, and what was left out or failed to run.
pub(super) fn render(summaries: &[Summary]) -> String {
    if summaries.is_empty() {
        return "no results\n".to_owned();
    }
    let name = |head, cell: fn(&Summary) -> &str| Column {
        head,
        left: true,
        cells: summaries.iter().map(|s| printable(cell(s))).collect(),
    };
    let number = |head, cell: &dyn Fn(&Summary) -> String| Column {
        head,
        left: false,
        cells: summaries.iter().map(cell).collect(),
    };
    let mut columns = vec![
        name("dataset", |s| &s.dataset),
        name("matcher", |s| &s.matcher),
    ];
    if summaries.iter().any(|s| !s.estimator.is_empty()) {
        columns.push(name("estimator", |s| &s.estimator));
    }
    columns.extend([
        number("pairs", &|s| s.pairs.to_string()),
        number("failed", &|s| s.failed.to_string()),
    ]);
    let ranks = |kind: &ScoreKind| summaries.iter().any(|s| s.ranked_by() == kind.id);
    let mut shown = shown_scores(summaries);
    shown.retain(|kind| {
        let known = |s: &Summary| s.scores.get(kind.id).value.is_some();
        kind.detail == Detail::Glance && (ranks(kind) || summaries.iter().any(known))
    });
    for kind in &shown {
        columns.push(number(kind.heading, &|s| {
            score(kind.notation, s.scores.get(kind.id).value)
        }));
        if ranks(kind) {
            columns.push(number("95 % interval", &|s| {
                interval(&s.scores.get(kind.id), ratio)
            }));
            if summaries.iter().any(|s| s.auc_deviation.is_some()) {
                columns.push(number("sd runs", &|s| {
                    s.auc_deviation.map_or_else(String::new, ratio)
                }));
            }
        }
    }
    let names = columns.iter().filter(|column| column.left).count();
    let head: Vec<String> = columns
        .iter()
        .map(|column| column.head.to_owned())
        .collect();
    let rows: Vec<Vec<String>> = (0..summaries.len())
        .map(|row| {
            columns
                .iter()
                .map(|column| column.cells[row].clone())
                .collect()
        })
        .collect();
    let mut text = aligned(&head, &rows, names);
    text.push('\n');
    for (heads, definition) in definitions(&shown, Detail::Glance) {
        let _ = writeln!(text, "{heads}: {definition}");
    }
    for note in protocol_notes(summaries) {
        let _ = writeln!(text, "{}", printable(&note));
    }
    text
}

/// The table, and below it the mean of every score over all datasets.
pub(super) fn render_with_mean(summaries: &[Summary]) -> String {
    let mut text = render(summaries);
    let means: Vec<String> = (SCORES.iter())
        .filter_map(|kind| {
            let values: Option<Vec<f64>> = (summaries.iter())
                .map(|summary| summary.scores.get(kind.id).value)
                .collect();
            let values = values.filter(|values| !values.is_empty())?;
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            Some(format!("{} {}", kind.heading, score(kind.notation, mean)))
        })
        .collect();
    if !means.is_empty() {
        let _ = writeln!(
            text,
            "\nMean over {}: {}",
            counted(summaries.len(), "dataset"),
            means.join(", ")
        );
    }
    text
}

/// A head, a rule and rows; the first `names` columns hold names.
pub(super) fn aligned(head: &[String], rows: &[Vec<String>], names: usize) -> String {
    let lines = || std::iter::once(head).chain(rows.iter().map(Vec::as_slice));
    let width = |column: usize| lines().map(|line| line[column].chars().count()).max();
    let widths: Vec<usize> = (0..head.len())
        .map(|column| width(column).unwrap_or(0))
        .collect();
    let mut text = String::new();
    for (number, line) in lines().enumerate() {
        let cells = line
            .iter()
            .zip(&widths)
            .enumerate()
            .map(|(column, (cell, &width))| {
                let cell = printable(cell);
                if column < names {
                    format!("{cell:<width$}")
                } else {
                    format!("{cell:>width$}")
                }
            });
        text.push_str(cells.collect::<Vec<_>>().join("  ").trim_end());
        text.push('\n');
        if number == 0 {
            let dashes: Vec<String> = widths.iter().map(|&width| "-".repeat(width)).collect();
            text.push_str(dashes.join("  ").trim_end());
            text.push('\n');
        }
    }
    text
}

/// The name without control characters, so that it cannot move the cursor.
pub(super) fn printable(name: &str) -> String {
    name.replace(char::is_control, "\u{fffd}")
}

#[cfg(test)]
mod tests {
    use super::super::tests::{homographies, summary};
    use super::*;

    #[test]
    fn every_score_at_a_glance_has_a_column_and_a_definition() {
        let text = render(&[summary("room", "sift", 6)]);
        let (table, below) = text.split_once("\n\n").expect("definitions below");
        let head = table.lines().next().expect("a head");
        let glance = |kind: &&&ScoreKind| kind.detail == Detail::Glance;
        let poses = shown_scores(&[summary("room", "sift", 6)]);
        for kind in poses.iter().filter(glance) {
            assert!(
                head.contains(kind.heading) && below.contains(kind.definition),
                "{}",
                kind.id
            );
        }
        // What is known of nobody takes no room, neither in the table nor below it.
        assert!(text.contains("AP(5)"));
        assert!(!render(&[summary("room", "sift", 0)]).contains("AP(5)"));
    }

    #[test]
    fn homographies_are_scored_in_pixels() {
        let text = render(&[homographies("boat", "sift")]);
        let (table, below) = text.split_once("\n\n").expect("definitions below");
        let head = table.lines().next().expect("a head");
        assert!(
            head.contains("AUC 3 px") && head.contains("MMA 3 px"),
            "{head}"
        );
        assert!(
            !head.contains("rot.") && !below.contains("degrees"),
            "{text}"
        );
        // A table of both has both.
        let text = render(&[summary("room", "sift", 6), homographies("boat", "sift")]);
        assert!(text.contains("AUC rot.") && text.contains("AUC 3 px"));
    }

    #[test]
    fn columns_are_aligned() {
        let text = render(&[summary("room", "sift", 6), summary("a-street", "orb", 10)]);
        let lines: Vec<&str> = text.lines().collect();
        let at = lines[0].find("AUC").expect("there is such a column") + "AUC".len();
        assert_eq!(&lines[2][at - 5..at], "0.600");
        assert_eq!(&lines[3][at - 5..at], "1.000");
        assert!(lines[3].starts_with("a-street  orb "));
    }

    #[test]
    fn the_mean_is_over_datasets() {
        let text = render_with_mean(&[summary("room", "sift", 6), summary("hall", "sift", 3)]);
        assert!(
            text.contains("\nMean over 2 datasets: AUC 0.450,"),
            "{text}"
        );
        assert_eq!(render_with_mean(&[]), render(&[]));
    }

    #[test]
    fn names_cannot_drive_the_terminal() {
        assert!(!render(&[summary("\u{1b}[2J", "sift", 1)]).contains('\u{1b}'));
    }
}
