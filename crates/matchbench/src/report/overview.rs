//! The paper's Table 2 as data: matchers by datasets, the best three marked, and those above SIFT.

use std::fmt::Write as _;

use crate::metrics::{Angle, Score, Summary};

use super::svg::{COLOURS, DASHES};
use super::words;

/// The matcher that the paper measures the others by.
const BASELINE: &str = "sift";
/// The estimator of the paper.
pub(super) const REFERENCE: &str = "ransac-e";

/// AUC of every matcher on every dataset, both in the order in which the scores name them, but
/// the baseline first, and of its estimators the reference.
pub(super) struct Overview<'a> {
    /// Names of the datasets, the columns.
    pub(super) datasets: Vec<&'a str>,
    /// What a row is.
    pub(super) subject: Subject,
    /// One row per matcher, or per matcher and estimator where there are several estimators.
    pub(super) rows: Vec<Row<'a>>,
}

/// What the rows compare: whatever there is only one of stands in no label.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Subject {
    Matchers,
    /// Estimators, with one matcher.
    Estimators,
    Both,
}

impl Subject {
    /// The head of the column of labels.
    pub(super) fn head(self) -> &'static str {
        match self {
            Self::Matchers => "Matcher",
            Self::Estimators => "Estimator",
            Self::Both => "Matcher + estimator",
        }
    }
}

/// One matcher (with one estimator) on all datasets.
pub(super) struct Row<'a> {
    /// How it is called in tables and legends.
    pub(super) label: String,
    /// Id of the estimator.
    pub(super) estimator: &'a str,
    /// Number of its colour, marker and dash; no two rows have the same.
    pub(super) series: usize,
    /// Whether it is what the others are measured by.
    pub(super) is_baseline: bool,
    /// One cell per dataset, `None` where the matcher was not run.
    pub(super) cells: Vec<Option<Cell<'a>>>,
}

/// One AUC and what the table says about it.
pub(super) struct Cell<'a> {
    pub(super) summary: &'a Summary,
    /// The AUC of the angle that the table is about.
    pub(super) auc: Score,
    /// 1, 2 or 3 for the best three of the dataset (equal scores share the rank), if there is
    /// anything to be better than.
    pub(super) rank: Option<u8>,
    /// Better than SIFT with the same estimator.
    pub(super) above_baseline: bool,
}

impl<'a> Overview<'a> {
    /// The table of the pose error.
    pub(super) fn new(summaries: &'a [Summary]) -> Self {
        Self::of(summaries, Angle::Pose)
    }

    /// The table of one angle of the error.
    pub(super) fn of(summaries: &'a [Summary], angle: Angle) -> Self {
        let mut datasets: Vec<&str> = Vec::new();
        let mut methods: Vec<(&str, &str)> = Vec::new();
        for summary in summaries {
            if !datasets.contains(&&*summary.dataset) {
                datasets.push(&summary.dataset);
            }
            let method = (&*summary.matcher, &*summary.estimator);
            if !methods.contains(&method) {
                methods.push(method);
            }
        }
        let matchers = distinct(methods.iter().map(|method| method.0));
        let place = |name| matchers.iter().position(|matcher| *matcher == name);
        methods.sort_by_key(|&(matcher, estimator)| {
            (matcher != BASELINE, place(matcher), estimator != REFERENCE)
        });
        let subject = subject(&methods);
        let rows = (methods.iter().zip(series(&methods)))
            .map(|(&method, series)| Row {
                series,
                label: match subject {
                    Subject::Matchers => method.0.to_owned(),
                    Subject::Estimators => method.1.to_owned(),
                    Subject::Both => words::method(method.0, method.1),
                },
                estimator: method.1,
                is_baseline: method.0 == BASELINE && subject != Subject::Estimators,
                cells: (datasets.iter())
                    .map(|dataset| cell(summaries, dataset, method, angle))
                    .collect(),
            })
            .collect();
        Self {
            datasets,
            subject,
            rows,
        }
    }

