//! Converts layouts of other datasets to ours: one importer per file, one entry per importer in [`KINDS`].
//!
//! Some sources are folders of frames with poses, from which a [`PairRule`] makes pairs. Others list their
//! pairs with the truth about each. The images of a list may be elsewhere or missing. Then the dataset names
//! where they belong, and `validate` says which are missing.

mod colmap;
mod euroc;
mod evd;
mod folder;
mod hpatches;
mod image_pairs;
mod imc;
mod kitti;
mod list;
mod megadepth;
mod nerf;
mod once;
mod options;
mod oxford;
mod pickle;
mod references;
mod rendered;
mod scannet;
mod scannet_raw;
mod seven_scenes;
mod strecha;
mod superglue;
mod tum;
mod zeb;

use crate::counted::counted;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

use matchbench_vision::geometry::Camera;

pub use once::import_once;
pub use options::{ImportOption, ImportOptions};
pub use references::reference;
pub(crate) use rendered::RENDERED;

use super::images::{image_files, unread_image_files};
use super::listed::is_there;
use super::native::parse_camera;
use super::pairs::{covisible, with_poses};
use super::rendered::Scene;
use super::text::TextFile;
use super::{About, DatasetError, Frame, ImageStorage, Pair, PairRule, Sequence, write_native};
use ImportOption as Has;

