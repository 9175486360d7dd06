//! An import that may be asked for several times: an existing dataset must be the one that the import would
//! make.

use std::path::Path;

use super::{ImportOptions, ImportReport, make};
use crate::counted::counted;
use crate::datasets::{DatasetError, Frame, Pair, Sequence};

/// Imports as [`import`](super::import) does. If the dataset exists already, it must be the one that this
/// import would make; then nothing is done and the result is `None`.
///
/// # Errors
/// As [`import`](super::import); or if another dataset exists there.
pub fn import_once(
    kind: &str,
    src: &Path,
    out: &Path,
    options: &ImportOptions<'_>,
) -> Result<Option<ImportReport>, DatasetError> {
    let made = make(kind, src, options)?;
    let is_there = std::fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_some());
    if !is_there {
        made.write(out, options.images)?;
        return Ok(Some(made.report()));
    }
    let there = Sequence::open(out)?;
    match difference(&there, &made.sequence) {
        None => Ok(None),
        Some(what) => Err(DatasetError::new(
            out,
            format!(
                "another dataset is there than {} gives now: {what}",
                src.display()
            ),
            "remove this folder, and it is imported again; or name another",
        )),
    }
}

/// The first difference between the dataset that is `there` and the one that was `made` from the same images.
/// Rounded poses are not a difference.
fn difference(there: &Sequence, made: &Sequence) -> Option<String> {
    const ROUNDED: f64 = 1e-9;
    let (found, expected) = (there.frames.len(), made.frames.len());
    if found != expected {
        return Some(format!(
            "it has {} and not {expected}",
            counted(found, "image")
        ));
    }
    let image = |frame: &Frame| std::fs::canonicalize(&frame.image).unwrap_or(frame.image.clone());
    for (there, made) in there.frames.iter().zip(&made.frames) {
        // The images of a rendered scene exist only in its own dataset.
        let is_made = made.image.as_os_str().is_empty();
        if !is_made && image(there) != image(made) {
            return Some(format!(
                "its images are elsewhere, {}",
                there.image.display()
            ));
        }
        if there.camera != made.camera {
            return Some(format!("{} has another camera", there.image.display()));
        }
    }
    let numbers = |sequence: &Sequence| -> Vec<(u32, u32)> {
        (sequence.pairs.iter())
            .map(|pair| (pair.a, pair.b))
            .collect()
    };
    if numbers(there) != numbers(made) {
        return Some("it has other pairs".to_owned());
    }
    let is_other = |(there, made): (&Pair, &Pair)| match (there.pose(), made.pose()) {
        (Some(there), Some(made)) => {
            (there.to_homogeneous() - made.to_homogeneous()).amax() > ROUNDED
        }
        (there, made) => there.is_some() != made.is_some(),
    };
    (there.pairs.iter().zip(&made.pairs))
        .any(is_other)
        .then(|| "its true poses are others".to_owned())
}
