//! The format of the authors of the benchmark, read as they published it.
//!
//! ```text
//! NAME/camera.txt       3x3 calibration matrix
//! NAME/pairs.txt        a b r11 r12 r13 t1 r21 ... t3: b_from_a, x_b = R x_a + t
//! NAME/homographies.txt a b h11 h12 h13 h21 ... h33: takes pixels of a to b; may be absent, and
//!                       where it is there, pairs.txt may be absent; a pair may stand in both
//! NAME/Images/0000.png  frame 0 (%04d, any decodable format), 0001.png ...
//! NAME/Images/pose.txt  one row of 12 numbers per frame: [R t], camera-to-world; may be absent
//! NAME/dataset.toml     ours, for what these files cannot say; may be absent
//! ```
//!
//! One reader serves two functions. It continues after an error and notes it. [`Sequence::open`] then returns
//! the first error, and `validate` reports all. The lists of pairs may be larger than memory, see `listed`.

use std::fs;
use std::path::{Path, PathBuf};

use matchbench_vision::geometry::{Camera, Distortion, Lens};
use nalgebra::{Isometry3, Matrix3};

use super::fingerprint::Fingerprint;
use super::images::{IMAGES, frame_images, missing_depth};
use super::listed::{
    Listed, each_pair, has_one_twice, is_there, listed, parse_homography, parse_pose,
};
use super::manifest::{self, Manifest};
use super::problem::first_error;
use super::text::{self, TextFile};
use super::{DatasetError, Frame, Pair, Problem, Sequence, Whole};
use crate::counted::counted;
use crate::files::check_name;

pub(super) const POSES: &str = "pose.txt";
pub(super) const CAMERA: &str = "camera.txt";
pub(super) const PAIRS: &str = "pairs.txt";
pub(super) const HOMOGRAPHIES: &str = "homographies.txt";

impl Sequence {
    /// Opens the dataset in the folder `dir`. Images are not read; `validate` does that.
    ///
    /// # Errors
    /// The first problem with its text files, or an image that does not exist.
    pub fn open(dir: &Path) -> Result<Self, DatasetError> {
        let unpaired = Unpaired::open(dir)?;
        let mut pairs = Vec::new();
        unpaired.each_pair(|pair| pairs.push(pair))?;
        if has_one_twice(&pairs) {
            // The code that notes all problems also knows their lines.
            let mut problems = Vec::new();
            Contents::read(dir, &mut problems);
            first_error(problems)?;
        }
        Ok(unpaired.with(pairs))
    }

    /// Opens the dataset in the folder `dir`, if it is there and the one with this [`fingerprint`](Self::fingerprint): what a
    /// run had may be gone, or another by now.
    pub fn open_same(dir: &Path, fingerprint: &str) -> Option<Self> {
        let sequence = Self::open(dir).ok()?;
        (sequence.fingerprint() == fingerprint).then_some(sequence)
    }
}

/// A dataset whose pairs are still in their files, for use if only a few of millions of pairs are needed.
#[derive(Clone, Debug)]
pub struct Unpaired {
    dir: PathBuf,
    name: String,
    frames: Vec<Frame>,
}

impl Unpaired {
    /// Opens the dataset in the folder `dir` as [`Sequence::open`] does, but without its pairs.
    ///
    /// # Errors
    /// The first problem with what is read, or an image that does not exist.
    pub fn open(dir: &Path) -> Result<Self, DatasetError> {
        let mut problems = Vec::new();
        let contents = Contents::without_pairs(dir, &mut problems);
        first_error(problems)?;
        let cameras = contents.cameras();
        let frames = (contents.images.into_iter().zip(cameras).enumerate())
            .map(|(index, (image, camera))| Frame {
                image,
                name: contents.manifest.name_of(index),
                turn: contents.manifest.turn(index),
                camera: camera.expect("a frame without a camera is an error"),
                world_from_camera: contents.poses.get(index).map(|&(_, pose)| pose),
                depth: contents.manifest.depth(dir, index),
            })
            .collect();
        Ok(Self {
            dir: dir.into(),
            name: contents.name,
            frames,
        })
    }

