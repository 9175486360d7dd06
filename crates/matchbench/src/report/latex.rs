//! A complete `tabular` like the paper's Table 2: AUC of matchers by datasets. The best three of a dataset are
//! red, green and blue, those above SIFT are bold, and `/` means that a matcher was not run. Rows and columns
//! are in the paper's order, under two portions (fragments and other pairs).

use std::fmt::Write as _;

use crate::metrics::{Portion, Score, Summary};

use super::names;
use super::numbers::ratio;
use super::overview::{Cell, Overview, Subject};

/// The table, after a comment that names the package it needs.
pub(super) fn render(summaries: &[Summary]) -> String {
    render_with(summaries, |_| String::new())
}

/// The same, with what `behind` says of a score behind its value.
pub(super) fn render_with(summaries: &[Summary], behind: fn(&Score) -> String) -> String {
    let overview = Overview::new(summaries).in_the_papers_order();
    let mut text = format!(
        "% AUC: {}. Best three of each dataset in red, green and blue;\n\
         % above the baseline (SIFT) in bold. Colours need \\usepackage{{xcolor}} in the preamble.\n",
        overview.auc()
    );
    let numbers = sequence_numbers(&overview.datasets);
    bases(&mut text, &overview, &numbers);
    text.push_str("\\providecommand{\\textcolor}[2]{#2}\n");
    text.push_str("\\begin{tabular}{|c|");
    text.push_str(&"c|".repeat(overview.datasets.len()));
    text.push_str("}\n\\hline\n");
    if overview.datasets.len() > 1 {
        for (portion, columns) in portions(&overview) {
            let _ = write!(
                text,
                " & \\multicolumn{{{columns}}}{{c|}}{{{}}}",
                portion.name()
            );
        }
        let _ = write!(
            text,
            " \\\\\n\\cline{{2-{}}}\n",
            overview.datasets.len() + 1
        );
    }
    text.push_str(head(&overview));
    for number in &numbers {
        text.push_str(" & ");
        text.push_str(&escape(number));
    }
    text.push_str(" \\\\\n\\hline\n");
    for row in &overview.rows {
        text.push_str(&bold_if(row.is_baseline, &label(&overview, &row.label)));
        for cell in &row.cells {
            text.push_str(" & ");
            text.push_str(&auc(cell.as_ref()));
            text.extend(cell.iter().map(|cell| behind(&cell.auc)));
        }
        text.push_str(" \\\\\n\\hline\n");
    }
    footnotes(&mut text, &overview, &[]);
    text.push_str("\\end{tabular}\n");
    text
}

/// What the numbers of the columns are computed from (pairs and estimator), as comments.
pub(super) fn bases(text: &mut String, overview: &Overview<'_>, numbers: &[String]) {
    for (column, (dataset, number)) in overview.datasets.iter().zip(numbers).enumerate() {
        let basis = overview.basis(column);
        let name = if dataset == number {
            comment(dataset)
        } else {
            format!("{} ({})", comment(number), comment(dataset))
        };
        let _ = writeln!(text, "% {name}: {}", comment(&basis));
    }
}

/// The portions, each with the number of neighbouring columns that belong to it.
pub(super) fn portions(overview: &Overview<'_>) -> Vec<(Portion, usize)> {
    let mut runs: Vec<(Portion, usize)> = Vec::new();
    for &portion in &overview.portions {
        match runs.last_mut() {
            Some((last, columns)) if *last == portion => *columns += 1,
            _ => runs.push((portion, 1)),
        }
    }
    runs
}

