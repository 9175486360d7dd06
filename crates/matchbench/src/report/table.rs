//! Aligned text for a terminal: one row per dataset, matcher and estimator.

use std::fmt::Write as _;

use crate::metrics::Summary;

use super::numbers::{count, interval, ratio};

/// A column: its head, whether it holds names (left-aligned), and its cells.
struct Column {
    head: &'static str,
    left: bool,
    cells: Vec<String>,
}

/// The table, the definitions of its scores below it, and what was left out or failed to run.
pub(super) fn render(summaries: &[Summary]) -> String {
    if summaries.is_empty() {
        return "no results\n".to_owned();
    }
    let name = |head, cell: fn(&Summary) -> &str| Column {
        head,
        left: true,
        cells: summaries.iter().map(|s| printable(cell(s))).collect(),
    };
    let number = |head, cell: fn(&Summary) -> String| Column {
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
        number("pairs", |s| s.pairs.to_string()),
        number("failed", |s| s.failed.to_string()),
        number("AUC", |s| ratio(s.auc.value)),
        number("95 % interval", |s| interval(&s.auc, ratio)),
    ]);
    if summaries.iter().any(|s| s.auc_deviation.is_some()) {
        columns.push(number("sd runs", |s| {
            s.auc_deviation.map_or_else(String::new, ratio)
        }));
    }
    columns.extend([
        number("SP(5)", |s| ratio(s.sp.at(5))),
        number("AUC rot.", |s| ratio(s.rotation_auc.value)),
        number("AUC trans.", |s| ratio(s.translation_auc.value)),
        number("AP(5)", |s| count(s.ap5.value)),
    ]);
    let mut text = line(&columns, |column| column.head);
    let dashes: Vec<String> = columns.iter().map(|c| "-".repeat(width(c))).collect();
    text.push_str(dashes.join("  ").trim_end());
    text.push('\n');
    for row in 0..summaries.len() {
        text.push_str(&line(&columns, |column| &column.cells[row]));
    }
    text.push_str(
        "\nAUC: mean of SP(1) ... SP(15). SP(k): share of pairs with a pose error below k degrees.\n\
         AP(5): mean correspondences of the pairs below 5 degrees. Failed pairs count in every share.\n",
    );
    for summary in summaries {
        let (missing, ignored) = (summary.failures.missing, summary.ignored);
        if missing + ignored > 0 {
            let _ = writeln!(
                text,
                "{} on {}: {missing} listed pairs have no result (counted as failed), \
                 {ignored} results are for pairs that are not listed (ignored)",
                printable(&summary.matcher),
                printable(&summary.dataset),
            );
        }
    }
    text
}

fn line<'a>(columns: &'a [Column], cell: impl Fn(&'a Column) -> &'a str) -> String {
    let cells: Vec<String> = (columns.iter())
        .map(|column| {
            let (text, width) = (cell(column), width(column));
            if column.left {
                format!("{text:<width$}")
            } else {
                format!("{text:>width$}")
            }
        })
        .collect();
    format!("{}\n", cells.join("  ").trim_end())
}

fn width(column: &Column) -> usize {
    let cells = column.cells.iter().map(|cell| cell.chars().count());
    cells.max().unwrap_or(0).max(column.head.len())
}

/// Without control characters: a name must not be able to move the cursor.
fn printable(name: &str) -> String {
    name.replace(char::is_control, "\u{fffd}")
}

#[cfg(test)]
mod tests {
    use super::super::tests::summary;
    use super::*;

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
    fn names_cannot_drive_the_terminal() {
        assert!(!render(&[summary("\u{1b}[2J", "sift", 1)]).contains('\u{1b}'));
    }

    #[test]
    fn missing_and_ignored_are_told() {
        let mut summary = summary("room", "sift", 6);
        summary.failures.missing = 3;
        summary.ignored = 2;
        let text = render(&[summary]);
        assert!(
            text.contains("sift on room: 3 listed pairs have no result"),
            "{text}"
        );
    }
}
