//! Markdown tables as GitHub and similar sites render them: AUC of matchers by datasets, then every score.

use std::fmt::Write as _;

use crate::metrics::{Detail, Model, Score, ScoreKind, Summary, shown_scores};

use super::numbers::{NONE, interval, ratio, score};
use super::overview::{Cell, Overview};
use super::score_words::{definitions, group_note, protocol_notes};

/// Two tables, each with a line of explanation.
pub(super) fn render(summaries: &[Summary]) -> String {
    render_with(summaries, |_| String::new())
}

/// The same, with what `behind` says of a score behind its value in the first.
pub(super) fn render_with(summaries: &[Summary], behind: fn(&Score) -> String) -> String {
    if summaries.is_empty() {
        return "No results.\n".to_owned();
    }
    let overview = Overview::new(summaries);
    let mut text = String::from("### AUC\n\n");
    let datasets = overview.datasets.iter().map(|name| escape(name));
    line(
        &mut text,
        std::iter::once(overview.subject.head().to_lowercase()).chain(datasets),
    );
    rule(&mut text, 1, overview.datasets.len());
    for row in &overview.rows {
        let cells = row.cells.iter().map(|cell| {
            let more = cell.as_ref().map(|cell| behind(&cell.auc));
            auc(cell.as_ref()) + &more.unwrap_or_default()
        });
        line(&mut text, std::iter::once(escape(&row.label)).chain(cells));
    }
    let bases = (overview.datasets.iter().enumerate())
        .map(|(column, name)| format!("{}: {}", escape(name), escape(&overview.basis(column))));
    let _ = write!(text, "\n{}.\n", bases.collect::<Vec<_>>().join("; "));
    if let Some(note) = overview.footnote(str::to_owned) {
        let _ = write!(text, "\n{}.\n", escape(&note));
    }
    let of = |model| summaries.iter().any(|s| s.model == model);
    text.push_str(match (of(Model::Pose), of(Model::Homography)) {
        (_, false) => "\nMean of SP(1) ... SP(15).",
        (false, true) => "\nAUC of the corner error at 3 px.",
        (true, true) => {
            "\nMean of SP(1) ... SP(15); of homographies the AUC of the corner error at 3 px."
        }
    });
    text.push_str(" ①②③: the best three of a dataset");
    text.push_str(if overview.has_baseline() {
        "; **bold**: above SIFT."
    } else {
        "."
    });
    if let Some(note) = group_note(summaries) {
        let _ = write!(text, " {note}");
    }
    text.push_str("\n\n### All scores\n\n");
    let mut heads: Vec<&str> = vec!["dataset", "matcher", "estimator", "pairs", "failed"];
    let shown = shown_scores(summaries);
    for kind in &shown {
        heads.push(kind.heading);
        if ranks(kind) {
            heads.push("95 % interval");
        }
    }
    let heads: Vec<String> = heads.into_iter().map(str::to_owned).collect();
    rule_below(&mut text, &heads, 3);
    for summary in summaries {
        line(&mut text, scores(summary, &shown));
    }
    text.push('\n');
    for (heads, definition) in definitions(&shown, Detail::Complete) {
        let _ = writeln!(text, "- {}: {}", escape(&heads), escape(definition));
    }
    for note in protocol_notes(summaries) {
        let _ = writeln!(text, "- {}", escape(&note));
    }
    text
}

fn auc(cell: Option<&Cell<'_>>) -> String {
    let Some(cell) = cell else {
        return NONE.to_owned();
    };
    let value = ratio(cell.auc.value);
    let group = match &*cell.summary.group {
        "" => String::new(),
        letters => format!(" <sup>{letters}</sup>"),
    };
    let mark = ["", "① ", "② ", "③ "][usize::from(cell.rank.unwrap_or(0))];
    if cell.above_baseline {
        format!("{mark}**{value}**{group}")
    } else {
        format!("{mark}{value}{group}")
    }
}