/// A layout that can be imported.
#[derive(Debug)]
pub struct Kind {
    /// Its name on the command line.
    pub id: &'static str,
    /// What its source holds, in one line.
    pub help: &'static str,
    /// The pair rule that is used if none is given. It is that of the paper, if the paper has one. `None` if
    /// the source lists its pairs.
    pub default_pairs: Option<PairRule>,
    /// The options that it has, besides the one that says where images go.
    pub options: &'static [ImportOption],
    read: fn(&Path, &ImportOptions<'_>) -> Result<Imported, DatasetError>,
}

/// All layouts that can be imported.
pub const KINDS: &[Kind] = &[
    Kind {
        id: "tum",
        help: "TUM RGB-D: rgb.txt, groundtruth.txt, rgb/; intrinsics by freiburg1/2/3 in the name",
        default_pairs: Some(PairRule::Fragments { length: 15 }),
        options: &[
            Has::Pairs,
            Has::Camera,
            Has::BodyFromCamera,
            Has::Tolerance,
            Has::Interpolate,
        ],
        read: tum::read,
    },
    Kind {
        id: "kitti",
        help: "KITTI odometry: sequences/NN/{image_0 (to image_3),calib.txt}, poses/NN.txt",
        default_pairs: Some(PairRule::Fragments { length: 5 }),
        options: &[
            Has::Pairs,
            Has::Camera,
            Has::BodyFromCamera,
            Has::Sequence,
            Has::Sensor,
        ],
        read: kitti::read,
    },
    Kind {
        id: "strecha",
        help: "Strecha: images/ with NAME.camera beside them or in gt_dense_cameras/",
        default_pairs: Some(PairRule::All),
        options: &[Has::Pairs, Has::Camera],
        read: strecha::read,
    },
    Kind {
        id: "7scenes",
        help: "7-Scenes: frame-NNNNNN.color.png and .pose.txt, in the folder or in seq-NN/",
        default_pairs: Some(PairRule::Fragments { length: 15 }),
        options: &[Has::Pairs, Has::Camera, Has::BodyFromCamera, Has::Sequence],
        read: seven_scenes::read,
    },
    Kind {
        id: "folder",
        help: "images, poses.txt (per image one TUM or KITTI line or a 4x4), camera.txt or K.txt (3x3)",
        default_pairs: Some(PairRule::All),
        options: &[
            Has::Pairs,
            Has::Camera,
            Has::Poses,
            Has::BodyFromCamera,
            Has::Tolerance,
            Has::Interpolate,
        ],
        read: folder::read,
    },
    Kind {
        id: "superglue",
        help: "SuperGlue: a list of pairs with 38 columns: names, EXIF turns, K, K, T_0to1",
        default_pairs: None,
        options: &[Has::ImageRoot],
        read: superglue::read,
    },
    Kind {
        id: "image-pairs",
        help: "glue-factory's image_pairs: per line names, K, K, and R and t or a 4x4 T_0to1; or names, H_0to1",
        default_pairs: None,
        options: &[Has::ImageRoot],
        read: image_pairs::read,
    },
    Kind {
        id: "scannet",
        help: "ScanNet-1500 of LoFTR: test.npz, with intrinsics.npz",
        default_pairs: None,
        options: &[Has::ImageRoot, Has::Intrinsics],
        read: scannet::read,
    },
    Kind {
        id: "scannet-raw",
        help: "a scan of ScanNet: color/N.jpg, pose/N.txt (4x4), intrinsic/intrinsic_color.txt",
        default_pairs: Some(PairRule::Fragments { length: 15 }),
        options: &[Has::Pairs, Has::Camera, Has::BodyFromCamera],
        read: scannet_raw::read,
    },
    Kind {
        id: "megadepth",
        help: "MegaDepth-1500: LoFTR's .npz (or a folder of them), or views.txt with pairs.txt",
        default_pairs: None,
        options: &[Has::ImageRoot],
        read: megadepth::read,
    },
    Kind {
        id: "colmap",
        help: "COLMAP model: cameras, images (and points), as .txt or .bin; also ETH3D, IMC 2023/24",
        default_pairs: Some(PairRule::Covisible {
            lowest: 0.1,
            highest: 0.7,
        }),
        options: &[Has::Pairs, Has::ImageRoot],
        read: colmap::read,
    },
    Kind {
        id: "nerf",
        help: "NeRF, nerfstudio, instant-ngp: transforms.json (transforms_train.json ...)",
        default_pairs: Some(PairRule::All),
        options: &[Has::Pairs, Has::ImageRoot],
        read: nerf::read,
    },
    Kind {
        id: "imc",
        help: "Image Matching Challenge: calibration_*.h5 (2020/21), or train_labels.csv (2025)",
        default_pairs: Some(PairRule::All),
        options: &[Has::Pairs, Has::Camera, Has::Sequence, Has::ImageRoot],
        read: imc::read,
    },
    Kind {
        id: "euroc",
        help: "EuRoC MAV: mav0/ with cam0 or cam1/{sensor.yaml,data}, state_groundtruth_estimate0",
        default_pairs: Some(PairRule::Fragments { length: 15 }),
        options: &[Has::Pairs, Has::Sensor, Has::Tolerance, Has::Interpolate],
        read: euroc::read,
    },
    Kind {
        id: "zeb",
        help: "ZEB of GIM: one NAME.txt per pair: names, overlaps, K, K, T_0to1",
        default_pairs: None,
        options: &[Has::ImageRoot],
        read: zeb::read,
    },
    Kind {
        id: "hpatches",
        help: "HPatches: folders i_* and v_* with 1.ppm to 6.ppm and H_1_2 to H_1_6",
        default_pairs: None,
        options: &[Has::Sequence],
        read: hpatches::read,
    },
    Kind {
        id: "oxford",
        help: "Oxford affine: img1 to img6 (.ppm or .pgm) and H1to2p to H1to6p, or folders of these",
        default_pairs: None,
        options: &[],
        read: oxford::read,
    },
    Kind {
        id: "evd",
        help: "Extreme View Dataset: 1/NAME.png, 2/NAME.png, h/NAME.txt",
        default_pairs: None,
        options: &[],
        read: evd::read,
    },
    Kind {
        id: rendered::RENDERED,
        help: "a built-in scene by its name, whose images are rendered into the dataset",
        default_pairs: None,
        options: &[],
        read: rendered::read,
    },
];

/// A source as it was read, before pairs are chosen.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Imported {
    /// Where it comes from and what was noticed.
    pub about: About,
    /// The frames: those with an image and a pose in the order of time, or those of a list in its order.
    pub frames: Vec<Frame>,
    /// The pairs, if the source lists them.
    pub pairs: Option<Vec<Pair>>,
    /// The points that each frame sees, without repetition, if the source has them.
    pub seen: Option<Vec<Vec<u64>>>,
    /// The sequence that was read, if the source may hold several: as the option of a sequence asks for it.
    pub sequence: Option<String>,
    /// The camera that was read, if the source may have several: as the option of a sensor asks for it.
    pub sensor: Option<String>,
}

