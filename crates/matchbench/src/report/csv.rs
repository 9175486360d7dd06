//! Comma-separated values (RFC 4180): one row per dataset, matcher and estimator, full precision. An undefined
//! score is an empty field. If a whole column is undefined, its fields are `NaN`, since readers would take a
//! column of empty fields for text. Times are medians, in seconds.

use crate::metrics::{Failures, Quartiles, SCORES, SuccessCurve, Summary, THRESHOLDS};

/// The content of each field in a column of numbers of which none is known.
pub(super) const UNKNOWN: &str = "NaN";

/// One field of a row.
pub(super) enum Cell {
    Name(String),
    /// A number that is the same in every row of a run.
    Constant(u32),
    /// A count; the row of means holds the sum.
    Count(usize),
    /// A score; the row of means holds the mean of the scores.
    Score(Option<f64>),
    /// A number whose mean would have no meaning.
    Number(Option<f64>),
}

/// A header line and one line per summary.
pub(super) fn render(summaries: &[Summary]) -> String {
    table(summaries.iter().map(row).collect())
}

/// The same, and a last line called `mean`: the mean of each score over all datasets, where each dataset counts
/// once, and the sum of each number of pairs.
pub(super) fn render_with_mean(summaries: &[Summary]) -> String {
    let mut rows: Vec<Row> = summaries.iter().map(row).collect();
    if let Some(first) = rows.first() {
        let mean = (0..first.len()).map(|column| mean(&rows, column)).collect();
        rows.push(mean);
    }
    table(rows)
}

/// Fields with the heads of their columns.
pub(super) type Row = Vec<(String, Cell)>;

/// A header line and one line for each row; all have the same heads.
pub(super) fn table(rows: Vec<Row>) -> String {
    let header: Vec<String> = match rows.first() {
        Some(row) => row.iter().map(|(head, _)| head.clone()).collect(),
        None => row(&Summary::empty())
            .into_iter()
            .map(|(head, _)| head)
            .collect(),
    };
    let nothing: Vec<bool> = (0..header.len())
        .map(|column| rows.iter().all(|row| is_nothing(&row[column].1)))
        .collect();
    let mut text = header.join(",") + "\n";
    for row in &rows {
        let cells: Vec<String> = (row.iter().zip(&nothing))
            .map(|((_, cell), nothing)| match cell {
                _ if *nothing => UNKNOWN.to_owned(),
                Cell::Name(name) => field(name),
                Cell::Constant(value) => value.to_string(),
                Cell::Count(count) => count.to_string(),
                Cell::Score(value) | Cell::Number(value) => number(*value),
            })
            .collect();
        text += &(cells.join(",") + "\n");
    }
    text
}

fn is_nothing(cell: &Cell) -> bool {
    match cell {
        Cell::Name(_) | Cell::Constant(_) | Cell::Count(_) => false,
        Cell::Score(value) | Cell::Number(value) => !value.is_some_and(f64::is_finite),
    }
}

