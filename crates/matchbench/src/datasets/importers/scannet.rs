//! ScanNet-1500, as LoFTR publishes it (Sun, Shen, Wang, Bao, Zhou: "LoFTR: Detector-Free Local
//! Feature Matching with Transformers", CVPR 2021; the pairs are those of SuperGlue's list).
//!
//! `test.npz`: `name`, 1500 x 4: scene, sub-scan, frame a, frame b; `rel_pose`, 1500 x 12, the row-major [R t]
//! that takes points from camera a to camera b, in metres. `intrinsics.npz`: one K per scan, for images of 640
//! x 480.
//!
//! - K was made from ScanNet's own K, for 1296 x 968 pixels. fx, cx were divided by 2.025 and fy, cy by
//!   968/480, as if pixels were counted from the corner. This is undone here. If the images have another size,
//!   K is then scaled with pixel centres at integers. A missing image is assumed to have 1296 x 968.
//! - Poses are in single precision, of numbers printed with five digits. They are converted back to these
//!   digits, so the dataset equals the one from SuperGlue's list.
//! - Images are `scene0707_00/color/15.jpg` under the image root. If none of them exists, but SuperGlue's
//!   `scans_test/scene0707_00/sens/frame-000015.color.jpg` do, those are taken.
//! - Depth in millimetres is `scene0707_00/depth/15.png`, or beside SuperGlue's images `frame-000015.depth.png`
//!   or `.pgm`, if it exists. The depth camera is a little beside the colour camera.

use std::path::{Path, PathBuf};

use matchbench_vision::geometry::Camera;
use nalgebra::Isometry3;

use super::list::{NamedFrames, camera};
use super::{ImportOption, ImportOptions, Imported, base_name};
use crate::arrays::{Array, Npz};
use crate::counted::counted;
use crate::datasets::text;
use crate::datasets::{DatasetError, DepthFile, DepthUnit, Pair, Turn, read_size};

/// Size of ScanNet's colour images.
pub(super) const COLOR: (f64, f64) = (1296.0, 968.0);
/// Image size to which the K of `intrinsics.npz` belong.
const SMALL: (f64, f64) = (640.0, 480.0);

/// The most pairs of a list, which need many times its bytes if it is compressed.
const MAX_PAIRS: usize = 1_000_000;

/// One row of `name`.
#[derive(Clone, Copy)]
struct Name {
    scene: u32,
    scan: u32,
    frames: [u32; 2],
}

pub(super) fn read(src: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let fail = |what: String| DatasetError::new(src, what, "give LoFTR's test.npz of ScanNet");
    if src.is_dir() {
        let remedy = "give LoFTR's test.npz, or import the folder of a scan as kind scannet-raw";
        return Err(DatasetError::new(src, "this is a folder", remedy));
    }
    let mut list = Npz::open(src).map_err(DatasetError::of_array)?;
    let [names, poses] =
        ["name", "rel_pose"].map(|name| list.array(name).map_err(DatasetError::of_array));
    let (names, poses) = (names?, poses?);
    let table = |name: &str, array: &Array, columns: usize| {
        let rows = array.rows(columns);
        rows.map_err(|what| fail(format!("array `{name}`: {what}")))
    };
    let counts = (table("name", &names, 4)?, table("rel_pose", &poses, 12)?);
    if counts.0 != counts.1 {
        let what = format!(
            "{} for {}",
            counted(counts.0, "name"),
            counted(counts.1, "pose")
        );
        return Err(fail(what));
    }
    if counts.0 > MAX_PAIRS {
        let what = format!("{} pairs; {MAX_PAIRS} are the most", counts.0);
        return Err(fail(what));
    }
    let (names, poses) = (names.to_vec(), poses.to_decimals());
    let rows = (names
        .chunks_exact(4)
        .zip(poses.chunks_exact(12))
        .enumerate())
    .map(|(index, (name, pose))| {
        let row = name_of(name).and_then(|name| Ok((name, motion(pose)?)));
        row.map_err(|what| fail(format!("row {index}: {what}")))
    })
    .collect::<Result<Vec<_>, _>>()?;

    let beside = src.parent().unwrap_or(Path::new(""));
    let intrinsics = (options.intrinsics.clone()).unwrap_or_else(|| beside.join("intrinsics.npz"));
    let mut intrinsics = Npz::open(&intrinsics).map_err(|error| DatasetError {
        remedy: format!(
            "give LoFTR's intrinsics.npz by {}",
            ImportOption::Intrinsics
        ),
        ..DatasetError::of_array(error)
    })?;
    let root = options.root(beside);
    let layout = layout(&root, &rows);
    let mut frames = NamedFrames::default();
    let mut pairs = Vec::new();
    let mut cameras = std::collections::HashMap::new();
    for &(name, b_from_a) in &rows {
        let original = if let Some(&camera) = cameras.get(&(name.scene, name.scan)) {
            camera
        } else {
            let original = original(&mut intrinsics, &name.folder())?;
            cameras.insert((name.scene, name.scan), original);
            original
        };
        let mut number = |frame: u32| {
            let image = root.join(layout(name, frame));
            let size = if image.is_file() {
                Some(read_size(&image)?)
            } else {
                None
            };
            let size = size.map_or(COLOR, |size| (size.width as f64, size.height as f64));
            let depth = depth_of(&image);
            let number = frames.number(image, Turn::None, scaled(original, size), None);
            frames.set_depth(number, depth);
            Ok(number)
        };
        let (a, b) = (number(name.frames[0])?, number(name.frames[1])?);
        if a == b {
            return Err(fail(format!(
                "{}: a frame is matched with itself",
                name.folder()
            )));
        }
        pairs.push(Pair::with_pose(a, b, b_from_a));
    }
    let origin = format!("ScanNet, LoFTR's {}", base_name(src));
    Ok(Imported::listed(origin, frames.into_frames(), pairs))
}