/// Whether methods are ranked by this score. Then its interval is shown beside it.
fn ranks(kind: &ScoreKind) -> bool {
    ["auc", "auc_h3"].contains(&kind.id)
}

fn scores(s: &Summary, shown: &[&ScoreKind]) -> Vec<String> {
    let mut cells = vec![
        escape(&s.dataset),
        escape(&s.matcher),
        escape(&s.estimator),
        s.pairs.to_string(),
        s.failed.to_string(),
    ];
    for kind in shown {
        let value = s.scores.get(kind.id);
        cells.push(score(kind.notation, value.value));
        if ranks(kind) {
            cells.push(interval(&value, ratio));
        }
    }
    cells
}

/// The head of a table of scores; the first `names` columns hold names.
pub(super) fn rule_below(text: &mut String, heads: &[String], names: usize) {
    line(text, heads.iter().cloned());
    rule(text, names, heads.len() - names);
}

pub(super) fn line(text: &mut String, cells: impl IntoIterator<Item = String>) {
    for cell in cells {
        text.push_str("| ");
        text.push_str(&cell);
        text.push(' ');
    }
    text.push_str("|\n");
}

fn rule(text: &mut String, names: usize, numbers: usize) {
    text.push_str(&"| --- ".repeat(names));
    text.push_str(&"| ---: ".repeat(numbers));
    text.push_str("|\n");
}

/// A name as plain text: no markup, no HTML, no new cell or line.
pub(super) fn escape(name: &str) -> String {
    let mut text = String::new();
    for c in name.chars() {
        match c {
            '<' => text.push_str("&lt;"),
            '>' => text.push_str("&gt;"),
            '&' => text.push_str("&amp;"),
            c if c.is_control() => text.push(' '),
            '\\' | '`' | '*' | '_' | '[' | ']' | '|' | '~' | '#' | '!' => {
                text.push('\\');
                text.push(c);
            }
            c => text.push(c),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::tests::{homographies, summary};
    use super::*;
    use crate::metrics::SCORES;

    #[test]
    fn every_line_of_a_table_has_as_many_cells() {
        let text = render(&[summary("a|b\nc", "sift", 6), summary("room", "orb_2", 8)]);
        for table in text.split("\n\n").filter(|block| block.starts_with('|')) {
            let bars = |line: &str| line.replace("\\|", "").matches('|').count();
            let first = table.lines().next().map(bars);
            assert!(
                table.lines().all(|line| Some(bars(line)) == first),
                "{table}"
            );
        }
        assert!(text.contains("| orb\\_2 |"));
    }

    #[test]
    fn every_score_has_a_column_and_a_definition() {
        let text = render(&[summary("room", "sift", 6), homographies("boat", "sift")]);
        for kind in SCORES {
            assert!(
                text.contains(&format!("| {} |", kind.heading)),
                "{}",
                kind.id
            );
            assert!(text.contains(&escape(kind.definition)), "{}", kind.id);
        }
    }

    #[test]
    fn estimators_are_escaped_too() {
        let by = |matcher: &str, estimator: &str| Summary {
            estimator: estimator.into(),
            ..summary("room", matcher, 6)
        };
        // Named after the dataset, and in the footnote.
        for summaries in [
            vec![by("sift", "<b>_x")],
            vec![by("sift", "<b>_x"), by("orb", "|<i>")],
        ] {
            let text = render(&summaries);
            assert!(text.contains("&lt;b&gt;\\_x"), "{text}");
            assert!(!text.contains("<b>") && !text.contains("<i>"), "{text}");
        }
    }

    #[test]
    fn marks_and_escapes() {
        let text = render(&[
            summary("<script>", "sift", 6),
            summary("<script>", "gms", 8),
        ]);
        assert!(text.contains("| gms | ① **0.800** |"), "{text}");
        assert!(text.contains("| sift | ② 0.600 |"));
        assert!(text.contains("&lt;script&gt;") && !text.contains("<script>"));
    }
}
