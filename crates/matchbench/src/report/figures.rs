//! The figures of a report: which curves and bars of which dataset go into which drawing.

use std::collections::BTreeSet;

use crate::metrics::{
    Angle, PairGeometry, Portion, Quartiles, StageQuartiles, Stratum, Summary, auc_by_stratum,
    strata,
};

use super::content::Content;
use super::latex::sequence_numbers;
use super::numbers::short;
use super::overview::{Overview, REFERENCE};
use super::svg::{
    ApSeries, Dot, Rival, Target, ap_bars, ap_panel, forest, heat_map, scatter, sp_curves,
    strata_curves,
};
use super::words::advantage;

/// Parts that the pairs of a dataset are cut into by difficulty.
const STRATA: usize = 4;

/// What the difficulty of a pair is told by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Difficulty {
    Baseline,
    ViewAngle,
    Overlap,
}

impl Difficulty {
    pub(super) const ALL: [Self; 3] = [Self::Baseline, Self::ViewAngle, Self::Overlap];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Baseline => "baseline",
            Self::ViewAngle => "angle",
            Self::Overlap => "overlap",
        }
    }

    fn axis(self) -> &'static str {
        match self {
            Self::Baseline => "baseline (unit of the dataset)",
            Self::ViewAngle => "angle between the optical axes (degrees)",
            Self::Overlap => "overlap (upper bound)",
        }
    }

    fn of(self, geometry: &PairGeometry) -> f64 {
        match self {
            Self::Baseline => geometry.baseline,
            Self::ViewAngle => geometry.view_angle,
            Self::Overlap => geometry.overlap,
        }
    }
}

/// A dataset as the title of a figure names it.
fn named(overview: &Overview<'_>, column: usize) -> String {
    format!("{} ({})", overview.datasets[column], overview.basis(column))
}

/// Number and name of a matcher, and its AUC in each range.
type Line<'a> = (usize, &'a str, Vec<Option<f64>>);

/// The ranges of a difficulty, and the AUC in each of every matcher; nothing where nothing is known
/// of it on this dataset.
pub(super) fn difficulty_lines<'a>(
    content: &Content,
    overview: &'a Overview<'_>,
    column: usize,
    difficulty: Difficulty,
) -> Option<(Vec<String>, Vec<Line<'a>>)> {
    let dataset = overview.datasets[column];
    let geometry = content.geometry.get(dataset)?;
    let value = |geometry: &PairGeometry| difficulty.of(geometry);
    let strata = strata(geometry, value, STRATA);
    let label = |stratum: &Stratum| match (short(stratum.low), short(stratum.high)) {
        (low, high) if low == high => low,
        (low, high) => format!("{low}–{high}"),
    };
    let ranges: Vec<String> = strata.iter().map(label).collect();
    let lines = (overview.ranked(column).into_iter())
        .filter_map(|(row, summary)| {
            let is_its = |set: &&crate::metrics::ResultSet| {
                (&set.dataset, &set.matcher, &set.estimator)
                    == (&summary.dataset, &summary.matcher, &summary.estimator)
            };
            let set = content.results.iter().find(is_its)?;
            Some((
                row.series,
                &*row.label,
                auc_by_stratum(set, geometry, value, &strata),
            ))
        })
        .collect();
    Some((ranges, lines))
}

/// AUC over difficulty, if anything is known of it on this dataset.
pub(super) fn difficulty_figure(
    content: &Content,
    overview: &Overview<'_>,
    column: usize,
    difficulty: Difficulty,
    target: Target,
) -> Option<String> {
    let (ranges, lines) = difficulty_lines(content, overview, column, difficulty)?;
    let title = format!(
        "AUC over {}: {}",
        difficulty.name(),
        named(overview, column)
    );
    Some(strata_curves(
        target,
        &title,
        (difficulty.axis(), &ranges),
        &lines,
    ))
}

