//! The figures of a report: which curves and bars of which dataset go into which drawing.

use std::collections::BTreeSet;

use crate::metrics::{
    Angle, DatasetGeometry, Lead, Model, PairGeometry, Portion, Reliability, ResultSet, Stratum,
    SuccessCurve, Summary, auc_by_stratum, strata,
};

use super::advantage::advantage;
use super::content::Content;
use super::latex::sequence_numbers;
use super::numbers::short;
use super::overview::Overview;
use super::pair_time::seconds_for_a_pair;
use super::svg::{
    ApSeries, Axes, Curve, Dot, Rival, Target, ap_bars, ap_panel, forest, reliability_diagram,
    scatter, sp_curves, strata_curves,
};
use super::words::names_or_count;

/// Pixels within which matches are counted for the number beside a curve of matching accuracy.
const ACCURACY_PX: usize = 3;
/// Number of groups into which the pairs of a dataset are divided by difficulty.
const STRATA: usize = 4;

/// The quantity that measures the difficulty of a pair.
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

    fn axis(self, geometry: &DatasetGeometry) -> &'static str {
        match self {
            Self::Baseline => "baseline (unit of the dataset)",
            Self::ViewAngle => "angle between the optical axes (degrees)",
            Self::Overlap if is_measured(geometry) => "overlap (measured by depth)",
            Self::Overlap => "overlap (upper bound)",
        }
    }

    fn of(self, geometry: &PairGeometry) -> Option<f64> {
        match self {
            Self::Baseline => geometry.baseline,
            Self::ViewAngle => geometry.view_angle,
            Self::Overlap => Some(geometry.overlap),
        }
    }
}

/// Whether the overlap of all pairs was measured; else it is called an upper bound.
pub(super) fn is_measured(geometry: &DatasetGeometry) -> bool {
    geometry.values().all(|pair| pair.is_measured)
}

/// The name of a dataset in the title of a figure.
fn named(overview: &Overview<'_>, column: usize) -> String {
    format!("{} ({})", overview.datasets[column], overview.basis(column))
}

/// Number and name of a matcher, and its AUC in each range.
type Line<'a> = (usize, &'a str, Vec<Option<f64>>);

/// The ranges of a difficulty, and the AUC of every matcher in each range. If there are both poses and
/// homographies, of poses. `None` if the difficulty is not known on this dataset.
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
    if strata.is_empty() {
        return None;
    }
    let label = |stratum: &Stratum| match (short(stratum.low), short(stratum.high)) {
        (low, high) if low == high => low,
        (low, high) => format!("{low}–{high}"),
    };
    let ranges: Vec<String> = strata.iter().map(label).collect();
    let model = overview.model(column);
    let lines = (overview.ranked(column).into_iter())
        .filter(|(_, summary)| summary.model == model)
        .filter_map(|(row, summary)| {
            let set = set_of(content, summary)?;
            Some((
                row.series,
                &*row.label,
                auc_by_stratum(set, geometry, value, &strata),
            ))
        })
        .collect();
    Some((ranges, lines))
}

/// The largest AUC over a difficulty on any dataset, to which the axes of all figures of it reach.
pub(super) fn most_over(content: &Content, overview: &Overview<'_>, difficulty: Difficulty) -> f64 {
    let lines = |column| difficulty_lines(content, overview, column, difficulty);
    (0..overview.datasets.len())
        .filter_map(lines)
        .flat_map(|(_, lines)| lines)
        .flat_map(|(_, _, values)| values.into_iter().flatten())
        .fold(0.0, f64::max)
}

/// AUC over difficulty, if anything is known of it on this dataset. The axis is for all datasets (see [`most_over`]).
pub(super) fn difficulty_figure(
    content: &Content,
    overview: &Overview<'_>,
    column: usize,
    (difficulty, most): (Difficulty, f64),
    target: Target,
) -> Option<String> {
    let (ranges, lines) = difficulty_lines(content, overview, column, difficulty)?;
    let geometry = content.geometry.get(overview.datasets[column])?;
    let title = format!(
        "AUC over {}: {}",
        difficulty.name(),
        named(overview, column)
    );
    Some(strata_curves(
        target,
        &title,
        (difficulty.axis(geometry), &ranges),
        &lines,
        most,
    ))
}

/// How well the stated probabilities of each method agree with its results on one dataset, the best method
/// first. Methods that state none are left out.
pub(super) fn reliabilities<'a>(
    content: &Content,
    overview: &'a Overview<'_>,
    column: usize,
) -> Vec<(usize, &'a str, Reliability)> {
    (overview.ranked(column).into_iter())
        .filter_map(|(row, summary)| {
            let set = set_of(content, summary)?;
            Some((row.series, &*row.label, Reliability::of(&set.pairs)?))
        })
        .collect()
}

