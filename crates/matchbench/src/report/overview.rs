//! The paper's Table 2 as data: matchers by datasets. The best three are marked, and those above SIFT.

use std::cmp::Reverse;
use std::fmt::Write as _;

use crate::counted::counted;
use crate::metrics::{Angle, Model, Portion, Score, Summary, is_above, ranks};

use super::names;
use super::svg::{COLOURS, DASHES};

/// The matcher that the paper compares the others with.
const BASELINE: &str = "sift";
/// The estimator of the paper.
const REFERENCE: &str = "ransac-e";

/// AUC of every matcher on every dataset. Both are in the order in which the scores name them (that of the plan), but the
/// baseline comes first. Estimators are in one order in every matcher.
pub(super) struct Overview<'a> {
    /// Names of the datasets, the columns.
    pub(super) datasets: Vec<&'a str>,
    /// The portion of the benchmark that each dataset belongs to.
    pub(super) portions: Vec<Portion>,
    /// The estimators, in the order in which the scores name them.
    pub(super) estimators: Vec<&'a str>,
    /// What a row is.
    pub(super) subject: Subject,
    /// One row per matcher, or per matcher and estimator where there are several estimators.
    pub(super) rows: Vec<Row<'a>>,
}

/// What the rows compare. If there is only one matcher or one estimator, no label names it. Labels do not name
/// estimators either if each matcher has its own; a footnote does ([`Overview::footnote`]).
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
    /// Its label in tables and legends.
    pub(super) label: String,
    /// Id of the matcher.
    pub(super) matcher: &'a str,
    /// Id of the estimator.
    pub(super) estimator: &'a str,
    /// Number of its colour, marker and dash; up to 192 rows, no two have the same.
    pub(super) series: usize,
    /// Whether it is the baseline that the others are compared with.
    pub(super) is_baseline: bool,
    /// One cell per dataset, `None` where the matcher was not run.
    pub(super) cells: Vec<Option<Cell<'a>>>,
}

