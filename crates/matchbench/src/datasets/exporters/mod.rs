//! Writes datasets in layouts of other tools: one exporter per file, one entry per exporter in [`EXPORTS`].
//!
//! These formats have no turned images. So cameras and poses are written for the pixels as they are stored.

mod colmap;
mod superglue;

use std::path::{Path, PathBuf};

use matchbench_vision::geometry::Camera;
use matchbench_vision::image::Size;

use super::{DatasetError, Frame, Pair, Sequence, read_size};
use crate::counted::counted;
use crate::files::place_of;

/// A layout that a dataset can be written in.
#[derive(Debug)]
pub struct Export {
    /// Its name on the command line.
    pub id: &'static str,
    /// What is written, in one line.
    pub help: &'static str,
    /// The file in the folder that lists the pairs, where an import must be given it (`--pairs list:FILE`).
    pub pairs: Option<&'static str>,
    write: fn(&Sequence, &Path) -> Result<PathBuf, DatasetError>,
}

/// All layouts that datasets can be written in.
pub const EXPORTS: &[Export] = &[
    Export {
        id: "colmap",
        help: "a folder with a COLMAP model as text (cameras, images, no points) and pairs.txt, for \
               COLMAP's matches importer",
        pairs: Some(colmap::PAIRS),
        write: colmap::write,
    },
    Export {
        id: "superglue",
        help: "a file with SuperGlue's 38 columns per pair: names, turns, K, K, T_0to1",
        pairs: None,
        write: superglue::write,
    },
];

/// Writes a dataset in the layout with this [`EXPORTS`] id as `out`, which must not exist. Returns the folder
/// to which the image names in it are relative.
///
/// # Errors
/// If there is no such layout, if it cannot express what the dataset holds, if an image cannot be read (the
/// sizes are needed), or if `out` cannot be written.
pub fn export(layout: &str, sequence: &Sequence, out: &Path) -> Result<PathBuf, DatasetError> {
    let entry = EXPORTS
        .iter()
        .find(|export| export.id == layout)
        .ok_or_else(|| {
            let ids: Vec<_> = EXPORTS.iter().map(|export| export.id).collect();
            DatasetError::new(
                layout,
                "no such layout",
                format!("use one of {}", ids.join(", ")),
            )
        })?;
    let place = place_of(out).map_err(|error| DatasetError::io(out, &error))?;
    if place.exists() {
        return Err(DatasetError::new(
            out,
            "there is something already",
            "give another name or remove this one",
        ));
    }
    (entry.write)(sequence, out)
}

/// What a dataset holds that no layout has a place for, in words.
pub fn not_exported(sequence: &Sequence) -> Vec<String> {
    let is_mapped = |pair: &&Pair| pair.homography().is_some();
    let homographies = sequence.pairs.iter().filter(is_mapped).count();
    let depths = (sequence.frames.iter())
        .filter(|frame| frame.depth.is_some())
        .count();
    [
        ("the homography", homographies, "pair"),
        ("the depth", depths, "frame"),
    ]
    .into_iter()
    .filter(|(_, count, _)| *count > 0)
    .map(|(what, count, of)| format!("{what} of {}", counted(count, of)))
    .collect()
}

/// The camera of a frame for the pixels as stored, and their size.
fn stored_camera(frame: &Frame) -> Result<(Camera, Size), DatasetError> {
    let stored = read_size(&frame.image)?;
    let turned = frame.turn.size(stored);
    let (width, height) = (turned.width as f64, turned.height as f64);
    let camera = frame.turn.inverse().camera(&frame.camera, width, height);
    Ok((camera, stored))
}

/// The folder that contains all images, and the name of each relative to it, with `/`.
fn names(sequence: &Sequence) -> Result<(PathBuf, Vec<String>), DatasetError> {
    let paths = (sequence.frames.iter())
        .map(|frame| super::bring::real_path(&frame.image))
        .collect::<Result<Vec<_>, _>>()?;
    let root = super::bring::common_folder(&paths);
    let name = |path: &PathBuf| {
        let relative = path.strip_prefix(&root).unwrap_or(path);
        let parts: Vec<_> = relative.iter().map(|part| part.to_string_lossy()).collect();
        let name = parts.join("/");
        if name.contains(char::is_whitespace) {
            let what = "the name of the image has a space, which this layout cannot say";
            return Err(DatasetError::new(
                path,
                what,
                "rename the image or its folder",
            ));
        }
        Ok(name)
    };
    let names = paths.iter().map(name).collect::<Result<Vec<_>, _>>()?;
    Ok((root, names))
}

fn cannot_say(frame: &Frame, what: &str) -> DatasetError {
    DatasetError::new(
        &frame.image,
        what,
        "choose another layout, or leave the frame out",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_cannot_be_written_is_named_once() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("occupied");
        std::fs::write(&file, "").unwrap();
        let sequence = Sequence {
            name: "room".into(),
            frames: Vec::new(),
            pairs: Vec::new(),
        };
        for entry in EXPORTS {
            let refused = export(entry.id, &sequence, &file.join("below")).unwrap_err();
            let message = refused.to_string();
            assert_eq!(message.matches("occupied").count(), 1, "{message}");
        }
    }
}
