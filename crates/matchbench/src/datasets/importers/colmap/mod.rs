//! COLMAP models (Schoenberger, Frahm: "Structure-from-Motion Revisited", CVPR 2016). The truth of ETH3D and of
//! the Image Matching Challenges of 2023 and 2024 has this format too.
//!
//! A model is a folder with `cameras` and `images`, each as `.txt` or (little-endian) `.bin`. `images` has
//! cam_from_world as quaternion (w x y z) and translation. The translation has no unit unless the model was
//! scaled. `images` also says which 3D point each keypoint belongs to. The points themselves are not needed.
//!
//! - Pixels are counted from the corner of the image, so the centre of the first pixel is (0.5, 0.5). Half a
//!   pixel is subtracted from principal points.
//! - Camera models: those of [`camera_of_model`](crate::datasets::camera_of_model); others are refused by name if an
//!   image has them.
//! - Images that exist must have the size of their camera. (Other sizes need another K.)
//! - Frames are sorted by name, since the order in a model is that of the reconstruction.
//! - Image names are relative to the image root. This is the given folder, or else the folder of the model or
//!   the nearest one above it that has `images/`.
//! - The default rule `covisible:0.1..0.7` takes pairs whose share of common 3D points is in this range. A list
//!   of pairs numbers the frames in the order of their names.

mod binary;
pub(super) mod lens;
mod text_model;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use matchbench_vision::geometry::Camera;
use matchbench_vision::image::Size;
use nalgebra::Isometry3;

use super::{ImportOptions, Imported, base_name, list};
use crate::datasets::{About, DatasetError, Frame};

/// At most so many models are named where none was given.
const NAMED: usize = 5;

/// A camera and the size of its images, or the reason why it cannot be used. The reason is reported only if an
/// image has this camera.
type Cameras = BTreeMap<u32, Result<(Camera, Size), lens::Unusable>>;

/// A photograph of a model.
#[derive(Clone, Debug, PartialEq)]
struct Photograph {
    name: String,
    camera: u32,
    camera_from_world: Isometry3<f64>,
    /// The 3D points that it sees, sorted, without repetition.
    points: Vec<u64>,
}

pub(super) fn read(src: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    if !is_model(src)
        && let Some(error) = models_below(src)
    {
        return Err(error);
    }
    let has = |name: &str| src.join(name).is_file();
    let is_binary = has("images.bin") || has("cameras.bin") && !has("images.txt");
    let (cameras, mut photographs, [cameras_file, file]) = if is_binary {
        let files = ["cameras.bin", "images.bin"].map(|name| src.join(name));
        (
            binary::cameras(&files[0])?,
            binary::images(&files[1])?,
            files,
        )
    } else {
        let files = ["cameras.txt", "images.txt"].map(|name| src.join(name));
        (
            text_model::cameras(&files[0])?,
            text_model::images(&files[1])?,
            files,
        )
    };
    photographs.sort_by(|p, q| p.name.cmp(&q.name));
    let fail = |what: String| DatasetError::new(&file, what, "export the model from COLMAP again");
    if let Some(twice) = photographs
        .windows(2)
        .find(|two| two[0].name == two[1].name)
    {
        return Err(fail(format!("the image {} is there twice", twice[0].name)));
    }
    let root = match &options.image_root {
        Some(root) => root.clone(),
        None => nearest_images(src),
    };
    let mut frames = Vec::with_capacity(photographs.len());
    let mut seen = Vec::with_capacity(photographs.len());
    for Photograph {
        name,
        camera,
        camera_from_world,
        points,
    } in photographs
    {
        let (id, image) = (camera, root.join(&name));
        let (camera, size) = match cameras.get(&camera) {
            Some(Ok(camera)) => *camera,
            Some(Err(unusable)) => {
                let named = |what| fail(format!("the camera {camera} of {name}: {what}"));
                return Err(unusable.clone().placed(named));
            }
            None => {
                return Err(fail(format!(
                    "{name} has the camera {camera}, which is not there"
                )));
            }
        };
        if image.is_file() {
            let whose = format!("the camera {id} of {name}");
            let error = |what| DatasetError::new(&cameras_file, what, "");
            list::check_camera_size(&image, size, &whose, error)?;
        }
        frames.push(Frame::with_pose(image, camera, camera_from_world.inverse()));
        seen.push(points);
    }
    Ok(Imported {
        about: About {
            origin: format!("COLMAP model {}", base_name(src)),
            notes: Vec::new(),
            ..About::default()
        },
        seen: seen.iter().any(|points| !points.is_empty()).then_some(seen),
        ..Imported::of(frames)
    })
}

/// Whether a folder has at least one file of a model.
fn is_model(folder: &Path) -> bool {
    let has = |name: &&str| folder.join(name).is_file();
    ["cameras.bin", "images.bin", "cameras.txt", "images.txt"]
        .iter()
        .any(has)
}

/// What is said of a folder that is no model where models lie below it. COLMAP puts them into `sparse/0`, `sparse/1` and so
/// on below its workspace.
fn models_below(src: &Path) -> Option<DatasetError> {
    let below = |folder: &Path| -> Vec<PathBuf> {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        let mut folders: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
        folders.sort();
        folders
    };
    let mut models = below(src);
    models.extend(below(&src.join("sparse")));
    models.retain(|folder| is_model(folder));
    let names: Vec<String> = (models.iter().take(NAMED))
        .map(|model| model.display().to_string())
        .collect();
    let more = if models.len() > NAMED { " ..." } else { "" };
    let remedy = match &names[..] {
        [] => return None,
        [one] => format!("give {one}"),
        several => format!("give one of {}{more}", several.join(", ")),
    };
    let what = "there is no COLMAP model here, but below";
    Some(DatasetError::new(src, what, remedy))
}

/// `images/` in the folder of the model or in one of the three folders above it; otherwise the folder of the
/// model.
fn nearest_images(src: &Path) -> PathBuf {
    let absolute = std::path::absolute(src).unwrap_or_else(|_| src.to_owned());
    let places = absolute
        .ancestors()
        .take(4)
        .map(|folder| folder.join("images"));
    let found = { places }.find(|folder| folder.is_dir());
    found.unwrap_or_else(|| src.to_owned())
}

/// The numbers of 3D points, sorted, without repetition.
fn distinct(mut points: Vec<u64>) -> Vec<u64> {
    points.sort_unstable();
    points.dedup();
    points
}

#[cfg(test)]
mod tests {
    use super::super::list_tests::read;
    use super::super::tests::source;
    use super::*;

    #[test]
    fn a_folder_above_models_names_them() {
        let files = [("images/a.png", ""), ("sparse/0/cameras.txt", "")];
        let (_folder, workspace) = source("workspace", &files);
        let said = |src: &Path| read("colmap", src).unwrap_err().to_string();
        let sparse = workspace.join("sparse");
        let [first, second] = ["0", "1"].map(|name| sparse.join(name));
        for src in [&workspace, &sparse] {
            let said = said(src);
            let remedy = format!("; give {}", first.display());
            assert!(said.starts_with(&*src.display().to_string()), "{said}");
            assert!(
                said.contains("no COLMAP model") && said.ends_with(&remedy),
                "{said}"
            );
        }
        fs::create_dir(&second).unwrap();
        fs::write(second.join("images.bin"), "").unwrap();
        let models = format!("; give one of {}, {}", first.display(), second.display());
        assert!(said(&workspace).ends_with(&models));
        // What is there is read, and what is missing of it is named.
        assert!(said(&first).contains("images.txt"));
    }
}
