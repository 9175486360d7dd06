//! Estimates homographies from a file of matches.
//!
//! ```text
//! homography MATCHES ESTIMATOR [SEEDS] [FIRST_SEED] [JSON]
//! ```
//!
//! `MATCHES` holds one block per pair of images: a line `pair NAME`, and a line `ax ay bx by ambiguity` per
//! match, in pixels. `ESTIMATOR` is `best-h` or `ransac-h`, with the parameters in `JSON`. `SEEDS` (default 1)
//! is the number of seeds; they start at `FIRST_SEED` (default 0). For each pair and seed one line is printed:
//!
//! ```text
//! NAME seed inliers iterations microseconds h11 h12 ... h33
//! ```
//!
//! or `NAME seed none microseconds reason` if there is no homography.

use std::time::Instant;
use std::{env, error, fs};

use matchbench::estimators::{self, Estimator};
use matchbench::memory::{HugePages, keep_freed};
use matchbench_vision::geometry::MatchedPoints;
use matchbench_vision::seed::Seed;
use nalgebra::Point2;

type Error = Box<dyn error::Error>;

// As in the program.
#[global_allocator]
static ALLOCATOR: HugePages = HugePages;

fn main() -> Result<(), Error> {
    keep_freed(1);
    let mut arguments = env::args().skip(1);
    let usage = "usage: homography MATCHES ESTIMATOR [SEEDS] [FIRST_SEED] [JSON]";
    let file = arguments.next().ok_or(usage)?;
    let id = arguments.next().ok_or(usage)?;
    let seeds: u64 = arguments.next().map_or(Ok(1), |n| n.parse())?;
    let first: u64 = arguments.next().map_or(Ok(0), |n| n.parse())?;
    let params = arguments.next().map(|json| json.parse()).transpose()?;
    let built = estimators::find(&id)?.build(params.as_ref())?;
    let Estimator::Homography(estimator) = built.estimator else {
        return Err(format!("{id} estimates poses; choose best-h or ransac-h").into());
    };
    for (name, points) in read(&fs::read_to_string(file)?)? {
        for seed in first..first + seeds {
            let start = Instant::now();
            let outcome = estimator.estimate(&points, Seed(seed));
            let micros = start.elapsed().as_secs_f64() * 1e6;
            match outcome {
                Ok(found) => {
                    let rows = found.b_from_a.transpose();
                    let numbers: Vec<String> = rows.iter().map(f64::to_string).collect();
                    println!(
                        "{name} {seed} {} {} {micros:.1} {}",
                        found.inliers.len(),
                        found.iterations,
                        numbers.join(" ")
                    );
                }
                Err(reason) => println!("{name} {seed} none {micros:.1} {reason}"),
            }
        }
    }
    Ok(())
}

fn read(text: &str) -> Result<Vec<(String, MatchedPoints)>, Error> {
    let mut pairs: Vec<(String, MatchedPoints)> = Vec::new();
    for (index, line) in text.lines().enumerate() {
        if let Some(name) = line.strip_prefix("pair ") {
            pairs.push((name.trim().into(), MatchedPoints::default()));
            continue;
        }
        let numbers: Result<Vec<f64>, _> = line.split_whitespace().map(str::parse).collect();
        let numbers = numbers.map_err(|error| format!("line {}: {error}", index + 1))?;
        match (pairs.last_mut(), numbers[..].as_ref()) {
            (Some((_, points)), &[ax, ay, bx, by, ambiguity]) => {
                points.push(Point2::new(ax, ay), Point2::new(bx, by), ambiguity as f32);
            }
            _ => {
                return Err(format!("line {}: expected `pair` or five numbers", index + 1).into());
            }
        }
    }
    Ok(pairs)
}
