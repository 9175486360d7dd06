//! Cameras of radiance fields: `transforms.json` as Blender's synthetic scenes (Mildenhall, Srinivasan, Tancik, Barron,
//! Ramamoorthi, Ng: "NeRF: Representing Scenes as Neural Radiance Fields for View Synthesis", ECCV 2020), instant-ngp
//! and nerfstudio write it.
//!
//! - `frames` has a `file_path` and a `transform_matrix` (4x4, or 3x4 without the last row, 0 0 0 1) for each image. The
//!   matrix is world-from-camera, with OpenGL's axes of the camera: x to the right, y up, z backward. Here y and z are
//!   turned round.
//! - The camera is `fl_x fl_y cx cy` in pixels, or `camera_angle_x` (radians, the whole width). It stands in a frame, or
//!   before all of them. Where `fl_y` is missing, it is `fl_x`; where `cx cy` are, they are half of `w h`. Where these
//!   are missing too, they are the size of the image.
//! - `k1 k2 p1 p2 k3`, or `k1 k2 k3 k4` of a fisheye, may be missing.
//! - Pixels are counted from the corner of the image, as in COLMAP, from which most of these files come. Half a pixel
//!   is subtracted from principal points.
//! - Paths are relative to the image root: the given folder, or that of the file. The ending may be missing, as in
//!   Blender's scenes; then it is that of the file which is there, or `.png`.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use matchbench_vision::geometry::Camera;
use matchbench_vision::image::Size;
use nalgebra::{Isometry3, Quaternion, UnitQuaternion};
use serde::Deserialize;

use super::colmap::lens::{self, Unusable};
use super::list::check_camera_size;
use super::{ImportOptions, Imported, base_name};
use crate::counted::counted;
use crate::datasets::images::EXTENSIONS;
use crate::datasets::text;
use crate::datasets::{About, DatasetError, Frame, read_size};
use crate::files::read_file;

/// The largest file, in bytes. A frame has less than a thousand.
const LARGEST: usize = 64 << 20;

/// The name of the file in its folder.
const FILE: &str = "transforms.json";

/// What stands before the frames, and may stand in each.
#[derive(Clone, Debug, Default, Deserialize)]
struct Intrinsics {
    camera_model: Option<String>,
    camera_angle_x: Option<f64>,
    camera_angle_y: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    w: Option<f64>,
    h: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    k5: Option<f64>,
    k6: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
    is_fisheye: Option<bool>,
}

/// A frame.
#[derive(Deserialize)]
struct View {
    file_path: String,
    transform_matrix: Vec<[f64; 4]>,
    #[serde(flatten)]
    own: Intrinsics,
}

#[derive(Deserialize)]
struct Views {
    frames: Vec<View>,
}

pub(super) fn read(src: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let file = if src.is_dir() {
        only_file(src)?
    } else {
        src.to_owned()
    };
    let bytes = read_file(&file).map_err(|error| DatasetError::io(&file, &error))?;
    if bytes.len() > LARGEST {
        let what = format!(
            "{} are more than are read, {LARGEST}",
            counted(bytes.len(), "byte")
        );
        return Err(DatasetError::new(
            &file,
            what,
            "give its frames in several files",
        ));
    }
    let shared: Intrinsics = parse(&file, &bytes)?;
    let Views { frames: views } = parse(&file, &bytes)?;
    let root = options.root(file.parent().unwrap_or(Path::new("")));
    let mut frames = Vec::with_capacity(views.len());
    let mut names = HashSet::new();
    for view in views {
        let name = &view.file_path;
        let image = image_of(&root, name);
        let fail = |what: String| {
            let what = format!("{}: {what}", text::brief(name));
            let error = DatasetError::new(&file, what, "correct this frame or take it out");
            DatasetError {
                line: line_of(name, &bytes),
                ..error
            }
        };
        if !names.insert(image.clone()) {
            return Err(fail("the image is there a second time".to_owned()));
        }
        let world_from_camera = pose(&view.transform_matrix).map_err(fail)?;
        let own = view.own.or(&shared);
        let is_there = image.is_file();
        let stated = own.size().map_err(fail)?;
        if let Some(size) = stated
            && is_there
        {
            check_camera_size(&image, size, &format!("the camera of {name}"), fail)?;
        }
        let size = match stated {
            None if is_there => Some(read_size(&image)?),
            stated => stated,
        };
        let camera = own.camera(size).map_err(|wrong| wrong.placed(fail))?;
        frames.push(Frame::with_pose(image, camera, world_from_camera));
    }
    Ok(Imported {
        about: About {
            origin: format!("NeRF, {}", base_name(src)),
            ..About::default()
        },
        ..Imported::of(frames)
    })
}

