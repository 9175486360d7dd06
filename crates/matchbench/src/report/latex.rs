//! A complete `tabular` like the paper's Table 2: AUC of matchers by datasets, the best three of a
//! dataset in red, green and blue, those above SIFT in bold, `/` where a matcher was not run.

use std::fmt::Write as _;

use crate::metrics::Summary;

use super::numbers::ratio;
use super::overview::{Cell, Overview, Subject};

/// The table, after a comment that names the package it needs.
pub(super) fn render(summaries: &[Summary]) -> String {
    let overview = Overview::new(summaries);
    let mut text = String::from(
        "% AUC: mean of SP(1) ... SP(15). Best three of each dataset in red, green and blue;\n\
         % above the baseline (SIFT) in bold. Colours need \\usepackage{xcolor} in the preamble.\n",
    );
    for (column, dataset) in overview.datasets.iter().enumerate() {
        let basis = overview.basis(column);
        let _ = writeln!(text, "% {}: {}", comment(dataset), comment(&basis));
    }
    text.push_str("\\providecommand{\\textcolor}[2]{#2}\n");
    text.push_str("\\begin{tabular}{|c|");
    text.push_str(&"c|".repeat(overview.datasets.len()));
    text.push_str("}\n\\hline\n");
    text.push_str(overview.subject.head());
    if overview.subject == Subject::Matchers {
        text.push('s');
    }
    for dataset in &overview.datasets {
        text.push_str(" & ");
        text.push_str(&escape(dataset));
    }
    text.push_str(" \\\\\n\\hline\n");
    for row in &overview.rows {
        let label = match overview.subject {
            Subject::Matchers => escape(published_name(&row.label)),
            _ => escape(&row.label),
        };
        text.push_str(&bold_if(row.is_baseline, &label));
        for cell in &row.cells {
            text.push_str(" & ");
            text.push_str(&auc(cell.as_ref()));
        }
        text.push_str(" \\\\\n\\hline\n");
    }
    text.push_str("\\end{tabular}\n");
    text
}

fn auc(cell: Option<&Cell<'_>>) -> String {
    let Some(cell) = cell.filter(|cell| cell.summary.auc.value.is_some()) else {
        return "/".to_owned();
    };
    let value = ratio(cell.summary.auc.value);
    let coloured = match cell.rank {
        Some(rank) => {
            let colour = ["red", "green", "blue"][usize::from(rank - 1)];
            format!("\\textcolor{{{colour}}}{{{value}}}")
        }
        None => value,
    };
    bold_if(cell.above_baseline, &coloured)
}

fn bold_if(bold: bool, text: &str) -> String {
    if bold {
        format!("\\textbf{{{text}}}")
    } else {
        text.to_owned()
    }
}

/// How the paper spells a matcher; others are called by their id.
fn published_name(id: &str) -> &str {
    const NAMES: [(&str, &str); 17] = [
        ("sift", "SIFT"),
        ("surf", "SURF"),
        ("orb", "ORB"),
        ("brisk", "BRISK"),
        ("kaze", "KAZE"),
        ("akaze", "AKAZE"),
        ("dlco", "DLCO"),
        ("freak", "FREAK"),
        ("binboost", "BinBoost"),
        ("latch", "LATCH"),
        ("daisy", "DAISY"),
        ("kvld", "KVLD"),
        ("gaim", "GAIM"),
        ("code", "CODE"),
        ("repmatch", "RepMatch"),
        ("gms", "GMS"),
        ("asift", "ASIFT"),
    ];
    let published = NAMES.iter().find(|name| name.0 == id);
    published.map_or(id, |name| name.1)
}

/// A name in a comment: it cannot end the line.
fn comment(text: &str) -> String {
    text.replace(char::is_control, " ")
}

/// A name as plain text.
fn escape(name: &str) -> String {
    let mut text = String::new();
    for c in name.chars() {
        match c {
            '\\' => text.push_str("\\textbackslash{}"),
            '~' => text.push_str("\\textasciitilde{}"),
            '^' => text.push_str("\\textasciicircum{}"),
            '<' => text.push_str("\\textless{}"),
            '>' => text.push_str("\\textgreater{}"),
            '|' => text.push_str("\\textbar{}"),
            '{' | '}' | '$' | '&' | '#' | '%' | '_' => {
                text.push('\\');
                text.push(c);
            }
            c if c.is_control() => text.push(' '),
            c => text.push(c),
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::tests::summary;
    use super::*;

    #[test]
    fn looks_like_the_table_of_the_paper() {
        let summaries = [
            summary("01", "sift", 6),
            summary("01", "orb", 3),
            summary("01", "gms", 9),
            summary("02", "gms", 5),
            summary("01", "kaze", 7),
        ];
        let expected = "\\begin{tabular}{|c|c|c|}\n\
            \\hline\n\
            Matchers & 01 & 02 \\\\\n\
            \\hline\n\
            \\textbf{SIFT} & \\textcolor{blue}{0.600} & / \\\\\n\
            \\hline\n\
            ORB & 0.300 & / \\\\\n\
            \\hline\n\
            GMS & \\textbf{\\textcolor{red}{0.900}} & 0.500 \\\\\n\
            \\hline\n\
            KAZE & \\textbf{\\textcolor{green}{0.700}} & / \\\\\n\
            \\hline\n\
            \\end{tabular}\n";
        let text = render(&summaries);
        assert!(text.ends_with(expected), "{text}");
        assert!(text.lines().take(4).all(|line| line.starts_with('%')));
        assert!(text.contains("% 01: 10 pairs, ransac-e\n"), "{text}");
        let evil = render(&[summary("a\n\\evil", "sift", 6)]);
        assert!(evil.contains("% a \\evil: 10 pairs"), "{evil}");
    }

    #[test]
    fn special_characters_are_text() {
        assert_eq!(
            escape("50%_of $x^2 & {a}~#\\"),
            "50\\%\\_of \\$x\\textasciicircum{}2 \\& \\{a\\}\\textasciitilde{}\\#\\textbackslash{}"
        );
    }
}
