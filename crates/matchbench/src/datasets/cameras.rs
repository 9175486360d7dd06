//! Checks whether a camera can belong to its images. The most common mistake is the camera of images of another
//! size.

use std::path::Path;

use matchbench_vision::geometry::Camera;
use matchbench_vision::image::Size;
use nalgebra::Point2;

use super::decode::read_size;
use super::{DatasetError, Problem, Sequence};

/// Largest distance of the principal point from the centre of the image, as a share of width or height. Beyond
/// it, the camera probably belongs to another image.
const CENTRE_TOLERANCE: f64 = 0.15;
/// Focal lengths of real lenses, as multiples of the longer side of the image.
const FOCAL_RANGE: std::ops::RangeInclusive<f64> = 0.2..=20.0;
/// A corner of the image, when its distortion is undone and applied again, may come back this far from where it
/// was, in pixels.
const LENS_TOLERANCE_PX: f64 = 0.1;

/// Most cameras that [`camera_problems`] checks.
const CAMERAS: usize = 100;

/// Most images of which [`camera_problems`] reads the size.
const IMAGES: usize = 10_000;

/// What is wrong with the cameras of an opened dataset in the folder `dir`. Only the first cameras are checked,
/// each with the size of the first image that it took; of the others that it took, the first of another size is noted. This
/// is quick: only the headers of images are read.
/// Images without a valid header are skipped; they are reported when their pixels are read.
pub fn camera_problems(dir: &Path, sequence: &Sequence) -> Vec<Problem> {
    let mut problems = Vec::new();
    let mut judged: Vec<(&Camera, Size, bool)> = Vec::new();
    for frame in sequence.frames.iter().take(IMAGES) {
        let known = (judged.iter()).position(|(camera, ..)| **camera == frame.camera);
        if known.is_none() && judged.len() == CAMERAS {
            continue;
        }
        let Ok(size) = read_size(&frame.image) else {
            continue;
        };
        let size = frame.turn.size(size);
        let Some(known) = known else {
            judged.push((&frame.camera, size, false));
            check_camera(&frame.camera, size, dir, &frame.image, &mut problems);
            continue;
        };
        let (_, other, is_noted) = &mut judged[known];
        if size != *other && !*is_noted {
            problems.push(other_size(&frame.image, size, *other));
            *is_noted = true;
        }
    }
    problems
}

/// An image has another size than the images of the same camera have.
pub(super) fn other_size(image: &Path, size: Size, other: Size) -> Problem {
    DatasetError::new(
        image,
        format!("the image is {size}, others of the same camera are {other}"),
        "give it its own camera in dataset.toml, or bring all to one size",
    )
    .into()
}

/// Notes what is wrong with a camera, given in `file`, for an image of this size.
pub(super) fn check_camera(
    camera: &Camera,
    size: Size,
    file: &Path,
    image: &Path,
    problems: &mut Vec<Problem>,
) {
    let (width, height) = (size.width as f64, size.height as f64);
    let Camera { fx, fy, cx, cy, .. } = *camera;
    let here = format!("the image {} of {size}", image.display());
    if !(0.0..width).contains(&cx) || !(0.0..height).contains(&cy) {
        problems.push(
            DatasetError::new(
                file,
                format!("the principal point {cx} {cy} is outside {here}"),
                "give the camera of images of this size (K scales with the image)",
            )
            .into(),
        );
    } else if (cx / width - 0.5).abs() > CENTRE_TOLERANCE
        || (cy / height - 0.5).abs() > CENTRE_TOLERANCE
    {
        problems.push(Problem::warning(DatasetError::new(
            file,
            format!("the principal point {cx} {cy} is far from the centre of {here}"),
            "check that K belongs to images of this size and not to scaled ones",
        )));
    }
    let longer = width.max(height);
    for (name, focal) in [("fx", fx), ("fy", fy)] {
        if !FOCAL_RANGE.contains(&(focal / longer)) {
            problems.push(Problem::warning(DatasetError::new(
                file,
                format!("the focal length {name} {focal} is implausible for {here}"),
                "check that it is in pixels of this image",
            )));
        }
    }
    let (right, bottom) = (width - 1.0, height - 1.0);
    let border = [(0.0, 0.0), (right, 0.0), (0.0, bottom), (right, bottom)];
    let off = |&(x, y): &(f64, f64)| {
        let pixel = Point2::new(x, y);
        let distance = (camera.project(camera.normalize(pixel)) - pixel).norm();
        distance.is_nan() || distance > LENS_TOLERANCE_PX
    };
    let sound = camera.check().is_ok();
    if let Some((x, y)) = border.iter().find(|pixel| sound && off(pixel)) {
        problems.push(
            DatasetError::new(
                file,
                format!("the lens distortion cannot be undone at the pixel {x} {y} of {here}"),
                "check the coefficients and their order, k1 k2 p1 p2 k3",
            )
            .into(),
        );
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn the_first_image_of_another_size_is_noted_once() {
        let folder = tempfile::tempdir().unwrap();
        let dir = &folder.path().join("wall");
        fs::create_dir_all(dir.join("Images")).unwrap();
        fs::write(dir.join("camera.txt"), "5 0 3.5\n0 5 2.5\n0 0 1").unwrap();
        fs::write(dir.join("pairs.txt"), "0 1 1 0 0 1 0 1 0 0 0 0 1 0\n").unwrap();
        for (name, size) in [("0", [8, 6]), ("1", [8, 6]), ("2", [16, 12]), ("3", [4, 3])] {
            let [width, height] = size;
            let mut image = format!("P5 {width} {height} 255\n").into_bytes();
            image.resize(image.len() + width * height, 7);
            fs::write(dir.join(format!("Images/000{name}.pgm")), image).unwrap();
        }
        let sequence = Sequence::open(dir).unwrap();
        let problems = camera_problems(dir, &sequence);
        let words: Vec<String> = problems.iter().map(ToString::to_string).collect();
        let said = "0002.pgm: the image is 16x12, others of the same camera are 8x6";
        assert!(words.len() == 1 && words[0].contains(said), "{words:?}");
    }
}
