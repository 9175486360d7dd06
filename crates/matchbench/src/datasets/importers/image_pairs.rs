//! Lists of pairs of glue-factory's dataset `image_pairs` (Lindenberger, Sarlin, Pollefeys: "LightGlue: Local Feature
//! Matching at Light Speed", ICCV 2023), as `pairs_calibrated.txt` of its ScanNet-1500 and MegaDepth-1500.
//!
//! One pair per line: two image names, K_0 (9), K_1 (9) and T_0to1, which is R (9) and t (3) or a 4x4 matrix (16). So
//! there are 32 or 36 columns.
//! - Names are relative to the image root (the folder of the list, or `images/` beside it, if the first image is there and
//!   not beside the list; unless one is given).
//! - `T_0to1` takes points from camera 0 to camera 1: `b_from_a`.
//! - glue-factory counts pixels from the corner of the image, so half a pixel is subtracted from principal points.

use std::path::Path;

use matchbench_vision::geometry::Camera;
use nalgebra::Isometry3;

use super::list::{NamedFrames, camera, from_corner};
use super::{ImportOptions, Imported, base_name};
use crate::counted::counted;
use crate::datasets::text::{self, TextFile};
use crate::datasets::{DatasetError, Pair, Turn};
use crate::front_door::PAIRS;

/// The names, and the columns before the pose.
const NAMES: usize = 2;
const BEFORE_POSE: usize = NAMES + 2 * 9;

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
    for (line, row) in file.rows() {
        let Row {
            names,
            cameras,
            b_from_a,
        } = match parse(row) {
            Ok(row) => row,
            Err(Wrong::Line(what)) => return Err(file.error_at(line, what)),
            Err(Wrong::NoTruth(what)) => return Err(file.error(what, as_list()).at(line)),
        };
        let [a, b] =
            [0, 1].map(|of| frames.number(root.join(names[of]), Turn::None, cameras[of], None));
        if a == b {
            return Err(file.error_at(line, "the image is matched with itself"));
        }
        pairs.push(Pair::with_pose(a, b, b_from_a));
    }
    let origin = format!("glue-factory, {}", base_name(src));
    Ok(Imported::listed(origin, frames.into_frames(), pairs))
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
    cameras: [Camera; 2],
    b_from_a: Isometry3<f64>,
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
    if ![32, 36].contains(&words.len()) {
        let found = counted(words.len(), "column");
        let what = format!("{found} where names, K, K and a pose have 32 or 36");
        return Err(what.into());
    }
    let numbers =
        text::numbers(&numbers.join(" ")).map_err(|what| format!("after the names, {what}"))?;
    let camera = |of: usize| camera(&numbers[9 * of..9 * of + 9]).map(from_corner);
    let b_from_a = match &numbers[BEFORE_POSE - NAMES..] {
        pose if pose.len() == 16 => text::rigid_motion_4x4(pose.try_into().expect("16 numbers"))?,
        m => text::rigid_motion(&[
            m[0], m[1], m[2], m[9], m[3], m[4], m[5], m[10], m[6], m[7], m[8], m[11],
        ])?,
    };
    Ok(Row {
        names,
        cameras: [camera(0)?, camera(1)?],
        b_from_a,
    })
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
    fn lists_without_truth_are_told_what_they_are_for() {
        for (line, words) in [
            (
                "a.png b.png",
                "l.txt:1: two names of images alone say nothing of the true pose; import the images",
            ),
            ("a.png", "l.txt:1: two names"),
            ("a.png b.png 1 0 0 0 1 0 0 0 1", "l.txt:1: 11 columns where"),
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
