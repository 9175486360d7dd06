//! Code that importers of lists of pairs share: frames that are named many times, and principal points that are
//! counted from the corner of the image.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use matchbench_vision::geometry::Camera;
use matchbench_vision::image::Size;
use nalgebra::{Isometry3, Matrix3};

use crate::datasets::{DatasetError, DepthFile, Frame, Turn, read_size};

/// Frames in the order in which a list first names them. One image is one frame, unless the list
/// gives it several cameras or turns.
#[derive(Debug, Default)]
pub(super) struct NamedFrames {
    frames: Vec<Frame>,
    numbers: HashMap<(PathBuf, Turn, [u64; 4]), u32>,
}

impl NamedFrames {
    /// The number of the frame; a new number if the frame is named for the first time.
    pub(super) fn number(
        &mut self,
        image: PathBuf,
        turn: Turn,
        camera: Camera,
        world_from_camera: Option<Isometry3<f64>>,
    ) -> u32 {
        let k = [camera.fx, camera.fy, camera.cx, camera.cy].map(f64::to_bits);
        let frames = &mut self.frames;
        *(self.numbers)
            .entry((image.clone(), turn, k))
            .or_insert_with(|| {
                frames.push(Frame {
                    image,
                    name: None,
                    turn,
                    camera,
                    world_from_camera,
                    depth: None,
                });
                frames.len() as u32 - 1
            })
    }

    /// Sets where the depth of a frame is, if it has any.
    pub(super) fn set_depth(&mut self, number: u32, depth: Option<DepthFile>) {
        self.frames[number as usize].depth = depth;
    }

    pub(super) fn frame(&self, number: u32) -> &Frame {
        &self.frames[number as usize]
    }

    pub(super) fn into_frames(self) -> Vec<Frame> {
        self.frames
    }
}

/// Converts a camera whose principal point is counted from the corner of the image (the centre of the first
/// pixel is (0.5, 0.5)) to one where it is counted from the centre of the first pixel.
pub(super) fn from_corner(camera: Camera) -> Camera {
    Camera {
        cx: camera.cx - 0.5,
        cy: camera.cy - 0.5,
        ..camera
    }
}

/// Checks that the image has the `expected` size, for which its camera `whose` is.
///
/// # Errors
/// If it has another, or if its size cannot be read; `error` makes the first error from what is wrong.
pub(super) fn check_camera_size(
    image: &Path,
    expected: Size,
    whose: &str,
    error: impl FnOnce(String) -> DatasetError,
) -> Result<(), DatasetError> {
    let found = read_size(image)?;
    if found == expected {
        return Ok(());
    }
    let what = format!("{whose} is for {expected} pixels, its image has {found}");
    let remedy = "use the original images, or scale K and size of the camera with them";
    Err(DatasetError {
        remedy: remedy.to_owned(),
        ..error(what)
    })
}

/// The size in words as a list writes it.
pub(super) fn size(width: &str, height: &str) -> Result<Size, String> {
    let side = |word: &str| {
        let side = word.parse().ok();
        side.ok_or_else(|| format!("`{word}` is no width or height of an image"))
    };
    Ok(Size::new(side(width)?, side(height)?))
}

/// Nine numbers, row by row, as a camera.
pub(super) fn camera(k: &[f64]) -> Result<Camera, String> {
    debug_assert_eq!(k.len(), 9, "the caller counted");
    Camera::from_matrix(&Matrix3::from_row_slice(k)).map_err(|error| error.to_string())
}

/// The note that is written if [`stand_in`] was used.
pub(super) const STAND_IN: &str = "the cameras are not known: a focal length of 1.2 times the longer side \
     stands in for each, with the principal point in the middle";

/// The note that is written if [`stand_in`] was used for pairs with homographies alone.
pub(super) fn stand_in_of_planes() -> String {
    format!("{STAND_IN}; homographies do not need them")
}

/// A camera for an image of which only the size is known. Its focal length is COLMAP's first guess, 1.2 times
/// the longer side.
pub(super) fn stand_in(size: Size) -> Camera {
    let (width, height) = (size.width as f64, size.height as f64);
    let focal = 1.2 * width.max(height);
    Camera::pinhole(focal, focal, (width - 1.0) / 2.0, (height - 1.0) / 2.0)
}