/// The reliability diagram of one dataset, of the methods with poses enough for a curve, if there are any.
pub(super) fn reliability_figure(
    lines: &[(usize, &str, Reliability)],
    overview: &Overview<'_>,
    column: usize,
    target: Target,
) -> Option<String> {
    let title = format!("Reliability: {}", named(overview, column));
    let curves: Vec<_> = (lines.iter())
        .filter(|(_, _, reliability)| reliability.has_curve())
        .collect();
    (!curves.is_empty()).then(|| reliability_diagram(target, &title, &curves))
}

/// The results behind a summary.
fn set_of<'a>(content: &'a Content, summary: &Summary) -> Option<&'a ResultSet> {
    content.results.iter().find(|set| {
        (&set.dataset, &set.matcher, &set.estimator)
            == (&summary.dataset, &summary.matcher, &summary.estimator)
    })
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
                model: summary.model,
                seconds: seconds_for_a_pair(content, summary)?,
                auc: summary.auc(),
                is_compared: summary.lacking == 0,
            })
        })
        .collect();
    let title = format!("AUC over time: {}", named(overview, column));
    (!dots.is_empty()).then(|| scatter(target, &title, &dots))
}

/// The best method of a dataset compared with the others, if there are others. If there are both poses and
/// homographies, poses.
pub(super) fn lead_figure(
    content: &Content,
    overview: &Overview<'_>,
    column: usize,
    target: Target,
) -> Option<String> {
    let dataset = overview.datasets[column];
    let leads = || leads_on(content, overview, column);
    let row = |(matcher, estimator): &(String, String)| overview.row(matcher, estimator);
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
    let level = rivals.iter().filter(|rival| rival.behind.is_zero());
    let mut leaders = vec![&*best.label];
    leaders.extend(level.map(|rival| rival.name));
    let who = names_or_count(&leaders, 1 + rivals.len());
    let title = format!("Lead of {who}: {}", named(overview, column));
    Some(forest(target, &title, &leaders, &rivals))
}

/// What [`lead_figure`] shows.
pub(super) fn leads_on<'a>(
    content: &'a Content,
    overview: &Overview<'_>,
    column: usize,
) -> impl Iterator<Item = &'a Lead> {
    let (dataset, model) = (overview.datasets[column].to_owned(), overview.model(column));
    (content.leads.iter()).filter(move |lead| lead.dataset == dataset && lead.model == model)
}

/// The curve of a summary for one angle of the error. For homographies the curve of the corner error is used
/// instead of that of the pose error; the other angles have none.
pub(super) fn success_curve(summary: &Summary, angle: Angle) -> Option<&SuccessCurve> {
    match (summary.model, angle) {
        (Model::Pose, Angle::Pose) => Some(&summary.sp),
        (Model::Pose, Angle::Rotation) => Some(&summary.rotation_sp),
        (Model::Pose, Angle::Translation) => Some(&summary.translation_sp),
        (Model::Homography, Angle::Pose) => Some(&summary.corner_sp),
        (Model::Homography, Angle::Rotation | Angle::Translation) => None,
    }
}

/// The SP curves of one dataset. If there are both poses and homographies, those of poses. `None` if there is
/// nothing to show.
pub(super) fn sp_figure(
    overview: &Overview<'_>,
    column: usize,
    angle: Angle,
    target: Target,
) -> Option<String> {
    let model = overview.model(column);
    let mut curves: Vec<Curve<'_>> = (overview.ranked(column).into_iter())
        .filter(|(_, summary)| summary.model == model)
        .filter_map(|(row, summary)| {
            let curve = success_curve(summary, angle)?;
            Some(Curve {
                series: row.series,
                others: Vec::new(),
                name: &row.label,
                values: curve.values().to_vec(),
                // Of homographies it is no mean of the curve but an area up to 3 px.
                number: match model {
                    Model::Pose => curve.auc(),
                    Model::Homography => summary.auc().value.unwrap_or(f64::NAN),
                },
            })
        })
        .collect();
    if curves.is_empty() {
        return None;
    }
    curves.sort_by(|one, other| other.number.total_cmp(&one.number));
    let what = match (model, angle) {
        (Model::Homography, _) => "Corner error",
        (Model::Pose, Angle::Pose) => "SP curves",
        (Model::Pose, Angle::Rotation) => "SP curves of the rotation",
        (Model::Pose, Angle::Translation) => "SP curves of the translation",
    };
    let (x, unit) = match model {
        Model::Pose => ("error threshold (degrees)", "°"),
        Model::Homography => ("corner error threshold (pixels)", " px"),
    };
    let axes = Axes {
        x,
        unit,
        y: "success ratio",
        most: most_success(overview, angle),
    };
    let title = format!("{what}: {}", named(overview, column));
    Some(sp_curves(target, &title, &axes, &curves))
}