/// All known values, in the order of the columns.
pub(super) fn row(summary: &Summary) -> Row {
    let mut row = Row::new();
    let mut push = |head: &str, cell| row.push((head.to_owned(), cell));
    push("dataset", Cell::Name(summary.dataset.clone()));
    push("matcher", Cell::Name(summary.matcher.clone()));
    push("estimator", Cell::Name(summary.estimator.clone()));
    push("pairs", Cell::Count(summary.pairs));
    push("failed", Cell::Count(summary.failed));
    push(
        SCORES[0].id,
        Cell::Score(summary.scores.get(SCORES[0].id).value),
    );
    curve(&mut row, "sp", &summary.sp);
    // Points of the curve have their own columns already, and so has the first score.
    for (kind, score) in summary.scores.iter() {
        if row.iter().all(|(head, _)| head != kind.id) {
            row.push((kind.id.to_owned(), Cell::Score(score.value)));
        }
    }
    for (kind, score) in summary
        .scores
        .iter()
        .filter(|(kind, _)| kind.has_interval())
    {
        let ends = [
            ("low", score.interval.map(|i| i.low)),
            ("high", score.interval.map(|i| i.high)),
        ];
        row.extend(ends.map(|(end, value)| (format!("{}_{end}", kind.id), Cell::Number(value))));
    }
    let mut push = |head: &str, cell| row.push((head.to_owned(), cell));
    push("repetitions", Cell::Constant(summary.repetitions));
    push("auc_deviation", Cell::Number(summary.auc_deviation));
    push("group", Cell::Name(summary.group.clone()));
    push("protocol", Cell::Name(summary.protocol.to_owned()));
    let Failures {
        too_few_matches,
        no_support,
        broken,
        unexplained,
        missing,
    } = summary.failures;
    push("too_few_matches", Cell::Count(too_few_matches));
    push("no_support", Cell::Count(no_support));
    push("broken", Cell::Count(broken));
    push("unexplained", Cell::Count(unexplained));
    push("missing", Cell::Count(missing));
    push("ignored", Cell::Count(summary.ignored));
    push("lacking", Cell::Count(summary.lacking));
    push("undirected", Cell::Count(summary.undirected));
    let stages = &summary.stages;
    for (head, spread) in [
        ("features", stages.features),
        ("extract_s", stages.extract),
        ("search_s", stages.search),
        ("select_s", stages.select),
        ("estimate_s", stages.estimate),
    ] {
        push(
            head,
            Cell::Number(spread.map(|spread: Quartiles| spread.median)),
        );
    }
    curve(&mut row, "rotation_sp", &summary.rotation_sp);
    curve(&mut row, "translation_sp", &summary.translation_sp);
    row
}

fn curve(row: &mut Row, prefix: &str, curve: &SuccessCurve) {
    let values = THRESHOLDS.zip(curve.values());
    row.extend(values.map(|(k, value)| (format!("{prefix}{k}"), Cell::Score(Some(value)))));
}

/// The field of the row of means in one column.
fn mean(rows: &[Row], column: usize) -> (String, Cell) {
    let head = rows[0][column].0.clone();
    let cells = || rows.iter().map(|row| &row[column].1);
    let cell = match &rows[0][column].1 {
        Cell::Name(_) if head == "dataset" => Cell::Name("mean".to_owned()),
        Cell::Name(first) => {
            let same = cells().all(|cell| matches!(cell, Cell::Name(name) if name == first));
            Cell::Name(if same { first.clone() } else { String::new() })
        }
        Cell::Count(_) => Cell::Count(
            cells()
                .map(|cell| {
                    if let Cell::Count(count) = cell {
                        *count
                    } else {
                        0
                    }
                })
                .sum(),
        ),
        Cell::Score(_) => {
            let values: Option<Vec<f64>> = cells()
                .map(|cell| {
                    if let Cell::Score(value) = cell {
                        *value
                    } else {
                        None
                    }
                })
                .collect();
            Cell::Score(values.map(|values| values.iter().sum::<f64>() / values.len() as f64))
        }
        Cell::Constant(_) | Cell::Number(_) => Cell::Number(None),
    };
    (head, cell)
}

/// The shortest digits that read back as the same number, always with a point or an exponent. If the first rows
/// held a plain `1`, readers would conclude that the column holds whole numbers.
pub(super) fn number(value: impl Into<Option<f64>>) -> String {
    (value.into().filter(|value| value.is_finite())).map_or_else(String::new, |v| format!("{v:?}"))
}

