//! Strecha's multi-view stereo sets (Strecha, von Hansen, Van Gool, Fua, Thoennessen: "On
//! Benchmarking Camera Calibration and Multi-View Stereo for High Resolution Imagery", CVPR 2008).
//!
//! For `0000.jpg` there is `0000.jpg.camera`, beside it or in `gt_dense_cameras/`: K (9 numbers), distortion
//! (3, zero), the camera-to-world rotation by rows (9), the centre of the camera (3), width and height (2). The
//! header of these files calls the rotation R. But the matrix in them is the transpose of the R in
//! `x = K [R t] X`; the paper's sequence 05 confirms this. Each image may have its own K.

use std::path::{Path, PathBuf};

use matchbench_vision::geometry::Camera;
use matchbench_vision::image::Size;
use nalgebra::{Isometry3, Matrix3};

use super::list::check_camera_size;
use super::{
    ImportOptions, Imported, base_name, given_camera, images_and_unread, images_left_out, own_name,
    unread_left_out,
};
use crate::counted::counted;
use crate::datasets::text::{self, TextFile};
use crate::datasets::{About, DatasetError, Frame};

pub(super) fn read(src: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let given = given_camera(src, options, &[])?;
    let inside = src.join("images");
    let folder = if inside.is_dir() {
        inside
    } else {
        src.to_owned()
    };
    let places = [folder.clone(), src.join("gt_dense_cameras"), src.to_owned()];
    let mut frames = Vec::new();
    let mut left_out = Vec::new();
    let (images, unread) = images_and_unread(&folder)?;
    for image in images {
        let Some(file) = camera_file(&image, &places) else {
            left_out.push(own_name(&image));
            continue;
        };
        let file = TextFile::read(&file)?;
        let (camera, pose, size) = parse(&file)?;
        check_camera_size(&image, size, "the camera", |what| file.error(what, ""))?;
        frames.push(Frame::with_pose(image, given.unwrap_or(camera), pose));
    }
    Ok(Imported {
        about: About {
            origin: format!("Strecha et al. 2008, {}", base_name(src)),
            notes: [
                images_left_out("without a .camera file", &left_out),
                unread_left_out(&unread),
            ]
            .into_iter()
            .flatten()
            .collect(),
            ..About::default()
        },
        ..Imported::of(frames)
    })
}

fn camera_file(image: &Path, places: &[PathBuf]) -> Option<PathBuf> {
    let mut name = image.file_name()?.to_owned();
    name.push(".camera");
    places
        .iter()
        .map(|place| place.join(&name))
        .find(|file| file.is_file())
}

fn parse(file: &TextFile) -> Result<(Camera, Isometry3<f64>, Size), DatasetError> {
    let wrong = |what: String| {
        file.error(
            what,
            "expected K (9), distortion (3), rotation (9), centre (3), width and height",
        )
    };
    let n: [f64; 26] = file.numbers()?.try_into().map_err(|n: Vec<f64>| {
        wrong(format!(
            "{} where 26 are expected",
            counted(n.len(), "number")
        ))
    })?;
    let camera = Camera::from_matrix(&Matrix3::from_row_slice(&n[..9]))
        .map_err(|error| wrong(error.to_string()))?;
    if n[9..12] != [0.0; 3] {
        return Err(wrong("the distortion is not zero".to_owned()));
    }
    let motion = [
        n[12], n[13], n[14], n[21], n[15], n[16], n[17], n[22], n[18], n[19], n[20], n[23],
    ];
    let pose = text::rigid_motion(&motion).map_err(wrong)?;
    Ok((camera, pose, Size::new(n[24] as usize, n[25] as usize)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: &str = "2759.48 0 1520.69 \n0 2764.16 1006.81 \n0 0 1 \n0 0 0\n\
        0 0 1 \n1 0 0 \n0 1 0 \n1 2 3 \n3072 2048\n";

    fn parse_text(text: &str) -> Result<(Camera, Isometry3<f64>, Size), DatasetError> {
        parse(&TextFile::new(Path::new("0000.jpg.camera"), text))
    }

    #[test]
    fn the_rotation_is_camera_to_world_by_rows() {
        let (camera, pose, size) = parse_text(CAMERA).unwrap();
        assert_eq!(camera, Camera::pinhole(2759.48, 2764.16, 1520.69, 1006.81));
        assert_eq!(size, Size::new(3072, 2048));
        // The optical axis (0, 0, 1) points along the world's x axis.
        let axis = pose * nalgebra::Vector3::z();
        assert!((axis - nalgebra::Vector3::x()).norm() < 1e-15);
        assert_eq!(pose.translation.vector.as_slice(), [1.0, 2.0, 3.0]);
    }

    /// Each of the nine numbers is another one.
    #[test]
    fn every_number_of_the_rotation_stands_in_its_place() {
        let turned = CAMERA.replace(
            "0 0 1 \n1 0 0 \n0 1 0 ",
            "0.36 0.48 -0.8\n-0.8 0.6 0\n0.48 0.64 0.6",
        );
        let (_, pose, _) = parse_text(&turned).unwrap();
        let rows = nalgebra::Matrix3::new(0.36, 0.48, -0.8, -0.8, 0.6, 0.0, 0.48, 0.64, 0.6);
        let found = pose.rotation.to_rotation_matrix();
        assert!((found.matrix() - rows).amax() < 1e-12, "{found}");
        assert_eq!(pose.translation.vector.as_slice(), [1.0, 2.0, 3.0]);
    }

    #[test]
    fn other_files_are_refused() {
        assert!(parse_text("").unwrap_err().what.contains("0 numbers"));
        let lens = CAMERA.replace("0 0 0\n", "0 0.1 0\n");
        assert!(parse_text(&lens).unwrap_err().what.contains("distortion"));
        let scaled = CAMERA.replace("0 1 0", "0 2 0");
        assert!(parse_text(&scaled).unwrap_err().what.contains("rotation"));
    }
}