impl Name {
    fn folder(self) -> String {
        format!("scene{:04}_{:02}", self.scene, self.scan)
    }
}

fn name_of(row: &[f64]) -> Result<Name, String> {
    let number = |value: f64| match value {
        value if (0.0..1e9).contains(&value) && value.fract() == 0.0 => Ok(value as u32),
        value => Err(format!("{value} is no number of a frame")),
    };
    Ok(Name {
        scene: number(row[0])?,
        scan: number(row[1])?,
        frames: [number(row[2])?, number(row[3])?],
    })
}

fn motion(row: &[f64]) -> Result<Isometry3<f64>, String> {
    text::rigid_motion(row.try_into().expect("rows have 12 columns"))
}

type Layout = fn(Name, u32) -> PathBuf;

/// How images are named: as LoFTR does, unless only images named as SuperGlue does exist.
fn layout(root: &Path, rows: &[(Name, Isometry3<f64>)]) -> Layout {
    const LAYOUTS: [Layout; 2] = [
        |name, frame| format!("{}/color/{frame}.jpg", name.folder()).into(),
        |name, frame| {
            format!(
                "scans_test/{}/sens/frame-{frame:06}.color.jpg",
                name.folder()
            )
            .into()
        },
    ];
    let there = |layout: &Layout| {
        (rows.iter()).any(|&(name, _)| root.join(layout(name, name.frames[0])).is_file())
    };
    LAYOUTS.into_iter().find(there).unwrap_or(LAYOUTS[0])
}

/// The depth of the image, if it exists.
pub(super) fn depth_of(image: &Path) -> Option<DepthFile> {
    let (folder, name) = (image.parent()?, image.file_name()?.to_str()?);
    let candidates = if let Some(frame) = name.strip_suffix(".color.jpg") {
        ["png", "pgm"].map(|end| folder.join(format!("{frame}.depth.{end}")))
    } else {
        let depth = folder.with_file_name("depth").join(name);
        ["png", "pgm"].map(|end| depth.with_extension(end))
    };
    let path = candidates.into_iter().find(|file| file.is_file())?;
    Some(DepthFile {
        path,
        unit: DepthUnit::MILLIMETRES,
    })
}

/// The camera of ScanNet's own images.
fn original(intrinsics: &mut Npz, scan: &str) -> Result<Camera, DatasetError> {
    let k = (intrinsics.array(scan)).map_err(DatasetError::of_array)?;
    let small = if k.shape() == [3, 3] {
        camera(&k.to_decimals())
    } else {
        Err(format!("the shape is {:?}, not 3 x 3", k.shape()))
    };
    let small = small.map_err(|what| {
        let remedy = "give the file as its authors publish it";
        DatasetError::new(intrinsics.path(), format!("array `{scan}`: {what}"), remedy)
    })?;
    // The error that is left from the division by 2.025 is beyond the ninth decimal.
    let undo = |value: f64, by: f64| (value * by * 1e9).round() / 1e9;
    let (x, y) = (COLOR.0 / SMALL.0, COLOR.1 / SMALL.1);
    Ok(Camera::pinhole(
        undo(small.fx, x),
        undo(small.fy, y),
        undo(small.cx, x),
        undo(small.cy, y),
    ))
}

/// The camera of images that were scaled to this size.
pub(super) fn scaled(original: Camera, size: (f64, f64)) -> Camera {
    if size == COLOR {
        return original;
    }
    let (x, y) = (size.0 / COLOR.0, size.1 / COLOR.1);
    Camera::pinhole(
        original.fx * x,
        original.fy * y,
        (original.cx + 0.5) * x - 0.5,
        (original.cy + 0.5) * y - 0.5,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half as wide and half as high: the corner of the image at -0.5 stays, so a centre of 647.5 is 648 / 2 from it.
    #[test]
    fn a_camera_is_scaled_about_the_corner_of_the_image() {
        let original = Camera::pinhole(1170.0, 1160.0, 647.5, 483.5);
        assert_eq!(scaled(original, COLOR), original);
        let half = Camera::pinhole(585.0, 580.0, 323.5, 241.5);
        assert_eq!(scaled(original, (648.0, 484.0)), half);
    }
}