/// The largest success ratio on any dataset.
fn most_success(overview: &Overview<'_>, angle: Angle) -> f64 {
    let cells = overview
        .rows
        .iter()
        .flat_map(|row| row.cells.iter().flatten());
    let curves = cells.filter_map(|cell| success_curve(cell.summary, angle));
    (curves.filter_map(|curve| curve.values().last().copied())).fold(0.0, f64::max)
}

/// The mean matching accuracy of each matcher on one dataset, if its true homographies are known.
pub(super) fn accuracy_figure(
    overview: &Overview<'_>,
    column: usize,
    target: Target,
) -> Option<String> {
    let curves: Vec<Curve<'_>> = (accuracies(overview, column).into_iter())
        .map(|(series, name, values)| {
            let same = overview.rows.iter().filter(|row| row.matcher == name);
            Curve {
                series,
                others: (same.map(|row| row.series).filter(|&other| other != series)).collect(),
                name,
                number: values[ACCURACY_PX - 1],
                values,
            }
        })
        .collect();
    let dataset = overview.datasets[column];
    let basis = accuracy_basis(overview, column);
    let title = format!("Mean matching accuracy: {dataset} ({basis})");
    let axes = Axes {
        x: "distance threshold (pixels)",
        unit: " px",
        y: "share of the matches",
        most: (0..overview.datasets.len())
            .flat_map(|column| accuracies(overview, column))
            .flat_map(|(_, _, values)| values)
            .fold(0.0, f64::max),
    };
    (!curves.is_empty()).then(|| sp_curves(target, &title, &axes, &curves))
}

/// What the numbers of the matching accuracy are, for its title. They depend on no estimator.
pub(super) fn accuracy_basis(overview: &Overview<'_>, column: usize) -> String {
    format!("{}, MMA at {ACCURACY_PX} px", overview.pairs(column))
}

/// Number, name and mean matching accuracy within 1, 2, ... 10 pixels of each matcher, the best within 3 pixels first. A
/// matcher is listed once, whatever its estimators. Matchers whose accuracy is not known are left out.
pub(super) fn accuracies<'a>(
    overview: &'a Overview<'_>,
    column: usize,
) -> Vec<(usize, &'a str, Vec<f64>)> {
    let mut seen = BTreeSet::new();
    let cells = (overview.rows.iter()).filter_map(|row| Some((row, row.cells[column].as_ref()?)));
    let mut rows: Vec<_> = cells
        .filter(|(row, _)| seen.insert(row.matcher))
        .filter_map(|(row, cell)| {
            let summary = cell.summary;
            let within = |k: usize| summary.scores.get(&format!("mma{k}")).value;
            let values = (1..=10).map(within).collect::<Option<Vec<f64>>>()?;
            Some((row.series, row.matcher, values))
        })
        .collect();
    let number = |values: &[f64]| values[ACCURACY_PX - 1];
    rows.sort_by(|(_, _, one), (_, _, other)| number(other).total_cmp(&number(one)));
    rows
}

/// The paper's panel of AP bars of one portion, with its `name` in the title, if poses were estimated on any dataset that
/// belongs to it.
pub(super) fn ap_panel_figure(
    overview: &Overview<'_>,
    portion: Portion,
    name: &str,
    target: Target,
) -> Option<String> {
    let columns: Vec<usize> = (0..overview.datasets.len())
        .filter(|&column| overview.portions[column] == portion)
        .filter(|&column| overview.model(column) == Model::Pose)
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
    let title = format!("AP bars at 5 degrees: {name}");
    (!columns.is_empty()).then(|| ap_panel(target, &title, &sequences, &series))
}

/// The AP bars of one dataset, if poses were estimated.
pub(super) fn ap_figure(overview: &Overview<'_>, column: usize, target: Target) -> Option<String> {
    let bars: Vec<_> = (overview.rows.iter())
        .filter_map(|row| {
            let summary = row.cells[column].as_ref()?.summary;
            let of_pose = summary.model == Model::Pose;
            of_pose.then(|| (row.series, &*row.label, summary.scores.get("ap5")))
        })
        .collect();
    let title = format!("AP bars at 5 degrees: {}", named(overview, column));
    (!bars.is_empty()).then(|| ap_bars(target, &title, &bars))
}