/// One AUC, and how it is marked in the table.
pub(super) struct Cell<'a> {
    pub(super) summary: &'a Summary,
    /// The AUC of the angle that the table is about.
    pub(super) auc: Score,
    /// 1, 2 or 3 for the best three of the dataset (equal scores share the rank), if there is anything to
    /// compare with.
    pub(super) rank: Option<u8>,
    /// Better than the SIFT of the run: with the same estimator, or, if SIFT was not run with it, with the
    /// estimator that SIFT was run with.
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
        let estimators = distinct(methods.iter().map(|method| method.1));
        let place = |names: &[&str], name| names.iter().position(|other| *other == name);
        methods.sort_by_key(|&(matcher, estimator)| {
            let (row, line) = (place(&matchers, matcher), place(&estimators, estimator));
            (matcher != BASELINE, row, line)
        });
        let subject = subject(&methods);
        let rows = (methods.iter().zip(series(&methods, subject)))
            .map(|(&method, series)| Row {
                series,
                label: match subject {
                    Subject::Matchers => method.0.to_owned(),
                    Subject::Estimators => method.1.to_owned(),
                    Subject::Both => crate::metrics::method(method.0, method.1),
                },
                matcher: method.0,
                estimator: method.1,
                is_baseline: method.0 == BASELINE && subject != Subject::Estimators,
                cells: (datasets.iter())
                    .map(|dataset| cell(summaries, dataset, method, angle))
                    .collect(),
            })
            .collect();
        let portion = |dataset: &&str| {
            let summary = summaries.iter().find(|s| s.dataset == *dataset);
            summary.map_or(Portion::Other, |summary| summary.portion)
        };
        Self {
            portions: datasets.iter().map(portion).collect(),
            datasets,
            estimators,
            subject,
            rows,
        }
    }

    /// The same table in the order of the paper: matchers in the order of the list of matchers, others after
    /// them, and fragments before other pairs.
    pub(super) fn in_the_papers_order(mut self) -> Self {
        self.rows.sort_by_key(|row| names::place(row.matcher));
        let mut columns: Vec<usize> = (0..self.datasets.len()).collect();
        columns.sort_by_key(|&column| self.portions[column]);
        for row in &mut self.rows {
            row.cells = columns
                .iter()
                .map(|&column| row.cells[column].take())
                .collect();
        }
        self.datasets = columns
            .iter()
            .map(|&column| self.datasets[column])
            .collect();
        self.portions = columns
            .iter()
            .map(|&column| self.portions[column])
            .collect();
        self
    }

    /// The row of a matcher with an estimator.
    pub(super) fn row(&self, matcher: &str, estimator: &str) -> Option<&Row<'a>> {
        let mut rows = self.rows.iter();
        rows.find(|row| row.matcher == matcher && row.estimator == estimator)
    }

    /// Whether there is a baseline, and something that may be above it.
    pub(super) fn has_baseline(&self) -> bool {
        let is_baseline = |row: &Row<'_>| row.is_baseline;
        self.rows.iter().any(is_baseline) && !self.rows.iter().all(is_baseline)
    }

    /// If each matcher has one estimator and they differ: which matcher was run with which, as
    /// `Pose by ransac-e; by rich: gms, code`. The estimator of SIFT (or of the first row, if there is no SIFT)
    /// is named without its matchers.
    pub(super) fn footnote(&self, name: impl Fn(&str) -> String) -> Option<String> {
        if self.subject != Subject::Matchers {
            return None;
        }
        let estimators = distinct(self.rows.iter().map(|row| row.estimator));
        let (first, others) = estimators.split_first()?;
        if others.is_empty() {
            return None;
        }
        let called = |id: &str| match id {
            "" => "an estimator that the results do not name".to_owned(),
            id => id.to_owned(),
        };
        let mut text = format!("Pose by {}", called(first));
        for other in others {
            let its = self.rows.iter().filter(|row| row.estimator == *other);
            let matchers: Vec<String> = its.map(|row| name(row.matcher)).collect();
            let _ = write!(text, "; by {}: {}", called(other), matchers.join(", "));
        }
        Some(text)
    }

    /// The rows that were run on a dataset, the highest AUC first, and equal ones by name.
    pub(super) fn ranked(&self, column: usize) -> Vec<(&Row<'a>, &'a Summary)> {
        let mut ranked: Vec<_> = (self.rows.iter())
            .filter_map(|row| Some((row, row.cells[column].as_ref()?)))
            .collect();
        ranked.sort_by_key(|(row, _)| (row.matcher, row.estimator));
        let aucs: Vec<Option<f64>> = ranked.iter().map(|(_, cell)| cell.auc.value).collect();
        let mut ranked: Vec<_> = ranks(&aucs).into_iter().zip(ranked).collect();
        ranked.sort_by_key(|(rank, _)| *rank);
        (ranked
            .into_iter()
            .map(|(_, (row, cell))| (row, cell.summary)))
        .collect()
    }

    /// What was estimated on a dataset; poses, if there are both poses and homographies.
    pub(super) fn model(&self, column: usize) -> Model {
        let cells = self
            .rows
            .iter()
            .filter_map(|row| row.cells[column].as_ref());
        cells
            .map(|cell| cell.summary.model)
            .min()
            .unwrap_or_default()
    }

    /// Whether anything that was estimated is of this kind.
    pub(super) fn has(&self, model: Model) -> bool {
        let mut cells = self.rows.iter().flat_map(|row| row.cells.iter().flatten());
        cells.any(|cell| cell.summary.model == model)
    }

    /// What is estimated from the matches, as text.
    pub(super) fn truth(&self) -> &'static str {
        match [Model::Pose, Model::Homography].map(|model| self.has(model)) {
            [true, true] => "pose or homography",
            [false, true] => "homography",
            [_, false] => "pose",
        }
    }

    /// What AUC means here.
    pub(super) fn auc(&self) -> &'static str {
        match [Model::Pose, Model::Homography].map(|model| self.has(model)) {
            [true, true] => {
                "mean of SP(1) ... SP(15); of homographies area under recall up to 3 px of corner error"
            }
            [false, true] => "area under recall up to 3 px of corner error",
            [_, false] => "mean of SP(1) ... SP(15)",
        }
    }

    /// The number of pairs from which the numbers of a dataset are computed: `171 pairs`.
    pub(super) fn pairs(&self, column: usize) -> String {
        self.pairs_of(column, self.model(column))
    }

    fn pairs_of(&self, column: usize, model: Model) -> String {
        let Some(summary) = self.fullest(column, model) else {
            return String::new();
        };
        let pairs = counted(summary.pairs / summary.repetitions.max(1) as usize, "pair");
        match summary.repetitions {
            0 | 1 => pairs,
            many => format!("{pairs}, each {many} times"),
        }
    }

    /// The scores that speak for a column: the first of those with the most pairs, since others lack some of these if the
    /// run is not finished.
    fn fullest(&self, column: usize, model: Model) -> Option<&'a Summary> {
        let cells = self
            .rows
            .iter()
            .filter_map(|row| row.cells[column].as_ref());
        let summaries = cells.map(|cell| cell.summary);
        summaries
            .filter(|summary| summary.model == model)
            .min_by_key(|summary| Reverse(summary.pairs))
    }

    /// Pairs, and the names that stand in no label: `171 pairs, ransac-e`. If there are both poses and
    /// homographies, of poses.
    pub(super) fn basis(&self, column: usize) -> String {
        self.basis_of(column, self.model(column))
    }

    /// The same of what was estimated of this kind.
    pub(super) fn basis_of(&self, column: usize, model: Model) -> String {
        let mut basis = self.pairs_of(column, model);
        let Some(summary) = self.fullest(column, model) else {
            return basis;
        };
        let silent = match self.subject {
            // Several stand in the footnote.
            Subject::Matchers if self.footnote(str::to_owned).is_some() => "",
            Subject::Matchers => &summary.estimator,
            Subject::Estimators => &summary.matcher,
            Subject::Both => "",
        };
        if !silent.is_empty() {
            let _ = write!(basis, ", {silent}");
        }
        if model == Model::Homography {
            basis.push_str(", AUC at 3 px");
        }
        basis
    }
}

