//! Whether methods know when they fail: reliability diagrams, and a table of scores of the stated
//! probabilities.

use minijinja::{Value, context};

use crate::metrics::MIN_FOR_CURVE;

use super::super::content::Content;
use super::super::figures::{reliabilities, reliability_figure};
use super::super::numbers::ratio;
use super::super::overview::Overview;
use super::super::svg::Target;

/// For each dataset with stated probabilities, the diagram and a row for each method.
pub(super) fn figures(content: &Content, overview: &Overview<'_>) -> Vec<Value> {
    (overview.datasets.iter().enumerate())
        .filter_map(|(column, dataset)| {
            let lines = reliabilities(content, overview, column);
            if lines.is_empty() {
                return None;
            }
            let svg = reliability_figure(&lines, overview, column, Target::Page);
            let few: Vec<&str> = (lines.iter())
                .filter(|(_, _, reliability)| !reliability.has_curve())
                .map(|(_, name, _)| *name)
                .collect();
            let few = match few.len() {
                0 => None,
                all if all == lines.len() => Some(format!(
                    "No curves: no method has {MIN_FOR_CURVE} poses or more."
                )),
                _ => Some(format!(
                    "No curve, for want of {MIN_FOR_CURVE} poses: {}.",
                    few.join(", ")
                )),
            };
            let rows: Vec<Value> = (lines.into_iter())
                .map(|(_, name, reliability)| {
                    context! {
                        name,
                        poses => reliability.poses,
                        stated => ratio(reliability.stated),
                        right => ratio(reliability.right),
                        brier => ratio(reliability.brier),
                        calibration_error => ratio(reliability.calibration_error),
                        no_overlap => reliability.no_overlap,
                        no_overlap_right => reliability.no_overlap_right,
                    }
                })
                .collect();
            let (svg, basis) = (svg.map(Value::from_safe_string), overview.basis(column));
            Some(context! { dataset => *dataset, basis, svg, few, rows })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::super::RunFacts;
    use super::super::super::tests::results;
    use super::super::render;
    use super::*;

    #[test]
    fn methods_of_few_poses_have_no_curve_and_a_sentence() {
        let set = |matcher: &str, copies: u32| {
            let mut set = results("room", matcher, 10);
            let pairs = (0..copies).flat_map(|copy| {
                set.pairs.iter().map(move |pair| {
                    let mut pair = pair.clone();
                    pair.a += 100 * copy;
                    pair.pose_probability = Some(0.05 + 0.3 * f64::from(copy));
                    pair
                })
            });
            set.pairs = pairs.collect();
            set
        };
        let page = |sets| {
            let content = Content::new(sets, RunFacts::default());
            render(&content)
        };
        let chart = "chart reliability";
        let both = page(vec![set("sift", 3), set("orb", 2)]);
        assert!(both.contains(chart) && both.contains("No curve, for want of 30 poses: orb."));
        let few = page(vec![set("sift", 2), set("orb", 2)]);
        assert!(!few.contains(chart) && few.contains("no method has 30 poses"));
        assert!(few.contains("Calibration error"), "the table stays");
        let enough = page(vec![set("sift", 3)]);
        assert!(enough.contains(chart) && !enough.contains("30 poses"));
    }
}
