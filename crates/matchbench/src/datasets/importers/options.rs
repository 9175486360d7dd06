//! Options of an import. Every kind declares the options that it has. To give another option is an error, which
//! names the kinds that have it.

use std::fmt;
use std::path::{Path, PathBuf};

use nalgebra::Isometry3;

use super::{KINDS, Kind};
use crate::datasets::text::{self, TextFile};
use crate::datasets::{Association, DatasetError, ImageStorage, PairRule};
use crate::front_door::{self, Asked};

/// An option that only some kinds have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ImportOption {
    /// [`ImportOptions::sequence`].
    Sequence,
    /// [`ImportOptions::sensor`].
    Sensor,
    /// [`ImportOptions::pairs`].
    Pairs,
    /// [`ImportOptions::camera`].
    Camera,
    /// [`ImportOptions::poses`].
    Poses,
    /// [`ImportOptions::body_from_camera`].
    BodyFromCamera,
    /// [`ImportOptions::tolerance`].
    Tolerance,
    /// [`ImportOptions::interpolate`].
    Interpolate,
    /// [`ImportOptions::image_root`].
    ImageRoot,
    /// [`ImportOptions::intrinsics`].
    Intrinsics,
}

impl fmt::Display for ImportOption {
    /// As whoever reads the message gives it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.asked().fmt(f)
    }
}

impl ImportOption {
    fn asked(self) -> Asked {
        match self {
            Self::Sequence => front_door::SEQUENCE,
            Self::Sensor => front_door::SENSOR,
            Self::Pairs => front_door::PAIRS,
            Self::Camera => front_door::CAMERA,
            Self::Poses => front_door::POSES,
            Self::BodyFromCamera => front_door::BODY_FROM_CAMERA,
            Self::Tolerance => front_door::TOLERANCE,
            Self::Interpolate => front_door::INTERPOLATE,
            Self::ImageRoot => front_door::IMAGE_ROOT,
            Self::Intrinsics => front_door::INTRINSICS,
        }
    }

    /// As it is typed on the command line.
    fn on_command_line(self) -> String {
        self.asked().on_command_line().to_owned()
    }
}

/// The options of an import. Every kind has `images` and `property`; [`Kind::options`] names the others that it
/// has.
#[derive(Clone, Debug, Default)]
pub struct ImportOptions<'a> {
    /// Which sequence of the source, if it holds several.
    pub sequence: Option<String>,
    /// Which camera of the source, if it has several that are fixed to each other; the first that is there if absent.
    pub sensor: Option<String>,
    /// Which pairs; the default of the kind if absent.
    pub pairs: Option<PairRule>,
    /// File with K (and distortion `k1 k2 p1 p2 [k3]`), which replaces the camera of the source.
    pub camera: Option<PathBuf>,
    /// File with the poses.
    pub poses: Option<PathBuf>,
    /// File with the pose of the camera on the body (depth camera, inertial sensor, robot ...) whose poses the source has.
    pub body_from_camera: Option<PathBuf>,
    /// Largest difference in time between an image and its pose, in seconds; 0.02 if absent, as in TUM's own
    /// tool.
    pub tolerance: Option<f64>,
    /// Interpolate between the poses before and after an image instead of taking the nearest.
    pub interpolate: bool,
    /// Folder to which the image names of the source are relative.
    pub image_root: Option<PathBuf>,
    /// File with the calibration matrices.
    pub intrinsics: Option<PathBuf>,
    /// What the images show, in a few words; every kind has it.
    pub property: Option<String>,
    /// Where the images of the dataset will be.
    pub images: ImageStorage<'a>,
}

