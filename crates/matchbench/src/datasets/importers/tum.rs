//! TUM RGB-D (Sturm, Engelhard, Endres, Burgard, Cremers: "A Benchmark for the Evaluation of
//! RGB-D SLAM Systems", IROS 2012).
//!
//! `rgb.txt` lists times and image files, `groundtruth.txt` times and poses of the colour camera. An image
//! takes the pose nearest in time ([`Association`](super::Association)), and frames are in the order of time. With
//! the default tolerance of 0.02 s this reproduces every digit of the paper's sequence 01. Images without a pose are
//! reported and left out. If there is a `depth.txt`, an image takes the depth nearest in time, within the same
//! tolerance, if its file exists. Depth is registered to the colour image. The published calibrations of the colour
//! cameras are chosen by the name of the folder:
//!
//! | name | fx | fy | cx | cy | k1 | k2 | p1 | p2 | k3 |
//! | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |
//! | freiburg1, fr1 | 517.3 | 516.5 | 318.6 | 255.3 | 0.2624 | -0.9531 | -0.0054 | 0.0026 | 1.1633 |
//! | freiburg2, fr2 | 520.9 | 521.0 | 325.1 | 249.7 | 0.2312 | -0.7849 | -0.0033 | -0.0001 | 0.9172 |
//! | freiburg3, fr3 | 535.4 | 539.2 | 320.1 | 247.6 | rectified |

use std::path::{Path, PathBuf};

use matchbench_vision::geometry::{Camera, Distortion, Lens};

use super::{ImportOptions, Imported, base_name, given_camera, images_left_out, own_name};
use crate::datasets::text::TextFile;
use crate::datasets::trajectory::{in_order_of_time, parse_tum};
use crate::datasets::{About, DatasetError, DepthFile, DepthUnit, Frame};

/// "The depth images are scaled by a factor of 5000", in metres; 0 is no measurement.
const DEPTH: DepthUnit = DepthUnit {
    per_unit: 5000.0,
    invalid: None,
};

pub(super) fn read(src: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let list = TextFile::read(&src.join("rgb.txt"))?;
    let trajectory = parse_tum(&TextFile::read(&src.join("groundtruth.txt"))?)?;
    let camera = camera(src, options)?;
    let association = options.association()?;
    let depth = depth(src)?;
    let mut frames = Vec::new();
    let mut left_out = Vec::new();
    for (line, row) in list.rows() {
        let (time, name) = timed_name(row).map_err(|what| list.error_at(line, what))?;
        match association.pose_at(&trajectory, time) {
            None => left_out.push(name.to_owned()),
            Some(pose) => {
                let depth = association.nearest(&depth, |(time, _)| *time, time);
                let depth = depth.map(|(_, path)| DepthFile {
                    path: path.clone(),
                    unit: DEPTH,
                });
                let frame = Frame::with_pose(src.join(name), camera, pose);
                frames.push((time, frame.with_depth(depth)));
            }
        }
    }
    let without = format!("without a pose within {} s", association.tolerance);
    Ok(Imported {
        about: About {
            origin: format!("TUM RGB-D, {}", base_name(src)),
            notes: images_left_out(&without, &left_out).into_iter().collect(),
            ..About::default()
        },
        ..Imported::of(in_order_of_time(frames).collect())
    })
}

/// The files that `depth.txt` lists and that exist, by their times.
fn depth(src: &Path) -> Result<Vec<(f64, PathBuf)>, DatasetError> {
    let list = src.join("depth.txt");
    if !list.exists() {
        return Ok(Vec::new());
    }
    let list = TextFile::read(&list)?;
    let rows = list.rows().map(|(line, row)| {
        let (time, name) = timed_name(row).map_err(|what| list.error_at(line, what))?;
        Ok((time, src.join(name)))
    });
    let mut files = rows.collect::<Result<Vec<_>, DatasetError>>()?;
    files.retain(|(_, file)| file.is_file());
    files.sort_by(|(one, _), (other, _)| one.total_cmp(other));
    Ok(files)
}