    /// Its folder.
    pub fn folder(&self) -> &Path {
        &self.dir
    }

    /// The name of the dataset.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its frames.
    pub(crate) fn into_frames(self) -> Vec<Frame> {
        self.frames
    }

    /// The dataset with only the pairs for which `keep` is true, in their order, and the number and fingerprint
    /// of all pairs. It is not checked that no pair is listed twice; the fingerprint of such a list equals that
    /// of no valid dataset.
    ///
    /// # Errors
    /// The first problem with the lists of pairs.
    pub fn part(
        self,
        mut keep: impl FnMut(&Pair) -> bool,
    ) -> Result<(Sequence, Whole), DatasetError> {
        let mut fingerprint = Fingerprint::of(&self.frames);
        let (mut count, mut pairs) = (0, Vec::new());
        self.each_pair(|pair| {
            fingerprint.add(&pair);
            count += 1;
            if keep(&pair) {
                pairs.push(pair);
            }
        })?;
        let whole = Whole {
            pairs: count,
            fingerprint: fingerprint.text(&self.frames),
        };
        Ok((self.with(pairs), whole))
    }

    /// Passes on the pairs, in the order of [`Sequence::pairs`].
    fn each_pair(&self, see: impl FnMut(Pair)) -> Result<(), DatasetError> {
        each_pair(
            &self.dir.join(PAIRS),
            &self.dir.join(HOMOGRAPHIES),
            self.frames.len(),
            see,
        )
    }

    fn with(self, pairs: Vec<Pair>) -> Sequence {
        Sequence {
            name: self.name,
            frames: self.frames,
            pairs,
        }
    }
}

/// All that the text files of a dataset contain, each item with its line.
#[derive(Debug, Default)]
pub(super) struct Contents {
    pub(super) name: String,
    pub(super) manifest: Manifest,
    /// K of `camera.txt` with the distortion of the manifest.
    pub(super) camera: Option<Camera>,
    pub(super) images: Vec<PathBuf>,
    pub(super) poses: Vec<(usize, Isometry3<f64>)>,
    /// What `pairs.txt` lists.
    pub(super) posed: Vec<Listed<Isometry3<f64>>>,
    /// What `homographies.txt` lists.
    pub(super) mapped: Vec<Listed<Matrix3<f64>>>,
}

impl Contents {
    pub(super) fn read(dir: &Path, problems: &mut Vec<Problem>) -> Self {
        let mut contents = Self::without_pairs(dir, problems);
        if !dir.is_dir() || something_else(dir).is_some() {
            return contents;
        }
        // Without images every row would be out of range, so only that error is reported.
        let count = (!contents.images.is_empty()).then_some(contents.images.len());
        let (pairs, homographies) = (dir.join(PAIRS), dir.join(HOMOGRAPHIES));
        if is_there(&pairs) || !is_there(&homographies) {
            contents.posed = listed(&pairs, count, parse_pose, problems);
        }
        if is_there(&homographies) {
            contents.mapped = listed(&homographies, count, parse_homography, problems);
        }
        contents
    }