impl ImportOptions<'_> {
    /// How images are associated with poses by time.
    pub(super) fn association(&self) -> Result<Association, DatasetError> {
        let tolerance = self.tolerance.unwrap_or(Association::default().tolerance);
        // Written this way so that NaN is refused too; `tolerance < 0.0` is false for NaN.
        if !(tolerance >= 0.0 && tolerance.is_finite()) {
            return Err(DatasetError::new(
                ImportOption::Tolerance.to_string(),
                format!("{tolerance} is no time"),
                "give a number of seconds from 0",
            ));
        }
        Ok(Association {
            tolerance,
            interpolate: self.interpolate,
        })
    }

    /// The pose of the camera on the body, from its file of 12 or 16 numbers: `[R t]`, or the 4x4 matrix.
    pub(super) fn camera_on_body(&self) -> Result<Option<Isometry3<f64>>, DatasetError> {
        let Some(file) = &self.body_from_camera else {
            return Ok(None);
        };
        let file = TextFile::read(file)?.without_commas();
        text::rigid_motion_of(&file.numbers()?)
            .map(Some)
            .map_err(|what| file.error(what, "expected [R t], 3x4, or the 4x4 matrix"))
    }

    /// The camera that is read, of those that a source may have: the given one, or the first that is there in `folder`.
    pub(super) fn sensor_in(
        &self,
        folder: &Path,
        all: &[&'static str],
    ) -> Result<&'static str, DatasetError> {
        let mut there = (all.iter()).filter(|name| folder.join(name).is_dir());
        let Some(wanted) = &self.sensor else {
            return Ok(there.next().unwrap_or(&all[0]));
        };
        if let Some(name) = all.iter().find(|name| *name == wanted) {
            return Ok(name);
        }
        Err(DatasetError::new(
            ImportOption::Sensor.to_string(),
            format!("there is no camera `{wanted}`"),
            format!("use one of {}", all.join(", ")),
        ))
    }

    /// The folder to which image names are relative: the given one, or `beside`.
    pub(super) fn root(&self, beside: &Path) -> PathBuf {
        self.image_root.clone().unwrap_or_else(|| beside.to_owned())
    }

    /// Refuses options that were given and that `kind` does not have.
    pub(super) fn check(&self, kind: &Kind) -> Result<(), DatasetError> {
        let Some(option) = (self.given()).find(|option| !kind.options.contains(option)) else {
            return Ok(());
        };
        let have = KINDS.iter().filter(|kind| kind.options.contains(&option));
        let have: Vec<_> = have.map(|kind| kind.id).collect();
        Err(DatasetError::new(
            option.to_string(),
            format!("kind {} has no such option", kind.id),
            format!("leave it out; these kinds have it: {}", have.join(", ")),
        ))
    }

    /// The arguments that make the same import from a source of this name, see [`About::import`]. Files below
    /// the source are named relative to it.
    ///
    /// [`About::import`]: crate::datasets::About::import
    pub(super) fn words(&self, kind: &Kind, (src, source): (&Path, &str)) -> Vec<String> {
        let below = |path: &Path| {
            let [path, src] = [path, src].map(|path| path.canonicalize().ok());
            let rest = path?.strip_prefix(src?).ok()?.to_owned();
            Some(Path::new(source).join(rest))
        };
        let name = |path: &PathBuf| {
            let name = path.file_name().unwrap_or(path.as_os_str());
            let path = below(path).unwrap_or_else(|| name.into());
            path.components()
                .collect::<PathBuf>()
                .to_string_lossy()
                .into_owned()
        };
        let rule = self.pairs.as_ref().map(|rule| match rule {
            PairRule::List { file } => format!("list:{}", name(file)),
            rule => rule.to_string(),
        });
        let mut words = vec![kind.id.to_owned(), source.to_owned()];
        for (option, value) in [
            (ImportOption::Sequence, self.sequence.clone()),
            (ImportOption::Sensor, self.sensor.clone()),
            (ImportOption::Pairs, rule),
            (ImportOption::Camera, self.camera.as_ref().map(name)),
            (ImportOption::Poses, self.poses.as_ref().map(name)),
            (
                ImportOption::BodyFromCamera,
                self.body_from_camera.as_ref().map(name),
            ),
            (
                ImportOption::Tolerance,
                self.tolerance.map(|seconds| seconds.to_string()),
            ),
            (ImportOption::ImageRoot, self.image_root.as_ref().map(name)),
            (ImportOption::Intrinsics, self.intrinsics.as_ref().map(name)),
        ] {
            words.extend(
                value
                    .into_iter()
                    .flat_map(|value| [option.on_command_line(), value]),
            );
        }
        if self.interpolate {
            words.push(ImportOption::Interpolate.on_command_line());
        }
        if let Some(property) = &self.property {
            words.extend(["--property".to_owned(), property.clone()]);
        }
        words
    }

    fn given(&self) -> impl Iterator<Item = ImportOption> {
        [
            (ImportOption::Sequence, self.sequence.is_some()),
            (ImportOption::Sensor, self.sensor.is_some()),
            (ImportOption::Pairs, self.pairs.is_some()),
            (ImportOption::Camera, self.camera.is_some()),
            (ImportOption::Poses, self.poses.is_some()),
            (
                ImportOption::BodyFromCamera,
                self.body_from_camera.is_some(),
            ),
            (ImportOption::Tolerance, self.tolerance.is_some()),
            (ImportOption::Interpolate, self.interpolate),
            (ImportOption::ImageRoot, self.image_root.is_some()),
            (ImportOption::Intrinsics, self.intrinsics.is_some()),
        ]
        .into_iter()
        .filter_map(|(option, given)| given.then_some(option))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::super::tests::source;
    use super::super::{import, read_source};
    use super::*;
    use crate::datasets::describe;

    /// The last arguments that are noted of an import from these files without an option, but for the rule of the
    /// pairs; and whether they read the same again.
    fn noted(kind: &str, files: &[(&str, &str)], file: &str) -> Vec<String> {
        let (folder, src) = source("source", files);
        let (src, out) = (src.join(file), folder.path().join("out"));
        import(kind, &src, &out, &ImportOptions::default()).expect("it has the layout");
        let words = describe(&out).expect("it was just written").import;
        let sequence = (words.iter().position(|word| word == "--sequence"))
            .map(|place| words[place + 1].clone());
        let named = ImportOptions {
            sequence: sequence.clone(),
            ..ImportOptions::default()
        };
        let read = |options| read_source(kind, &src, options).expect("it was imported");
        assert_eq!(read(&named).frames, read(&ImportOptions::default()).frames);
        sequence.into_iter().collect()
    }

    #[test]
    fn poses_of_a_body_become_those_of_the_camera_on_it() {
        // The body looks along x of the world, and the camera on it to the left, half a unit above.
        let poses = "0 0 1 3 -1 0 0 4 0 -1 0 5\n0 0 1 4 -1 0 0 4 0 -1 0 5\n";
        let camera = "0 0 -1 0\n0 1 0 -0.5\n1 0 0 0\n";
        let files = [
            ("0.png", ""),
            ("1.png", ""),
            ("camera.txt", "20 0 12 0 20 8 0 0 1"),
            ("poses.txt", poses),
            ("camera-on-body.txt", camera),
        ];
        let (folder, src) = source("robot", &files);
        let options = ImportOptions {
            body_from_camera: Some(src.join("camera-on-body.txt")),
            ..ImportOptions::default()
        };
        let read = |options| read_source("folder", &src, options);
        let frames = read(&options).expect("it has the layout").frames;
        let pose = frames[0].world_from_camera.expect("it has one");
        let off = pose.translation.vector - Vector3::new(3.0, 4.0, 5.5);
        assert!(off.norm() < 1e-12, "{pose}");
        let ahead = pose * Vector3::z() - Vector3::y();
        assert!(ahead.norm() < 1e-12, "{pose}");

        let out = folder.path().join("out");
        import("folder", &src, &out, &options).expect("it has the layout");
        let words = describe(&out).expect("it was just written").import;
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        assert!(
            words.ends_with(&["--body-from-camera", "robot/camera-on-body.txt"]),
            "{words:?}"
        );

        let whole = format!("{camera}0 0 0 1\n");
        for (written, error) in [
            (whole.as_str(), None),
            ("1 0 0\n0 1 0\n0 0 1\n", Some("9 numbers")),
            ("2 0 0 0\n0 1 0 0\n0 0 1 0\n", Some("rotation")),
        ] {
            std::fs::write(src.join("camera-on-body.txt"), written).expect("it can be written");
            match (read(&options), error) {
                (Ok(again), None) => assert_eq!(again.frames, frames),
                (Err(found), Some(error)) => {
                    assert!(found.file.ends_with("camera-on-body.txt"), "{found}");
                    assert!(found.what.contains(error), "{found}");
                }
                (found, _) => panic!("{written}: {found:?}"),
            }
        }
    }

    #[test]
    fn the_sequence_that_was_found_is_noted() {
        let poses = "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 1 0 1 0 0 0 0 1 0\n";
        let kitti = [
            ("sequences/06/image_0/000000.png", ""),
            ("sequences/06/image_0/000001.png", ""),
            ("sequences/06/calib.txt", "P0: 20 0 12 0 0 20 8 0 0 0 1 0\n"),
            ("poses/06.txt", poses),
        ];
        assert_eq!(noted("kitti", &kitti, ""), ["06"]);
        let pose = |x: u32| format!("1 0 0 {x}\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
        let (first, second) = (pose(0), pose(1));
        for (folder, expected) in [("seq-03/", &["03"][..]), ("", &[])] {
            let files = [
                ("frame-000000.color.png", ""),
                ("frame-000000.pose.txt", &*first),
                ("frame-000001.color.png", ""),
                ("frame-000001.pose.txt", &*second),
            ]
            .map(|(name, text)| (format!("{folder}{name}"), text));
            let files = files.each_ref().map(|(name, text)| (&**name, *text));
            assert_eq!(noted("7scenes", &files, ""), expected);
        }
        let labels = "dataset,scene,image,rotation_matrix,translation_vector\n\
                      fort,wall,a.png,1;0;0;0;1;0;0;0;1,0;0;0\nfort,wall,b.png,1;0;0;0;1;0;0;0;1,2;0;0\n";
        let imc = [
            ("train_labels.csv", labels),
            ("train/fort/a.png", ""),
            ("train/fort/b.png", ""),
        ];
        assert_eq!(noted("imc", &imc, "train_labels.csv"), ["fort/wall"]);
        let shift = "1 0 2\n0 1 0\n0 0 1\n";
        let series = |name| {
            [("1.png", ""), ("2.png", ""), ("H_1_2", shift)]
                .map(|(file, text)| (format!("{name}/{file}"), text))
        };
        let (wall, boat) = (series("v_wall"), series("v_boat"));
        let both: Vec<_> = (wall.iter().chain(&boat))
            .map(|(name, text)| (&**name, *text))
            .collect();
        assert_eq!(noted("hpatches", &both[..3], ""), ["v_wall"]);
        assert_eq!(noted("hpatches", &both, ""), [""; 0], "all of them");
    }
}