    /// The rows that were run on a dataset, the highest AUC first.
    pub(super) fn ranked(&self, column: usize) -> Vec<(&Row<'a>, &'a Summary)> {
        let mut ranked: Vec<_> = (self.rows.iter())
            .filter_map(|row| Some((row, row.cells[column].as_ref()?)))
            .collect();
        let auc = |cell: &Cell<'_>| cell.auc.value.unwrap_or(f64::NEG_INFINITY);
        ranked.sort_by(|(_, one), (_, other)| auc(other).total_cmp(&auc(one)));
        (ranked.into_iter().map(|(row, cell)| (row, cell.summary))).collect()
    }

    /// How many pairs the numbers of a dataset rest on: `171 pairs`.
    pub(super) fn pairs(&self, column: usize) -> String {
        let Some(summary) = self.first(column) else {
            return String::new();
        };
        let pairs = summary.pairs / summary.repetitions.max(1) as usize;
        match summary.repetitions {
            0 | 1 => format!("{pairs} pairs"),
            many => format!("{pairs} pairs, each {many} times"),
        }
    }

    fn first(&self, column: usize) -> Option<&'a Summary> {
        let mut cells = self
            .rows
            .iter()
            .filter_map(|row| row.cells[column].as_ref());
        cells.next().map(|cell| cell.summary)
    }

    /// Pairs, and the names that stand in no label: `171 pairs, ransac-e`.
    pub(super) fn basis(&self, column: usize) -> String {
        let mut basis = self.pairs(column);
        let Some(summary) = self.first(column) else {
            return basis;
        };
        let silent = match self.subject {
            Subject::Matchers => &summary.estimator,
            Subject::Estimators => &summary.matcher,
            Subject::Both => "",
        };
        if !silent.is_empty() {
            let _ = write!(basis, ", {silent}");
        }
        basis
    }
}

impl Row<'_> {
    /// The mean over all datasets; `None` if it was not run on all of them.
    pub(super) fn mean(&self) -> Option<f64> {
        let values: Option<Vec<f64>> = (self.cells.iter())
            .map(|cell| cell.as_ref()?.auc.value)
            .collect();
        values.map(|values| values.iter().sum::<f64>() / values.len().max(1) as f64)
    }
}

fn subject(methods: &[(&str, &str)]) -> Subject {
    let one = |names: Vec<&str>| names.len() < 2;
    if one(distinct(methods.iter().map(|method| method.1))) {
        Subject::Matchers
    } else if one(distinct(methods.iter().map(|method| method.0))) {
        Subject::Estimators
    } else {
        Subject::Both
    }
}

/// Rows are numbered as they come. But where there are enough dashes for the estimators, a matcher
/// keeps its colour and marker with all of them, and the dash tells the estimator.
fn series(methods: &[(&str, &str)]) -> Vec<usize> {
    let matchers = distinct(methods.iter().map(|method| method.0));
    let estimators = distinct(methods.iter().map(|method| method.1));
    let fits = matchers.len() > 1 && matchers.len() <= COLOURS && estimators.len() <= DASHES;
    let place = |names: &[&str], name| names.iter().position(|other| *other == name);
    (methods.iter().enumerate())
        .map(|(i, &(matcher, estimator))| {
            match (place(&matchers, matcher), place(&estimators, estimator)) {
                (Some(m), Some(e)) if fits => m + COLOURS * e,
                _ => i,
            }
        })
        .collect()
}

/// Each name once, in the order in which they come.
fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut seen = Vec::new();
    for name in names {
        if !seen.contains(&name) {
            seen.push(name);
        }
    }
    seen
}

/// The AUC of one angle of the error.
fn auc_of(summary: &Summary, angle: Angle) -> Score {
    match angle {
        Angle::Pose => summary.auc,
        Angle::Rotation => summary.rotation_auc,
        Angle::Translation => summary.translation_auc,
    }
}

fn cell<'a>(
    summaries: &'a [Summary],
    dataset: &str,
    method: (&str, &str),
    angle: Angle,
) -> Option<Cell<'a>> {
    let rivals = || summaries.iter().filter(|s| s.dataset == dataset);
    let value = |s: &Summary| auc_of(s, angle).value;
    let summary = rivals().find(|s| (&*s.matcher, &*s.estimator) == method)?;
    let auc = value(summary);
    let better = rivals().filter(|s| value(s) > auc).count();
    let scored = rivals().filter(|s| value(s).is_some()).count();
    let baseline = rivals()
        .find(|s| s.matcher == BASELINE && s.estimator == method.1)
        .and_then(value);
    Some(Cell {
        summary,
        auc: auc_of(summary, angle),
        rank: (auc.is_some() && scored > 1 && better < 3).then_some(better as u8 + 1),
        above_baseline: baseline.is_some() && auc > baseline,
    })
}