/// The head of the first column.
pub(super) fn head(overview: &Overview<'_>) -> &'static str {
    match overview.subject {
        Subject::Matchers => "Matchers",
        other => other.head(),
    }
}

/// The name of a row, as publications write it.
pub(super) fn label(overview: &Overview<'_>, label: &str) -> String {
    match overview.subject {
        Subject::Matchers => escape(&names::title(label)),
        _ => escape(label),
    }
}

/// Lines across the whole width below the table: the estimators, if each matcher has its own, and `more`.
pub(super) fn footnotes(text: &mut String, overview: &Overview<'_>, more: &[&str]) {
    let estimators = overview.footnote(names::title).map(|note| escape(&note));
    let notes = estimators
        .iter()
        .map(String::as_str)
        .chain(more.iter().copied());
    for note in notes {
        let _ = writeln!(
            text,
            "\\multicolumn{{{}}}{{l}}{{\\footnotesize {note}}} \\\\",
            overview.datasets.len() + 1
        );
    }
}

/// Datasets as the paper's tables call them: `01-office` is `01`, if no other has this number.
pub(super) fn sequence_numbers(datasets: &[&str]) -> Vec<String> {
    let number = |name: &str| {
        let number = name.split('-').next().unwrap_or_default();
        let is_number = number.len() == 2 && number.bytes().all(|b| b.is_ascii_digit());
        is_number.then(|| number.to_owned())
    };
    let unique = |wanted: &String| {
        let same = datasets
            .iter()
            .filter(|name| number(name).as_ref() == Some(wanted));
        same.count() == 1
    };
    (datasets.iter())
        .map(|name| {
            number(name)
                .filter(unique)
                .unwrap_or_else(|| (*name).to_owned())
        })
        .collect()
}

fn auc(cell: Option<&Cell<'_>>) -> String {
    let Some(cell) = cell.filter(|cell| cell.auc.value.is_some()) else {
        return "/".to_owned();
    };
    let value = ratio(cell.auc.value);
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

/// A name in a comment, without line ends, which would end the comment.
pub(super) fn comment(text: &str) -> String {
    text.replace(char::is_control, " ")
}

/// A name as plain text. After the end of a row or a rule, a `[` or `*` at the beginning would be its argument.
pub(super) fn escape(name: &str) -> String {
    let mut text = String::new();
    let is_space = |c: char| c.is_whitespace() || c.is_control();
    if name.trim_start_matches(is_space).starts_with(['[', '*']) {
        text.push_str("{}");
    }
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
        let mut summaries = [
            summary("05-castle", "gms", 5),
            summary("01-office", "sift", 6),
            summary("01-office", "gms", 9),
            summary("01-office", "kaze", 7),
            summary("01-office", "orb", 3),
            summary("01-office", "binboost", 6),
        ];
        for summary in &mut summaries[1..] {
            summary.portion = Portion::Fragments;
        }
        for i in [0, 2] {
            summaries[i].estimator = "rich".to_owned();
        }
        let expected = "\\begin{tabular}{|c|c|c|}\n\
            \\hline\n \
            & \\multicolumn{1}{c|}{fragments} & \\multicolumn{1}{c|}{other pairs} \\\\\n\
            \\cline{2-3}\n\
            Matchers & 01 & 05 \\\\\n\
            \\hline\n\
            \\textbf{SIFT} & \\textcolor{blue}{0.600} & / \\\\\n\
            \\hline\n\
            ORB & 0.300 & / \\\\\n\
            \\hline\n\
            KAZE & \\textbf{\\textcolor{green}{0.700}} & / \\\\\n\
            \\hline\n\
            BinBoost & \\textcolor{blue}{0.600} & / \\\\\n\
            \\hline\n\
            GMS & \\textbf{\\textcolor{red}{0.900}} & 0.500 \\\\\n\
            \\hline\n\
            \\multicolumn{3}{l}{\\footnotesize Pose by ransac-e; by rich: GMS} \\\\\n\
            \\end{tabular}\n";
        let text = render(&summaries);
        assert!(text.ends_with(expected), "{text}");
        assert!(text.lines().take(4).all(|line| line.starts_with('%')));
        assert!(text.contains("% 01 (01-office): 10 pairs\n"), "{text}");
        let evil = render(&[summary("a\n\\evil", "sift", 6)]);
        assert!(evil.contains("% a \\evil: 10 pairs"), "{evil}");
    }

    #[test]
    fn only_a_number_of_its_own_stands_for_a_name() {
        let names = ["01-office", "02-a", "02-b", "2024-run", "mine"];
        assert_eq!(
            sequence_numbers(&names),
            ["01", "02-a", "02-b", "2024-run", "mine"]
        );
    }

    #[test]
    fn special_characters_are_text() {
        assert_eq!(
            escape("50%_of $x^2 & {a}~#\\"),
            "50\\%\\_of \\$x\\textasciicircum{}2 \\& \\{a\\}\\textasciitilde{}\\#\\textbackslash{}"
        );
        // `\\` would take these for its argument, and a rule of booktabs too.
        for name in ["[1pt]", "*", "\n [a"] {
            assert!(escape(name).starts_with("{}"), "{name}");
        }
        assert_eq!(escape("a[1]*"), "a[1]*");
    }
}
