//! The commands with which a reader computes again what the page shows.

use std::collections::BTreeMap;

use minijinja::{Value, context};

use super::super::again::{Again, DatasetAgain};

/// By the name of a dataset: the places on the page that say how it is computed again and which commands then
/// show the scores.
pub(super) fn anchors(again: &Again) -> BTreeMap<String, Value> {
    (again.datasets.iter().enumerate())
        .map(|(number, dataset)| {
            let anchor = format!("again-{number}");
            let report = dataset.whole.last();
            (dataset.name.clone(), context! { anchor, report })
        })
        .collect()
}

/// The commands that compute everything again; `None` if they are not known.
pub(super) fn commands(again: &Again) -> Option<Value> {
    let dataset = |dataset: &DatasetAgain| {
        let cells = dataset.cells.iter();
        let cells: Vec<Value> = cells
            .map(|cell| context! { method => &cell.method, run => &cell.run, note => &cell.note })
            .collect();
        context! {
            name => &dataset.name,
            pairs => dataset.pairs,
            fingerprint => &dataset.fingerprint,
            origin => &dataset.origin,
            import => &dataset.import,
            needs => &dataset.needs,
            whole => &dataset.whole,
            time => &dataset.time,
            cells,
        }
    };
    (!again.is_empty()).then(|| {
        context! {
            version => &again.version,
            varies => again.varies,
            datasets => again.datasets.iter().map(dataset).collect::<Vec<_>>(),
            all => &again.all,
            missing => &again.missing,
            finish => again.finish(),
            finish_of_cell => Again::finish_of_cell(),
            scoring => &again.scoring,
        }
    })
}