#[cfg(test)]
mod tests {
    use super::super::RunFacts;
    use super::super::numbers::ratio;
    use super::super::tests::{homography_results, results};
    use super::*;

    #[test]
    fn the_best_pose_does_not_lead_a_homography() {
        let sets = vec![
            results("wall", "sift", 7),
            results("wall", "orb", 5),
            homography_results("wall", "sift", 1.0),
            homography_results("wall", "orb", 0.1),
        ];
        let content = Content::new(sets, RunFacts::default());
        let overview = Overview::new(&content.summaries);
        let svg = lead_figure(&content, &overview, 0, Target::File).expect("there are rivals");
        assert!(svg.contains("AUC by which sift + ransac-e leads"), "{svg}");
        assert_eq!(svg.matches("class=\"rival").count(), 1, "{svg}");
        assert!(!svg.contains("best-h"), "{svg}");
    }

    #[test]
    fn homographies_have_no_panel_of_correspondences_of_poses() {
        let panel = |sets| {
            let content = Content::new(sets, RunFacts::default());
            let overview = Overview::new(&content.summaries);
            ap_panel_figure(&overview, overview.portions[0], "other pairs", Target::File)
        };
        let plane = homography_results("wall", "sift", 1.0);
        assert_eq!(panel(vec![plane.clone()]), None);
        assert!(panel(vec![plane, results("wall", "sift", 7)]).is_some());
    }

    #[test]
    fn poses_and_homographies_share_no_axis_of_difficulty() {
        let sets = vec![
            homography_results("wall", "sift", 1.0),
            results("wall", "sift", 7),
        ];
        let mut content = Content::new(sets, RunFacts::default());
        let known = |a: u32| PairGeometry {
            baseline: Some(f64::from(a)),
            view_angle: None,
            overlap: 0.5,
            is_measured: false,
        };
        let pairs = (0..10).map(|a| ((a, a + 1), known(a)));
        content.geometry.insert("wall".into(), pairs.collect());
        let overview = Overview::new(&content.summaries);
        let lines = difficulty_lines(&content, &overview, 0, Difficulty::Baseline);
        let (_, lines) = lines.expect("the baselines are known");
        let names: Vec<&str> = lines.iter().map(|(_, name, _)| *name).collect();
        assert_eq!(names, ["ransac-e"]);
    }

    #[test]
    fn the_numbers_beside_corner_errors_are_those_of_the_table() {
        let sets = vec![homography_results("wall", "sift", 2.0)];
        let content = Content::new(sets, RunFacts::default());
        let overview = Overview::new(&content.summaries);
        let svg = sp_figure(&overview, 0, Angle::Pose, Target::File).expect("it is known");
        let summary = &content.summaries[0];
        let auc = ratio(summary.auc().value.expect("it is known"));
        assert!(svg.contains("AUC at 3 px)") && svg.contains(&format!(">{auc}<")));
        let mean = ratio(summary.corner_sp.auc());
        assert!(auc != mean && !svg.contains(&format!(">{mean}<")), "{auc}");
    }

    #[test]
    fn the_accuracy_of_matches_is_switched_by_every_estimator_of_its_matcher() {
        let mut sets = vec![
            homography_results("wall", "sift", 1.0),
            homography_results("wall", "orb", 1.0),
            homography_results("wall", "sift", 0.1),
            homography_results("wall", "orb", 0.1),
        ];
        for set in &mut sets[2..] {
            set.estimator = "ransac-h".into();
        }
        let content = Content::new(sets, RunFacts::default());
        let overview = Overview::new(&content.summaries);
        let svg = accuracy_figure(&overview, 0, Target::Page).expect("it is known");
        let accuracy = content.summaries[0].scores.get("mma3").value;
        let accuracy = ratio(accuracy.expect("it is known"));
        assert!(svg.contains(&accuracy) && svg.contains(", MMA at 3 px)"));
        for matcher in ["sift", "orb"] {
            let rows = overview.rows.iter().filter(|row| row.matcher == matcher);
            let series: Vec<String> = rows.map(|row| row.series.to_string()).collect();
            let switches = format!(
                r#"data-series="{}" data-name="{matcher}""#,
                series.join(" ")
            );
            assert!(svg.contains(&switches), "{switches}: {svg}");
        }
    }
}