    fn without_pairs(dir: &Path, problems: &mut Vec<Problem>) -> Self {
        if !dir.is_dir() {
            problems.push(
                DatasetError::new(dir, "no such folder", "give the folder of a dataset").into(),
            );
            return Self::default();
        }
        if let Some(error) = something_else(dir) {
            problems.push(error.into());
            return Self::default();
        }
        let mut note = |error: DatasetError| problems.push(error.into());
        let manifest = optional(&dir.join(manifest::FILE))
            .unwrap_or_else(|error| {
                note(error);
                None
            })
            .and_then(|file| {
                let (manifest, errors) = Manifest::parse_all(&file);
                errors.into_iter().for_each(&mut note);
                manifest
            })
            .unwrap_or_default();
        if std::path::absolute(dir).is_ok_and(|path| path.to_str().is_none()) {
            note(DatasetError::new(
                dir,
                "the path is not UTF-8, so no run can name it",
                "rename the folder",
            ));
        }
        let name = manifest.name.clone().unwrap_or_else(|| folder_name(dir));
        let all_have_cameras =
            !manifest.frames.is_empty() && manifest.frames.iter().all(|f| f.camera.is_some());
        let camera_file = dir.join(CAMERA);
        let camera = if all_have_cameras && !is_there(&camera_file) {
            None
        } else {
            TextFile::read(&camera_file)
                .and_then(|file| parse_camera(&file))
                .map_err(&mut note)
                .ok()
        };
        let camera = camera.map(|pinhole| Camera {
            distortion: manifest.distortion.or(pinhole.distortion),
            ..pinhole
        });

        if let Err(wrong) = check_name(&name) {
            let what = format!("the dataset's name, `{}`, {wrong}", text::brief(&name));
            let remedy = "rename the folder, or give `name` in dataset.toml";
            problems.push(DatasetError::new(dir, what, remedy).into());
        }
        let wrong = check_manifest(dir, &manifest, camera.as_ref());
        problems.extend(wrong.into_iter().map(Problem::from));
        let images = frame_images(dir, &manifest, problems);
        problems.extend(missing_depth(dir, &manifest));
        let poses_file = dir.join(IMAGES).join(POSES);
        let poses = match optional(&poses_file) {
            Ok(Some(file)) => parse_poses(&file, images.len(), problems),
            Ok(None) => Vec::new(),
            Err(error) => {
                problems.push(error.into());
                Vec::new()
            }
        };
        Self {
            name,
            manifest,
            camera,
            images,
            poses,
            posed: Vec::new(),
            mapped: Vec::new(),
        }
    }

    /// The camera of every frame; `None` if neither the manifest nor `camera.txt` has one.
    pub(super) fn cameras(&self) -> Vec<Option<Camera>> {
        (0..self.images.len())
            .map(|index| {
                let own = self.manifest.frames.get(index).and_then(|f| f.camera);
                own.or(self.camera)
            })
            .collect()
    }
}

/// Why a folder is no dataset at all: nothing in it is that of one. Whoever has the original data has not imported them.
fn something_else(dir: &Path) -> Option<DatasetError> {
    let parts = [manifest::FILE, CAMERA, PAIRS, HOMOGRAPHIES, IMAGES];
    if parts.iter().any(|part| is_there(&dir.join(part))) {
        return None;
    }
    let remedy = if is_there(&dir.join("plan.json")) {
        "it looks like the folder of a run; name the dataset that was run"
    } else {
        "make a dataset of it with `matchbench import`"
    };
    let what = format!(
        "this is no dataset: it has neither {} nor {PAIRS}",
        manifest::FILE
    );
    Some(DatasetError::new(dir, what, remedy))
}

/// The last part of the folder's path, also for `.` and `..`.
fn folder_name(dir: &Path) -> String {
    let real = fs::canonicalize(dir).unwrap_or_else(|_| dir.to_owned());
    real.file_name()
        .map_or_else(|| "dataset".into(), |name| name.to_string_lossy().into())
}

fn optional(path: &Path) -> Result<Option<TextFile>, DatasetError> {
    if is_there(path) {
        TextFile::read(path).map(Some)
    } else {
        Ok(None)
    }
}