/// The pose of a frame, with our axes of the camera.
fn pose(matrix: &[[f64; 4]]) -> Result<Isometry3<f64>, String> {
    let motion = match matrix.len() {
        3 | 4 => text::rigid_motion_of(matrix.as_flattened()),
        rows => Err(format!(
            "its transform_matrix has {}, and a pose 3 or 4",
            counted(rows, "row")
        )),
    }?;
    // Half a turn about x, exactly.
    let axes = UnitQuaternion::new_unchecked(Quaternion::new(0.0, 1.0, 0.0, 0.0));
    Ok(motion * axes)
}

/// The line in which a name first stands.
fn line_of(name: &str, bytes: &[u8]) -> Option<usize> {
    let quoted = format!("\"{name}\"");
    let mut places = bytes.windows(quoted.len());
    let place = places.position(|part| part == quoted.as_bytes())?;
    Some(bytes[..place].split(|&byte| byte == b'\n').count())
}

/// The file in a folder.
fn only_file(folder: &Path) -> Result<PathBuf, DatasetError> {
    let file = folder.join(FILE);
    let parts = ["train", "val", "test"].map(|part| format!("transforms_{part}.json"));
    let there: Vec<_> = (parts.iter())
        .filter(|part| folder.join(part).is_file())
        .map(String::as_str)
        .collect();
    if file.is_file() || there.is_empty() {
        return Ok(file);
    }
    let remedy = format!(
        "give one of these files instead of the folder: {}",
        there.join(", ")
    );
    Err(DatasetError::new(file, "there is no such file", remedy))
}

fn parse<'a, T: Deserialize<'a>>(file: &Path, bytes: &'a [u8]) -> Result<T, DatasetError> {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes); // a byte order mark
    serde_json::from_slice(text).map_err(|error| {
        let what = error.to_string();
        // The line has its own place.
        let what = what.split(" at line ").next().unwrap_or(&what);
        let error_at = DatasetError::new(file, what, "write it as nerfstudio or Blender do");
        match error.line() {
            0 => error_at,
            line => error_at.at(line),
        }
    })
}

/// The image of this name; the ending may be missing.
fn image_of(root: &Path, name: &str) -> PathBuf {
    let name = name.strip_prefix("./").unwrap_or(name);
    let image = root.join(name);
    if image.is_file() {
        return image;
    }
    let with = |ending: &str| root.join(format!("{name}.{ending}"));
    let has_ending = Path::new(name).extension().is_some_and(|ending| {
        let ending = ending.to_string_lossy().to_lowercase();
        EXTENSIONS.contains(&&*ending)
    });
    if has_ending {
        return image;
    }
    let mut all = EXTENSIONS.iter().map(|ending| with(ending));
    let found = all.find(|path| path.is_file());
    found.unwrap_or_else(|| with("png"))
}

impl Intrinsics {
    /// The same, with what is missing from `shared`.
    fn or(self, shared: &Self) -> Self {
        // A focal length of a frame replaces the angle of all, and an angle the focal length.
        let has_own_x = self.fl_x.is_some() || self.camera_angle_x.is_some();
        let has_own_y = self.fl_y.is_some() || self.camera_angle_y.is_some();
        let across = if has_own_x { &self } else { shared };
        let down = if has_own_x || has_own_y {
            &self
        } else {
            shared
        };
        let (fl_x, camera_angle_x) = (across.fl_x, across.camera_angle_x);
        let (fl_y, camera_angle_y) = (down.fl_y, down.camera_angle_y);
        Self {
            camera_angle_x,
            camera_angle_y,
            fl_x,
            fl_y,
            camera_model: (self.camera_model).or_else(|| shared.camera_model.clone()),
            cx: self.cx.or(shared.cx),
            cy: self.cy.or(shared.cy),
            w: self.w.or(shared.w),
            h: self.h.or(shared.h),
            k1: self.k1.or(shared.k1),
            k2: self.k2.or(shared.k2),
            k3: self.k3.or(shared.k3),
            k4: self.k4.or(shared.k4),
            k5: self.k5.or(shared.k5),
            k6: self.k6.or(shared.k6),
            p1: self.p1.or(shared.p1),
            p2: self.p2.or(shared.p2),
            is_fisheye: self.is_fisheye.or(shared.is_fisheye),
        }
    }

