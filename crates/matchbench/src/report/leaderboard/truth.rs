//! Whether records state the errors that their poses have.
//!
//! A record holds the pose that was estimated and how far it was from the truth. Who has the dataset need not
//! believe the second: the error is computed again from the first.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Isometry3;

use crate::datasets::Sequence;
use crate::records::{DatasetPlan, Outcome, RunFolder, RunRecord};

/// How far a stated error may be from the one that is computed, in degrees: records are rounded, and small
/// angles lose half of their digits.
const ROUNDED: f64 = 1e-3;

/// The true poses of the pairs of a dataset.
type Poses = BTreeMap<(u32, u32), Isometry3<f64>>;

/// The true poses of the datasets that are at hand, by their fingerprints.
#[derive(Debug, Default)]
pub(super) struct Truths(BTreeMap<String, Option<Poses>>);

impl Truths {
    /// Those of a planned dataset: in the folder `datasets`, or where the run had it.
    pub(super) fn of(&mut self, dataset: &DatasetPlan, datasets: Option<&Path>) -> Option<&Poses> {
        let find = || {
            let named = datasets.map(|datasets| datasets.join(&dataset.name));
            let places = named.iter().map(|path| &**path).chain([&*dataset.path]);
            let mut open = places.filter_map(|path| Sequence::open(path).ok());
            let sequence = open.find(|found| found.fingerprint() == dataset.fingerprint)?;
            let pose = |pair: &crate::datasets::Pair| Some(((pair.a, pair.b), *pair.pose()?));
            Some(sequence.pairs.iter().filter_map(pose).collect())
        };
        let known = self.0.entry(dataset.fingerprint.clone());
        known.or_insert_with(find).as_ref()
    }
}

/// Computes the errors of all records of one method again.
///
/// # Errors
/// The first that states another, in words; the records that cannot be read.
pub(super) fn check(run: &RunFolder, names: [&str; 3], truth: &Poses) -> Result<(), String> {
    let mut wrong = None;
    let read = run.for_each_of(names, |record| {
        if wrong.is_none() {
            wrong = contradiction(&record, truth);
        }
    });
    read.map_err(|error| error.to_string())?;
    wrong.map_or(Ok(()), Err)
}

/// In what a record contradicts itself, if it does.
fn contradiction(record: &RunRecord, truth: &Poses) -> Option<String> {
    let pose = record.outcome.pose()?;
    let (a, b) = (record.task.a, record.task.b);
    let Some(truth) = truth.get(&(a, b)) else {
        return Some(format!("the dataset does not list the pair {a} {b}"));
    };
    let errors = |outcome: &Outcome| match *outcome {
        Outcome::Pose {
            rotation_error,
            translation_error,
            ..
        } => [Some(rotation_error), translation_error],
        _ => [None; 2],
    };
    let stated = errors(&record.outcome);
    let found = errors(&Outcome::judged(&pose, truth, 0, 0, 0));
    let agrees = stated
        .iter()
        .zip(found)
        .all(|(stated, found)| match (stated, found) {
            (Some(stated), Some(found)) => (stated - found).abs() <= ROUNDED,
            (None, None) => true,
            _ => false,
        });
    let degrees = |errors: [Option<f64>; 2]| {
        let [rotation, translation] =
            errors.map(|error| error.map_or("none".to_owned(), |error| format!("{error:.4}")));
        format!("{rotation} of the rotation and {translation} of the translation")
    };
    (!agrees).then(|| {
        format!(
            "the record of the pair {a} {b} states errors of {}, but its pose has {} (degrees)",
            degrees(stated),
            degrees(found)
        )
    })
}