#[cfg(test)]
mod tests {
    use super::super::tests::summary;
    use super::*;

    fn marks(overview: &Overview<'_>) -> Vec<(String, Option<u8>, bool)> {
        (overview.rows.iter())
            .map(|row| {
                let cell = row.cells[0].as_ref().expect("all were run on the first");
                (row.label.clone(), cell.rank, cell.above_baseline)
            })
            .collect()
    }

    #[test]
    fn best_three_and_above_sift() {
        let summaries = [
            ("orb", 3),
            ("sift", 6),
            ("gms", 9),
            ("surf", 8),
            ("latch", 6),
        ]
        .map(|(name, tenths)| summary("room", name, tenths));
        let expected = [
            ("sift", Some(3), false),
            ("orb", None, false),
            ("gms", Some(1), true),
            ("surf", Some(2), true),
            // Equal to SIFT: shares its rank and is not above it.
            ("latch", Some(3), false),
        ];
        let expected = expected.map(|(name, rank, above)| (name.to_owned(), rank, above));
        assert_eq!(marks(&Overview::new(&summaries)), expected);
    }

    #[test]
    fn a_matcher_that_was_not_run_has_no_cell() {
        let summaries = [
            summary("room", "sift", 6),
            summary("room", "orb", 5),
            summary("street", "sift", 6),
        ];
        let overview = Overview::new(&summaries);
        assert_eq!(overview.datasets, ["room", "street"]);
        assert!(overview.rows[1].cells[1].is_none());
        // Alone on the street, SIFT is not the best of anything.
        assert_eq!(
            overview.rows[0].cells[1].as_ref().and_then(|c| c.rank),
            None
        );
    }

    #[test]
    fn several_estimators_are_told_apart() {
        let mut other = summary("room", "sift", 8);
        other.estimator = "lmeds-e".to_owned();
        let summaries = [summary("room", "sift", 6), other];
        let overview = Overview::new(&summaries);
        let labels: Vec<_> = marks(&overview);
        // The baseline is SIFT with the same estimator, here itself.
        assert_eq!(labels[1], ("lmeds-e".to_owned(), Some(1), false));
        assert_eq!(overview.subject, Subject::Estimators);
        assert_eq!(overview.basis(0), "10 pairs, sift");

        let both = [&summaries[..], &[summary("room", "orb", 7)]].concat();
        let overview = Overview::new(&both);
        assert_eq!(marks(&overview)[0].0, "sift + ransac-e");
        assert_eq!(overview.basis(0), "10 pairs");
        let best_first: Vec<_> = (overview.ranked(0).iter())
            .map(|(row, _)| &*row.label)
            .collect();
        assert_eq!(
            best_first,
            ["sift + lmeds-e", "orb + ransac-e", "sift + ransac-e"]
        );
    }

    #[test]
    fn the_mean_is_of_all_datasets_or_none() {
        let summaries = [
            summary("room", "sift", 6),
            summary("room", "orb", 5),
            summary("street", "sift", 8),
        ];
        let overview = Overview::new(&summaries);
        let mean = overview.rows[0].mean().expect("it was run on both");
        assert!((mean - 0.7).abs() < 1e-12, "{mean}");
        assert_eq!(overview.rows[1].mean(), None);
    }

    #[test]
    fn a_matcher_keeps_its_colour_with_every_estimator() {
        let methods = [("sift", "a"), ("sift", "b"), ("orb", "a"), ("orb", "b")];
        assert_eq!(series(&methods), [0, COLOURS, 1, COLOURS + 1]);
        // One matcher alone: the estimators are what is compared.
        assert_eq!(series(&methods[..2]), [0, 1]);
        let many: Vec<(&str, &str)> = ["a", "b", "c", "d"].map(|e| ("sift", e)).to_vec();
        assert_eq!(
            series(&[&many[..], &[("orb", "a")]].concat()),
            [0, 1, 2, 3, 4]
        );
    }
}
