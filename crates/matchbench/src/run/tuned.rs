//! What was chosen by its score on some scenes, and so must not be scored on them by a run.

use std::collections::BTreeSet;
use std::path::Path;

use rayon::prelude::*;

use super::Dataset;
use crate::datasets::Frame;
use crate::files::read_file;
use crate::records::{FolderError, Plan, RunFolder, Tuned};

/// What was tuned for the run in this folder, if there is one already, and these choices, each once.
pub(super) fn all_tuned(folder: &Path, more: &[Tuned]) -> Result<Vec<Tuned>, FolderError> {
    let before = match RunFolder::open(folder) {
        Ok(run) => run.tuned()?,
        // There is none, or what is wrong with it is told when the run starts.
        Err(_) => Vec::new(),
    };
    Ok(Tuned::each_once(before.into_iter().chain(more.to_vec())))
}

/// Refuses to report on datasets that something was tuned on. Their images are read only if there is a choice to check; one
/// that cannot be read is no image of a scene.
pub(super) fn refuse_tuned(
    tuned: &[Tuned],
    plan: &Plan,
    datasets: &[Dataset],
) -> Result<(), FolderError> {
    if tuned.is_empty() {
        return Ok(());
    }
    let hash = |frame: &Frame| {
        let file = read_file(&frame.image).ok()?;
        Some(blake3::hash(&file).to_hex().to_string())
    };
    let images: Vec<BTreeSet<String>> = (datasets.iter())
        .map(|dataset| {
            let frames = dataset.sequence.frames.par_iter();
            frames.filter_map(hash).collect()
        })
        .collect();
    (tuned.iter()).try_for_each(|tuned| tuned.check(plan, &images))
}
