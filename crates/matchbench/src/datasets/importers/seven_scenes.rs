//! 7-Scenes (Shotton, Glocker, Zach, Izadi, Criminisi, Fitzgibbon: "Scene Coordinate Regression
//! Forests for Camera Relocalization in RGB-D Images", CVPR 2013).
//!
//! `frame-000017.color.png` (or jpg) with `frame-000017.pose.txt`, a 4x4 camera-to-world matrix, in the source
//! folder itself or in its `seq-NN/`. The poses come from KinectFusion and are those of the depth camera, so
//! they are approximate for colour images, unless an option says where the colour camera is. If a pose is not finite
//! (tracking was lost) or is not there, the image is reported and left out. `frame-000017.depth.png`, if it exists, is
//! the depth in millimetres, with 65535 where nothing was measured. It was taken by the depth camera, beside the colour
//! camera, so it is as approximate as the poses.
//!
//! K is not distributed with the colour images. The default, 525 525 320 240, is the Kinect's
//! nominal colour camera; `camera-intrinsics.txt`, which some copies add, is the depth camera's
//! (585) and is not used. Another K can be given as an option, or as `camera.txt` in the folder of the images or in the
//! source.

use std::fs;
use std::path::Path;

use matchbench_vision::geometry::Camera;
use nalgebra::Isometry3;

use super::{
    ImportOption, ImportOptions, Imported, base_name, given_camera, images_and_unread,
    images_left_out, own_name, unread_left_out,
};
use crate::counted::counted;
use crate::datasets::listed::is_there;
use crate::datasets::text::{self, TextFile};
use crate::datasets::{About, DatasetError, DepthFile, DepthUnit, Frame};

/// Nominal calibration of the Kinect's colour camera at 640x480.
const KINECT_COLOR: Camera = Camera::pinhole(525.0, 525.0, 320.0, 240.0);

/// What stands in the names of colour images, between their number and their ending.
const COLOR: &str = ".color.";

const DEPTH: DepthUnit = DepthUnit {
    invalid: Some(65535),
    ..DepthUnit::MILLIMETRES
};

pub(super) fn read(src: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let number = choose(src, options.sequence.as_deref())?;
    let folder = (number.as_ref()).map_or_else(
        || src.to_owned(),
        |number| src.join(format!("seq-{number}")),
    );
    let mut notes = Vec::new();
    // One camera took all sequences of a scene, so its file may lie beside their folders.
    let names = ["camera.txt", "K.txt"];
    let given = match given_camera(&folder, options, &names)? {
        None => given_camera(src, options, &names)?,
        found => found,
    };
    if given.is_none() {
        notes.push(
            "K 525 525 320 240, the Kinect's nominal colour camera, was assumed; camera.txt in the \
             source replaces it"
                .to_owned(),
        );
    }
    let camera = given.unwrap_or(KINECT_COLOR);
    let mut frames = Vec::new();
    let (mut lost, mut without) = (Vec::new(), Vec::new());
    let (images, mut unread) = images_and_unread(&folder)?;
    unread.retain(|name| name.contains(COLOR));
    for image in images {
        let name = own_name(&image);
        let Some((stem, _)) = name.split_once(COLOR) else {
            continue; // depth images lie beside
        };
        let file = folder.join(format!("{stem}.pose.txt"));
        if !is_there(&file) {
            without.push(name);
            continue;
        }
        match pose(&TextFile::read(&file)?)? {
            None => lost.push(name),
            Some(pose) => {
                let path = folder.join(format!("{stem}.depth.png"));
                let depth = path.is_file().then_some(DepthFile { path, unit: DEPTH });
                frames.push(Frame::with_pose(image, camera, pose).with_depth(depth));
            }
        }
    }
    notes.extend(images_left_out("whose pose is not finite", &lost));
    notes.extend(images_left_out("without a pose", &without));
    notes.extend(unread_left_out(&unread));
    if options.body_from_camera.is_none() {
        notes.push(format!(
            "the poses are those of the depth camera; if the run warns of that, {} takes where it says that the colour \
             camera is",
            ImportOption::BodyFromCamera
        ));
    }
    Ok(Imported {
        about: About {
            origin: format!("7-Scenes, {}", base_name(&folder)),
            notes,
            ..About::default()
        },
        sequence: number,
        ..Imported::of(frames)
    })
}

/// The number of the chosen one of the folders `seq-NN`, or of the only one; `None` if there is none, and the source
/// itself holds the frames.
fn choose(src: &Path, wanted: Option<&str>) -> Result<Option<String>, DatasetError> {
    let entries = fs::read_dir(src).map_err(|error| DatasetError::io(src, &error))?;
    let mut found: Vec<String> = entries
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| src.join(name).is_dir())
        .filter_map(|name| Some(name.strip_prefix("seq-")?.to_owned()))
        .collect();
    found.sort();
    let list = found.iter().map(|number| format!("seq-{number}"));
    let list = list.collect::<Vec<_>>().join(", ");
    if let Some(wanted) = wanted {
        let wanted = wanted.strip_prefix("seq-").unwrap_or(wanted);
        let padded = format!("{wanted:0>2}");
        return match found
            .iter()
            .find(|number| [wanted, padded.as_str()].contains(&number.as_str()))
        {
            Some(number) => Ok(Some(number.clone())),
            None => Err(DatasetError::new(
                src,
                format!("there is no folder seq-{padded}"),
                format!("those here: {list}"),
            )),
        };
    }
    match found.as_slice() {
        [] => Ok(None),
        [only] => Ok(Some(only.clone())),
        _ => Err(DatasetError::new(
            src,
            "there are several sequences",
            format!("choose one of {list} by {}", ImportOption::Sequence),
        )),
    }
}

/// The pose in a file of 4x4 numbers; `None` if one of them is not finite.
pub(super) fn pose(file: &TextFile) -> Result<Option<Isometry3<f64>>, DatasetError> {
    let is_lost = |word: &str| {
        let word = word.to_lowercase();
        word.contains("nan") || word.contains("inf") || word.contains('#')
    };
    let mut words = file.rows().flat_map(|(_, row)| row.split_whitespace());
    if words.any(is_lost) {
        return Ok(None);
    }
    let wrong = |what: String| file.error(what, "expected a 4x4 camera-to-world matrix");
    let numbers = file.numbers()?;
    let (motion, last) = numbers
        .split_first_chunk::<12>()
        .filter(|(_, last)| last.len() == 4)
        .ok_or_else(|| {
            wrong(format!(
                "{} where 16 are expected",
                counted(numbers.len(), "number")
            ))
        })?;
    if last != [0.0, 0.0, 0.0, 1.0] {
        return Err(wrong("the last row is not 0 0 0 1".to_owned()));
    }
    text::rigid_motion(motion).map(Some).map_err(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_is_a_rigid_4x4_matrix_or_lost() {
        let read = |text: &str| pose(&TextFile::new(Path::new("p"), text));
        let eye = "1 0 0 5\t\n0 1 0 6 \n0 0 1 7\n0 0 0 1\n";
        let found = read(eye).unwrap().unwrap();
        assert_eq!(found.translation.vector.as_slice(), [5.0, 6.0, 7.0]);
        assert_eq!(read(&eye.replace('5', "-1.#IND")), Ok(None));
        assert_eq!(read(&eye.replace('5', "NaN")), Ok(None));
        assert_eq!(read(&format!("# camera to world\n{eye}")), Ok(Some(found)));
        assert!(read("1 2 3").is_err());
        assert!(read(&eye.replace("0 0 0 1", "0 0 0 2")).is_err());
    }
}
