//! The AUC table (matchers by datasets) in the style of today's papers, as LaTeX: rules of the package
//! booktabs, the best of a dataset in bold, the second underlined, and letters for methods that do not differ
//! significantly.

use std::fmt::Write as _;

use crate::metrics::Summary;

use super::latex::{bases, escape, footnotes, head, label, portions, sequence_numbers};
use super::numbers::ratio;
use super::overview::{Cell, Overview};
use super::score_words::group_note;

/// A complete `tabular`.
pub(super) fn render(summaries: &[Summary]) -> String {
    let overview = Overview::new(summaries).in_the_papers_order();
    let numbers = sequence_numbers(&overview.datasets);
    let mut text = format!(
        "% AUC: {}. Best in bold, second underlined. Needs \\usepackage{{booktabs}}.\n",
        overview.auc()
    );
    bases(&mut text, &overview, &numbers);
    text.push_str("\\begin{tabular}{l");
    text.push_str(&"l".repeat(overview.datasets.len()));
    text.push_str("}\n\\toprule\n");
    if overview.datasets.len() > 1 {
        let mut rules = String::new();
        let mut column = 2;
        for (portion, columns) in portions(&overview) {
            let _ = write!(
                text,
                " & \\multicolumn{{{columns}}}{{c}}{{{}}}",
                portion.name()
            );
            let _ = write!(rules, "\\cmidrule(lr){{{column}-{}}}", column + columns - 1);
            column += columns;
        }
        let _ = write!(text, " \\\\\n{rules}\n");
    }
    text.push_str(head(&overview));
    for number in &numbers {
        text.push_str(" & ");
        text.push_str(&escape(number));
    }
    text.push_str(" \\\\\n\\midrule\n");
    for row in &overview.rows {
        text.push_str(&label(&overview, &row.label));
        for cell in &row.cells {
            text.push_str(" & ");
            text.push_str(&auc(cell.as_ref()));
        }
        text.push_str(" \\\\\n");
    }
    text.push_str("\\bottomrule\n");
    let note = group_note(summaries).map(|note| escape(&note));
    footnotes(&mut text, &overview, note.as_deref().as_slice());
    text.push_str("\\end{tabular}\n");
    text
}

fn auc(cell: Option<&Cell<'_>>) -> String {
    let Some(cell) = cell.filter(|cell| cell.auc.value.is_some()) else {
        return "--".to_owned();
    };
    let value = ratio(cell.auc.value);
    let value = match cell.rank {
        Some(1) => format!("\\textbf{{{value}}}"),
        Some(2) => format!("\\underline{{{value}}}"),
        _ => value,
    };
    match &*cell.summary.group {
        "" => value,
        letters => format!("{value}$^{{\\mathrm{{{letters}}}}}$"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{content, summary};
    use super::super::{Content, html, markdown};
    use super::*;

    #[test]
    fn best_second_and_groups_are_marked() {
        let summaries = content(&[("room", "orb", 1), ("room", "sift", 6), ("room", "gms", 10)]);
        let text = render(&summaries.summaries);
        assert!(text.contains("ORB & 0.100$^{\\mathrm{"), "{text}");
        assert!(
            text.contains("SIFT & \\underline{0.600}$^{\\mathrm{"),
            "{text}"
        );
        assert!(
            text.contains("GMS & \\textbf{1.000}$^{\\mathrm{a}}$"),
            "{text}"
        );
        assert!(
            text.contains("share a letter") && text.contains("5 \\%"),
            "{text}"
        );
        let rules = ["\\toprule", "\\midrule", "\\bottomrule"];
        assert!(rules.iter().all(|rule| text.matches(rule).count() == 1));
    }

    #[test]
    fn without_groups_nothing_is_said_of_them() {
        let text = render(&[summary("room", "sift", 6)]);
        assert!(
            text.contains("SIFT & 0.600 \\\\") && !text.contains("letter"),
            "{text}"
        );
    }

    #[test]
    fn more_groups_than_letters_are_told_wherever_letters_are() {
        let mut content = content(&[("room", "sift", 6), ("room", "orb", 1)]);
        let note = "have no letters if they form more than 26 groups";
        let tables = |content: &Content| {
            [
                render(&content.summaries),
                markdown::render(&content.summaries),
                html::render(content),
            ]
        };
        assert!(tables(&content).iter().all(|text| !text.contains(note)));
        for summary in &mut content.summaries {
            summary.group.clear();
            summary.beyond_letters = true;
        }
        for text in tables(&content) {
            assert!(
                text.contains(note) && !text.contains("share a letter"),
                "{text}"
            );
        }
    }
}
