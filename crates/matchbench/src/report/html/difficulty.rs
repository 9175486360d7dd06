//! AUC of easy and of hard pairs, and which measures of difficulty are known.

use minijinja::{Value, context};

use super::super::content::Content;
use super::super::figures::{Difficulty, difficulty_figure, most_over};
use super::super::overview::Overview;
use super::super::svg::Target;

/// The AUC figures over each measure of difficulty that is known on a dataset, and the measures that are known
/// on any dataset.
pub(super) fn figures(
    content: &Content,
    overview: &Overview<'_>,
) -> (Vec<Value>, Vec<&'static str>) {
    let (mut figures, mut known) = (Vec::new(), [false; Difficulty::ALL.len()]);
    let most = Difficulty::ALL.map(|difficulty| most_over(content, overview, difficulty));
    for (column, dataset) in overview.datasets.iter().enumerate() {
        let mut panels = Vec::new();
        let scaled = Difficulty::ALL.into_iter().zip(most);
        for ((difficulty, most), known) in scaled.zip(&mut known) {
            let scaled = (difficulty, most);
            let figure = difficulty_figure(content, overview, column, scaled, Target::Page);
            if let Some(svg) = figure {
                let svg = Value::from_safe_string(svg);
                panels.push(context! { name => difficulty.name(), svg });
                *known = true;
            }
        }
        if !panels.is_empty() {
            let basis = overview.basis(column);
            figures.push(context! { dataset => *dataset, basis, panels });
        }
    }
    let known = Difficulty::ALL.into_iter().zip(known);
    let names = known.filter(|(_, known)| *known).map(|(it, _)| it.name());
    (figures, names.collect())
}
