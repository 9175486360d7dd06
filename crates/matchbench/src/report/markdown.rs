//! Pipe tables as forges render them: AUC of matchers by datasets, then every score.

use std::fmt::Write as _;

use crate::metrics::Summary;

use super::numbers::{NONE, count, interval, ratio};
use super::overview::{Cell, Overview};

/// Two tables with a line of explanation each.
pub(super) fn render(summaries: &[Summary]) -> String {
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
        let cells = row.cells.iter().map(|cell| auc(cell.as_ref()));
        line(&mut text, std::iter::once(escape(&row.label)).chain(cells));
    }
    let bases = (overview.datasets.iter().enumerate())
        .map(|(column, name)| format!("{}: {}", escape(name), overview.basis(column)));
    let _ = write!(text, "\n{}.\n", bases.collect::<Vec<_>>().join("; "));
    text.push_str(
        "\nMean of SP(1) ... SP(15). ①②③: the best three of a dataset; **bold**: above SIFT.\n\n\
         ### All scores\n\n",
    );
    let heads = "dataset,matcher,estimator,pairs,failed,AUC,95 % interval,SP(5),AUC rotation,\
                 AUC translation,AP(5),exact AUC 5°,10°,20°,mAA 10°";
    line(&mut text, heads.split(',').map(str::to_owned));
    rule(&mut text, 3, 12);
    for summary in summaries {
        line(&mut text, scores(summary));
    }
    text.push_str(
        "\nSP(k): share of pairs with a pose error below k degrees; AP(5): mean correspondences of \
         the pairs below 5 degrees; exact AUC (as SuperGlue) and mAA (as the Image Matching \
         Challenge) take a translation and its opposite for the same.\n",
    );
    text
}

fn auc(cell: Option<&Cell<'_>>) -> String {
    let Some(cell) = cell else {
        return NONE.to_owned();
    };
    let value = ratio(cell.summary.auc.value);
    let mark = ["", "① ", "② ", "③ "][usize::from(cell.rank.unwrap_or(0))];
    if cell.above_baseline {
        format!("{mark}**{value}**")
    } else {
        format!("{mark}{value}")
    }
}

fn scores(s: &Summary) -> [String; 15] {
    [
        escape(&s.dataset),
        escape(&s.matcher),
        escape(&s.estimator),
        s.pairs.to_string(),
        s.failed.to_string(),
        ratio(s.auc.value),
        interval(&s.auc, ratio),
        ratio(s.sp.at(5)),
        ratio(s.rotation_auc.value),
        ratio(s.translation_auc.value),
        count(s.ap5.value),
        ratio(s.exact_auc_5),
        ratio(s.exact_auc_10),
        ratio(s.exact_auc_20),
        ratio(s.maa_10),
    ]
}

fn line(text: &mut String, cells: impl IntoIterator<Item = String>) {
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
fn escape(name: &str) -> String {
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
    use super::super::tests::summary;
    use super::*;

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
