//! A plain folder of images, a file of poses and a calibration matrix.
//!
//! Images are in the folder or in its `images/`, `Images/` or `rgb/`, in natural order (`img2` before `img10`).
//! `poses.txt` has one camera-to-world line per image, in that order: 12 numbers (KITTI), the 16 of a 4x4 matrix, or
//! `time tx ty tz qx qy qz qw` (TUM). Commas may separate numbers. The times in it are normally ignored. But if the
//! images are named by their times (`1341847980.722988.png`) and the poses are in TUM's format, images and poses are
//! associated by time, and frames are in the order of time. Otherwise a folder that has images in formats that are not
//! read too (`3.gif`) is refused, since a line might be theirs. `camera.txt` or `K.txt` holds K, optionally followed by
//! `k1 k2 p1 p2 [k3]`.

use std::path::{Path, PathBuf};

use nalgebra::Isometry3;

use super::{
    ImportOptions, Imported, base_name, given_camera, images_and_unread, images_left_out,
    in_other_formats, note_of, own_name, unread_left_out,
};
use crate::counted::counted;
use crate::datasets::text::TextFile;
use crate::datasets::trajectory::{
    in_order_of_time, parse_4x4, parse_kitti, parse_tum, parse_tum_lines,
};
use crate::datasets::{About, DatasetError, Frame};
use crate::front_door::{INTERPOLATE, TOLERANCE};

pub(super) fn read(src: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let camera = given_camera(src, options, &["camera.txt", "K.txt"])?.ok_or_else(|| {
        DatasetError::new(
            src.join("camera.txt"),
            "there is no calibration matrix",
            "write fx 0 cx, 0 fy cy, 0 0 1 into this file",
        )
    })?;
    let folder = folder_of_images(src);
    let (images, unread) = images_and_unread(&folder)?;
    let file = options
        .poses
        .clone()
        .unwrap_or_else(|| src.join("poses.txt"));
    let poses = poses(
        &TextFile::read(&file)?.without_commas(),
        &images,
        &unread,
        options,
    )?;
    let mut frames = Vec::new();
    let mut left_out = Vec::new();
    for (image, (time, pose)) in images.into_iter().zip(poses) {
        match pose {
            None => left_out.push(own_name(&image)),
            Some(pose) => frames.push((time, Frame::with_pose(image, camera, pose))),
        }
    }
    let notes = [
        images_left_out("without a pose", &left_out),
        unread_left_out(&unread),
    ];
    Ok(Imported {
        about: About {
            origin: format!("folder {}", base_name(src)),
            notes: notes.into_iter().flatten().collect(),
            ..About::default()
        },
        ..Imported::of(in_order_of_time(frames).collect())
    })
}

fn folder_of_images(src: &Path) -> PathBuf {
    let inside = ["images", "Images", "rgb"].map(|name| src.join(name));
    (inside.into_iter())
        .find(|folder| folder.is_dir())
        .unwrap_or_else(|| src.to_owned())
}

/// The time of an image, or its number where images have no times, and its pose if it has one.
type Timed = (f64, Option<Isometry3<f64>>);

/// The poses of all images; beside these are others, `unread`.
fn poses(
    file: &TextFile,
    images: &[PathBuf],
    unread: &[String],
    options: &ImportOptions<'_>,
) -> Result<Vec<Timed>, DatasetError> {
    let association = options.association()?;
    let columns = file
        .rows()
        .next()
        .map(|(_, row)| row.split_whitespace().count());
    let poses: Vec<_> = match columns {
        Some(8) => {
            if let Some(times) = times_in_names(images) {
                let trajectory = parse_tum(file)?;
                return Ok(times
                    .into_iter()
                    .map(|time| (time, association.pose_at(&trajectory, time)))
                    .collect());
            }
            let lines = parse_tum_lines(file)?;
            lines.iter().map(|p| p.world_from_camera).collect()
        }
        Some(12) => parse_kitti(file)?,
        Some(16) => parse_4x4(file)?,
        _ => {
            return Err(file.error(
                "these are no poses",
                "expected per line 12 numbers (KITTI), the 16 of a 4x4 matrix, or time tx ty tz qx qy qz qw (TUM)",
            ));
        }
    };
    let given = [
        (INTERPOLATE, options.interpolate),
        (TOLERANCE, options.tolerance.is_some()),
    ];
    if let Some((option, _)) = given.into_iter().find(|(_, given)| *given) {
        return Err(file.error(
            format!("{option} is about times, and these poses or the names of the images have none"),
            format!(
                "leave {option} out, or give poses in TUM's format and name the images by their times \
                 (1341847980.722988.png)"
            ),
        ));
    }
    let of_unread = format!("{} beside them", in_other_formats(unread));
    if let Some(unread) = note_of(&of_unread, unread) {
        return Err(file.error(
            format!(
                "{} for {}, and {unread}, so it is not certain which pose is of which image",
                counted(poses.len(), "pose"),
                counted(images.len(), "image")
            ),
            "convert those to PNG or move them out of the folder, or name all images by their times",
        ));
    }
    if poses.len() != images.len() {
        return Err(file.error(
            format!(
                "{} for {}",
                counted(poses.len(), "pose"),
                counted(images.len(), "image")
            ),
            "give one line per image, or name the images by their times",
        ));
    }
    let numbered = poses.into_iter().enumerate();
    Ok(numbered.map(|(i, pose)| (i as f64, Some(pose))).collect())
}

/// The times in the names of the images, if all images are named by times.
fn times_in_names(images: &[PathBuf]) -> Option<Vec<f64>> {
    images
        .iter()
        .map(|image| {
            let stem = image.file_stem()?.to_str()?;
            let time: f64 = stem.contains('.').then(|| stem.parse().ok())??;
            time.is_finite().then_some(time)
        })
        .collect()
}
