//! COLMAP models as text. `cameras.txt` has lines `id MODEL width height params`. `images.txt` has two lines
//! per image: `id qw qx qy qz tx ty tz camera name`, then `x y point` for each keypoint, with -1 for no point.
//! The second line may be empty but must be there.

use std::path::Path;

use super::{Cameras, Photograph, distinct, lens};
use crate::datasets::DatasetError;
use crate::datasets::importers::list::size;
use crate::datasets::text::{self, TextFile};

/// The longest line of `images.txt`, in bytes. It holds the keypoints of an image, and has room for a million.
const LONGEST_LINE: usize = 32 << 20;

pub(super) fn cameras(path: &Path) -> Result<Cameras, DatasetError> {
    let file = TextFile::read(path)?;
    let mut cameras = Cameras::new();
    for (line, row) in file.rows() {
        let words: Vec<&str> = row.split_whitespace().collect();
        let parsed = match words[..] {
            [id, model, width, height, ref params @ ..] => (id.parse::<u32>())
                .map_err(|_| format!("`{id}` is no number of a camera"))
                .and_then(|id| {
                    let size = size(width, height)?;
                    let params = text::numbers(&params.join(" "))?;
                    Ok((
                        id,
                        lens::camera(model, &params).map(|camera| (camera, size)),
                    ))
                }),
            _ => Err("id, MODEL, width, height and parameters are expected".to_owned()),
        };
        let (id, camera) = parsed.map_err(|what| file.error_at(line, what))?;
        // The message has the line number, which only a text file has.
        let camera = camera.map_err(|unusable| lens::Unusable {
            what: format!("line {line} of cameras.txt: {}", unusable.what),
            ..unusable
        });
        if cameras.insert(id, camera).is_some() {
            return Err(file.error_at(line, format!("the camera {id} stands here a second time")));
        }
    }
    Ok(cameras)
}

pub(super) fn images(path: &Path) -> Result<Vec<Photograph>, DatasetError> {
    let file = TextFile::with_lines_of(path, LONGEST_LINE)?;
    let mut lines = (file.text().lines().enumerate())
        .map(|(index, line)| (index + 1, line.trim()))
        .filter(|(_, line)| !line.starts_with('#'));
    let mut images = Vec::new();
    while let Some((line, row)) = lines.next() {
        if row.is_empty() {
            continue; // before the first image, or after the last
        }
        let image = photograph(row).map_err(|what| file.error_at(line, what))?;
        let (line, row) = lines.next().unwrap_or((line, ""));
        let points = points(row).map_err(|what| file.error_at(line, what))?;
        images.push(Photograph { points, ..image });
    }
    Ok(images)
}

fn photograph(row: &str) -> Result<Photograph, String> {
    let mut words = row.split_whitespace();
    let numbers: Vec<&str> = words.by_ref().take(8).collect();
    let Some(camera) = words.next() else {
        return Err("id, qw qx qy qz, tx ty tz, camera and name are expected".to_owned());
    };
    let [_id, w, x, y, z, tx, ty, tz] = text::exactly(&numbers.join(" "))?;
    let name: Vec<&str> = words.collect();
    if name.is_empty() {
        return Err("the image has no name".to_owned());
    }
    Ok(Photograph {
        name: name.join(" "),
        camera: (camera.parse()).map_err(|_| format!("`{camera}` is no number of a camera"))?,
        camera_from_world: text::quaternion_motion([tx, ty, tz], [x, y, z, w])
            .map_err(|what| format!("{what} (order: qw qx qy qz tx ty tz)"))?,
        points: Vec::new(),
    })
}

fn points(row: &str) -> Result<Vec<u64>, String> {
    let mut words = row.split_whitespace();
    let mut points = Vec::new();
    while words.next().is_some() {
        let (Some(_y), Some(point)) = (words.next(), words.next()) else {
            return Err("keypoints are not written as x y point".to_owned());
        };
        match point.parse::<i64>() {
            Ok(-1) => {}
            Ok(point) if point >= 0 => points.push(point as u64),
            _ => return Err(format!("`{point}` is no number of a point")),
        }
    }
    Ok(distinct(points))
}
