//! Checks whether a camera can belong to its images. The most common mistake is the camera of images of another
//! size.

use std::path::Path;

use matchbench_vision::geometry::{Camera, Lens};
use matchbench_vision::image::Size;
use nalgebra::Point2;

use super::decode::read_size;
use super::{DatasetError, Problem, Sequence};

/// Largest distance of the principal point from the centre of the image, as a share of width or height. Beyond
/// it, the camera probably belongs to another image.
const CENTRE_TOLERANCE: f64 = 0.15;
/// Both coordinates of the principal point, counted from the corner in halves of width and height, are this near to
/// each other where a camera was scaled, as a share of the larger ...
const SCALED_ALIKE: f64 = 0.06;
/// ... and this far from 1 in the mean. Of real cameras both are rarely off the centre to the same side: DTU's by 3 %.
const SCALED_BY: f64 = 0.1;
/// A focal length below this multiple of the longer side is not in pixels: the image would cover 168 degrees.
const NOT_IN_PIXELS: f64 = 0.05;
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
    let longer = width.max(height);
    if fx.max(fy) < NOT_IN_PIXELS * longer {
        let what = format!("the focal length {fx} {fy} is not in pixels, for {here}");
        problems.push(DatasetError::new(file, what, in_pixels(camera, size)).into());
        return;
    }
    let other = other_images(camera, size);
    if !(0.0..width).contains(&cx) || !(0.0..height).contains(&cy) {
        let made = other.map_or_else(String::new, |other| {
            format!(", as of images of about {other}")
        });
        problems.push(
            DatasetError::new(
                file,
                format!("the principal point {cx} {cy} is outside {here}{made}"),
                "give the camera of images of this size (K scales with the image)",
            )
            .into(),
        );
    } else if let Some(other) = other {
        problems.push(Problem::warning(DatasetError::new(
            file,
            format!(
                "K looks as if made for images of about {other}: its principal point {cx} {cy} is far from the centre \
                 of {here}"
            ),
            "K scales with the image: give that of images of this size",
        )));
    } else if (cx / width - 0.5).abs() > CENTRE_TOLERANCE
        || (cy / height - 0.5).abs() > CENTRE_TOLERANCE
    {
        problems.push(Problem::warning(DatasetError::new(
            file,
            format!("the principal point {cx} {cy} is far from the centre of {here}"),
            "check that K belongs to images of this size and not to scaled or cropped ones",
        )));
    }
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
                remedy_of_lens(camera),
            )
            .into(),
        );
    }
}

/// What to do about a lens that cannot be undone.
fn remedy_of_lens(camera: &Camera) -> &'static str {
    match camera.distortion {
        Some(Lens::Fisheye(_)) => {
            "check the coefficients, k1 k2 k3 k4; what lies 90 degrees and more from the axis has no point at depth 1, so \
             undistort such images first"
        }
        _ => "check the coefficients and their order, k1 k2 p1 p2 k3",
    }
}

/// How a focal length comes to be in pixels.
fn in_pixels(camera: &Camera, size: Size) -> String {
    let Size { width, height } = size;
    if camera.cx <= 1.0 && camera.cy <= 1.0 {
        return format!(
            "K is in shares of the image: multiply its first row by the width {width} and its second by the height \
             {height}"
        );
    }
    format!("if it is in millimetres, multiply it by {width} and divide by the width of the sensor")
}

/// The size of the images that the camera seems to be made for, if it is another than `size`: its principal point is
/// off the centre by one factor in both directions.
fn other_images(camera: &Camera, size: Size) -> Option<Size> {
    let (width, height) = (size.width as f64, size.height as f64);
    // Pixel centres are at integers.
    let (across, down) = (
        (2.0 * camera.cx + 1.0) / width,
        (2.0 * camera.cy + 1.0) / height,
    );
    let scale = across.midpoint(down);
    let alike = (across - down).abs() <= SCALED_ALIKE * across.max(down);
    (alike && (scale - 1.0).abs() > SCALED_BY).then(|| {
        let scaled = |side: f64| (side * scale).round().max(1.0) as usize;
        Size::new(scaled(width), scaled(height))
    })
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

    fn found(k: [f64; 4], width: usize, height: usize) -> Vec<String> {
        let [fx, fy, cx, cy] = k;
        let (file, image) = (Path::new("camera.txt"), Path::new("0.png"));
        let (camera, size) = (Camera::pinhole(fx, fy, cx, cy), Size::new(width, height));
        let mut problems = Vec::new();
        check_camera(&camera, size, file, image, &mut problems);
        problems.iter().map(ToString::to_string).collect()
    }

    const CASTLE: [f64; 4] = [2759.48, 2764.16, 1520.69, 1006.81];

    #[test]
    fn cameras_of_real_datasets_are_sound() {
        for (k, width, height) in [
            (CASTLE, 3072, 2048),
            ([718.856, 718.856, 607.1928, 185.2157], 1241, 376), // KITTI 00
            ([707.0912, 707.0912, 601.8873, 183.1104], 1226, 370), // KITTI 04
            ([552.554, 552.554, 682.049, 238.77], 1408, 376),    // KITTI-360
            ([517.3, 516.5, 318.6, 255.3], 640, 480),            // TUM fr1
            ([520.9, 521.0, 325.1, 249.7], 640, 480),            // TUM fr2
            ([458.654, 457.296, 367.215, 248.375], 752, 480),    // EuRoC, left
            ([457.587, 456.134, 379.999, 255.238], 752, 480),    // EuRoC, right
            ([1170.188, 1170.188, 647.75, 483.75], 1296, 968),   // ScanNet
            ([585.0, 585.0, 320.0, 240.0], 640, 480),            // 7-Scenes
            ([2892.33, 2883.18, 823.205, 619.071], 1600, 1200),  // DTU
            ([1266.42, 1266.42, 816.27, 491.51], 1600, 900),     // nuScenes
            // Cut from one side, as collections of photographs have them.
            ([900.0, 900.0, 520.0, 300.0], 840, 600),
            ([900.0, 900.0, 400.0, 380.0], 800, 640),
        ] {
            assert_eq!(found(k, width, height), [""; 0], "{k:?}");
        }
    }

    #[test]
    fn a_scaled_camera_names_the_size_that_it_is_of() {
        for (scale, size) in [(0.75, "2274x1516"), (0.5, "1517x1011"), (1.5, "4548x3032")] {
            let said = found(CASTLE.map(|x| scale * x), 3072, 2048);
            let words = format!("made for images of about {size}");
            assert!(said.len() == 1 && said[0].contains(&words), "{said:?}");
            assert!(said[0].starts_with("warning"), "{said:?}");
        }
        let said = found(CASTLE.map(|x| 4.0 * x), 3072, 2048);
        let words = "outside the image 0.png of 3072x2048, as of images of about 12125x8083";
        assert!(said.len() == 1 && said[0].contains(words), "{said:?}");
    }

    #[test]
    fn a_focal_length_in_other_units_is_an_error() {
        for (k, remedy) in [
            ([0.898, 1.35, 0.495, 0.4916], "first row by the width 3072"),
            (
                [35.0, 35.0, 1536.0, 1024.0],
                "multiply it by 3072 and divide by the width",
            ),
        ] {
            let said = found(k, 3072, 2048);
            assert!(said.len() == 1 && said[0].starts_with("error"), "{said:?}");
            assert!(said[0].contains(remedy), "{said:?}");
        }
    }
}
