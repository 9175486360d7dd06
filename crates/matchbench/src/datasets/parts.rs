//! Which files belong to a dataset.

use std::path::Path;

use super::images::IMAGES;
use super::manifest;
use super::native::{CAMERA, HOMOGRAPHIES, PAIRS, POSES};
use super::write::DEPTH;

/// The folder of the dataset that a file is a part of: an image in it, its cameras, poses, pairs ... `file` is absolute
/// and without links.
pub fn dataset_of_part(file: &Path) -> Option<&Path> {
    const PARTS: [&str; 7] = [
        IMAGES,
        DEPTH,
        POSES,
        CAMERA,
        PAIRS,
        HOMOGRAPHIES,
        manifest::FILE,
    ];
    file.ancestors().skip(1).find(|folder| {
        let part = file
            .strip_prefix(folder)
            .ok()
            .and_then(|inner| inner.iter().next());
        part.is_some_and(|part| PARTS.iter().any(|name| part == *name)) && is_dataset(folder)
    })
}

/// Whether a folder is that of a dataset, which may be damaged.
pub fn is_dataset(folder: &Path) -> bool {
    [PAIRS, HOMOGRAPHIES, manifest::FILE]
        .iter()
        .any(|name| folder.join(name).is_file())
}
