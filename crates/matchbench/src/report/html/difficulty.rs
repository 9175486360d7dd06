//! AUC of easy and hard pairs apart, and which kinds of difficulty are known.

use minijinja::{Value, context};

use super::super::content::Content;
use super::super::figures::{Difficulty, difficulty_figure, difficulty_lines};
use super::super::overview::Overview;
use super::super::svg::Target;

/// AUC over what is known of the pairs of each dataset.
pub(super) fn figures(content: &Content, overview: &Overview<'_>) -> Vec<Value> {
    (overview.datasets.iter().enumerate())
        .filter_map(|(column, dataset)| {
            let panel = |difficulty: Difficulty| {
                let svg = difficulty_figure(content, overview, column, difficulty, Target::Page)?;
                Some(context! { name => difficulty.name(), svg => Value::from_safe_string(svg) })
            };
            let panels: Vec<Value> = Difficulty::ALL.into_iter().filter_map(panel).collect();
            (!panels.is_empty()).then(|| {
                context! { dataset => *dataset, basis => overview.basis(column), panels }
            })
        })
        .collect()
}

/// What is known of any dataset.
pub(super) fn known(content: &Content, overview: &Overview<'_>) -> Vec<&'static str> {
    let is_known = |difficulty: &Difficulty| {
        let mut columns = 0..overview.datasets.len();
        columns.any(|column| difficulty_lines(content, overview, column, *difficulty).is_some())
    };
    let all = Difficulty::ALL.into_iter().filter(is_known);
    all.map(Difficulty::name).collect()
}
