//! EuRoC MAV (Burri, Nikolic, Gohl, Schneider, Rehder, Omari, Achtelik, Siegwart: "The EuRoC Micro
//! Aerial Vehicle Datasets", IJRR 35, 2016): the left camera `cam0`, or the right one `cam1`.
//!
//! `mav0/cam0/data.csv` (nanoseconds, file name), `mav0/cam0/data/` (images),
//! `mav0/cam0/sensor.yaml` (`T_BS`: 4x4, camera to body; `intrinsics`: fx fy cx cy;
//! `distortion_coefficients`: k1 k2 p1 p2, or k1 k2 k3 k4 of a fisheye, whose `distortion_model` is `equidistant`;
//! pixels count from the first one's centre) and
//! `mav0/state_groundtruth_estimate0/data.csv` (nanoseconds, position in metres, quaternion w x y z,
//! and more, of the body). world_from_camera = world_from_body * T_BS. An image takes the state nearest in
//! time, or an interpolated one; frames are in the order of time. Images without a state are reported and left out.

use std::path::Path;

use matchbench_vision::geometry::{Camera, Distortion, Fisheye, Lens};
use matchbench_vision::image::Size;
use nalgebra::Isometry3;

use super::list::check_camera_size;
use super::{ImportOptions, Imported, base_name, images_left_out, list};
use crate::datasets::text::{self, TextFile};
use crate::datasets::trajectory::{TimedPose, in_order_of_time};
use crate::datasets::{About, DatasetError, Frame};

/// The cameras of the rig; the first is read if none is asked for.
const SENSORS: [&str; 2] = ["cam0", "cam1"];

pub(super) fn read(src: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let inside = src.join("mav0");
    let folder = if inside.is_dir() {
        inside
    } else {
        src.to_owned()
    };
    let name = options.sensor_in(&folder, &SENSORS)?;
    let sensor = folder.join(name);
    let about = TextFile::read(&sensor.join("sensor.yaml"))?;
    let (camera, body_from_camera) = sensor_of(&about)?;
    let resolution = resolution_of(&about)?;
    let states = folder.join("state_groundtruth_estimate0").join("data.csv");
    let trajectory = trajectory(&TextFile::read(&states)?)?;
    let association = options.association()?;
    let images = TextFile::read(&sensor.join("data.csv"))?;
    let mut frames = Vec::new();
    let mut left_out = Vec::new();
    for (line, row) in images.rows() {
        let parsed = row
            .split_once(',')
            .ok_or_else(|| "time,name is expected".to_owned());
        let parsed = parsed.and_then(|(time, image)| Ok((seconds(time)?, image.trim())));
        let (time, image) = parsed.map_err(|what| images.error_at(line, what))?;
        match association.pose_at(&trajectory, time) {
            None => left_out.push(image.to_owned()),
            Some(world_from_body) => {
                let image = sensor.join("data").join(image);
                let pose = world_from_body * body_from_camera;
                frames.push((time, Frame::with_pose(image, camera, pose)));
            }
        }
    }
    let frames: Vec<Frame> = in_order_of_time(frames).collect();
    if let Some(size) = resolution
        && let Some(frame) = frames.iter().find(|frame| frame.image.is_file())
    {
        let fail = |what| about.error(what, "give the calibration of these images");
        check_camera_size(&frame.image, size, name, fail)?;
    }
    let without = format!("without a state within {} s", association.tolerance);
    Ok(Imported {
        about: About {
            origin: match name {
                "cam0" => format!("EuRoC MAV, {}", base_name(src)),
                other => format!("EuRoC MAV, {}, {other}", base_name(src)),
            },
            notes: images_left_out(&without, &left_out).into_iter().collect(),
            ..About::default()
        },
        sensor: Some(name.to_owned()),
        ..Imported::of(frames)
    })
}

/// Nanoseconds as seconds. A double holds today's times to less than a microsecond.
fn seconds(nanoseconds: &str) -> Result<f64, String> {
    let time = nanoseconds.trim();
    let count: u64 = (time.parse()).map_err(|_| format!("`{time}` is no time in nanoseconds"))?;
    Ok(count as f64 * 1e-9)
}

fn trajectory(file: &TextFile) -> Result<Vec<TimedPose>, DatasetError> {
    let pose = |row: &str| {
        let (time, rest) = row
            .split_once(',')
            .ok_or("time, position and quaternion are expected")?;
        let state: Vec<&str> = rest.split(',').take(7).collect();
        let [x, y, z, qw, qx, qy, qz] = text::exactly(&state.join(" "))?;
        Ok(TimedPose {
            time: seconds(time)?,
            world_from_camera: text::quaternion_motion([x, y, z], [qx, qy, qz, qw])
                .map_err(|what| format!("{what} (order: x y z qw qx qy qz)"))?,
        })
    };
    let mut poses = (file.rows())
        .map(|(line, row)| pose(row).map_err(|what: String| file.error_at(line, what)))
        .collect::<Result<Vec<_>, _>>()?;
    poses.sort_by(|p, q| p.time.total_cmp(&q.time));
    Ok(poses)
}

