//! COLMAP models (Schoenberger, Frahm: "Structure-from-Motion Revisited", CVPR 2016). The truth of ETH3D and of
//! the Image Matching Challenges of 2023 and 2024 has this format too.
//!
//! A model is a folder with `cameras` and `images`, each as `.txt` or (little-endian) `.bin`. `images` has
//! cam_from_world as quaternion (w x y z) and translation. The translation has no unit unless the model was
//! scaled. `images` also says which 3D point each keypoint belongs to. The points themselves are not needed.
//!
//! - Pixels are counted from the corner of the image, so the centre of the first pixel is (0.5, 0.5). Half a
//!   pixel is subtracted from principal points.
//! - Camera models: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, OPENCV_FISHEYE, and FULL_OPENCV where k4, k5
//!   and k6 are 0; others are refused by name if an image has them.
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
use std::path::{Path, PathBuf};

use matchbench_vision::geometry::Camera;
use matchbench_vision::image::Size;
use nalgebra::Isometry3;

use super::{ImportOptions, Imported, base_name, list};
use crate::datasets::{About, DatasetError, Frame};

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