    /// The size of the images, if it is stated.
    fn size(&self) -> Result<Option<Size>, String> {
        let side = |side: f64| {
            let whole = side.fract() == 0.0 && (1.0..=1e9).contains(&side);
            (whole.then_some(side as usize))
                .ok_or_else(|| format!("{side} is no width or height of an image"))
        };
        match (self.w, self.h) {
            (Some(w), Some(h)) => Ok(Some(Size::new(side(w)?, side(h)?))),
            (None, None) => Ok(None),
            _ => Err("one of w and h is missing".to_owned()),
        }
    }

    fn camera(&self, size: Option<Size>) -> Result<Camera, Unusable> {
        let sides = || {
            let size = size.ok_or("w and h are missing, and the image is not there")?;
            Ok::<_, String>((size.width as f64, size.height as f64))
        };
        let of_angle = |angle: f64, side: f64| {
            let is_one = angle > 0.0 && angle < std::f64::consts::PI;
            (is_one.then(|| 0.5 * side / libm::tan(0.5 * angle)))
                .ok_or_else(|| format!("the camera cannot see an angle of {angle} radians"))
        };
        let fx = match (self.fl_x, self.camera_angle_x) {
            (Some(focal), _) => focal,
            (None, Some(angle)) => of_angle(angle, sides()?.0)?,
            (None, None) => return Err("fl_x or camera_angle_x is missing".into()),
        };
        let fy = match (self.fl_y, self.fl_x, self.camera_angle_y) {
            (Some(focal), ..) => focal,
            (None, None, Some(angle)) => of_angle(angle, sides()?.1)?,
            _ => fx,
        };
        let cx = self
            .cx
            .map_or_else(|| Ok::<_, String>(0.5 * sides()?.0), Ok)?;
        let cy = self
            .cy
            .map_or_else(|| Ok::<_, String>(0.5 * sides()?.1), Ok)?;
        let [k1, k2, k3, k4, p1, p2] =
            [self.k1, self.k2, self.k3, self.k4, self.p1, self.p2].map(|k| k.unwrap_or(0.0));
        let [k5, k6] = [self.k5, self.k6].map(|k| k.unwrap_or(0.0));
        if [k5, k6] != [0.0; 2] {
            return Err(format!("k5 is {k5} and k6 is {k6}, which no lens here has").into());
        }
        let is_fisheye = self.is_fisheye == Some(true);
        let unnamed = if is_fisheye {
            "OPENCV_FISHEYE"
        } else {
            "OPENCV"
        };
        let model = self.camera_model.as_deref().unwrap_or(unnamed);
        match model {
            "OPENCV_FISHEYE"
            | "RADIAL_FISHEYE"
            | "SIMPLE_RADIAL_FISHEYE"
            | "FISHEYE"
            | "SIMPLE_FISHEYE" => {
                if [p1, p2] != [0.0; 2] {
                    return Err("a fisheye has no p1 and p2".into());
                }
                lens::camera("OPENCV_FISHEYE", &[fx, fy, cx, cy, k1, k2, k3, k4])
            }
            _ if is_fisheye => {
                let what = format!("is_fisheye is true, and the camera_model is {model}");
                Err(what.into())
            }
            "SIMPLE_PINHOLE" | "PINHOLE" | "SIMPLE_RADIAL" | "RADIAL" | "OPENCV" => {
                if k4 != 0.0 {
                    return Err(format!("k4 is {k4}, and only a fisheye may have it").into());
                }
                let params = [fx, fy, cx, cy, k1, k2, p1, p2, k3, 0.0, 0.0, 0.0];
                lens::camera("FULL_OPENCV", &params)
            }
            "FULL_OPENCV" => {
                let params = [fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6];
                lens::camera(model, &params)
            }
            other => lens::camera(other, &[]),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use matchbench_vision::geometry::Lens;
    use nalgebra::{Point3, Vector3};

    use super::super::read_source;
    use super::super::tests::source;
    use super::*;

    /// The camera is at (1, 2, 3), looks along x of the world, and has z up.
    const POSE: &str = "[[0, 0, -1, 1], [-1, 0, 0, 2], [0, 1, 0, 3], [0, 0, 0, 1]]";

    fn read(src: &Path) -> Result<Imported, DatasetError> {
        read_source("nerf", src, &ImportOptions::default())
    }

    #[test]
    fn blenders_scenes_are_read() {
        let frame = |name: &str| {
            format!(
                r#"{{"file_path": "./train/{name}", "rotation": 0.1, "transform_matrix": {POSE}}}"#
            )
        };
        let text = format!(
            r#"{{"camera_angle_x": 1.0, "frames": [{}, {}, {}]}}"#,
            frame("r_0"),
            frame("r_1"),
            frame("gone.v2")
        );
        let files = [
            ("train/r_0.png", ""),
            ("train/r_1.png", ""),
            ("transforms_train.json", &*text),
        ];
        let (_folder, src) = source("lego", &files);
        let error = read(&src).unwrap_err().to_string();
        assert!(
            error.contains("give one of these files instead of the folder: transforms_train.json"),
            "{error}"
        );
        let error = read(&src.join("transforms_train.json"))
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("gone.v2: w and h are missing, and the image is not there"),
            "{error}"
        );
        let sized = text.replace("{\"camera", "{\"w\": 24, \"h\": 17, \"camera");
        fs::write(src.join("transforms_train.json"), sized).unwrap();
        let found = read(&src.join("transforms_train.json")).unwrap();
        let images = ["r_0.png", "r_1.png", "gone.v2.png"].map(|name| src.join("train").join(name));
        let named: Vec<_> = found
            .frames
            .iter()
            .map(|frame| frame.image.clone())
            .collect();
        assert_eq!(named, images);
        let camera = found.frames[0].camera;
        // Half of the width is seen at half of the angle.
        assert!((camera.fx * 0.5_f64.tan() - 12.0).abs() < 1e-12);
        assert_eq!((camera.fy, camera.cx, camera.cy), (camera.fx, 11.5, 8.0));
        assert_eq!(camera.distortion, None);
        // What lies before the camera, to its right and below it.
        let seen =
            found.frames[0].world_from_camera.unwrap().inverse() * Point3::new(6.0, 1.5, 2.0);
        assert!(
            (seen.coords - Vector3::new(0.5, 1.0, 5.0)).norm() < 1e-12,
            "{seen}"
        );
    }

    #[test]
    fn a_frame_has_its_own_camera_where_it_is_written() {
        let text = format!(
            r#"{{"camera_model": "OPENCV", "fl_x": 20, "fl_y": 21, "cx": 12, "cy": 8.5, "w": 24, "h": 17, "k1": 0.125, "p2": 0.25,
                "applied_transform": [[1, 0, 0, 0]], "frames": [
                {{"file_path": "images/a.png", "transform_matrix": {POSE}}},
                {{"file_path": "images/b.png", "transform_matrix": {POSE}, "camera_model": "OPENCV_FISHEYE", "p2": 0,
                  "fl_x": 30, "cx": 13, "k1": 0.5, "k4": 0.75}},
                {{"file_path": "images/c", "transform_matrix": {POSE}, "camera_angle_x": 1.5707963267948966, "k1": 0, "p2": 0.0}},
                {{"file_path": "images/d.png", "transform_matrix": {POSE}, "fl_y": 23}}]}}"#
        );
        let (_folder, src) = source("room", &[("transforms.json", &*text), ("images/a.png", "")]);
        let found = read(&src).unwrap();
        assert_eq!(found.about.origin, "NeRF, room");
        let cameras: Vec<_> = found.frames.iter().map(|frame| frame.camera).collect();
        let lens = cameras[0].distortion.unwrap().brown().unwrap();
        assert_eq!(
            (cameras[0].fy, cameras[0].cx, lens.k1, lens.p2),
            (21.0, 11.5, 0.125, 0.25)
        );
        let fisheye = Lens::Fisheye(matchbench_vision::geometry::Fisheye {
            k1: 0.5,
            k4: 0.75,
            ..Default::default()
        });
        assert_eq!(cameras[1].distortion, Some(fisheye));
        assert_eq!(
            (cameras[1].fx, cameras[1].fy, cameras[1].cx),
            (30.0, 30.0, 12.5)
        );
        assert!((cameras[2].fx - 12.0).abs() < 1e-12 && cameras[2].distortion.is_none());
        assert_eq!(found.frames[2].image, src.join("images/c.png"));
        assert_eq!((cameras[3].fx, cameras[3].fy), (20.0, 23.0));
        let larger = text.replace("\"w\": 24", "\"w\": 48");
        fs::write(src.join("transforms.json"), larger).unwrap();
        let error = read(&src).unwrap_err().to_string();
        assert!(
            error.contains("images/a.png is for 48x17 pixels, its image has 24x17"),
            "{error}"
        );
    }

    #[test]
    fn a_pose_may_lack_its_last_row_and_is_checked_all_the_same() {
        let (_folder, src) = source("room", &[("transforms.json", "")]);
        let read = |matrix: &str| {
            let frame = format!(r#"{{"file_path": "a.png", "transform_matrix": {matrix}}}"#);
            let text = format!(r#"{{"w": 24, "h": 17, "fl_x": 20, "frames": [{frame}]}}"#);
            fs::write(src.join("transforms.json"), text).unwrap();
            read(&src).map(|found| found.frames[0].world_from_camera.unwrap())
        };
        let short = POSE.replace(", [0, 0, 0, 1]]", "]");
        assert_eq!(read(&short).unwrap(), read(POSE).unwrap());
        for (from, to, words) in [
            ("[0, 1, 0, 3]", "[0, 2, 0, 3]", "is not a rotation"),
            ("[0, 1, 0, 3]", "[0, 0, 0, 1]", "is not a rotation"),
            ("[0, 1, 0, 3]", "[0, 1, 0]", "expected an array of length 4"),
            (
                ", [0, 1, 0, 3]",
                "",
                "a.png: its transform_matrix has 2 rows, and a pose 3 or 4",
            ),
        ] {
            assert!(short.contains(from), "{from}");
            let error = read(&short.replace(from, to)).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line_or_frame() {
        let sound = format!(
            "{{\"w\": 24, \"h\": 17, \"fl_x\": 20,\n\"frames\": [\n{{\"file_path\": \"a.png\", \"transform_matrix\": {POSE}}},\n\
             {{\"file_path\": \"b.png\", \"transform_matrix\": {POSE}}}\n]}}"
        );
        let (_folder, src) = source("room", &[("transforms.json", &*sound)]);
        assert_eq!(read(&src).unwrap().frames.len(), 2);
        let full = sound.replace("\"w\"", "\"camera_model\": \"FULL_OPENCV\", \"w\"");
        for same in [format!("\u{feff}{sound}"), full] {
            fs::write(src.join("transforms.json"), same).unwrap();
            assert_eq!(read(&src).unwrap().frames.len(), 2);
        }
        let b = "\"b.png\", ";
        for (from, to, words) in [
            (
                "[[0, 0, -1",
                "[[0, 0, -2",
                "transforms.json:3: a.png: the 3x3 block is not a rotation",
            ),
            (
                "[0, 0, 0, 1]]}\n]",
                "[0, 0, 0, 2]]}\n]",
                "transforms.json:4: b.png: the last row",
            ),
            (
                "b.png",
                "./a.png",
                "./a.png: the image is there a second time",
            ),
            ("\"fl_x\": 20", "\"fl_x\": \"20\"", "transforms.json:1: "),
            (
                "\"fl_x\": 20",
                "\"fx\": 20",
                "a.png: fl_x or camera_angle_x is missing",
            ),
            (
                "\"fl_x\": 20",
                "\"fl_x\": -20",
                "a.png: focal lengths must be positive",
            ),
            (
                "\"fl_x\": 20",
                "\"camera_angle_x\": 3.2",
                "cannot see an angle of 3.2 radians",
            ),
            ("\"h\": 17", "\"H\": 17", "a.png: one of w and h is missing"),
            (
                "\"w\": 24",
                "\"w\": 24.5",
                "a.png: 24.5 is no width or height",
            ),
            (
                b,
                "\"b.png\", \"k4\": 1, ",
                "b.png: k4 is 1, and only a fisheye",
            ),
            (
                b,
                "\"b.png\", \"k1\": 0.1, \"k6\": 0.2, ",
                "b.png: k5 is 0 and k6 is 0.2, which no lens here has",
            ),
            (
                b,
                "\"b.png\", \"camera_model\": \"FULL_OPENCV\", \"k4\": 0.1, ",
                "b.png: ",
            ),
            (
                b,
                "\"b.png\", \"p1\": 1, \"is_fisheye\": true, ",
                "b.png: a fisheye has no p1",
            ),
            (
                b,
                "\"b.png\", \"camera_model\": \"EQUIRECTANGULAR\", ",
                "b.png: the camera model EQUIRECTANGULAR is not supported",
            ),
            (
                b,
                "\"b.png\", \"camera_model\": \"PINHOLE\", \"is_fisheye\": true, ",
                "the camera_model is PINHOLE",
            ),
            ("\"frames\"", "\"views\"", "missing field `frames`"),
            ("\n]}", "\n]", "transforms.json:5: EOF"),
        ] {
            assert!(sound.contains(from), "{from}");
            fs::write(src.join("transforms.json"), sound.replacen(from, to, 1)).unwrap();
            let error = read(&src).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }
}
