//! The relative pose of two cameras from two image files.
//!
//! ```text
//! cargo run --release --example two_view_pose -- IMAGE_A IMAGE_B FOCAL_LENGTH_PX
//! ```
//!
//! Both images are taken to come from one camera without lens distortion whose principal point is the middle of
//! the image. The focal length in pixels is the image width times the focal length in millimetres over the width
//! of the sensor; for a photo of a telephone it is roughly the image width.

use std::error::Error;
use std::path::Path;

use matchbench_vision::features::{Sift, SiftParams};
use matchbench_vision::geometry::Camera;
use matchbench_vision::image::{GrayImage, Size};
use matchbench_vision::matching::{Matcher, Pipeline};
use matchbench_vision::robust::{PoseEstimator, SampleConsensus, TwoViews, presets};
use matchbench_vision::seed::Seed;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path_a, path_b, focal] = arguments.as_slice() else {
        return Err("usage: two_view_pose IMAGE_A IMAGE_B FOCAL_LENGTH_PX".into());
    };
    let (a, b) = (open(path_a.as_ref())?, open(path_b.as_ref())?);
    let focal: f64 = focal.parse()?;
    let (camera_a, camera_b) = (camera_of(&a, focal), camera_of(&b, focal));

    let matcher = Pipeline::of_features(Sift::new(SiftParams::default())?);
    let points = matcher.match_images(&a, &b, None, Seed(0))?;
    println!("{} matches", points.len());

    let estimator = SampleConsensus::new(presets::best())?;
    let views = TwoViews {
        points: &points,
        camera_a: &camera_a,
        camera_b: &camera_b,
    };
    let found = estimator.estimate(views, Seed(0))?;
    let turned = found.b_from_a.rotation.angle().to_degrees();
    let direction = found.b_from_a.direction;
    println!("{} agree on one pose", found.inliers.len());
    println!("x_b = R x_a + t, t of unknown length:");
    println!(
        "R = {} ({turned:.2} degrees)",
        found.b_from_a.rotation.to_rotation_matrix()
    );
    println!(
        "t = {:.4} {:.4} {:.4}",
        direction.x, direction.y, direction.z
    );
    Ok(())
}

fn open(path: &Path) -> Result<GrayImage, Box<dyn Error>> {
    let grey = image::open(path)
        .map_err(|error| format!("{}: {error}", path.display()))?
        .into_luma8();
    let size = Size::new(grey.width() as usize, grey.height() as usize);
    Ok(GrayImage::from_vec(size, grey.into_raw()))
}

fn camera_of(image: &GrayImage, focal: f64) -> Camera {
    let middle = |length: usize| (length as f64 - 1.0) / 2.0;
    Camera::pinhole(focal, focal, middle(image.width()), middle(image.height()))
}