/// `time filename`; the name may contain spaces.
fn timed_name(row: &str) -> Result<(f64, &str), String> {
    let (time, name) = row
        .split_once(char::is_whitespace)
        .ok_or("a time and a file name are expected")?;
    match time.parse::<f64>() {
        Ok(seconds) if seconds.is_finite() => Ok((seconds, name.trim())),
        _ => Err(format!("`{time}` is not a time in seconds")),
    }
}

fn camera(src: &Path, options: &ImportOptions<'_>) -> Result<Camera, DatasetError> {
    if let Some(camera) = given_camera(src, options, &["camera.txt", "K.txt"])? {
        return Ok(camera);
    }
    // A link that is named so tells it as well as the folder that it points to.
    let names = [own_name(src), base_name(src)];
    names.iter().find_map(|name| calibration(name)).ok_or_else(|| {
        DatasetError::new(
            src,
            format!("`{}` does not tell whether this is freiburg1, 2 or 3", names[1]),
            "put camera.txt (3x3, optionally k1 k2 p1 p2 k3 below) into the folder, or name it so",
        )
    })
}

/// The published calibration of the colour camera, by the name of the sequence.
fn calibration(name: &str) -> Option<Camera> {
    let name = name.to_lowercase();
    let is = |number: &str| {
        name.contains(&format!("freiburg{number}")) || name.contains(&format!("fr{number}"))
    };
    let lens = |k1, k2, p1, p2, k3| Some(Lens::Brown(Distortion { k1, k2, p1, p2, k3 }));
    let (camera, distortion) = if is("1") {
        (
            Camera::pinhole(517.3, 516.5, 318.6, 255.3),
            lens(0.2624, -0.9531, -0.0054, 0.0026, 1.1633),
        )
    } else if is("2") {
        (
            Camera::pinhole(520.9, 521.0, 325.1, 249.7),
            lens(0.2312, -0.7849, -0.0033, -0.0001, 0.9172),
        )
    } else if is("3") {
        (Camera::pinhole(535.4, 539.2, 320.1, 247.6), None)
    } else {
        return None;
    };
    Some(Camera {
        distortion,
        ..camera
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calibrations_are_found_by_name() {
        let fx = |name| calibration(name).map(|camera| camera.fx);
        assert_eq!(fx("rgbd_dataset_freiburg1_desk"), Some(517.3));
        assert_eq!(fx("fr2_xyz"), Some(520.9));
        assert_eq!(fx("RGBD_Dataset_Freiburg3_teddy"), Some(535.4));
        assert_eq!(fx("my_room"), None);
        assert!(calibration("fr1").unwrap().distortion.is_some());
        assert!(calibration("fr3").unwrap().distortion.is_none());
    }

    #[test]
    fn a_row_without_time_or_name_is_refused() {
        assert_eq!(timed_name("1.5  rgb/a b.png"), Ok((1.5, "rgb/a b.png")));
        assert!(timed_name("1.5").is_err());
        assert!(timed_name("nan x.png").is_err());
        assert!(timed_name("x.png 1.5").is_err());
    }

    #[test]
    fn calibrations_are_those_that_the_authors_publish() {
        let numbers = |name: &str| {
            let camera = calibration(name).expect("it is one of theirs");
            let lens = camera.distortion.and_then(|lens| lens.brown());
            let lens = lens.map(|lens| [lens.k1, lens.k2, lens.p1, lens.p2, lens.k3]);
            ([camera.fx, camera.fy, camera.cx, camera.cy], lens)
        };
        let first = [0.2624, -0.9531, -0.0054, 0.0026, 1.1633];
        assert_eq!(numbers("fr1"), ([517.3, 516.5, 318.6, 255.3], Some(first)));
        let second = [0.2312, -0.7849, -0.0033, -0.0001, 0.9172];
        assert_eq!(numbers("fr2"), ([520.9, 521.0, 325.1, 249.7], Some(second)));
        assert_eq!(numbers("fr3"), ([535.4, 539.2, 320.1, 247.6], None));
    }
}
