//! From other people's layouts to ours: one importer per file, one line per importer in [`KINDS`].

mod folder;
mod kitti;
mod seven_scenes;
mod strecha;
mod tum;

use std::path::{Path, PathBuf};

use matchbench_vision::geometry::Camera;

use super::native::parse_camera;
use super::text::TextFile;
use super::{
    About, Association, DatasetError, Frame, ImageStorage, PairRule, Sequence, write_native,
};

/// A layout that can be imported.
#[derive(Debug)]
pub struct Kind {
    /// What it is called on the command line.
    pub id: &'static str,
    /// What its folder holds, in one line.
    pub help: &'static str,
    /// The pair rule used unless another is given: the paper's, where the paper has one.
    pub default_pairs: PairRule,
    /// Whether a source may hold several sequences, to be chosen from.
    pub has_sequences: bool,
    read: fn(&Path, &ImportOptions) -> Result<Imported, DatasetError>,
}

/// All layouts that can be imported.
pub const KINDS: &[Kind] = &[
    Kind {
        id: "tum",
        help: "TUM RGB-D: rgb.txt, groundtruth.txt, rgb/; intrinsics by freiburg1/2/3 in the name",
        default_pairs: PairRule::Fragments { length: 15 },
        has_sequences: false,
        read: tum::read,
    },
    Kind {
        id: "kitti",
        help: "KITTI odometry: sequences/NN/{image_0,calib.txt}, poses/NN.txt",
        default_pairs: PairRule::Fragments { length: 5 },
        has_sequences: true,
        read: kitti::read,
    },
    Kind {
        id: "strecha",
        help: "Strecha: images/ with NAME.camera beside them or in gt_dense_cameras/",
        default_pairs: PairRule::All,
        has_sequences: false,
        read: strecha::read,
    },
    Kind {
        id: "7scenes",
        help: "7-Scenes: frame-NNNNNN.color.png and .pose.txt, in the folder or in seq-NN/",
        default_pairs: PairRule::Fragments { length: 15 },
        has_sequences: true,
        read: seven_scenes::read,
    },
    Kind {
        id: "folder",
        help: "images, poses.txt (one TUM or KITTI line per image), camera.txt or K.txt (3x3)",
        default_pairs: PairRule::All,
        has_sequences: false,
        read: folder::read,
    },
];

/// What may be chosen at an import.
#[derive(Clone, Debug, Default)]
pub struct ImportOptions<'a> {
    /// Which sequence of the source, where it holds several.
    pub sequence: Option<String>,
    /// Which pairs; the kind's default if absent.
    pub pairs: Option<PairRule>,
    /// File with K (and distortion `k1 k2 p1 p2 [k3]`) that replaces what the source says.
    pub camera: Option<PathBuf>,
    /// File with the poses, for kind `folder`.
    pub poses: Option<PathBuf>,
    /// How images find their poses where both carry times.
    pub association: Association,
    /// Where the images of the dataset will be.
    pub images: ImageStorage<'a>,
}

/// A source as it was read, before pairs are chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// Where it comes from and what was noticed.
    pub about: About,
    /// The frames that have an image and a pose, in the order of time.
    pub frames: Vec<Frame>,
}

/// What an import wrote.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImportReport {
    /// Number of frames.
    pub frames: usize,
    /// Number of pairs.
    pub pairs: usize,
    /// The pair rule that was used.
    pub rule: PairRule,
    /// What the user should know: frames left out, defaults assumed.
    pub notes: Vec<String>,
}

/// Imports the source folder `src`, of the given [`KINDS`] id, as the new dataset `out`.
///
/// # Errors
/// If the kind is unknown, the source is not of its layout, no pair comes out, or `out` exists.
pub fn import(
    kind: &str,
    src: &Path,
    out: &Path,
    options: &ImportOptions<'_>,
) -> Result<ImportReport, DatasetError> {
    let kind = find(kind)?;
    let Imported { mut about, frames } = read_as(kind, src, options)?;
    let rule = options.pairs.as_ref().unwrap_or(&kind.default_pairs);
    let found = frames.len();
    let (frames, pairs) = rule.apply(frames)?;
    if pairs.is_empty() {
        return Err(DatasetError::new(
            src,
            format!("{found} frames give no pair under the rule {rule}"),
            "choose another rule for the pairs",
        ));
    }
    about.origin = format!("{}; pairs {rule}", about.origin);
    let sequence = Sequence {
        name: String::new(), // the folder's
        frames,
        pairs,
    };
    write_native(out, &sequence, &about, options.images)?;
    Ok(ImportReport {
        frames: sequence.frames.len(),
        pairs: sequence.pairs.len(),
        rule: rule.clone(),
        notes: about.notes,
    })
}

/// Reads the source folder `src` without writing anything.
///
/// # Errors
/// If the kind is unknown or the source is not of its layout.
pub fn read_source(
    kind: &str,
    src: &Path,
    options: &ImportOptions<'_>,
) -> Result<Imported, DatasetError> {
    read_as(find(kind)?, src, options)
}

fn find(id: &str) -> Result<&'static Kind, DatasetError> {
    KINDS.iter().find(|kind| kind.id == id).ok_or_else(|| {
        let ids: Vec<_> = KINDS.iter().map(|kind| kind.id).collect();
        DatasetError::new(
            id,
            "no such kind of dataset",
            format!("use one of {}", ids.join(", ")),
        )
    })
}

fn read_as(kind: &Kind, src: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    if !src.is_dir() {
        return Err(DatasetError::new(src, "no such folder", "check the path"));
    }
    if options.sequence.is_some() && !kind.has_sequences {
        return Err(DatasetError::new(
            src,
            format!("kind {} has no numbered sequences", kind.id),
            "leave the sequence out, or give its folder",
        ));
    }
    if options.poses.is_some() && kind.id != "folder" {
        return Err(DatasetError::new(
            src,
            format!("kind {} has its own file of poses", kind.id),
            "use kind folder to combine images and poses freely",
        ));
    }
    let imported = (kind.read)(src, options)?;
    if imported.frames.is_empty() {
        return Err(DatasetError::new(
            src,
            "no image has a pose",
            format!("expected {}", kind.help),
        ));
    }
    Ok(imported)
}

/// The camera that the user gave: as an option, or as `camera.txt` or `K.txt` in the source.
fn given_camera(
    src: &Path,
    options: &ImportOptions<'_>,
    names: &[&str],
) -> Result<Option<Camera>, DatasetError> {
    let in_source = || names.iter().map(|name| src.join(name)).find(|p| p.exists());
    match options.camera.clone().or_else(in_source) {
        Some(file) => parse_camera(&TextFile::read(&file)?).map(Some),
        None => Ok(None),
    }
}

/// The last part of the path, for the origin.
fn base_name(path: &Path) -> String {
    let real = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    real.file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into())
}

/// "`what`: a, b, c ... (12 in all)", short enough for a note.
fn note_of(what: &str, items: &[String]) -> Option<String> {
    let shown = items.iter().take(5).map(String::as_str).collect::<Vec<_>>();
    match items.len() {
        0 => None,
        n if n <= 5 => Some(format!("{n} {what}: {}", shown.join(", "))),
        n => Some(format!("{n} {what}: {}, ...", shown.join(", "))),
    }
}

#[cfg(test)]
mod tests;
