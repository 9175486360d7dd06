//! The paper's Table 3: number of features, and the time of detection, matching and selection.
//!
//! The paper shows means. A few slow pairs change a mean a lot, so the median is shown beside it. The time of
//! detection (with description) is per image, the others are per pair. The paper leaves out the time of the
//! pose, so it is only in the CSV file.

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

use crate::metrics::{Quartiles, StageQuartiles};

use super::csv::{field, number};
use super::latex::{comment, escape};
use super::names;

/// The stages of one matcher.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MatcherTimes {
    /// Id of the matcher.
    pub matcher: String,
    /// The times that were measured.
    pub stages: StageQuartiles,
}

/// A column: its name in CSV, and its head in the paper's table if it is in it.
type Column = (
    &'static str,
    Option<&'static str>,
    f64,
    fn(&StageQuartiles) -> Option<Quartiles>,
);

/// Times are shown in milliseconds.
const COLUMNS: [Column; 5] = [
    ("features", Some("Feature numbers"), 1.0, |s| s.features),
    ("detection_ms", Some("Detection time (ms)"), 1e3, |s| {
        s.extract
    }),
    ("matching_ms", Some("Matching time (ms)"), 1e3, |s| s.search),
    ("selection_ms", Some("Selection time (ms)"), 1e3, |s| {
        s.select
    }),
    ("pose_ms", None, 1e3, |s| s.estimate),
];

/// Means, medians and quartiles at full precision; what was not timed is an empty field.
pub fn times_as_csv(rows: &[MatcherTimes]) -> String {
    let mut text = String::from("matcher");
    for (name, ..) in COLUMNS {
        let _ = write!(text, ",{name}_mean,{name}_median,{name}_lower,{name}_upper");
    }
    text.push('\n');
    for row in rows {
        text.push_str(&field(&row.matcher));
        for (_, _, unit, get) in COLUMNS {
            let spread = get(&row.stages);
            for part in [
                |s: Quartiles| s.mean,
                |s: Quartiles| s.median,
                |s: Quartiles| s.lower,
                |s: Quartiles| s.upper,
            ] {
                text.push(',');
                text.push_str(&number(spread.map(|spread| part(spread) * unit)));
            }
        }
        text.push('\n');
    }
    text
}

/// A complete `tabular` in the order of the paper: means, with medians in brackets. `about` says in a comment
/// what was measured where.
pub fn times_as_latex(rows: &[MatcherTimes], about: &str) -> String {
    let mut rows: Vec<&MatcherTimes> = rows.iter().collect();
    rows.sort_by_key(|row| names::place(&row.matcher));
    let mut text = format!(
        "% Mean (median). Detection and description of an image; search and selection of a pair.\n% {}\n",
        comment(about)
    );
    text.push_str("\\begin{tabular}{|c|c|c|c|c|}\n\\hline\nMatchers");
    for head in COLUMNS.iter().filter_map(|column| column.1) {
        let _ = write!(text, " & {head}");
    }
    text.push_str(" \\\\\n\\hline\n");
    for row in rows {
        text.push_str(&escape(&names::title(&row.matcher)));
        for (_, head, unit, get) in COLUMNS {
            if head.is_none() {
                continue;
            }
            let decimals = usize::from(unit > 1.0);
            match get(&row.stages) {
                Some(spread) => {
                    let (mean, median) = (spread.mean * unit, spread.median * unit);
                    let _ = write!(text, " & {mean:.decimals$} ({median:.decimals$})");
                }
                None => text.push_str(" & /"),
            }
        }
        text.push_str(" \\\\\n\\hline\n");
    }
    text.push_str("\\end{tabular}\n");
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows() -> [MatcherTimes; 2] {
        let times = |matcher: &str, seconds: [f64; 3]| MatcherTimes {
            matcher: matcher.into(),
            stages: StageQuartiles {
                features: Quartiles::of([1000.0, 1001.0]),
                extract: Quartiles::of(seconds),
                ..StageQuartiles::default()
            },
        };
        [
            times("gms", [0.033, 0.033, 0.033]),
            times("sift", [0.05, 0.0564, 0.09]),
        ]
    }

    #[test]
    fn means_stand_before_medians_in_the_order_of_the_paper() {
        let text = times_as_latex(&rows(), "machine\nof mine");
        let expected = "SIFT & 1000 (1000) & 65.5 (56.4) & / & / \\\\\n\\hline\n\
                        GMS & 1000 (1000) & 33.0 (33.0) & / & / \\\\\n";
        assert!(text.contains(expected), "{text}");
        assert!(text.contains("% machine of mine\n"));
    }

    #[test]
    fn csv_has_a_field_for_every_head() {
        let text = times_as_csv(&rows());
        let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
        assert!(lines.iter().all(|line| line.len() == 1 + 4 * COLUMNS.len()));
        let at = lines[0]
            .iter()
            .position(|head| *head == "detection_ms_median");
        assert_eq!(at.map(|at| lines[2][at]), Some("56.4"));
    }
}