/// What an import wrote.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportReport {
    /// Number of frames.
    pub frames: usize,
    /// Number of pairs.
    pub pairs: usize,
    /// The pair rule that was used; `None` if the source lists its pairs.
    pub rule: Option<PairRule>,
    /// What the user should know: frames that were left out, defaults that were assumed.
    pub notes: Vec<String>,
}

impl Imported {
    /// Frames from which a rule makes pairs.
    fn of(frames: Vec<Frame>) -> Self {
        Self {
            frames,
            ..Self::default()
        }
    }

    /// Frames and their pairs, as a source lists them.
    fn listed(origin: String, frames: Vec<Frame>, pairs: Vec<Pair>) -> Self {
        Self {
            about: About {
                origin,
                notes: Vec::new(),
                ..About::default()
            },
            frames,
            pairs: Some(pairs),
            ..Self::default()
        }
    }

    /// The frames that remain under `rule`, and their pairs.
    fn paired(self, rule: Option<&PairRule>) -> Result<(Vec<Frame>, Vec<Pair>), DatasetError> {
        match (rule, self.pairs, self.seen) {
            (_, Some(pairs), _) => Ok((self.frames, pairs)),
            (Some(&PairRule::Covisible { lowest, highest }), _, Some(seen)) => {
                let pairs = covisible(&seen, lowest, highest)?;
                let pairs = with_poses(&self.frames, pairs)?;
                Ok((self.frames, pairs))
            }
            (rule, ..) => rule.unwrap_or(&PairRule::All).apply(self.frames),
        }
    }
}

/// Imports the source `src` as the new dataset `out`; `kind` is one of the ids of [`KINDS`].
///
/// # Errors
/// If the kind is unknown or does not have one of the `options`, if the source does not have its layout, if
/// there are no pairs or one stands twice, or if `out` exists.
pub fn import(
    kind: &str,
    src: &Path,
    out: &Path,
    options: &ImportOptions<'_>,
) -> Result<ImportReport, DatasetError> {
    let made = make(kind, src, options)?;
    made.write(out, options.images)?;
    Ok(made.report())
}

/// A dataset that is not yet written.
struct Made {
    sequence: Sequence,
    about: About,
    rule: Option<PairRule>,
    /// The scene to be rendered, if the images are not made yet.
    scene: Option<&'static Scene>,
}

impl Made {
    fn write(&self, out: &Path, images: ImageStorage<'_>) -> Result<(), DatasetError> {
        match self.scene {
            Some(scene) => rendered::write(out, scene, &self.sequence, &self.about, images),
            None => write_native(out, &self.sequence, &self.about, images),
        }
    }

    fn report(self) -> ImportReport {
        ImportReport {
            frames: self.sequence.frames.len(),
            pairs: self.sequence.pairs.len(),
            rule: self.rule,
            notes: self.about.notes,
        }
    }
}

