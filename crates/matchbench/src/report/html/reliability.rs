//! Whether methods know when they fail: reliability diagrams, and a table of scores of the stated
//! probabilities.

use minijinja::{Value, context};

use super::super::content::Content;
use super::super::figures::{reliabilities, reliability_figure};
use super::super::overview::Overview;
use super::super::svg::Target;

/// For each dataset with stated probabilities, the diagram and a row for each method.
pub(super) fn figures(content: &Content, overview: &Overview<'_>) -> Vec<Value> {
    (overview.datasets.iter().enumerate())
        .filter_map(|(column, dataset)| {
            let lines = reliabilities(content, overview, column);
            let svg = reliability_figure(&lines, overview, column, Target::Page)?;
            let rows: Vec<Value> = (lines.into_iter())
                .map(|(_, name, reliability)| {
                    context! {
                        name,
                        poses => reliability.poses,
                        stated => format!("{:.3}", reliability.stated),
                        right => format!("{:.3}", reliability.right),
                        brier => format!("{:.3}", reliability.brier),
                        calibration_error => format!("{:.3}", reliability.calibration_error),
                        no_overlap => reliability.no_overlap,
                        no_overlap_right => reliability.no_overlap_right,
                    }
                })
                .collect();
            let (svg, basis) = (Value::from_safe_string(svg), overview.basis(column));
            Some(context! { dataset => *dataset, basis, svg, rows })
        })
        .collect()
}