impl Row<'_> {
    /// The mean over all datasets; `None` if it was not run on all of them, or lacks results of one.
    pub(super) fn mean(&self) -> Option<f64> {
        let values: Option<Vec<f64>> = (self.cells.iter())
            .map(|cell| {
                cell.as_ref()
                    .filter(|cell| cell.summary.lacking == 0)?
                    .auc
                    .value
            })
            .collect();
        values.map(|values| values.iter().sum::<f64>() / values.len().max(1) as f64)
    }
}

fn subject(methods: &[(&str, &str)]) -> Subject {
    let one = |names: Vec<&str>| names.len() < 2;
    let matchers = distinct(methods.iter().map(|method| method.0));
    let estimators = distinct(methods.iter().map(|method| method.1));
    if one(estimators) || matchers.len() == methods.len() {
        Subject::Matchers
    } else if one(distinct(methods.iter().map(|method| method.0))) {
        Subject::Estimators
    } else {
        Subject::Both
    }
}

/// Numbers of the rows, in their order. But if there are enough dashes for the estimators, a matcher keeps its
/// colour and marker with all of them, and the dash distinguishes the estimators.
fn series(methods: &[(&str, &str)], subject: Subject) -> Vec<usize> {
    let matchers = distinct(methods.iter().map(|method| method.0));
    let estimators = distinct(methods.iter().map(|method| method.1));
    let fits = subject == Subject::Both && matchers.len() <= COLOURS && estimators.len() <= DASHES;
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

fn cell<'a>(
    summaries: &'a [Summary],
    dataset: &str,
    method: (&str, &str),
    angle: Angle,
) -> Option<Cell<'a>> {
    let here = || summaries.iter().filter(|s| s.dataset == dataset);
    let value = |s: &Summary| s.auc_of(angle).value;
    let summary = here().find(|s| (&*s.matcher, &*s.estimator) == method)?;
    let rivals = || here().filter(|s| s.model == summary.model && s.lacking == 0);
    let is_ranked = summary.lacking == 0;
    let auc = value(summary);
    let better = rivals().filter(|s| is_above(value(s), auc)).count();
    let scored = rivals().filter(|s| value(s).is_some()).count();
    let baselines = || rivals().filter(|s| s.matcher == BASELINE);
    let baseline = baselines()
        .find(|s| s.estimator == method.1)
        .or_else(|| baselines().find(|s| s.estimator == REFERENCE))
        .or_else(|| baselines().next())
        .and_then(value);
    Some(Cell {
        summary,
        auc: summary.auc_of(angle),
        // If no method solved a pair, none is best.
        rank: (is_ranked && auc > Some(0.0) && scored > 1 && better < 3)
            .then_some(better as u8 + 1),
        above_baseline: is_ranked && baseline.is_some() && is_above(auc, baseline),
    })
}