fn make(kind: &str, src: &Path, options: &ImportOptions<'_>) -> Result<Made, DatasetError> {
    let kind = find(kind)?;
    let imported = read_as(kind, src, options)?;
    let mut about = imported.about.clone();
    let rule = options.pairs.as_ref().or(kind.default_pairs.as_ref());
    let found = imported.frames.len();
    let (sequence, sensor) = (imported.sequence.clone(), imported.sensor.clone());
    let (frames, pairs) = imported.paired(rule)?;
    if let Some(rule) = rule
        && rule.has_numbers()?
    {
        let note = numbers_of_frames(&frames, &pairs, &about.notes);
        about.notes.extend(note);
    }
    if pairs.is_empty() {
        let by = rule.map_or(String::new(), |rule| format!(" under the rule {rule}"));
        return Err(DatasetError::new(
            src,
            format!("no pair of {}{by}", counted(found, "frame")),
            "choose another rule for the pairs",
        ));
    }
    check_distinct(src, &frames, &pairs)?;
    if let Some(rule) = rule {
        about.origin = format!("{}; pairs {rule}", about.origin);
    }
    let scene = rendered::scene(kind, src);
    if scene.is_none() {
        about.notes.extend(missing_images(&frames));
    }
    about.property = options.property.clone().unwrap_or_default();
    // What was chosen here is asked for, since the source may hold more elsewhere.
    let resolved = ImportOptions {
        sequence,
        sensor,
        pairs: rule.cloned(),
        ..options.clone()
    };
    about.import = resolved.words(kind, (src, &source_name(src, scene)));
    Ok(Made {
        sequence: Sequence {
            name: String::new(), // the folder's
            frames,
            pairs,
        },
        about,
        rule: rule.cloned(),
        scene,
    })
}

/// What the numbers of a list of pairs mean, where they may be taken for those of images: images were left out, or the
/// first image is not called 0.
fn numbers_of_frames(frames: &[Frame], pairs: &[Pair], notes: &[String]) -> Option<String> {
    let name = |frame: u32| own_name(&frames[frame as usize].image);
    let differs = |frame: &u32| {
        let name = name(*frame);
        let mut numbers = name.split(|c: char| !c.is_ascii_digit());
        numbers.all(|number| number.parse() != Ok(*frame))
    };
    let is_number = |frame: &u32| {
        let name = name(*frame);
        let stem = name.split_once('.').map_or(&*name, |(stem, _)| stem);
        stem.parse::<u32>().is_ok()
    };
    let listed = || pairs.iter().flat_map(|pair| [pair.a, pair.b]);
    let mut other = listed().filter(differs);
    let shown = if notes.iter().any(|note| note.starts_with(LEFT_OUT)) {
        other.next().or_else(|| listed().next())
    } else {
        other.find(is_number)
    }?;
    Some(format!(
        "the list numbers the frames of this dataset from 0: {shown} is {}; if images are meant, list their names",
        name(shown)
    ))
}

/// No dataset may have a pair twice, though sources may.
fn check_distinct(src: &Path, frames: &[Frame], pairs: &[Pair]) -> Result<(), DatasetError> {
    let mut first = HashMap::new();
    for (index, pair) in pairs.iter().enumerate() {
        if let Some(before) = first.insert((pair.a, pair.b), index) {
            let image = |frame: u32| frames[frame as usize].image.display();
            let (a, b) = (image(pair.a), image(pair.b));
            let what = format!(
                "its pairs {} and {} are the same, {a} with {b}",
                before + 1,
                index + 1
            );
            return Err(DatasetError::new(src, what, "take one of them out"));
        }
    }
    Ok(())
}

/// Reads the source `src` without writing anything.
///
/// # Errors
/// If the kind is unknown or does not have one of the `options`, or if the source does not have its layout.
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
    options.check(kind)?;
    if kind.id != rendered::RENDERED && !src.exists() {
        return Err(DatasetError::new(
            src,
            "no such file or folder",
            "check the path",
        ));
    }
    let body_from_camera = options.camera_on_body()?;
    let mut imported = (kind.read)(src, options).map_err(|error| with_layout(error, kind, src))?;
    if let Some(body_from_camera) = body_from_camera {
        for pose in imported
            .frames
            .iter_mut()
            .filter_map(|frame| frame.world_from_camera.as_mut())
        {
            *pose *= body_from_camera;
        }
    }
    if imported.frames.is_empty() {
        // Why images were left out: no pose is near enough in time, perhaps.
        let notes = imported.about.notes.iter().map(|note| format!("; {note}"));
        return Err(DatasetError::new(
            src,
            format!("no image has a pose{}", notes.collect::<String>()),
            format!("expected {}", kind.help),
        ));
    }
    Ok(imported)
}

