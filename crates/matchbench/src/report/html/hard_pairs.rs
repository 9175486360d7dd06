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
        for hard in hard_pairs(&sets, content.geometry.get(*dataset)) {
            let right: Vec<[Option<f64>; 2]> = sets.iter().map(|set| hard.right(set)).collect();
            let mean = |side: usize| {
                let values: Vec<f64> = right.iter().filter_map(|right| right[side]).collect();
                (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
            };
            let best = (sets.iter().zip(&right))
                .filter_map(|(set, right)| Some((set, right[0]?)))
                .rev()
                .max_by(|(_, one), (_, other)| one.total_cmp(other));
            let best = best
                .filter(|(_, right)| *right > 0.0)
                .map(|(set, right)| format!("{} ({})", set.method(), ratio(right)));
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
