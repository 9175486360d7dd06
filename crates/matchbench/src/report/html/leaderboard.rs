//! The page of a leaderboard: a table for each group, intervals as figures, and the entries that were refused
//! with the reasons.

use minijinja::{Value, context};

use super::super::figures::{lead_figure, sp_figure};
use super::super::leaderboard::{Group, Leaderboard, Row};
use super::super::numbers::{count, interval, ratio, score};
use super::super::overview::Overview;
use super::super::score_words::{definitions, group_note, protocol_notes};
use super::super::svg::Target;
use super::{environment, legend, template};
use crate::metrics::{Angle, Detail, GROUP_LEVEL_NOTE, Model, ScoreKind, Summary, shown_scores};

/// The page as text.
pub(in super::super) fn leaderboard_page(board: &Leaderboard) -> String {
    let summaries: Vec<Summary> = (board.groups.iter())
        .flat_map(|group| group.rows.iter().map(|row| row.summary.clone()))
        .collect();
    let shown = shown_scores(&summaries);
    let environment = environment();
    let page = template(&environment, "leaderboard.html").render(context! {
        title => "matchbench leaderboard",
        style => include_str!("style.css"),
        script => include_str!("script.js"),
        version => env!("CARGO_PKG_VERSION"),
        methods => summaries.len(),
        groups => (board.groups.iter().enumerate())
            .map(|(number, group)| group_of(group, number))
            .collect::<Vec<_>>(),
        refused => (board.refused.iter())
            .map(|refused| context! { place => &refused.place, reason => &refused.reason })
            .collect::<Vec<_>>(),
        group_note => group_note(&summaries).unwrap_or_else(|| GROUP_LEVEL_NOTE.to_owned()),
        protocols => protocol_notes(&summaries),
        definitions => (definitions(&shown, Detail::Glance).into_iter())
            .map(|(heads, text)| context! { heads, text })
            .collect::<Vec<_>>(),
    });
    page.expect("the template only uses what it is given")
}

fn group_of(group: &Group, number: usize) -> Value {
    let summaries: Vec<Summary> = group.rows.iter().map(|row| row.summary.clone()).collect();
    let shown: Vec<&ScoreKind> = (shown_scores(&summaries).into_iter())
        .filter(|kind| kind.detail == Detail::Glance && kind.id != summaries[0].ranked_by())
        .collect();
    let overview = Overview::new(&group.content.summaries);
    let figure = |name: &str, svg: Option<String>| {
        Some(context! { name, svg => Value::from_safe_string(svg?) })
    };
    let figures = [
        figure(
            "Certainty",
            lead_figure(&group.content, &overview, 0, Target::Page),
        ),
        figure(
            "SP curves",
            sp_figure(&overview, 0, Angle::Pose, Target::Page),
        ),
    ];
    context! {
        anchor => format!("group-{number}"),
        dataset => &group.dataset,
        protocol => group.protocol,
        homographies => group.model == Model::Homography,
        fingerprint => &group.fingerprint,
        pairs => group.pairs[0],
        listed => group.pairs[1],
        namesakes => group.namesakes,
        heads => shown.iter().map(|kind| kind.heading).collect::<Vec<_>>(),
        rows => group.rows.iter().map(|row| row_of(row, &shown)).collect::<Vec<_>>(),
        legend => legend(&overview),
        figures => figures.into_iter().flatten().collect::<Vec<_>>(),
    }
}

/// The number of pairs that failed. If each pair was run several times, the mean over these.
fn failed(summary: &Summary) -> String {
    let times = summary.repetitions.max(1) as usize;
    if summary.failed.is_multiple_of(times) {
        (summary.failed / times).to_string()
    } else {
        count(summary.failed as f64 / times as f64)
    }
}

fn row_of(row: &Row, shown: &[&ScoreKind]) -> Value {
    let Row {
        rank,
        label,
        summary,
        source,
    } = row;
    let auc = summary.auc_of(Angle::Pose);
    let cells: Vec<String> = (shown.iter())
        .map(|kind| score(kind.notation, summary.scores.get(kind.id).value))
        .collect();
    context! {
        label,
        rank,
        medal => (*rank <= 3).then_some(*rank),
        auc => ratio(auc.value),
        interval => interval(&auc, ratio),
        group => &summary.group,
        cells,
        failed => failed(summary),
        repetitions => summary.repetitions,
        entry => &source.entry,
        file => &source.file,
        hash => &source.blake3,
        short_hash => source.blake3.get(..12).unwrap_or(&source.blake3),
        version => &source.version,
        errors => source.errors.words(),
        commands => &source.commands,
        note => &source.note,
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::tests::summary;
    use super::*;

    #[test]
    fn a_pair_that_fails_every_time_has_failed_once() {
        let mut twice = summary("room", "sift", 6);
        assert_eq!(failed(&twice), "4");
        twice.repetitions = 2;
        assert_eq!(failed(&twice), "2");
        twice.failed = 5;
        assert_eq!(failed(&twice), "2.5");
    }
}