/// The stages of a matcher on a dataset: each is timed with the first estimator alone, since the
/// others are given the same matches, and detection with the first matcher that has these features.
/// The pose is that of `summary`.
pub(super) fn stages_of(content: &Content, summary: &Summary) -> StageQuartiles {
    let features = |matcher: &str| content.extractions.get(matcher);
    let here = || (content.summaries.iter()).filter(|s| s.dataset == summary.dataset);
    let stage = |get: fn(&StageQuartiles) -> Option<Quartiles>| {
        let mut same = here().filter(|s| s.matcher == summary.matcher);
        get(&summary.stages).or_else(|| same.find_map(|s| get(&s.stages)))
    };
    let extract = || {
        let own = features(&summary.matcher)?;
        let mut same = here().filter(|s| features(&s.matcher) == Some(own));
        same.find_map(|s| s.stages.extract)
    };
    StageQuartiles {
        extract: stage(|stages| stages.extract).or_else(extract),
        search: stage(|stages| stages.search),
        select: stage(|stages| stages.select),
        outside: stage(|stages| stages.outside),
        ..summary.stages
    }
}

/// Seconds for a pair, both of whose images are new: the medians of all stages that were timed, if
/// detection and search were.
pub(super) fn seconds_for_a_pair(content: &Content, summary: &Summary) -> Option<f64> {
    let stages = stages_of(content, summary);
    let optional = |stage: Option<Quartiles>| stage.map_or(0.0, |spread| spread.median);
    let (extract, search) = (stages.extract?.median, stages.search?.median);
    Some(2.0 * extract + search + optional(stages.select) + optional(stages.estimate))
}

/// Accuracy against time on one dataset, if anything was timed.
pub(super) fn time_figure(
    content: &Content,
    overview: &Overview<'_>,
    column: usize,
    target: Target,
) -> Option<String> {
    let dots: Vec<Dot<'_>> = (overview.rows.iter())
        .filter_map(|row| {
            let summary = row.cells[column].as_ref()?.summary;
            Some(Dot {
                series: row.series,
                name: &row.label,
                seconds: seconds_for_a_pair(content, summary)?,
                auc: summary.auc(),
            })
        })
        .collect();
    let title = format!("AUC over time: {}", named(overview, column));
    (!dots.is_empty()).then(|| scatter(target, &title, &dots))
}

/// Matchers whose time for a pair is not known.
pub(super) fn untimed<'a>(
    content: &Content,
    overview: &Overview<'a>,
    column: usize,
) -> BTreeSet<&'a str> {
    (overview.rows.iter())
        .filter_map(|row| Some(row.cells[column].as_ref()?.summary))
        .filter(|summary| seconds_for_a_pair(content, summary).is_none())
        .map(|summary| &*summary.matcher)
        .collect()
}

/// The best of a dataset against the others, if there are others.
pub(super) fn lead_figure(
    content: &Content,
    overview: &Overview<'_>,
    column: usize,
    target: Target,
) -> Option<String> {
    let dataset = overview.datasets[column];
    let leads = || content.leads.iter().filter(|lead| lead.dataset == dataset);
    let row = |(matcher, estimator): &(String, String)| {
        overview.rows.iter().find(|row| {
            let summary = row.cells[column].as_ref().map(|cell| cell.summary);
            summary.is_some_and(|s| s.matcher == *matcher && s.estimator == *estimator)
        })
    };
    let best = row(&leads().next()?.best)?;
    let mut rivals: Vec<Rival<'_>> = leads()
        .filter_map(|lead| {
            let row = row(&lead.other)?;
            Some(Rival {
                series: row.series,
                name: &row.label,
                words: advantage(&best.label, &row.label, dataset, &lead.difference),
                behind: lead.difference,
            })
        })
        .collect();
    let behind = |rival: &Rival<'_>| rival.behind.value.unwrap_or(f64::INFINITY);
    rivals.sort_by(|one, other| behind(one).total_cmp(&behind(other)));
    let title = format!("Lead of {}: {}", best.label, named(overview, column));
    Some(forest(target, &title, &best.label, &rivals))
}

