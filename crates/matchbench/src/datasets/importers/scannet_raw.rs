//! A scan of ScanNet as its SensReader exports it (Dai, Chang, Savva, Halber, Funkhouser, Niessner: "ScanNet:
//! Richly-annotated 3D Reconstructions of Indoor Scenes", CVPR 2017).
//!
//! `color/17.jpg` with `pose/17.txt`, a 4x4 camera-to-world matrix, and `intrinsic/intrinsic_color.txt`, a 4x4 matrix
//! with K. If a pose is not finite (tracking was lost) or is not there, the image is reported and left out. K is for
//! images of 1296 x 968. For those of another size it is scaled, as for ScanNet-1500 (`scannet`), unless it is given
//! as an option. `depth/17.png`, if it exists, is the depth in millimetres. The depth camera is a little beside the
//! colour camera.

use std::path::Path;

use matchbench_vision::geometry::Camera;

use super::scannet::{COLOR, depth_of, scaled};
use super::seven_scenes::pose;
use super::{
    ImportOptions, Imported, base_name, given_camera, images_and_unread, images_left_out, list,
    own_name, unread_left_out,
};
use crate::counted::counted;
use crate::datasets::listed::is_there;
use crate::datasets::text::TextFile;
use crate::datasets::{About, DatasetError, Frame, read_size};
use crate::front_door::CAMERA;

pub(super) fn read(src: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let given = given_camera(src, options, &["camera.txt", "K.txt"])?;
    let intrinsics = src.join("intrinsic/intrinsic_color.txt");
    let original = match given {
        Some(camera) => camera,
        None => matrix(&TextFile::read(&intrinsics)?)?,
    };
    let (images, unread) = images_and_unread(&src.join("color"))?;
    let (mut frames, mut lost, mut without) = (Vec::new(), Vec::new(), Vec::new());
    let mut other_size = None;
    for image in images {
        let stem = image.file_stem().unwrap_or_default().to_string_lossy();
        let file = src.join("pose").join(format!("{stem}.txt"));
        if !is_there(&file) {
            without.push(own_name(&image));
            continue;
        }
        let Some(pose) = pose(&TextFile::read(&file)?)? else {
            lost.push(own_name(&image));
            continue;
        };
        let mut camera = original;
        if given.is_none() {
            let size = read_size(&image)?;
            let sides = (size.width as f64, size.height as f64);
            if sides != COLOR {
                other_size = Some(size);
                camera = scaled(original, sides);
                (camera.check()).map_err(|error| no_camera(&intrinsics, error.to_string()))?;
            }
        }
        let depth = depth_of(&image);
        frames.push(Frame::with_pose(image, camera, pose).with_depth(depth));
    }
    let scaled = other_size.map(|size| {
        let (width, height) = COLOR;
        format!(
            "images have {size} pixels: K was scaled from {width}x{height}; {CAMERA} replaces it"
        )
    });
    let notes = [
        images_left_out("whose pose is not finite", &lost),
        images_left_out("without a pose", &without),
        unread_left_out(&unread),
        scaled,
    ];
    Ok(Imported {
        about: About {
            origin: format!("ScanNet, {}", base_name(src)),
            notes: notes.into_iter().flatten().collect(),
            ..About::default()
        },
        ..Imported::of(frames)
    })
}

fn no_camera(file: &Path, what: String) -> DatasetError {
    DatasetError::new(
        file,
        what,
        "expected a 4x4 matrix with K, as SensReader writes it",
    )
}

/// The camera of a 4x4 matrix.
fn matrix(file: &TextFile) -> Result<Camera, DatasetError> {
    let wrong = |what: String| no_camera(&file.path, what);
    let numbers = file.numbers()?;
    let m: [f64; 16] = (numbers.try_into()).map_err(|numbers: Vec<f64>| {
        let found = counted(numbers.len(), "number");
        wrong(format!("{found} where 16 are expected"))
    })?;
    if [m[3], m[7], m[11], m[12], m[13], m[14], m[15]] != [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0] {
        return Err(wrong("the last row and column are not 0 0 0 1".to_owned()));
    }
    list::camera(&[m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]]).map_err(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_camera_is_that_of_a_4x4_matrix() {
        let read = |text: &str| matrix(&TextFile::new(Path::new("K"), text));
        let k = "1170 0 647.5 0\n0 1170 483.5 0\n0 0 1 0\n0 0 0 1\n";
        assert_eq!(read(k), Ok(Camera::pinhole(1170.0, 1170.0, 647.5, 483.5)));
        assert!(read("1 2 3").unwrap_err().what.contains("3 numbers"));
        assert!(read(&k.replace("0 0 0 1", "0 0 0 2")).is_err());
        assert!(
            read(&k.replacen("1170 0", "1170 5", 1))
                .unwrap_err()
                .what
                .contains("skew")
        );
    }
}
