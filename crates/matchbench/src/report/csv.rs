//! Comma-separated values (RFC 4180): one row per dataset, matcher and estimator, full precision.
//! A score that is undefined is an empty field, and `NaN` where the whole column is: readers would
//! take a column of nothing for one of text. Times are medians, in seconds.

use crate::metrics::{Score, Spread, SuccessCurve, Summary, THRESHOLDS};

/// Columns that hold names.
const NAMES: usize = 3;
/// What a column of numbers holds if none of them is known.
pub(super) const UNKNOWN: &str = "NaN";

/// A header line and one line per summary.
pub(super) fn render(summaries: &[Summary]) -> String {
    let mut text = header().join(",");
    text.push('\n');
    let mut rows: Vec<Vec<String>> = summaries.iter().map(row).collect();
    for column in NAMES..header().len() {
        if rows.iter().all(|row| row[column].is_empty()) {
            for row in &mut rows {
                UNKNOWN.clone_into(&mut row[column]);
            }
        }
    }
    for row in rows {
        text.push_str(&row.join(","));
        text.push('\n');
    }
    text
}

fn header() -> Vec<String> {
    let sp = |prefix| {
        THRESHOLDS
            .map(|k| format!("{prefix}sp{k}"))
            .collect::<Vec<_>>()
    };
    let names = |names: &str| names.split(' ').map(str::to_owned).collect::<Vec<_>>();
    [
        names("dataset matcher estimator pairs failed auc"),
        sp(""),
        names("ap5 auc_low auc_high ap5_low ap5_high"),
        names("rotation_auc rotation_auc_low rotation_auc_high"),
        names("translation_auc translation_auc_low translation_auc_high"),
        names("exact_auc_5 exact_auc_10 exact_auc_20 maa_10 repetitions auc_deviation"),
        names("too_few_matches no_support broken unexplained missing ignored undirected"),
        names("features extract_s search_s select_s estimate_s"),
        sp("rotation_"),
        sp("translation_"),
    ]
    .concat()
}

fn row(summary: &Summary) -> Vec<String> {
    let sp = |curve: &SuccessCurve| curve.values().map(number).to_vec();
    let median = |spread: Option<Spread>| number(spread.map(|spread| spread.median));
    let failures = summary.failures;
    let stages = &summary.stages;
    [
        vec![
            field(&summary.dataset),
            field(&summary.matcher),
            field(&summary.estimator),
            summary.pairs.to_string(),
            summary.failed.to_string(),
            number(summary.auc.value),
        ],
        sp(&summary.sp),
        vec![number(summary.ap5.value)],
        interval(&summary.auc),
        interval(&summary.ap5),
        vec![number(summary.rotation_auc.value)],
        interval(&summary.rotation_auc),
        vec![number(summary.translation_auc.value)],
        interval(&summary.translation_auc),
        vec![
            number(summary.exact_auc_5),
            number(summary.exact_auc_10),
            number(summary.exact_auc_20),
            number(summary.maa_10),
            summary.repetitions.to_string(),
            number(summary.auc_deviation),
            failures.too_few_matches.to_string(),
            failures.no_support.to_string(),
            failures.broken.to_string(),
            failures.unexplained.to_string(),
            failures.missing.to_string(),
            summary.ignored.to_string(),
            summary.undirected.to_string(),
            median(stages.features),
            median(stages.extract),
            median(stages.search),
            median(stages.select),
            median(stages.estimate),
        ],
        sp(&summary.rotation_sp),
        sp(&summary.translation_sp),
    ]
    .concat()
}

fn interval(score: &Score) -> Vec<String> {
    let ends = [
        score.interval.map(|i| i.low),
        score.interval.map(|i| i.high),
    ];
    ends.map(number).to_vec()
}

/// The shortest digits that read back as the same number, always with a point or an exponent: from
/// a `1` in the first rows readers conclude that a column holds whole numbers.
pub(super) fn number(value: impl Into<Option<f64>>) -> String {
    (value.into().filter(|value| value.is_finite())).map_or_else(String::new, |v| format!("{v:?}"))
}

/// Quoted where a comma, a quote or a line end would break the row, and where a name looks like a
/// number (`06`), which it is not.
pub(super) fn field(text: &str) -> String {
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

    #[test]
    fn every_row_has_a_field_for_every_head() {
        let mut partial = summary("room", "sift", 6);
        partial.ap5.interval = None;
        for summary in [partial, summary("room", "sift", 0)] {
            assert_eq!(row(&summary).len(), header().len());
        }
        let start = "dataset,matcher,estimator,pairs,failed,auc,sp1,sp2,";
        assert!(render(&[]).starts_with(start));
        assert!(render(&[]).contains(",sp15,ap5,"));
    }

    #[test]
    fn a_column_of_nothing_is_one_of_numbers() {
        let text = render(&[summary("room", "sift", 6), summary("hall", "sift", 0)]);
        let at = header().iter().position(|head| head == "auc_deviation");
        let cell = |line: usize, at: Option<usize>| {
            let line = text.lines().nth(line).expect("a head and two rows");
            line.split(',').nth(at.expect("there is such a column"))
        };
        assert_eq!(cell(1, at), Some("NaN"));
        // Known on one of two: nothing is nothing.
        let at = header().iter().position(|head| head == "ap5");
        assert_eq!((cell(1, at), cell(2, at)), (Some("102.5"), Some("")));
    }

    #[test]
    fn fields_stand_under_their_heads() {
        let mut summary = summary("room", "sift", 6);
        summary.failures.missing = 77;
        summary.maa_10 = 0.123456789012345;
        summary.rotation_sp.below[14] = 9;
        let row = row(&summary);
        let under = |head: &str| {
            let at = header().iter().position(|h| h == head);
            row[at.expect("there is such a column")].as_str()
        };
        assert_eq!(under("auc"), "0.6");
        assert_eq!(under("sp15"), "0.6");
        assert_eq!(under("ap5"), "102.5");
        assert_eq!(under("missing"), "77");
        assert_eq!(under("maa_10"), "0.123456789012345");
        assert_eq!(under("rotation_sp15"), "0.9");
        assert_eq!(under("search_s"), "");
    }

    #[test]
    fn commas_and_quotes_are_quoted() {
        let text = render(&[summary("a, \"b\"", "sift", 1)]);
        assert!(text.contains("\n\"a, \"\"b\"\"\",sift,"), "{text}");
    }
}