/// The error, with what the kind expects where a file of its layout is not there: `src` may be the folder above.
fn with_layout(error: DatasetError, kind: &Kind, src: &Path) -> DatasetError {
    if error.line.is_some() || !error.file.starts_with(src) || error.file.exists() {
        return error;
    }
    DatasetError {
        remedy: format!("{}; kind {} reads {}", error.remedy, kind.id, kind.help),
        ..error
    }
}

fn missing_images(frames: &[Frame]) -> Option<String> {
    let missing: Vec<_> = (frames.iter())
        .map(|frame| &frame.image)
        .filter(|image| !image.is_file())
        .map(|image| image.display().to_string())
        .collect();
    let images = counted(frames.len(), "image");
    let what = format!("not there (yet): {} of {images}", missing.len());
    note_of(&what, &missing)
}

/// The camera that the user gave: as an option, or as `camera.txt` or `K.txt` in the source.
fn given_camera(
    src: &Path,
    options: &ImportOptions<'_>,
    names: &[&str],
) -> Result<Option<Camera>, DatasetError> {
    let in_source = || {
        names
            .iter()
            .map(|name| src.join(name))
            .find(|p| is_there(p))
    };
    match options.camera.clone().or_else(in_source) {
        Some(file) => parse_camera(&TextFile::read(&file)?.without_commas()).map(Some),
        None => Ok(None),
    }
}

/// The last part of the path, for the origin: that of what a link points to, and of the folder that `.` means.
fn base_name(path: &Path) -> String {
    own_name(&std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned()))
}

/// What a file is called in its folder, though it may be a link to a file of another name; empty for `.` and `..`.
fn own_name(path: &Path) -> String {
    path.file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into())
}

/// The name of a source without the folders above it, which are private to this machine.
fn source_name(path: &Path, scene: Option<&Scene>) -> String {
    if let Some(scene) = scene {
        return scene.name.to_owned();
    }
    let name = base_name(path);
    let parent = path.parent().map(base_name).unwrap_or_default();
    // COLMAP numbers its models.
    if !parent.is_empty() && name.chars().all(|c| c.is_ascii_digit()) {
        return format!("{parent}/{name}");
    }
    name
}

/// What a note begins with that says which images were left out.
const LEFT_OUT: &str = "left out: ";

/// "left out: 3 images `why` (a, b, c)", if there is any.
fn images_left_out(why: &str, images: &[String]) -> Option<String> {
    let count = counted(images.len(), "image");
    note_of(&format!("{LEFT_OUT}{count} {why}"), images)
}

/// The images of a folder, and the names of those in formats that are not read.
fn images_and_unread(folder: &Path) -> Result<(Vec<PathBuf>, Vec<String>), DatasetError> {
    let images = image_files(folder)?;
    let unread = unread_image_files(folder, &images)?;
    let unread = unread.iter().map(|image| own_name(image)).collect();
    Ok((images, unread))
}

/// "left out: 3 images in formats that are not read (a, b, c)", if there is any.
fn unread_left_out(unread: &[String]) -> Option<String> {
    note_of(&format!("{LEFT_OUT}{}", in_other_formats(unread)), unread)
}

fn in_other_formats(unread: &[String]) -> String {
    let count = counted(unread.len(), "image");
    format!("{count} in formats that are not read")
}

/// "`what` (a, b, ...)", if there is any.
fn note_of(what: &str, items: &[String]) -> Option<String> {
    let shown = items.iter().take(5).map(String::as_str).collect::<Vec<_>>();
    match items.len() {
        0 => None,
        n if n <= 5 => Some(format!("{what} ({})", shown.join(", "))),
        _ => Some(format!("{what} ({}, ...)", shown.join(", "))),
    }
}

#[cfg(test)]
mod folder_tests;
#[cfg(test)]
mod list_tests;
#[cfg(test)]
mod model_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod value_tests;