/// The camera, and the transformation from its coordinates to those of the body.
fn sensor_of(file: &TextFile) -> Result<(Camera, Isometry3<f64>), DatasetError> {
    let fail = |what: String| file.error(what, "give the sensor.yaml of a camera of EuRoC");
    let text = &without_comments(file.text());
    let pose: [f64; 16] = bracketed(text, "T_BS:").map_err(fail)?;
    let [fx, fy, cx, cy] = bracketed(text, "intrinsics:").map_err(fail)?;
    let [k1, k2, third, fourth] = bracketed(text, "distortion_coefficients:").map_err(fail)?;
    if let Some(model) = value_of(text, "camera_model:")
        && model != "pinhole"
    {
        let model = text::brief(model);
        return Err(fail(format!(
            "the camera_model is {model}, and not pinhole"
        )));
    }
    let model = value_of(text, "distortion_model:").unwrap_or_default();
    let lens: Lens = match model {
        "radial-tangential" | "radtan" => {
            let (p1, p2, k3) = (third, fourth, 0.0);
            Distortion { k1, k2, p1, p2, k3 }.into()
        }
        "equidistant" => {
            let (k3, k4) = (third, fourth);
            Fisheye { k1, k2, k3, k4 }.into()
        }
        _ => {
            let what = "the distortion_model is neither radial-tangential nor equidistant";
            return Err(fail(what.to_owned()));
        }
    };
    let pinhole = list::camera(&[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]).map_err(fail)?;
    let camera = Camera {
        distortion: Some(lens),
        ..pinhole
    };
    camera.check().map_err(|error| fail(error.to_string()))?;
    Ok((camera, text::rigid_motion_4x4(&pose).map_err(fail)?))
}

/// The size of the images, if the file has it.
fn resolution_of(file: &TextFile) -> Result<Option<Size>, DatasetError> {
    const KEY: &str = "resolution:";
    let fail = |what: String| file.error(what, "give the sensor.yaml of a camera of EuRoC");
    let text = &without_comments(file.text());
    if value_of(text, KEY).is_none() {
        return Ok(None);
    }
    let sides: [f64; 2] = bracketed(text, KEY).map_err(fail)?;
    if sides
        .iter()
        .any(|side| !(1.0..=1e6).contains(side) || side.fract() != 0.0)
    {
        return Err(fail(format!("{KEY} {sides:?} is no width and height")));
    }
    let [width, height] = sides.map(|side| side as usize);
    Ok(Some(Size::new(width, height)))
}

/// The text with each line as far as it is no comment.
fn without_comments(text: &str) -> String {
    let lines = text.lines();
    lines
        .flat_map(|line| [line.split('#').next().unwrap_or_default(), "\n"])
        .collect()
}

/// What follows `key` wherever it begins a line, to the end of the text.
fn behind<'t>(text: &'t str, key: &str) -> impl Iterator<Item = &'t str> {
    let starts = text.match_indices('\n').map(|(at, _)| at + 1);
    let lines = std::iter::once(0).chain(starts).map(|at| &text[at..]);
    let indent = |c: char| c != '\n' && c.is_whitespace();
    lines.filter_map(move |line| line.trim_start_matches(indent).strip_prefix(key))
}

/// What stands behind `key` in the first line that begins with it, without quotes about it.
fn value_of<'t>(text: &'t str, key: &str) -> Option<&'t str> {
    let rest = behind(text, key).next()?;
    let value = rest.lines().next().unwrap_or_default().trim();
    Some(value.trim_matches(['"', '\'']))
}

/// The `N` numbers in the first square brackets after `key`, which begins one line.
fn bracketed<const N: usize>(text: &str, key: &str) -> Result<[f64; N], String> {
    let mut found = behind(text, key);
    let rest = found.next();
    if found.next().is_some() {
        return Err(format!("`{key}` is there twice"));
    }
    let inside = rest
        .and_then(|rest| rest.split_once('['))
        .and_then(|(_, rest)| rest.split_once(']'));
    let (inside, _) = inside.ok_or_else(|| format!("there is no `{key} [...]`"))?;
    text::exactly(&inside.replace(',', " ")).map_err(|what| format!("{key} {what}"))
}

#[cfg(test)]
mod tests {
    use super::super::read_source;
    use super::super::tests::source;
    use super::*;

