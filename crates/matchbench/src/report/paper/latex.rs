//! The tables as LaTeX, and a document that contains all of them.

use std::fmt::Write as _;

use super::super::latex::{comment, escape};
use super::figures::PaperFigure;
use super::{NOTHING, RANKS, Sheet, SheetCell, SheetRow};

/// How a published number is typeset: small and grey, after ours.
const PUBLISHED: &str = "\\providecommand{\\published}[1]{{\\scriptsize\\textcolor{gray}{#1}}}\n";

/// A complete `tabular`, after a comment that names the package it needs.
pub(super) fn table(sheet: &Sheet) -> String {
    let mut text = format!(
        "% {} Published numbers small and grey.\n% Colours need \\usepackage{{xcolor}} in the preamble.\n",
        comment(&sheet.caption)
    );
    for note in &sheet.notes {
        let _ = writeln!(text, "% {}", comment(note));
    }
    text.push_str(PUBLISHED);
    let columns = sheet.heads.len() - 1;
    let groups = match &sheet.groups[..] {
        [] => vec![columns],
        groups => groups.iter().map(|(_, columns)| *columns).collect(),
    };
    let groups: Vec<String> = groups.iter().map(|columns| "c".repeat(*columns)).collect();
    let _ = writeln!(
        text,
        "\\begin{{tabular}}{{l|{}}}\n\\hline",
        groups.join("|")
    );
    if let Some((last, others)) = sheet.groups.split_last() {
        for (group, columns) in others {
            let _ = write!(text, " & \\multicolumn{{{columns}}}{{c|}}{{{group}}}");
        }
        let _ = writeln!(
            text,
            " & \\multicolumn{{{}}}{{c}}{{{}}} \\\\",
            last.1, last.0
        );
    }
    let heads: Vec<String> = sheet.heads.iter().map(|head| escape(head)).collect();
    let _ = writeln!(text, "{} \\\\", heads.join(" & "));
    text.extend(sheet.under.iter().map(line));
    text.push_str("\\hline\n");
    text.extend(sheet.rows.iter().map(line));
    text.push_str("\\hline\n\\end{tabular}\n");
    text
}

fn line(row: &SheetRow) -> String {
    let label = bold_if(row.is_baseline, escape(&row.label));
    let cells: Vec<String> = row.cells.iter().map(cell).collect();
    format!("{label} & {} \\\\\n", cells.join(" & "))
}

fn cell(cell: &SheetCell) -> String {
    let ours = escape(cell.ours.as_deref().unwrap_or(NOTHING));
    let coloured = match cell.rank {
        Some(rank) => format!("\\textcolor{{{}}}{{{ours}}}", RANKS[usize::from(rank - 1)]),
        None => ours,
    };
    let ours = bold_if(cell.is_above, coloured);
    match &cell.published {
        Some(published) => format!("{ours} \\published{{{}}}", escape(published)),
        None => ours,
    }
}

fn bold_if(bold: bool, text: String) -> String {
    if bold {
        format!("\\textbf{{{text}}}")
    } else {
        text
    }
}

/// A document that shows tables and figures, which stand beside it, and says first what is `lacking`.
pub(super) fn document(
    lacking: Option<&str>,
    sheets: &[Sheet],
    figures: &[&PaperFigure],
) -> String {
    let mut text = String::from(
        "\\documentclass{article}\n\\usepackage[a4paper,margin=2cm]{geometry}\n\\usepackage{graphicx}\n\
         \\usepackage{xcolor}\n\\definecolor{green}{rgb}{0,0.6,0}\n\\begin{document}\n\
         \\section*{MatchBench: tables and figures, run again}\n",
    );
    if let Some(lacking) = lacking {
        let _ = writeln!(text, "\\noindent {}", escape(lacking));
    }
    for sheet in sheets {
        let notes: Vec<String> = sheet.notes.iter().map(|note| escape(note)).collect();
        let _ = writeln!(
            text,
            "\\begin{{table}}[ht]\n\\noindent {}\n\n\\smallskip\\noindent\n\\resizebox{{\\textwidth}}{{!}}{{%\n\
             \\input{{tables/{}.tex}}}}\n\n\\smallskip\\noindent{{\\footnotesize {}}}\n\\end{{table}}",
            escape(&sheet.caption),
            sheet.name,
            notes.join(" ")
        );
    }
    for figure in figures {
        let _ = writeln!(
            text,
            "\\begin{{figure}}[p]\n\\centering\n\\includegraphics[width=\\textwidth,height=0.85\\textheight,\
             keepaspectratio]{{figures/{}.pdf}}\n\n\\smallskip\\noindent {}\n\\end{{figure}}",
            figure.name,
            escape(&figure.caption)
        );
    }
    text.push_str("\\end{document}\n");
    text
}
