//! The table of failures: a column for each reason that any pair failed for, and what the reasons mean.

use minijinja::{Value, context};

use crate::metrics::{Failure, Summary};
use crate::protocols::of_estimator;

use super::super::pair_words::reason;
use super::super::score_words::protocols;
use super::row;

/// A column: its head, its number, and what it means.
struct Column {
    head: &'static str,
    number: fn(&Summary) -> usize,
    meaning: String,
}

/// Heads, rows and definitions. Reasons that no pair failed for are left out.
pub(super) fn table(summaries: &[Summary]) -> Value {
    let has_any = |column: &Column| summaries.iter().any(|s| (column.number)(s) > 0);
    let columns: Vec<Column> = columns(summaries).into_iter().filter(has_any).collect();
    let heads: Vec<&str> = ["Pairs", "Failed"]
        .into_iter()
        .chain(columns.iter().map(|c| c.head))
        .collect();
    let rows: Vec<Value> = (summaries.iter())
        .map(|s| {
            let counts = columns.iter().map(|column| (column.number)(s));
            let cells = [s.pairs, s.failed].into_iter().chain(counts);
            row(s, cells.map(|count| count.to_string()).collect())
        })
        .collect();
    let definitions: Vec<Value> = (columns.iter())
        .map(|column| context! { head => column.head, text => &column.meaning })
        .collect();
    context! { heads, rows, definitions }
}

fn columns(summaries: &[Summary]) -> Vec<Column> {
    let column = |head, number, meaning: String| Column {
        head,
        number,
        meaning,
    };
    let of = |failure| meaning(summaries, failure);
    vec![
        column("Too few matches", |s| s.failures.too_few_matches, of(Failure::TooFewMatches)),
        column("No support", |s| s.failures.no_support, of(Failure::NoSupport)),
        column("Broken", |s| s.failures.broken, of(Failure::Broken)),
        column("Unexplained", |s| s.failures.unexplained, of(Failure::Unexplained)),
        column("Missing", |s| s.failures.missing, of(Failure::Missing)),
        column(
            "No baseline",
            |s| s.undirected,
            "Not failed, but the true translation is zero: there is no true direction, so such pairs count as wrong in \
             every score but those of the rotation."
                .into(),
        ),
        column(
            "Ignored",
            |s| s.ignored,
            "Results of pairs that the dataset does not list, or that were not to count; they are in no score and not \
             among the pairs."
                .into(),
        ),
    ]
}

/// The reason under each protocol that poses were estimated by, and what it means where these differ.
fn meaning(summaries: &[Summary], failure: Failure) -> String {
    let mut reasons: Vec<(&str, String)> = (protocols(summaries))
        .map(|protocol| (protocol.id, reason(failure, protocol)))
        .collect();
    reasons.dedup_by(|one, other| one.1 == other.1);
    match &reasons[..] {
        [] => reason(failure, of_estimator("")),
        [(_, one)] => one.clone(),
        several => {
            let each = several.iter().map(|(id, text)| format!("{text} ({id})"));
            each.collect::<Vec<_>>().join(" ")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::tests::content;
    use super::super::render;

    #[test]
    fn only_reasons_that_occur_have_a_column_and_each_is_defined() {
        let mut content = content(&[("room", "sift", 4), ("room", "orb", 2)]);
        let heads = ["Too few matches", "No support", "Unexplained", "Ignored"];
        let shown = |page: &str| -> Vec<bool> {
            let both = |head: &&str| {
                let column = page.contains(&format!("<th scope=\"col\">{head}</th>"));
                assert_eq!(column, page.contains(&format!("<dt>{head}</dt>")), "{head}");
                column
            };
            heads.iter().map(both).collect()
        };
        assert_eq!(shown(&render(&content)), [false, true, false, false]);
        content.summaries[1].ignored = 3;
        content.summaries[0].failures.unexplained = 1;
        assert_eq!(shown(&render(&content)), [false, true, true, true]);
    }
}
