//! A dataset of one's own: images, cameras and poses that a program knows, written as a folder that every command
//! opens.
//!
//! ```text
//! cargo run --release --example own_dataset -- IMAGES POSES.csv DATASET
//! ```
//!
//! `POSES.csv` has a line for each image in the folder `IMAGES`, as a capture program might write it: the name of its file, the focal
//! length and principal point in pixels, the position of the camera, and its rotation as a quaternion w x y z,
//! camera to world.
//!
//! ```text
//! 0001.png, 525, 525, 319.5, 239.5, 0.00, 0, 0, 1, 0, 0, 0
//! 0002.png, 525, 525, 319.5, 239.5, 0.25, 0, 0, 1, 0, 0, 0
//! ```
//!
//! Each frame is paired with the five after it. What the importers of the program read needs no program:
//! `matchbench list datasets`.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use matchbench::datasets::{
    About, Frame, ImageStorage, PairRule, Sequence, Severity, validate, write_native,
};
use matchbench_vision::geometry::Camera;
use matchbench_vision::nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

/// An image of the folder `images` and what a line says about it.
fn frame(images: &Path, line: &str) -> Result<Frame, Box<dyn Error>> {
    let mut cells = line.split(',').map(str::trim);
    let name = cells.next().unwrap_or_default();
    let numbers = cells.map(str::parse).collect::<Result<Vec<f64>, _>>()?;
    let &[fx, fy, cx, cy, x, y, z, qw, qx, qy, qz] = numbers.as_slice() else {
        return Err(format!("found {} numbers, needed 11", numbers.len()).into());
    };
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(qw, qx, qy, qz));
    Ok(Frame::with_pose(
        images.join(name),
        // The middle of the upper left pixel is (0, 0).
        Camera::pinhole(fx, fy, cx, cy),
        Isometry3::from_parts(Translation3::new(x, y, z), rotation),
    ))
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [images, poses, out] = arguments.as_slice() else {
        return Err("usage: own_dataset IMAGES POSES.csv DATASET".into());
    };
    let mut frames = Vec::new();
    for (index, line) in fs::read_to_string(poses)?.lines().enumerate() {
        let found = frame(&fs::canonicalize(images)?, line);
        frames.push(found.map_err(|error| format!("{}:{}: {error}", poses.display(), index + 1))?);
    }
    let rule = PairRule::Window { size: 5, stride: 1 };
    let (frames, pairs) = rule.apply(frames)?;
    let sequence = Sequence {
        name: String::new(), // the folder gives it
        frames,
        pairs,
    };
    let about = About {
        origin: poses.display().to_string(),
        ..About::default()
    };
    write_native(out, &sequence, &about, ImageStorage::Reference)?;

    let written = Sequence::open(out)?;
    println!(
        "{} frames, {} pairs",
        written.frames.len(),
        written.pairs.len()
    );
    for problem in validate(out) {
        println!("{problem}");
        if problem.severity == Severity::Error {
            return Err("the dataset is not complete".into());
        }
    }
    println!(
        "next: matchbench run {} --matchers sift,orb --out RUN",
        out.display()
    );
    Ok(())
}
