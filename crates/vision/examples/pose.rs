//! Relative poses from a file of matches, with the reference estimator.
//!
//! ```text
//! pose MATCHES [SEEDS] [FIRST_SEED]
//! ```
//!
//! `MATCHES` holds one block for each pair of images: a line `pair NAME`, a line with `fx fy cx cy` of
//! both cameras (eight numbers), and a line `ax ay bx by` for each match, in pixels. For each pair and
//! each of `SEEDS` seeds (default 1), counted from `FIRST_SEED` (default 0), one line is printed:
//!
//! ```text
//! NAME seed inliers support iterations microseconds r11 r12 ... r33 t1 t2 t3
//! ```
//!
//! with `x_b = R x_a + t`, or `NAME seed none microseconds reason` where there is no pose.

use std::time::Instant;
use std::{env, error, fs};

use matchbench_vision::geometry::Camera;
use matchbench_vision::robust::{PoseEstimator, Ransac, RansacParams, TwoViews};
use matchbench_vision::seed::Seed;
use nalgebra::Point2;

type Error = Box<dyn error::Error>;

struct Pair {
    name: String,
    cameras: Option<(Camera, Camera)>,
    a: Vec<Point2<f64>>,
    b: Vec<Point2<f64>>,
}

fn main() -> Result<(), Error> {
    let mut arguments = env::args().skip(1);
    let file = arguments
        .next()
        .ok_or("usage: pose MATCHES [SEEDS] [FIRST_SEED]")?;
    let seeds: u64 = arguments.next().map_or(Ok(1), |n| n.parse())?;
    let first: u64 = arguments.next().map_or(Ok(0), |n| n.parse())?;
    let ransac = Ransac::new(RansacParams::default())?;
    for pair in read(&fs::read_to_string(file)?)? {
        let (camera_a, camera_b) = pair.cameras.as_ref().ok_or("a pair without cameras")?;
        let views = TwoViews {
            a: &pair.a,
            b: &pair.b,
            camera_a,
            camera_b,
            ambiguity: &vec![0.0; pair.a.len()],
        };
        for seed in first..first + seeds {
            let start = Instant::now();
            let outcome = ransac.estimate(views, Seed(seed));
            let micros = start.elapsed().as_secs_f64() * 1e6;
            match outcome {
                Ok(found) => {
                    let r = found.b_from_a.rotation.to_rotation_matrix();
                    let rows = r.matrix().transpose();
                    let numbers = rows.iter().chain(found.b_from_a.direction.iter());
                    let numbers: Vec<String> = numbers.map(f64::to_string).collect();
                    println!(
                        "{} {seed} {} {} {} {micros:.1} {}",
                        pair.name,
                        found.inliers.len(),
                        found.support,
                        found.iterations,
                        numbers.join(" ")
                    );
                }
                Err(reason) => println!("{} {seed} none {micros:.1} {reason}", pair.name),
            }
        }
    }
    Ok(())
}

fn read(text: &str) -> Result<Vec<Pair>, Error> {
    let mut pairs: Vec<Pair> = Vec::new();
    for (index, line) in text.lines().enumerate() {
        if let Some(name) = line.strip_prefix("pair ") {
            pairs.push(Pair {
                name: name.trim().into(),
                cameras: None,
                a: Vec::new(),
                b: Vec::new(),
            });
            continue;
        }
        let numbers: Result<Vec<f64>, _> = line.split_whitespace().map(str::parse).collect();
        let numbers = numbers.map_err(|error| format!("line {}: {error}", index + 1))?;
        match (pairs.last_mut(), numbers[..].as_ref()) {
            (_, []) => {}
            (Some(pair), &[fx, fy, cx, cy, gx, gy, dx, dy]) => {
                let cameras = (
                    Camera::pinhole(fx, fy, cx, cy),
                    Camera::pinhole(gx, gy, dx, dy),
                );
                pair.cameras = Some(cameras);
            }
            (Some(pair), &[ax, ay, bx, by]) => {
                pair.a.push(Point2::new(ax, ay));
                pair.b.push(Point2::new(bx, by));
            }
            _ => return Err(format!("line {}: expected `pair`, 8 or 4 numbers", index + 1).into()),
        }
    }
    Ok(pairs)
}
