//! KITTI odometry (Geiger, Lenz, Urtasun: "Are we ready for Autonomous Driving? The KITTI Vision
//! Benchmark Suite", CVPR 2012).
//!
//! `sequences/NN/image_0` holds the rectified images of the left grey camera. Its K is the first projection
//! matrix of `sequences/NN/calib.txt`. `poses/NN.txt` holds its poses (camera-to-world). Image `000017.png`
//! belongs to line 17 (from 0) of the poses; a part of a sequence, with fewer images than poses, is accepted.
//! Frames are assigned by number, not by time. Of `sequences/NN/times.txt` only the number of lines is read, to
//! detect poses of another sequence.

use std::path::{Path, PathBuf};

use matchbench_vision::geometry::Camera;
use nalgebra::Matrix3;

use super::{
    ImportOptions, Imported, base_name, given_camera, images_and_unread, images_left_out,
    unread_left_out,
};
use crate::counted::counted;
use crate::datasets::text::{self, TextFile};
use crate::datasets::trajectory::parse_kitti;
use crate::datasets::{About, DatasetError, Frame};

pub(super) fn read(src: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let number = choose(src, options.sequence.as_deref())?;
    let folder = src.join("sequences").join(&number);
    let camera = match given_camera(&folder, options, &["camera.txt", "K.txt"])? {
        Some(camera) => camera,
        None => first_projection(&TextFile::read(&folder.join("calib.txt"))?)?,
    };
    let poses = parse_kitti(&TextFile::read(&poses_file(src, &number))?)?;
    let mut frames = Vec::new();
    let mut left_out = Vec::new();
    let (images, unread) = images_and_unread(&folder.join("image_0"))?;
    for image in images {
        let stem = image.file_stem().unwrap_or_default().to_string_lossy();
        let pose = stem.parse().ok().and_then(|i: usize| poses.get(i));
        match pose {
            None => left_out.push(base_name(&image)),
            Some(&pose) => frames.push(Frame::with_pose(image, camera, pose)),
        }
    }
    let mut notes: Vec<String> = images_left_out("without a pose", &left_out)
        .into_iter()
        .chain(unread_left_out(&unread))
        .collect();
    if frames.len() < poses.len() {
        notes.push(format!(
            "an image is there for {} of {}",
            frames.len(),
            counted(poses.len(), "pose")
        ));
    }
    let times = folder.join("times.txt");
    if times.is_file() {
        let timed = TextFile::read(&times)?.rows().count();
        if timed != poses.len() {
            notes.push(format!(
                "times.txt has {} and the poses have {}: do they belong to one sequence?",
                counted(timed, "line"),
                poses.len()
            ));
        }
    }
    Ok(Imported {
        about: About {
            origin: format!("KITTI odometry, sequence {number}"),
            notes,
            ..About::default()
        },
        sequence: Some(number),
        ..Imported::of(frames)
    })
}

fn poses_file(src: &Path, number: &str) -> PathBuf {
    src.join("poses").join(format!("{number}.txt"))
}

/// The sequence that was asked for, or the only one with images and poses.
fn choose(src: &Path, wanted: Option<&str>) -> Result<String, DatasetError> {
    let folder = src.join("sequences");
    let entries = std::fs::read_dir(&folder).map_err(|error| DatasetError::io(&folder, &error))?;
    let mut found: Vec<String> = entries
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|number| {
            folder.join(number).join("image_0").is_dir() && poses_file(src, number).is_file()
        })
        .collect();
    found.sort();
    let list = found.join(", ");
    let Some(wanted) = wanted else {
        return match found.len() {
            0 => Err(DatasetError::new(
                folder,
                "no sequence has both image_0 and poses",
                "expected sequences/NN/image_0 and poses/NN.txt (00 to 10 have poses)",
            )),
            1 => Ok(found.swap_remove(0)),
            _ => Err(DatasetError::new(
                folder,
                "there are several sequences",
                format!("choose one of {list}"),
            )),
        };
    };
    let padded = format!("{wanted:0>2}");
    if let Some(number) = [wanted, padded.as_str()]
        .into_iter()
        .find(|name| found.iter().any(|own| own == *name))
    {
        return Ok(number.to_owned());
    }
    Err(DatasetError::new(
        folder,
        format!("there is no sequence {padded} with image_0 and poses"),
        format!("those here: {list}"),
    ))
}

/// K of the left gray camera: the line `P0:`, or the first line where lines have no labels.
fn first_projection(file: &TextFile) -> Result<Camera, DatasetError> {
    let (line, row) = file
        .rows()
        .find(|(_, row)| row.starts_with("P0"))
        .or_else(|| file.rows().next())
        .ok_or_else(|| file.error("there is no line", "expected `P0: ` and 12 numbers"))?;
    let numbers = row.strip_prefix("P0:").unwrap_or(row);
    text::exactly::<12>(numbers)
        .and_then(|p| {
            let k = Matrix3::new(p[0], p[1], p[2], p[4], p[5], p[6], p[8], p[9], p[10]);
            Camera::from_matrix(&k).map_err(|error| error.to_string())
        })
        .map_err(|what| file.error_at(line, what))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calibrations_with_and_without_labels_are_read() {
        let p = "7e2 0 6e2 0 0 7e2 1.8e2 0 0 0 1 0";
        let read = |text: &str| first_projection(&TextFile::new(Path::new("calib.txt"), text));
        let camera = Camera::pinhole(700.0, 700.0, 600.0, 180.0);
        assert_eq!(read(&format!("Tr: 1\nP0: {p}\nP1: 0")), Ok(camera));
        assert_eq!(read(p), Ok(camera));
        assert!(read("").is_err());
        assert_eq!(read("P0: 1 2 3").unwrap_err().line, Some(1));
    }
}
