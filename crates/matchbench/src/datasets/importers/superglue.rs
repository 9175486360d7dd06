//! SuperGlue's lists of pairs (Sarlin, DeTone, Malisiewicz, Rabinovich: "SuperGlue: Learning Feature Matching
//! with Graph Neural Networks", CVPR 2020): ScanNet, YFCC100M, and lists of others in the same form.
//!
//! One pair per line, 38 columns: two image names, two turns, K_0 (9), K_1 (9), T_0to1 (16).
//! - Names are relative to the image root (the folder of the list, unless one is given).
//! - A turn is the number of quarter turns counterclockwise that make the stored pixels upright. It was taken
//!   from EXIF data that the images no longer have. K and T in the list belong to the pixels as stored. Here
//!   pixels, K and T are turned, as in SuperGlue's evaluation. K of a turned image needs the size of the image.
//!   If the image does not exist, twice the principal point is used as its size.
//! - `T_0to1` takes points from camera 0 to camera 1: `b_from_a`. ScanNet: metres; YFCC: no unit.
//! - K is taken unchanged, since it is used with pixels counted from the centre of the first one.
//!
//! Rotations are printed with five digits and replaced by the nearest rotation.

use std::path::Path;

use matchbench_vision::geometry::Camera;
use nalgebra::{Isometry3, Translation3};

use super::list::{NamedFrames, camera};
use super::{ImportOptions, Imported, base_name};
use crate::counted::counted;
use crate::datasets::text::{self, TextFile};
use crate::datasets::{DatasetError, Pair, Turn, read_size};

/// Columns of a line.
const COLUMNS: usize = 38;

pub(super) fn read(src: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let file = TextFile::read(src)?;
    let root = options.root(src.parent().unwrap_or(Path::new("")));
    let mut frames = NamedFrames::default();
    let mut pairs = Vec::new();
    let mut assumed = 0;
    for (line, row) in file.rows() {
        let Row {
            names,
            turns,
            cameras,
            pose,
        } = parse(row).map_err(|what| file.error_at(line, what))?;
        let mut number = |of: usize| {
            let image = root.join(names[of]);
            let mut camera = cameras[of];
            if !turns[of].is_none() {
                let (width, height) = if image.is_file() {
                    let size = read_size(&image)?;
                    (size.width as f64, size.height as f64)
                } else {
                    assumed += 1;
                    (2.0 * camera.cx + 1.0, 2.0 * camera.cy + 1.0)
                };
                camera = turns[of].camera(&camera, width, height);
            }
            Ok(frames.number(image, turns[of], camera, None))
        };
        let (a, b) = (number(0)?, number(1)?);
        if a == b {
            return Err(file.error_at(line, "the image is matched with itself"));
        }
        let turned =
            turns.map(|turn| Isometry3::from_parts(Translation3::default(), turn.rotation()));
        let b_from_a = turned[1] * pose * turned[0].inverse();
        pairs.push(Pair::with_pose(
            a,
            b,
            if turns == [Turn::None; 2] {
                pose
            } else {
                b_from_a
            },
        ));
    }
    let origin = format!("SuperGlue list {}", base_name(src));
    let mut imported = Imported::listed(origin, frames.into_frames(), pairs);
    if assumed > 0 {
        imported.about.notes.push(format!(
            "{assumed} times an image that is to be turned is not there: its size was taken as twice \
             the principal point"
        ));
    }
    Ok(imported)
}

struct Row<'a> {
    names: [&'a str; 2],
    turns: [Turn; 2],
    cameras: [Camera; 2],
    pose: Isometry3<f64>,
}

fn parse(row: &str) -> Result<Row<'_>, String> {
    let columns = row.split_whitespace().count();
    if columns != COLUMNS {
        return Err(format!(
            "{} where {COLUMNS} are expected",
            counted(columns, "column")
        ));
    }
    let mut words = row.split_whitespace();
    let mut word = || words.next().expect("the columns were counted");
    let names = [word(), word()];
    let mut turn = || {
        let word = word();
        let quarters: u8 =
            (word.parse()).map_err(|_| format!("`{word}` is no number of quarter turns"))?;
        Turn::try_from(quarters)
    };
    let turns = [turn()?, turn()?];
    let numbers = text::numbers(&words.collect::<Vec<_>>().join(" "))
        .map_err(|what| format!("after the turns, {what}"))?;
    let pose: &[f64; 16] = numbers[18..].try_into().expect("the columns were counted");
    Ok(Row {
        names,
        turns,
        cameras: [camera(&numbers[..9])?, camera(&numbers[9..18])?],
        pose: text::rigid_motion_4x4(pose)?,
    })
}