/// A calibration matrix, optionally followed by the distortion `k1 k2 p1 p2 [k3]`.
pub(super) fn parse_camera(file: &TextFile) -> Result<Camera, DatasetError> {
    let numbers = file.numbers()?;
    let (k, lens) = match numbers.len() {
        9 | 13 | 14 => numbers.split_at(9),
        found => {
            return Err(file.error(
                format!(
                    "{} where the 9 of a calibration matrix are expected",
                    counted(found, "number")
                ),
                "write fx 0 cx, 0 fy cy and 0 0 1 in three lines",
            ));
        }
    };
    let camera = Camera::from_matrix(&Matrix3::from_row_slice(k))
        .map_err(|error| file.error(error.to_string(), "write fx 0 cx, 0 fy cy, 0 0 1"))?;
    let distortion = (!lens.is_empty()).then(|| {
        Lens::Brown(Distortion {
            k1: lens[0],
            k2: lens[1],
            p1: lens[2],
            p2: lens[3],
            k3: lens.get(4).copied().unwrap_or(0.0),
        })
    });
    let camera = Camera {
        distortion,
        ..camera
    };
    match camera.check() {
        Ok(()) => Ok(camera),
        Err(error) => Err(file.error(error.to_string(), "write k1 k2 p1 p2 k3 after K")),
    }
}

/// What is wrong with the cameras of the manifest and with its unit of depth, each problem once.
fn check_manifest(dir: &Path, manifest: &Manifest, camera: Option<&Camera>) -> Vec<DatasetError> {
    let frames = manifest.frames.iter().enumerate();
    let own = frames.filter_map(|(index, frame)| Some((format!("frame {index}: "), frame.camera?)));
    let shared = camera.filter(|_| manifest.distortion.is_some()).copied();
    let shared = shared.map(|camera| (String::new(), camera));
    let mut wrong: Vec<(String, String)> = (shared.into_iter().chain(own))
        .filter_map(|(whose, camera)| Some((whose, camera.check().err()?.to_string())))
        .collect();
    wrong.dedup_by(|(_, next), (_, before)| next == before);
    let wrong = wrong.into_iter().map(|(whose, what)| whose + &what);
    let mut wrong: Vec<String> = wrong.collect();
    let is_used =
        manifest.frames.is_empty() || (manifest.frames.iter()).any(|f| f.camera.is_none());
    if manifest.distortion.is_some() && !is_used {
        wrong.push(
            "`distortion` is that of the camera in camera.txt, which no frame has; give each camera its own".to_owned(),
        );
    }
    match manifest.depth {
        Some(unit) => wrong.extend(unit.check().err()),
        None if manifest.frames.iter().any(|frame| frame.depth.is_some()) => wrong.push(
            "frames have depth, and nothing says how it is stored: depth = { per_unit = 1000 } is for millimetres"
                .to_owned(),
        ),
        None => {}
    }
    let error = |what| DatasetError::new(dir.join(manifest::FILE), what, "correct this number");
    wrong.into_iter().map(error).collect()
}