/// AUC of matchers by estimators on one dataset, or the mean over all; nothing where there is only
/// one estimator.
pub(super) fn estimator_figure(
    summaries: &[Summary],
    dataset: Option<&str>,
    target: Target,
) -> Option<String> {
    let mut matchers: Vec<&str> = Vec::new();
    let mut estimators: Vec<&str> = Vec::new();
    for summary in summaries {
        if !matchers.contains(&&*summary.matcher) {
            matchers.push(&summary.matcher);
        }
        if !estimators.contains(&&*summary.estimator) {
            estimators.push(&summary.estimator);
        }
    }
    estimators.sort_by_key(|id| *id != REFERENCE);
    if estimators.len() < 2 {
        return None;
    }
    let mean = |matcher: &str, estimator: &str| {
        let here = |s: &&Summary| {
            s.matcher == matcher
                && s.estimator == estimator
                && dataset.is_none_or(|name| s.dataset == name)
        };
        let values: Vec<f64> = summaries
            .iter()
            .filter(here)
            .filter_map(|s| s.auc().value)
            .collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    };
    let cells: Vec<Vec<Option<f64>>> = (matchers.iter())
        .map(|matcher| {
            estimators
                .iter()
                .map(|estimator| mean(matcher, estimator))
                .collect()
        })
        .collect();
    let title = format!(
        "AUC by estimator: {}",
        dataset.unwrap_or("mean over all datasets")
    );
    Some(heat_map(target, &title, &matchers, &estimators, &cells))
}

/// The SP curves of one dataset.
pub(super) fn sp_figure(
    overview: &Overview<'_>,
    column: usize,
    angle: Angle,
    target: Target,
) -> String {
    let mut curves: Vec<_> = (overview.ranked(column).into_iter())
        .map(|(row, summary)| {
            let curve = match angle {
                Angle::Pose => &summary.sp,
                Angle::Rotation => &summary.rotation_sp,
                Angle::Translation => &summary.translation_sp,
            };
            (row.series, &*row.label, curve)
        })
        .collect();
    curves.sort_by(|(_, _, one), (_, _, other)| other.auc().total_cmp(&one.auc()));
    let what = match angle {
        Angle::Pose => "SP curves",
        Angle::Rotation => "SP curves of the rotation",
        Angle::Translation => "SP curves of the translation",
    };
    let title = format!("{what}: {}", named(overview, column));
    sp_curves(target, &title, &curves)
}

/// The paper's panel of AP bars of one portion, if any dataset belongs to it.
pub(super) fn ap_panel_figure(
    overview: &Overview<'_>,
    portion: Portion,
    target: Target,
) -> Option<String> {
    let columns: Vec<usize> = (0..overview.datasets.len())
        .filter(|&column| overview.portions[column] == portion)
        .collect();
    let numbers = sequence_numbers(&overview.datasets);
    let sequences: Vec<String> = columns
        .iter()
        .map(|&column| numbers[column].clone())
        .collect();
    let series: Vec<ApSeries<'_>> = (overview.rows.iter())
        .filter(|row| columns.iter().any(|&column| row.cells[column].is_some()))
        .map(|row| {
            let ap = |&column: &usize| row.cells[column].as_ref()?.summary.scores.get("ap5").value;
            (row.series, &*row.label, columns.iter().map(ap).collect())
        })
        .collect();
    let title = format!("AP bars at 5 degrees: {} baselines", portion.name());
    (!columns.is_empty()).then(|| ap_panel(target, &title, &sequences, &series))
}

/// The AP bars of one dataset.
pub(super) fn ap_figure(overview: &Overview<'_>, column: usize, target: Target) -> String {
    let bars: Vec<_> = (overview.rows.iter())
        .filter_map(|row| {
            let summary = row.cells[column].as_ref()?.summary;
            Some((row.series, &*row.label, summary.scores.get("ap5")))
        })
        .collect();
    let title = format!("AP bars at 5 degrees: {}", named(overview, column));
    ap_bars(target, &title, &bars)
}
