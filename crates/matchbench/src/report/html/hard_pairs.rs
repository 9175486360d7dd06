//! Where methods fail: the kinds of hard pairs of each dataset, and an example pair of each kind.

use std::collections::BTreeSet;

use minijinja::{Value, context};

use super::super::content::Content;
use super::super::file_names::file_names;
use super::super::numbers::ratio;
use super::super::overview::Overview;
use crate::metrics::{ResultSet, hard_pairs};

/// Rows of the table, dataset by dataset. A pair that has pictures on a page of its own is linked, unless the
/// main page stands `alone`.
pub(super) fn rows(content: &Content, overview: &Overview<'_>, alone: bool) -> Vec<Value> {
    let mut rows = Vec::new();
    for (dataset, folder) in overview.datasets.iter().zip(file_names(&overview.datasets)) {
        let sets = content.results.iter().filter(|set| set.dataset == *dataset);
        let sets: Vec<&ResultSet> = sets.collect();
        let pictured: BTreeSet<(u32, u32)> = (content.views.iter())
            .filter(|view| view.dataset == *dataset)
            .map(|view| view.frames)
            .collect();
        // Those that lack results of others are not compared with them.
        let whole: Vec<&ResultSet> = (sets.iter().copied())
            .filter(|set| set.lacking == 0)
            .collect();
        for hard in hard_pairs(&sets, content.geometry.get(*dataset)) {
            let right: Vec<[Option<f64>; 2]> = whole.iter().map(|set| hard.right(set)).collect();
            let mean = |side: usize| {
                let values: Vec<f64> = right.iter().filter_map(|right| right[side]).collect();
                (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
            };
            let best = (whole.iter().zip(&right))
                .filter_map(|(set, right)| {
                    let row = overview.row(&set.matcher, &set.estimator)?;
                    Some((row, right[0]?))
                })
                .rev()
                .max_by(|(_, one), (_, other)| one.total_cmp(other));
            let best = best
                .filter(|(_, right)| *right > 0.0)
                .map(|(row, right)| format!("{} ({})", row.label, ratio(right)));
            let link = (hard.example)
                .filter(|pair| !alone && pictured.contains(pair))
                .map(|(a, b)| format!("pairs/{folder}/{a}-{b}.html"));
            rows.push(context! {
                dataset => *dataset,
                kind => hard.hardship.name(),
                told_by => hard.hardship.told_by(),
                pairs => hard.pairs.len(),
                inside => ratio(mean(0)),
                outside => ratio(mean(1)),
                best,
                example => hard.example.map(|(a, b)| format!("{a} – {b}")),
                link,
            });
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::super::super::tests::content;
    use super::*;
    use crate::metrics::{PairGeometry, Summary};

    #[test]
    fn the_best_has_its_label_and_one_that_lacks_results_is_best_of_nothing() {
        let mut content = content(&[("room", "sift", 2), ("room", "orb", 4)]);
        let wide = PairGeometry {
            baseline: Some(1.0),
            view_angle: Some(40.0),
            overlap: 0.9,
            is_measured: false,
        };
        let pairs = (0..6).map(|a| ((a, a + 1), wide));
        content.geometry.insert("room".into(), pairs.collect());
        let shown = |content: &Content| {
            let rows = rows(content, &Overview::new(&content.summaries), true);
            ["best", "inside"].map(|name| {
                let value = rows[0].get_attr(name);
                value.expect("a column of the table").to_string()
            })
        };
        assert_eq!(shown(&content), ["orb (0.667)", "0.500"]);
        let other = Summary {
            estimator: "rich".into(),
            ..content.summaries[1].clone()
        };
        content.summaries.push(other);
        assert_eq!(shown(&content), ["orb + ransac-e (0.667)", "0.500"]);
        content.summaries.pop();
        content.results[1].lacking = 1;
        assert_eq!(shown(&content), ["sift (0.333)", "0.333"]);
    }
}