fn parse_poses(
    file: &TextFile,
    frames: usize,
    problems: &mut Vec<Problem>,
) -> Vec<(usize, Isometry3<f64>)> {
    let rows: Vec<_> = file.rows().collect();
    if rows.len() != frames {
        problems.push(
            file.error(
                format!(
                    "{} for {}",
                    counted(rows.len(), "pose"),
                    counted(frames, "image")
                ),
                "give one row per image, in the images' order",
            )
            .into(),
        );
    }
    rows.into_iter()
        .map(|(line, row)| {
            let pose = text::exactly(row).and_then(|numbers| text::rigid_motion(&numbers));
            let pose = pose.unwrap_or_else(|what| {
                problems.push(file.error_at(line, what).into());
                Isometry3::identity()
            });
            (line, pose)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::{describe, testing};
    use super::super::{read_dataset_pairs, read_pairs};
    use super::*;

    #[test]
    fn pairs_for_scoring_come_from_both_lists_and_none_twice() {
        let (_folder, dir) = testing::dataset();
        let pairs = read_dataset_pairs(&dir).unwrap();
        let (poses, homographies) = (dir.join(PAIRS), dir.join(HOMOGRAPHIES));
        fs::write(&homographies, "0 1 1 0 5 0 1 -3 0 0 1\n").unwrap();
        let both = read_dataset_pairs(&dir).unwrap();
        assert_eq!(both.len(), pairs.len());
        assert!(
            both.iter()
                .any(|pair| pair.pose().and(pair.homography()).is_some())
        );
        let text = fs::read_to_string(&poses).unwrap();
        let first = text.lines().next().unwrap();
        fs::write(&poses, format!("{text}{first}\n")).unwrap();
        let error = read_dataset_pairs(&dir).unwrap_err();
        assert_eq!(error.line, Some(text.lines().count() + 1), "{error}");
        fs::remove_file(&poses).unwrap();
        assert_eq!(read_dataset_pairs(&dir).unwrap().len(), 1);
    }

    #[test]
    fn a_published_folder_is_read_with_all_its_irregularities() {
        let folder = tempfile::tempdir().unwrap();
        let dir = folder.path().join("09-mine");
        let file = |name: &str, text: &str| fs::write(dir.join(name), text).unwrap();
        fs::create_dir_all(dir.join("Images")).unwrap();
        file("camera.txt", "535.4 0 320.1 \r\n0   539.2 247.6 \r\n0 0 1");
        file("Images/0000.png", "");
        file("Images/0001.JPG", "");
        file(
            "Images/pose.txt",
            "\u{feff}1 0 0 0 0 1 0 0 0 0 1 0 \r\n\r\n0.999999 0 0 2 0 1 0 0 0 0 1 0",
        );
        file("pairs.txt", "0   1 1 0 0 -2 0 1 0 0 0 0 1 0  \n\n");
        let sequence = Sequence::open(&dir).unwrap();
        assert_eq!(sequence.name, "09-mine");
        assert_eq!(sequence.frames.len(), 2);
        assert_eq!(sequence.frames[1].image, dir.join("Images/0001.JPG"));
        assert_eq!(
            sequence.frames[0].camera,
            Camera::pinhole(535.4, 539.2, 320.1, 247.6)
        );
        let pose = sequence.frames[1].world_from_camera.unwrap();
        assert_eq!(pose, Isometry3::translation(2.0, 0.0, 0.0));
        assert_eq!((sequence.pairs[0].a, sequence.pairs[0].b), (0, 1));
        assert_eq!(sequence.pairs[0].pose(), Some(&pose.inverse()));
        assert_eq!(read_pairs(&dir.join("pairs.txt")).unwrap(), sequence.pairs);
        assert_eq!(read_dataset_pairs(&dir).unwrap(), sequence.pairs);
    }

    #[test]
    fn poses_may_be_absent_but_images_may_not() {
        let (_folder, dir) = testing::dataset();
        fs::remove_file(dir.join("Images/pose.txt")).unwrap();
        let sequence = Sequence::open(&dir).unwrap();
        assert!(
            sequence
                .frames
                .iter()
                .all(|f| f.world_from_camera.is_none())
        );
        fs::remove_file(dir.join("Images/0002.png")).unwrap();
        let error = Sequence::open(&dir).unwrap_err().to_string();
        assert!(error.contains("0002, is missing"), "{error}");
        let error = Sequence::open(&dir.join("nowhere")).unwrap_err();
        assert_eq!(error.what, "no such folder");
    }

    #[test]
    fn the_manifest_renames_redirects_and_bends() {
        let (_folder, dir) = testing::dataset();
        fs::rename(dir.join("Images/0003.png"), dir.join("last.png")).unwrap();
        let manifest = "version = 1\nname = \"other\"\nproperty = \"indoor\"\n\
            distortion = { k1 = 0.1, k2 = 0, p1 = 0, p2 = 0, k3 = 0 }\n\
            [[frames]]\nimage = \"Images/0000.png\"\n[[frames]]\nimage = \"Images/0001.png\"\n\
            [[frames]]\nimage = \"Images/0002.png\"\n[[frames]]\nimage = \"last.png\"\n\
            camera = { fx = 1, fy = 1, cx = 2, cy = 3 }\n";
        fs::write(dir.join("dataset.toml"), manifest).unwrap();
        let sequence = Sequence::open(&dir).unwrap();
        assert_eq!(sequence.name, "other");
        let about = describe(&dir).unwrap();
        assert_eq!((&*about.origin, &*about.property), ("", "indoor"));
        assert_eq!(sequence.frames[3].image, dir.join("last.png"));
        assert_eq!(
            sequence.frames[3].camera,
            Camera::pinhole(1.0, 1.0, 2.0, 3.0)
        );
        assert_eq!(
            sequence.frames[0]
                .camera
                .distortion
                .unwrap()
                .brown()
                .unwrap()
                .k1,
            0.1
        );
        let own = "image = \"$1\"\ncamera = { fx = 1, fy = 1, cx = 2, cy = 3 }\n";
        let manifest = [
            "Images/0000.png",
            "Images/0001.png",
            "Images/0002.png",
            "last.png",
        ]
        .map(|image| format!("[[frames]]\n{}", own.replace("$1", image)));
        let lens = "version = 1\ndistortion = { k1 = 0.1, k2 = 0, p1 = 0, p2 = 0, k3 = 0 }\n";
        fs::write(
            dir.join("dataset.toml"),
            lens.to_owned() + &manifest.concat(),
        )
        .unwrap();
        let error = Sequence::open(&dir).unwrap_err().to_string();
        assert!(error.contains("which no frame has"), "{error}");
    }

    #[test]
    fn homographies_stand_beside_or_instead_of_poses() {
        let (_folder, dir) = testing::dataset();
        let rows = "0 1 1 0 5 0 1 -3 0 0 1\n3 0 2 0 0 0 2 0 1e-5 0 2\n";
        fs::write(dir.join("homographies.txt"), rows).unwrap();
        let pairs = Sequence::open(&dir).unwrap().pairs;
        assert_eq!(pairs.len(), 7);
        assert!(pairs[0].pose().is_some());
        assert_eq!(pairs[0].homography().unwrap()[(1, 2)], -3.0);
        assert!(pairs[1].pose().is_some() && pairs[1].homography().is_none());
        assert_eq!((pairs[6].a, pairs[6].b, pairs[6].pose()), (3, 0, None));
        fs::remove_file(dir.join("pairs.txt")).unwrap();
        assert_eq!(Sequence::open(&dir).unwrap().pairs.len(), 2);
        let singular = "0 1 1 0 0 0 1 0 0 0 1\n0 2 1 2 3 1 2 3 0 0 1\n";
        fs::write(dir.join("homographies.txt"), singular).unwrap();
        let error = Sequence::open(&dir).unwrap_err().to_string();
        assert!(
            error.contains("homographies.txt:2: the homography"),
            "{error}"
        );
    }

    #[test]
    fn a_camera_file_may_carry_distortion() {
        let parse = |text: &str| parse_camera(&TextFile::new(Path::new("K.txt"), text));
        let k = "5 0 2\n0 5 2\n0 0 1\n";
        assert_eq!(parse(k), Ok(Camera::pinhole(5.0, 5.0, 2.0, 2.0)));
        let lens = parse(&format!("{k}0.1 0.2 0.3 0.4"))
            .unwrap()
            .distortion
            .unwrap()
            .brown()
            .unwrap();
        assert_eq!((lens.k1, lens.p2, lens.k3), (0.1, 0.4, 0.0));
        assert!(parse("5 0 2 0 5 2").unwrap_err().what.contains("6 numbers"));
        assert!(
            parse("5 1 2 0 5 2 0 0 1")
                .unwrap_err()
                .what
                .contains("skew")
        );
        assert_eq!(parse("5 0 2\n0 x 2\n0 0 1").unwrap_err().line, Some(2));
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "([-0-9.e]{1,4}[ \n]){0,40}|.{0,60}") {
            let file = TextFile::new(Path::new("t"), &text);
            let mut problems = Vec::new();
            let _ = parse_camera(&file);
            parse_poses(&file, 2, &mut problems);
        }
    }
}