#[cfg(test)]
mod tests {
    use super::super::tests::{homographies, summary};
    use super::super::{booktabs, latex};
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
        // What is not finished has no rank and takes none from others.
        let mut stopped = summaries;
        stopped[2].lacking = 1;
        let marks = marks(&Overview::new(&stopped)).into_iter();
        let ranks: Vec<Option<u8>> = marks.map(|(_, rank, _)| rank).collect();
        assert_eq!(ranks, [Some(2), None, None, Some(1), Some(2)]);
    }

    #[test]
    fn what_auc_means_is_said_of_poses_and_of_homographies() {
        let (poses, corners) = ("SP(15)", "3 px of corner error");
        let pose = summary("room", "sift", 6);
        let homography = homographies("room", "sift");
        for (summaries, said) in [
            (vec![pose.clone()], [true, false]),
            (vec![homography.clone()], [false, true]),
            (vec![pose, homography], [true, true]),
        ] {
            for table in [
                Overview::new(&summaries).auc().to_owned(),
                latex::render(&summaries),
                booktabs::render(&summaries),
            ] {
                assert_eq!([poses, corners].map(|text| table.contains(text)), said);
            }
        }
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
        // The first was stopped.
        let mut stopped = summaries.clone();
        (stopped[0].pairs, stopped[0].lacking) = (4, 6);
        assert_eq!(Overview::new(&stopped).basis(0), "10 pairs, sift");

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
    fn matchers_as_they_were_run_are_measured_by_sift_as_it_was_run() {
        let mut gms = summary("room", "gms", 9);
        gms.estimator = "rich".to_owned();
        let summaries = [gms, summary("room", "orb", 3), summary("room", "sift", 6)];
        let overview = Overview::new(&summaries);
        let expected = [
            ("sift", Some(2), false),
            ("gms", Some(1), true),
            ("orb", Some(3), false),
        ];
        let expected = expected.map(|(name, rank, above)| (name.to_owned(), rank, above));
        assert_eq!(marks(&overview), expected);
        assert_eq!(overview.basis(0), "10 pairs");
        let note = overview.footnote(str::to_owned);
        assert_eq!(note.as_deref(), Some("Pose by ransac-e; by rich: gms"));
        // Where SIFT was run with the same estimator too, that is what counts.
        let mut rich = summary("room", "sift", 10);
        rich.estimator = "rich".to_owned();
        let summaries = [&summaries[..], &[rich]].concat();
        let overview = Overview::new(&summaries);
        let row = overview.rows.iter().find(|row| row.label == "gms + rich");
        let cell = row
            .and_then(|row| row.cells[0].as_ref())
            .expect("it was run");
        assert!(!cell.above_baseline && overview.footnote(str::to_owned).is_none());
    }

    #[test]
    fn the_paper_has_its_own_order() {
        let mut street = summary("street", "kaze", 6);
        street.portion = Portion::Fragments;
        let summaries = [
            summary("room", "gms", 6),
            summary("room", "mine", 6),
            summary("room", "orb", 5),
            street,
        ];
        let overview = Overview::new(&summaries).in_the_papers_order();
        let labels: Vec<&str> = overview.rows.iter().map(|row| &*row.label).collect();
        assert_eq!(labels, ["orb", "kaze", "gms", "mine"]);
        assert_eq!(overview.datasets, ["street", "room"]);
        assert!(overview.rows[1].cells[0].is_some() && overview.rows[1].cells[1].is_none());
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
        let mut stopped = summaries;
        stopped[2].lacking = 1;
        assert_eq!(Overview::new(&stopped).rows[0].mean(), None);
    }

    #[test]
    fn a_matcher_keeps_its_colour_with_every_estimator() {
        let methods = [("sift", "a"), ("sift", "b"), ("orb", "a"), ("orb", "b")];
        let series = |methods: &[(&str, &str)]| series(methods, subject(methods));
        assert_eq!(series(&methods), [0, COLOURS, 1, COLOURS + 1]);
        // One matcher alone: the estimators are what is compared.
        assert_eq!(series(&methods[..2]), [0, 1]);
        // Each with its own: the estimator is a footnote.
        assert_eq!(series(&[("sift", "a"), ("gms", "b")]), [0, 1]);
        let many: Vec<(&str, &str)> = ["a", "b", "c", "d"].map(|e| ("sift", e)).to_vec();
        assert_eq!(
            series(&[&many[..], &[("orb", "a")]].concat()),
            [0, 1, 2, 3, 4]
        );
    }
}
