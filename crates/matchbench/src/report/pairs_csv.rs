//! Every result of every pair as comma-separated values, full precision; angles in degrees.

use super::content::Content;
use super::csv::{UNKNOWN, field, number};
use super::pair_table::{Column, Values, columns};

/// Every result of every pair as CSV, as `tables/pairs.csv` of a report has them.
pub fn render_pairs(content: &Content) -> String {
    render(&columns(content))
}

/// A header line and one line per row.
pub(super) fn render(columns: &[Column<'_>]) -> String {
    let names: Vec<&str> = columns.iter().map(|column| column.name).collect();
    let mut text = names.join(",");
    text.push('\n');
    let nothing: Vec<bool> = columns
        .iter()
        .map(|column| is_nothing(&column.values))
        .collect();
    let rows = columns.first().map_or(0, |column| column.values.len());
    for row in 0..rows {
        for (i, column) in columns.iter().enumerate() {
            if i > 0 {
                text.push(',');
            }
            text.push_str(&if nothing[i] {
                UNKNOWN.to_owned()
            } else {
                cell(&column.values, row)
            });
        }
        text.push('\n');
    }
    text
}

/// Whether no number of a column is known.
fn is_nothing(values: &Values<'_>) -> bool {
    match values {
        Values::Text(_) | Values::Index(_) => false,
        Values::Count(values) => values.iter().all(Option::is_none),
        Values::Number(values) => values.iter().all(Option::is_none),
    }
}

fn cell(values: &Values<'_>, row: usize) -> String {
    match values {
        Values::Text(values) => field(values[row]),
        Values::Index(values) => values[row].to_string(),
        Values::Count(values) => values[row].map_or_else(String::new, |count| count.to_string()),
        Values::Number(values) => number(values[row]),
    }
}

#[cfg(test)]
mod tests {
    use super::super::pair_table::columns;
    use super::super::tests::content;
    use super::*;

    #[test]
    fn every_row_has_a_field_for_every_head() {
        let content = content(&[("ro,om", "sift", 6)]);
        let text = render(&columns(&content));
        let heads = text.lines().next().map(|line| line.split(',').count());
        assert_eq!(heads, Some(28));
        assert_eq!(text.lines().count(), 11);
        // Nothing is known of the geometry; of the errors something is.
        assert!(
            text.contains(",NaN,NaN,NaN,") && text.contains(",,,,"),
            "{text}"
        );
        let row = text.lines().nth(1).expect("ten pairs");
        assert_eq!(
            row.replace("\"ro,om\"", "room").split(',').count(),
            28,
            "{row}"
        );
        assert!(
            text.lines()
                .last()
                .is_some_and(|row| row.ends_with(",no support"))
        );
    }

    #[test]
    fn without_results_the_heads_stay() {
        let text = render(&columns(&content(&[])));
        assert!(text.starts_with("dataset,matcher,") && text.lines().count() == 1);
    }
}
