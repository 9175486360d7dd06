//! KITTI odometry (Geiger, Lenz, Urtasun: "Are we ready for Autonomous Driving? The KITTI Vision
//! Benchmark Suite", CVPR 2012).
//!
//! `sequences/NN/image_0` to `image_3` hold the rectified images of four cameras: grey left and right, colour left and
//! right. `poses/NN.txt` holds the poses of the first one (camera-to-world). The projection matrix `P_i = K [I | t]` of
//! `sequences/NN/calib.txt` takes points of the first camera to pixels of camera i. So `K` is its calibration, and it
//! lies at `-t` in the frame of the first (0.54 m to the right for `image_1`). Image `000017.png`
//! belongs to line 17 (from 0) of the poses; a part of a sequence, with fewer images than poses, is accepted.
//! Frames are assigned by number, not by time. Of `sequences/NN/times.txt` only the number of lines is read, to
//! detect poses of another sequence.

use std::path::{Path, PathBuf};

use matchbench_vision::geometry::Camera;
use nalgebra::{Isometry3, Matrix3};

use super::{
    ImportOption, ImportOptions, Imported, given_camera, images_and_unread, images_left_out,
    own_name, unread_left_out,
};
use crate::counted::counted;
use crate::datasets::text::{self, TextFile};
use crate::datasets::trajectory::parse_kitti;
use crate::datasets::{About, DatasetError, Frame};

/// The folders of images of the cameras; the first that is there is read if none is asked for.
const SENSORS: [&str; 4] = ["image_0", "image_1", "image_2", "image_3"];

pub(super) fn read(src: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let number = choose(src, options)?;
    let folder = src.join("sequences").join(&number);
    let sensor = options.sensor_in(&folder, &SENSORS)?;
    let index = (SENSORS.iter().position(|name| *name == sensor)).expect("it is one of them");
    let projection = || projection(&TextFile::read(&folder.join("calib.txt"))?, index);
    let (camera, camera_from_first) =
        match given_camera(&folder, options, &["camera.txt", "K.txt"])? {
            // Where the others lie, only the projections say.
            Some(camera) if index == 0 => (camera, Isometry3::identity()),
            Some(camera) => (camera, projection()?.1),
            None => projection()?,
        };
    let first_from_camera = camera_from_first.inverse();
    let poses = parse_kitti(&TextFile::read(&poses_file(src, &number))?)?;
    let mut frames = Vec::new();
    let mut left_out = Vec::new();
    let (images, unread) = images_and_unread(&folder.join(sensor))?;
    for image in images {
        let stem = image.file_stem().unwrap_or_default().to_string_lossy();
        let pose = stem.parse().ok().and_then(|i: usize| poses.get(i));
        match pose {
            None => left_out.push(own_name(&image)),
            Some(pose) => {
                frames.push(Frame::with_pose(image, camera, pose * first_from_camera));
            }
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
            origin: match index {
                0 => format!("KITTI odometry, sequence {number}"),
                _ => format!("KITTI odometry, sequence {number}, {sensor}"),
            },
            notes,
            ..About::default()
        },
        sequence: Some(number),
        sensor: Some(sensor.to_owned()),
        ..Imported::of(frames)
    })
}

fn poses_file(src: &Path, number: &str) -> PathBuf {
    src.join("poses").join(format!("{number}.txt"))
}

/// The sequence that was asked for, or the only one with images and poses.
fn choose(src: &Path, options: &ImportOptions<'_>) -> Result<String, DatasetError> {
    let folder = src.join("sequences");
    let entries = std::fs::read_dir(&folder).map_err(|error| DatasetError::io(&folder, &error))?;
    let mut found = Vec::new();
    for number in entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok()) {
        let images = folder.join(&number);
        let images = images.join(options.sensor_in(&images, &SENSORS)?);
        if images.is_dir() && poses_file(src, &number).is_file() {
            found.push(number);
        }
    }
    found.sort();
    let sensor = options.sensor.as_deref().unwrap_or(SENSORS[0]);
    let list = found.join(", ");
    if found.is_empty() {
        return Err(DatasetError::new(
            folder,
            format!("no sequence has both {sensor} and poses"),
            format!("expected sequences/NN/{sensor} and poses/NN.txt (00 to 10 have poses)"),
        ));
    }
    let Some(wanted) = options.sequence.as_deref() else {
        if found.len() == 1 {
            return Ok(found.swap_remove(0));
        }
        return Err(DatasetError::new(
            folder,
            "there are several sequences",
            format!("choose one of {list} by {}", ImportOption::Sequence),
        ));
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
        format!("there is no sequence {padded} with {sensor} and poses"),
        format!("those here: {list}"),
    ))
}

