//! Every result of every pair as a table of typed columns, used for both CSV and Parquet.

use crate::metrics::{Angle, PairGeometry, PairResult, ResultSet};

use super::content::Content;
use super::pair_words::outcome;

/// One column, as long as all others.
pub(super) struct Column<'a> {
    pub(super) name: &'static str,
    pub(super) values: Values<'a>,
}

/// The values of a column; what is not known is `None`.
pub(super) enum Values<'a> {
    /// Names, each of which occurs many times.
    Text(Vec<&'a str>),
    /// Whole numbers that are always known.
    Index(Vec<u32>),
    /// Whole numbers that may not have been counted.
    Count(Vec<Option<u32>>),
    /// Numbers; all of them are finite.
    Number(Vec<Option<f64>>),
}

/// One row per pair, matcher, estimator and repetition; angles in degrees, corner errors in pixels.
pub(super) fn columns(content: &Content) -> Vec<Column<'_>> {
    let rows: Vec<Row<'_>> = (content.results.iter())
        .flat_map(|set| {
            let geometry = content.geometry.get(&set.dataset);
            set.pairs.iter().map(move |pair| Row {
                set,
                pair,
                geometry: geometry.and_then(|known| known.get(&(pair.a, pair.b))),
            })
        })
        .collect();
    let column = |name, values| Column { name, values };
    let text = |name, get: fn(&Row<'_>) -> &'static str| {
        column(name, Values::Text(rows.iter().map(get).collect()))
    };
    let names = |name, get: for<'r> fn(&'r ResultSet) -> &'r str| {
        column(
            name,
            Values::Text(rows.iter().map(|row| get(row.set)).collect()),
        )
    };
    let index = |name, get: fn(&PairResult) -> u32| {
        column(
            name,
            Values::Index(rows.iter().map(|row| get(row.pair)).collect()),
        )
    };
    let count = |name, get: fn(&PairResult) -> Option<u32>| {
        column(
            name,
            Values::Count(rows.iter().map(|row| get(row.pair)).collect()),
        )
    };
    let number = |name, get: &dyn Fn(&Row<'_>) -> Option<f64>| {
        let values = rows
            .iter()
            .map(|row| get(row).filter(|value| value.is_finite()));
        column(name, Values::Number(values.collect()))
    };
    let known = |name, get: fn(&PairGeometry) -> Option<f64>| {
        number(name, &move |row: &Row<'_>| row.geometry.and_then(get))
    };
    let error = |name, angle| number(name, &move |row: &Row<'_>| row.pair.error(angle));
    vec![
        names("dataset", |set| &set.dataset),
        names("matcher", |set| &set.matcher),
        names("estimator", |set| &set.estimator),
        index("a", |pair| pair.a),
        index("b", |pair| pair.b),
        index("repetition", |pair| pair.repetition),
        known("baseline", |geometry| geometry.baseline),
        known("view_angle", |geometry| geometry.view_angle),
        known("overlap", |geometry| Some(geometry.overlap)),
        known("measured_overlap", |geometry| {
            geometry.is_measured.then_some(geometry.overlap)
        }),
        error("pose_error", Angle::Pose),
        error("rotation_error", Angle::Rotation),
        error("translation_error", Angle::Translation),
        number("corner_error", &|row: &Row<'_>| row.pair.corner_error()),
        count("correspondences", |pair| pair.correspondences),
        count("putative", |pair| pair.counts.map(|counts| counts.putative)),
        count("selected", |pair| pair.counts.map(|counts| counts.selected)),
        count("within_1px", |pair| Some(pair.correct?[0])),
        count("within_3px", |pair| Some(pair.correct?[2])),
        count("within_5px", |pair| Some(pair.correct?[4])),
        count("within_10px", |pair| Some(pair.correct?[9])),
        count("with_depth", |pair| Some(pair.by_depth.as_ref()?.judged)),
        count("by_depth_1px", |pair| {
            Some(pair.by_depth.as_ref()?.within[0])
        }),
        count("by_depth_3px", |pair| {
            Some(pair.by_depth.as_ref()?.within[2])
        }),
        count("by_depth_5px", |pair| {
            Some(pair.by_depth.as_ref()?.within[4])
        }),
        number("pose_probability", &|row: &Row<'_>| {
            row.pair.pose_probability
        }),
        number("overlap_probability", &|row: &Row<'_>| {
            row.pair.overlap_probability
        }),
        text("outcome", |row| outcome(row.pair)),
    ]
}

struct Row<'a> {
    set: &'a ResultSet,
    pair: &'a PairResult,
    geometry: Option<&'a PairGeometry>,
}

impl Values<'_> {
    /// How many rows there are.
    pub(super) fn len(&self) -> usize {
        match self {
            Self::Text(values) => values.len(),
            Self::Index(values) => values.len(),
            Self::Count(values) => values.len(),
            Self::Number(values) => values.len(),
        }
    }
}