    #[test]
    fn either_camera_of_the_rig_is_read() {
        let sensor = |x: f64, fx: f64| {
            format!(
                "T_BS:\n  data: [1, 0, 0, {x}, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n\
                 intrinsics: [{fx}, 20, 12, 8]\ndistortion_model: radial-tangential\n\
                 distortion_coefficients: [0.1, 0, 0, 0]\n"
            )
        };
        let (left, right) = (sensor(0.0, 20.0), sensor(0.11, 21.0));
        let files = [
            ("mav0/cam0/sensor.yaml", &*left),
            ("mav0/cam0/data.csv", "1000000000,a.png\n"),
            ("mav0/cam1/sensor.yaml", &*right),
            ("mav0/cam1/data.csv", "1000000000,b.png\n"),
            (
                "mav0/state_groundtruth_estimate0/data.csv",
                "1000000000,1,2,3,1,0,0,0\n",
            ),
        ];
        let (_folder, src) = source("V1_01", &files);
        let with = |sensor: Option<&str>| {
            let options = ImportOptions {
                sensor: sensor.map(str::to_owned),
                ..ImportOptions::default()
            };
            read_source("euroc", &src, &options)
        };
        let found = with(None).unwrap();
        assert_eq!(found, with(Some("cam0")).unwrap());
        assert_eq!(found.about.origin, "EuRoC MAV, V1_01");
        let found = with(Some("cam1")).unwrap();
        assert_eq!(found.about.origin, "EuRoC MAV, V1_01, cam1");
        assert_eq!(found.sensor.as_deref(), Some("cam1"));
        let frame = &found.frames[0];
        assert_eq!(frame.image, src.join("mav0/cam1/data/b.png"));
        assert_eq!(frame.camera.fx, 21.0);
        assert_eq!(frame.world_from_camera.unwrap().translation.x, 1.11);
        let error = with(Some("cam2")).unwrap_err().to_string();
        assert!(error.ends_with("use one of cam0, cam1"), "{error}");
    }

    /// The coefficients stand in the order of the file: k1 k2 p1 p2, or k1 k2 k3 k4 of a fisheye.
    #[test]
    fn either_lens_has_its_coefficients_in_the_order_of_the_file() {
        let lens = |model: &str| {
            let text = format!(
                "T_BS:\n  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n\
                 intrinsics: [458, 457, 367, 248]\ndistortion_model: {model}\n\
                 distortion_coefficients: [-0.28, 0.07, 0.0002, 0.0001]\n"
            );
            let (camera, _) = sensor_of(&TextFile::new(Path::new("sensor.yaml"), &text)).unwrap();
            let numbers = [camera.fx, camera.fy, camera.cx, camera.cy];
            assert_eq!(numbers, [458.0, 457.0, 367.0, 248.0]);
            camera.distortion
        };
        let (k1, k2) = (-0.28, 0.07);
        let (p1, p2, k3) = (0.0002, 0.0001, 0.0);
        let brown = Distortion { k1, k2, p1, p2, k3 };
        assert_eq!(lens("radial-tangential"), Some(brown.into()));
        let (k3, k4) = (p1, p2);
        let fisheye = Fisheye { k1, k2, k3, k4 };
        assert_eq!(lens("equidistant"), Some(fisheye.into()));
    }

    #[test]
    fn times_are_nanoseconds() {
        let found = seconds(" 1403636579763555584 ").unwrap();
        assert!((found - 1_403_636_579.763_555_5).abs() < 1e-6, "{found}");
        assert!(seconds("1.5").is_err());
    }

    #[test]
    fn a_calibration_of_other_cameras_or_images_is_refused() {
        let sound = "T_BS:\n  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\ncamera_model: pinhole # as all\n\
             intrinsics: [20, 20, 12, 8]\nresolution: [24, 17]\ndistortion_model: radial-tangential\n\
             distortion_coefficients: [0.1, 0, 0, 0]\n";
        let read = |from: &str, to: &str| {
            let about = sound.replacen(from, to, 1);
            let files = [
                ("cam0/sensor.yaml", &*about),
                ("cam0/data.csv", "1000000000,a.png\n"),
                ("cam0/data/a.png", ""),
                (
                    "state_groundtruth_estimate0/data.csv",
                    "1000000000,1,2,3,1,0,0,0\n",
                ),
            ];
            let (_folder, src) = source("V1_01", &files);
            let found = read_source("euroc", &src, &ImportOptions::default());
            found.map(drop).map_err(|error| error.to_string())
        };
        assert_eq!(read("", ""), Ok(()));
        assert_eq!(read("resolution: [24, 17]\n", ""), Ok(()));
        assert_eq!(read("pinhole", "\"pinhole\""), Ok(()));
        assert_eq!(read("radial-tangential", "'radtan'"), Ok(()));
        for (from, to, words) in [
            (
                "pinhole",
                "omni",
                "the camera_model is omni, and not pinhole",
            ),
            (
                "[24, 17]",
                "[48, 34]",
                "cam0 is for 48x34 pixels, its image has 24x17",
            ),
            ("[24, 17]", "[24, 0.5]", "is no width and height"),
            (
                "radial-tangential",
                "fov # not radial-tangential",
                "the distortion_model is neither radial-tangential nor equidistant",
            ),
            (
                "intrinsics: ",
                "intrinsics: [1, 1, 1, 1]\nintrinsics: ",
                "`intrinsics:` is there twice",
            ),
        ] {
            let said = read(from, to).expect_err(words);
            assert!(
                said.contains(words) && said.contains("sensor.yaml"),
                "{said}"
            );
        }
    }
}
