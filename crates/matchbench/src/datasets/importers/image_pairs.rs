//! Lists of pairs of glue-factory's dataset `image_pairs` (Lindenberger, Sarlin, Pollefeys: "LightGlue: Local Feature
//! Matching at Light Speed", ICCV 2023), as `pairs_calibrated.txt` of its ScanNet-1500 and MegaDepth-1500.
//!
//! One pair per line: two image names and the truth. Of scenes that is K_0 (9), K_1 (9) and T_0to1, which is R (9) and t
//! (3) or a 4x4 matrix (16), of planes H_0to1 (9). So there are 32, 36 or 11 columns.
//! - Names are relative to the image root (the folder of the list, or `images/` beside it, if the first image is there and
//!   not beside the list; unless one is given).
//! - `T_0to1` takes points from camera 0 to camera 1: `b_from_a`.
//! - glue-factory counts pixels from the corner of the image, so half a pixel is subtracted from principal points.
//! - `H_0to1` takes pixels of image 0 to those of image 1. glue-factory uses the numbers of other datasets, such as HPatches,
//!   as they are, so nothing is subtracted: pixels count from the centre of the first one.

use std::path::{Path, PathBuf};

use matchbench_vision::geometry::Camera;
use nalgebra::{Isometry3, Matrix3};

use super::list::{self, NamedFrames, camera, from_corner};
use super::{ImportOptions, Imported, base_name};
use crate::counted::counted;
use crate::datasets::text::{self, TextFile};
use crate::datasets::{DatasetError, Pair, Turn, read_size};
use crate::front_door::PAIRS;

const NAMES: usize = 2;
/// The numbers before the pose, of two calibration matrices.
const BEFORE_POSE: usize = 2 * 9;

pub(super) fn read(src: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let file = TextFile::read(src)?;
    let folder = src.parent().unwrap_or(Path::new(""));
    let images = folder.join("images");
    let first = file
        .rows()
        .next()
        .and_then(|(_, row)| row.split_whitespace().next());
    let is_inside =
        first.is_some_and(|name| images.join(name).is_file() && !folder.join(name).is_file());
    let root = options.root(if is_inside { &images } else { folder });
    let mut frames = NamedFrames::default();
    let mut pairs = Vec::new();
    let mut has_stand_ins = false;
    for (line, row) in file.rows() {
        let Row { names, truth } = match parse(row) {
            Ok(row) => row,
            Err(Wrong::Line(what)) => return Err(file.error_at(line, what)),
            Err(Wrong::NoTruth(what)) => return Err(file.error(what, as_list()).at(line)),
        };
        let images = names.map(|name| root.join(name));
        let cameras = match &truth {
            Truth::Pose { cameras, .. } => *cameras,
            Truth::Homography(_) => {
                has_stand_ins = true;
                let [a, b] = &images;
                [list::stand_in(read_size(a)?), list::stand_in(read_size(b)?)]
            }
        };
        let [a, b] = [0, 1].map(|of| {
            let image: &PathBuf = &images[of];
            frames.number(image.clone(), Turn::None, cameras[of], None)
        });
        if a == b {
            return Err(file.error_at(line, "the image is matched with itself"));
        }
        pairs.push(match truth {
            Truth::Pose { b_from_a, .. } => Pair::with_pose(a, b, b_from_a),
            Truth::Homography(b_from_a) => Pair::with_homography(a, b, b_from_a),
        });
    }
    let origin = format!("glue-factory, {}", base_name(src));
    let mut imported = Imported::listed(origin, frames.into_frames(), pairs);
    if has_stand_ins {
        imported.about.notes.push(list::stand_in_of_planes());
    }
    Ok(imported)
}

/// What to do with a list that has names alone.
fn as_list() -> String {
    let given = PAIRS.with("list:FILE");
    format!(
        "import the images with their poses (kind colmap, folder ...) and give this list as {given}"
    )
}

struct Row<'a> {
    names: [&'a str; 2],
    truth: Truth,
}

enum Truth {
    Pose {
        cameras: [Camera; 2],
        b_from_a: Isometry3<f64>,
    },
    Homography(Matrix3<f64>),
}

enum Wrong {
    Line(String),
    NoTruth(String),
}

impl From<String> for Wrong {
    fn from(what: String) -> Self {
        Self::Line(what)
    }
}