/// Quoted if a comma, a quote or a line end would break the row, or if a name looks like a number (`06`)
/// although it is a name.
pub(super) fn field(text: &str) -> String {
    // Spreadsheets evaluate fields that begin with these characters; after an apostrophe they take them as
    // text.
    let apostrophe = if text.starts_with(['=', '+', '-', '@', '\t', '\r']) {
        "'"
    } else {
        ""
    };
    let text = &format!("{apostrophe}{text}");
    if text.contains(['"', ',', '\n', '\r']) || text.parse::<f64>().is_ok() {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::summary;
    use super::*;
    use crate::metrics::Interval;

    #[test]
    fn a_name_is_no_formula() {
        for name in ["=1+1", "+1", "-x", "@SUM(A1)", "\t=1"] {
            assert_eq!(field(name), format!("'{name}"));
        }
        assert_eq!(field("=a,\"b"), "\"'=a,\"\"b\"");
        assert_eq!(field("a=b"), "a=b");
    }

    /// The field of a line (from 0, below the header) under a head.
    fn under<'a>(text: &'a str, line: usize, head: &str) -> &'a str {
        let mut lines = text.lines();
        let heads: Vec<&str> = lines.next().expect("a header").split(',').collect();
        let at = heads.iter().position(|h| *h == head);
        let fields: Vec<&str> = lines.nth(line).expect("a row").split(',').collect();
        assert_eq!(fields.len(), heads.len());
        fields[at.unwrap_or_else(|| panic!("no column {head}"))]
    }

    #[test]
    fn every_score_has_one_column_and_those_with_intervals_two_more() {
        let text = render(&[]);
        assert!(text.starts_with("dataset,matcher,estimator,pairs,failed,auc,sp1,sp2,"));
        let heads: Vec<&str> = text.trim_end().split(',').collect();
        let count = |wanted: &str| heads.iter().filter(|head| **head == wanted).count();
        for kind in SCORES {
            assert_eq!(count(kind.id), 1, "{}", kind.id);
            let ends = usize::from(kind.has_interval());
            assert_eq!(count(&format!("{}_low", kind.id)), ends, "{}", kind.id);
            assert_eq!(count(&format!("{}_high", kind.id)), ends, "{}", kind.id);
        }
        assert_eq!(
            text,
            render(&[summary("room", "sift", 1)])
                .lines()
                .next()
                .unwrap_or("")
                .to_owned()
                + "\n"
        );
    }

    #[test]
    fn a_column_of_nothing_is_one_of_numbers() {
        let text = render(&[summary("room", "sift", 6), summary("hall", "sift", 0)]);
        assert_eq!(under(&text, 0, "auc_deviation"), "NaN");
        // Known on one of two: nothing is nothing.
        assert_eq!(
            (under(&text, 0, "ap5"), under(&text, 1, "ap5")),
            ("102.5", "")
        );
    }

    #[test]
    fn fields_stand_under_their_heads() {
        let mut summary = summary("room", "sift", 6);
        summary.failures.missing = 77;
        summary.scores.get_mut("maa_10").value = Some(0.123456789012345);
        summary.rotation_sp.below[14] = 9;
        summary.translation_sp.below[14] = 4;
        let (low, high) = (0.25, 0.75);
        summary.scores.get_mut("auc").interval = Some(Interval { low, high });
        let text = render(&[summary]);
        for (head, expected) in [
            ("auc", "0.6"),
            ("sp15", "0.6"),
            ("ap5", "102.5"),
            ("missing", "77"),
            ("auc_low", "0.25"),
            ("auc_high", "0.75"),
            ("rotation_sp15", "0.9"),
            ("translation_sp15", "0.4"),
            ("maa_10", "0.123456789012345"),
            ("rotation_sp15", "0.9"),
            ("repetitions", "1"),
            ("search_s", "NaN"),
        ] {
            assert_eq!(under(&text, 0, head), expected, "{head}");
        }
    }

    #[test]
    fn commas_and_quotes_are_quoted() {
        let text = render(&[summary("a, \"b\"", "sift", 1)]);
        assert!(text.contains("\n\"a, \"\"b\"\"\",sift,"), "{text}");
    }

    #[test]
    fn the_mean_is_over_datasets() {
        let text = render_with_mean(&[summary("room", "sift", 6), summary("hall", "sift", 3)]);
        assert_eq!(
            (under(&text, 2, "dataset"), under(&text, 2, "matcher")),
            ("mean", "sift")
        );
        let mean: f64 = under(&text, 2, "exact_auc_5").parse().expect("a number");
        let each = [0, 1].map(|line| under(&text, line, "exact_auc_5").parse::<f64>());
        let [Ok(room), Ok(hall)] = each else {
            panic!("numbers: {each:?}")
        };
        assert!((mean - f64::midpoint(room, hall)).abs() < 1e-15 && room > hall);
        assert_eq!(under(&text, 2, "pairs"), "20");
        assert_eq!(under(&text, 2, "auc_low"), "");
        assert!(!render_with_mean(&[]).contains("mean"));
    }
}