/// The camera of this index, and the motion to it from the first: the line `P0:` (to `P3:`), or the line of this number
/// where lines have no labels.
fn projection(file: &TextFile, index: usize) -> Result<(Camera, Isometry3<f64>), DatasetError> {
    let label = format!("P{index}:");
    let is_labelled = file.rows().any(|(_, row)| row.contains(':'));
    let found = if is_labelled {
        let labelled = |(line, row)| Some((line, str::strip_prefix(row, &label)?));
        let mut found = file.rows().filter_map(labelled);
        let first = found.next();
        if let Some((line, _)) = found.next() {
            return Err(file.error_at(line, format!("`{label}` is there twice")));
        }
        first
    } else {
        file.rows().nth(index)
    };
    let (line, row) = found.ok_or_else(|| {
        let what = format!("there is no projection matrix of image_{index}");
        file.error(what, format!("expected `{label} ` and 12 numbers"))
    })?;
    let parsed = text::exactly::<12>(row).and_then(|p| {
        let k = Matrix3::new(p[0], p[1], p[2], p[4], p[5], p[6], p[8], p[9], p[10]);
        let camera = Camera::from_matrix(&k).map_err(|error| error.to_string())?;
        let z = p[11];
        let (x, y) = (
            (p[3] - camera.cx * z) / camera.fx,
            (p[7] - camera.cy * z) / camera.fy,
        );
        let motion = text::rigid_motion(&[1., 0., 0., x, 0., 1., 0., y, 0., 0., 1., z])?;
        Ok((camera, motion))
    });
    parsed.map_err(|what| file.error_at(line, what))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};

    use super::super::read_source;
    use super::super::tests::source;
    use super::*;

    #[test]
    fn calibrations_with_and_without_labels_are_read() {
        let p = "7e2 0 6e2 0 0 7e2 1.8e2 0 0 0 1 0";
        let read =
            |text: &str, index| projection(&TextFile::new(Path::new("calib.txt"), text), index);
        let camera = Camera::pinhole(700.0, 700.0, 600.0, 180.0);
        let first = Ok((camera, Isometry3::identity()));
        assert_eq!(read(&format!("Tr: 1\nP0: {p}\nP1: 0"), 0), first);
        assert_eq!(read(p, 0), first);
        let two = format!("{p}\n7e2 0 6e2 -350 0 7e2 1.8e2 0 0 0 1 0");
        let (_, second) = read(&two, 1).unwrap();
        assert_eq!(second, Isometry3::translation(-0.5, 0.0, 0.0));
        for (text, index, what) in [
            ("", 0, "calib.txt: there is no projection matrix of image_0"),
            ("P0: 1 2 3", 0, "calib.txt:1: 3 columns"),
            (
                "P0: 1\nP2: 2\nP0: 1",
                0,
                "calib.txt:3: `P0:` is there twice",
            ),
            (
                "P0: 1",
                2,
                "calib.txt: there is no projection matrix of image_2",
            ),
            (p, 1, "calib.txt: there is no projection matrix of image_1"),
            (
                "7 0 6 1e200 0 7 1 0 0 0 1 0",
                0,
                "calib.txt:1: the translation",
            ),
        ] {
            let error = read(text, index).unwrap_err().to_string();
            assert!(error.starts_with(what), "{error}");
        }
    }

    /// A point is seen by the colour camera where its projection matrix has it.
    #[test]
    fn the_colour_camera_lies_beside_the_grey_one() {
        // As KITTI's calibration of sequence 00, with a larger shift.
        let p2 = "718.856 0 607.1928 453.8225 0 718.856 185.2157 -11.3 0 0 1 0.375";
        let p = p2.split(' ').map(|x| x.parse().unwrap());
        let p2 = nalgebra::Matrix3x4::from_row_iterator(p);
        let calib = format!(
            "P0: 718.856 0 607.1928 0 0 718.856 185.2157 0 0 0 1 0\nP2: {}\n",
            p2.row_iter()
                .map(|row| format!("{} {} {} {}", row[0], row[1], row[2], row[3]))
                .collect::<Vec<_>>()
                .join(" ")
        );
        // The first camera of line 1 looks along the world's x.
        let poses = "1 0 0 0 0 1 0 0 0 0 1 0\n0 0 1 5 0 1 0 6 -1 0 0 7\n";
        let (_folder, src) = source(
            "kitti",
            &[
                ("sequences/00/image_2/000000.png", ""),
                ("sequences/00/image_2/000001.png", ""),
                ("sequences/00/calib.txt", &calib),
                ("sequences/01/image_0/000000.png", ""),
                ("poses/00.txt", poses),
                ("poses/01.txt", poses),
            ],
        );
        let with = |sequence: Option<&str>, sensor: Option<&str>| {
            let options = ImportOptions {
                sequence: sequence.map(str::to_owned),
                sensor: sensor.map(str::to_owned),
                ..ImportOptions::default()
            };
            read_source("kitti", &src, &options)
        };
        let found = with(Some("00"), None).unwrap();
        assert_eq!(found, with(None, Some("image_2")).unwrap(), "01 has none");
        assert_eq!(found.sensor.as_deref(), Some("image_2"));
        assert_eq!(found.about.origin, "KITTI odometry, sequence 00, image_2");
        let first = Isometry3::from_parts(
            Vector3::new(5.0, 6.0, 7.0).into(),
            nalgebra::UnitQuaternion::from_axis_angle(
                &Vector3::y_axis(),
                std::f64::consts::FRAC_PI_2,
            ),
        );
        let point = Point3::new(25.0, 5.0, 8.0);
        let seen = p2 * (first.inverse() * point).to_homogeneous();
        let there = found.frames[1].world_from_camera.unwrap().inverse() * point;
        let pixel = found.frames[1].camera.project(there.xy() / there.z);
        assert!(
            (pixel.coords - seen.xy() / seen.z).norm() < 1e-9,
            "{pixel} {seen}"
        );
        for (sequence, sensor, what) in [
            (Some("00"), Some("image_1"), "no sequence has both image_1"),
            (Some("00"), Some("image_0"), "no sequence 00 with image_0"),
            (
                None,
                Some("../x"),
                "there is no camera `../x`; use one of image_0, image_1",
            ),
            (None, None, "choose one of 00, 01"),
        ] {
            let error = with(sequence, sensor).unwrap_err().to_string();
            assert!(error.contains(what), "{error}");
        }
    }
}