fn parse(row: &str) -> Result<Row<'_>, Wrong> {
    let words: Vec<&str> = row.split_whitespace().collect();
    let (names, numbers) = match words.split_at_checked(NAMES) {
        Some((&[a, b], numbers)) => ([a, b], numbers),
        _ => return Err("two names of images are expected".to_owned().into()),
    };
    if numbers.is_empty() {
        let what = "two names of images alone say nothing of the true pose";
        return Err(Wrong::NoTruth(what.to_owned()));
    }
    if ![11, 32, 36].contains(&words.len()) {
        let found = counted(words.len(), "column");
        let what =
            format!("{found} where names, K, K and a pose have 32 or 36, names and H have 11");
        return Err(what.into());
    }
    let numbers =
        text::numbers(&numbers.join(" ")).map_err(|what| format!("after the names, {what}"))?;
    let Some(pose) = numbers.get(BEFORE_POSE..) else {
        let truth = Truth::Homography(text::homography(&numbers)?);
        return Ok(Row { names, truth });
    };
    let camera = |of: usize| camera(&numbers[9 * of..9 * of + 9]).map(from_corner);
    let b_from_a = match pose {
        pose if pose.len() == 16 => text::rigid_motion_4x4(pose.try_into().expect("16 numbers"))?,
        m => text::rigid_motion(&[
            m[0], m[1], m[2], m[9], m[3], m[4], m[5], m[10], m[6], m[7], m[8], m[11],
        ])?,
    };
    let cameras = [camera(0)?, camera(1)?];
    let truth = Truth::Pose { cameras, b_from_a };
    Ok(Row { names, truth })
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::super::read_source;
    use super::super::tests::source;
    use super::*;

    const K: &str = "20 0 12 0 20 8.5 0 0 1";

    #[test]
    fn poses_of_both_forms_are_read() {
        let turned = "0 -1 0 1 0 0 0 0 1 1 2 3";
        let matrix = "0 -1 0 1 1 0 0 2 0 0 1 3 0 0 0 1";
        let list = format!("a.png b.png {K} {K} {turned}\nb.png c.png {K} {K} {matrix}\n");
        let files = [("images/a.png", ""), ("pairs_calibrated.txt", &*list)];
        let (_folder, src) = source("pairs", &files);
        let file = src.join("pairs_calibrated.txt");
        let found = read_source("image-pairs", &file, &ImportOptions::default()).unwrap();
        let images: Vec<_> = found
            .frames
            .iter()
            .map(|frame| frame.image.clone())
            .collect();
        let expected = ["a.png", "b.png", "c.png"].map(|name| src.join("images").join(name));
        assert_eq!(images, expected);
        assert_eq!(
            found.frames[0].camera,
            Camera::pinhole(20.0, 20.0, 11.5, 8.0)
        );
        let pairs = found.pairs.unwrap();
        assert_eq!((pairs[1].a, pairs[1].b), (1, 2));
        for pair in pairs {
            let seen = pair.pose().unwrap() * Point3::new(5.0, 7.0, 1.0);
            assert!(
                (seen - Point3::new(-6.0, 7.0, 4.0)).norm() < 1e-12,
                "{seen}"
            );
        }
    }

    #[test]
    fn homographies_are_taken_as_they_are() {
        let white = "P5 4 3 255\n............";
        let list = "a.pgm b.pgm 2 0 5 0 2 7 0 0 1\na.pgm c.pgm 1 0 0 0 1 0 0 0 1\n";
        let files = [
            ("a.pgm", white),
            ("b.pgm", white),
            ("c.pgm", white),
            ("l.txt", list),
        ];
        let (_folder, src) = source("pairs", &files);
        let file = src.join("l.txt");
        let found = read_source("image-pairs", &file, &ImportOptions::default()).unwrap();
        assert_eq!(found.frames[0].camera, Camera::pinhole(4.8, 4.8, 1.5, 1.0));
        assert_eq!(found.about.notes.len(), 1);
        let pairs = found.pairs.unwrap();
        let places: Vec<_> = pairs.iter().map(|pair| (pair.a, pair.b)).collect();
        assert_eq!(places, [(0, 1), (0, 2)]);
        assert!(pairs[0].pose().is_none());
        let expected = Matrix3::new(2.0, 0.0, 5.0, 0.0, 2.0, 7.0, 0.0, 0.0, 1.0);
        assert_eq!(pairs[0].homography(), Some(&expected));
    }

    #[test]
    fn lists_without_truth_are_told_what_they_are_for() {
        for (line, words) in [
            (
                "a.png b.png",
                "l.txt:1: two names of images alone say nothing of the true pose; import the images",
            ),
            ("a.png", "l.txt:1: two names"),
            ("a.png b.png 1 0 0 0 1 0 0 0", "l.txt:1: 10 columns where"),
            (
                "a.png b.png 1 0 0 0 1 0 0 0 0",
                "l.txt:1: the homography is singular",
            ),
            ("a.png b.png 1 0 0 0 1 0 0 0 1", "a.png: "),
            (
                &format!("a.png b.png {K} {K} 1 0 0 0 1 0 0 0 x 0 0 0"),
                "after the names, column 27",
            ),
            (
                &format!("a.png a.png {K} {K} 1 0 0 0 1 0 0 0 1 0 0 1"),
                "matched with itself",
            ),
            (
                &format!("a.png b.png {K} {K} 2 0 0 0 1 0 0 0 1 0 0 1"),
                "not a rotation",
            ),
        ] {
            let (_folder, src) = source("pairs", &[("l.txt", line)]);
            let file = src.join("l.txt");
            let error = read_source("image-pairs", &file, &ImportOptions::default()).unwrap_err();
            assert!(error.to_string().contains(words), "{error}");
        }
    }
}
