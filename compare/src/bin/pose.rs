//! Estimates relative poses from a file of matches, with the reference estimator or another one.
//!
//! ```text
//! pose MATCHES [SEEDS] [FIRST_SEED] [NAME=VALUE ...]
//! ```
//!
//! `MATCHES` holds one block per pair of images: a line `pair NAME`, a line with `fx fy cx cy` of both cameras
//! (eight numbers), and a line `ax ay bx by [ambiguity [turn [growth]]]` per match, in pixels and radians; the
//! growth is a logarithm. `SEEDS` (default 1) is the number of seeds; they start at `FIRST_SEED` (default 0). For
//! each pair and seed one line is printed:
//!
//! ```text
//! NAME seed inliers support iterations microseconds r11 r12 ... r33 t1 t2 t3
//! ```
//!
//! with `x_b = R x_a + t`, or `NAME seed none microseconds reason` if there is no pose.
//!
//! Without settings, the estimator is [`Ransac`] with its defaults. With settings, it is [`SampleConsensus`]:
//! `preset` `best` or `adaptive` (the values that the other settings change), `sampler` `uniform`, `prosac` or
//! `spread`, `horizon=5000` (PROSAC), `score` `msac` or `even-msac`, `score_cells=10`, `threshold=1.5`,
//! `sprt=false`, `iterations=10000`, `min=50`, `confidence=0.999`, `local=10`, `final=25`, `loss` `truncated`
//! or `cauchy`, `geometry=fundamental`, `degensac=false`, `cheirality=false`, `plane_poses=true`,
//! `turns=false`, `hypotheses=8`, `hopeless=0.1`.

use std::time::Instant;
use std::{env, error, fs};

use matchbench::memory::{HugePages, keep_freed};
use matchbench_vision::geometry::{Camera, Loss, MatchedPoints};
use matchbench_vision::robust::{
    GeometryName, PoseEstimator, Ransac, RansacParams, SampleConsensus, SampleConsensusParams,
    SamplerName, ScoreName, Settings, TwoViews, presets,
};
use matchbench_vision::seed::Seed;
use nalgebra::Point2;

type Error = Box<dyn error::Error>;

struct Pair {
    name: String,
    cameras: Option<(Camera, Camera)>,
    points: MatchedPoints,
    /// Turns and growths of the matches that have them.
    changes: [Vec<f32>; 2],
}

// As in the program.
#[global_allocator]
static ALLOCATOR: HugePages = HugePages;

fn main() -> Result<(), Error> {
    keep_freed(1);
    let mut arguments = env::args().skip(1);
    let file = arguments
        .next()
        .ok_or("usage: pose MATCHES [SEEDS] [FIRST_SEED] [NAME=VALUE ...]")?;
    let seeds: u64 = arguments.next().map_or(Ok(1), |n| n.parse())?;
    let first: u64 = arguments.next().map_or(Ok(0), |n| n.parse())?;
    let settings: Vec<String> = arguments.collect();
    let estimator = estimator(&settings)?;
    for pair in read(&fs::read_to_string(file)?)? {
        let (camera_a, camera_b) = pair.cameras.as_ref().ok_or("a pair without cameras")?;
        let views = TwoViews {
            points: &pair.points,
            camera_a,
            camera_b,
        };
        for seed in first..first + seeds {
            let start = Instant::now();
            let outcome = estimator.estimate(views, Seed(seed));
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

fn estimator(settings: &[String]) -> Result<Box<dyn PoseEstimator>, Error> {
    if settings.is_empty() {
        return Ok(Box::new(Ransac::new(RansacParams::default())?));
    }
    let mut base = SampleConsensusParams::default();
    let mut changes = Settings::default();
    for setting in settings {
        match setting.split_once('=').ok_or("expected NAME=VALUE")? {
            ("preset", "best") => base = presets::best(),
            ("preset", "adaptive") => base = presets::adaptive(),
            ("sampler", "uniform") => changes.sampler = Some(SamplerName::Uniform),
            ("sampler", "prosac") => changes.sampler = Some(SamplerName::Prosac),
            ("sampler", "spread") => changes.sampler = Some(SamplerName::Spread),
            ("score", "msac") => changes.score = Some(ScoreName::Msac),
            ("score", "even-msac") => changes.score = Some(ScoreName::EvenMsac),
            ("plane_poses", value) => changes.plane_poses = Some(value.parse()?),
            ("turns", value) => changes.turns = Some(value.parse()?),
            ("hypotheses", value) => changes.hypotheses = Some(value.parse()?),
            ("hopeless", value) => changes.hopeless = Some(value.parse()?),
            ("score_cells", value) => changes.score_cells = Some(value.parse()?),
            ("loss", "truncated") => changes.final_loss = Some(Loss::Truncated),
            ("loss", "cauchy") => changes.final_loss = Some(Loss::Cauchy),
            ("cheirality", value) => changes.cheirality = Some(value.parse()?),
            ("geometry", "fundamental") => changes.geometry = Some(GeometryName::Fundamental),
            ("degensac", value) => changes.degensac = Some(value.parse()?),
            ("sprt", value) => changes.sprt = Some(value.parse()?),
            ("horizon", value) => changes.prosac_horizon = Some(value.parse()?),
            ("threshold", value) => changes.threshold_px = Some(value.parse()?),
            ("confidence", value) => changes.confidence = Some(value.parse()?),
            ("iterations", value) => changes.max_iterations = Some(value.parse()?),
            ("min", value) => changes.min_iterations = Some(value.parse()?),
            ("local", value) => changes.local_steps = Some(value.parse()?),
            ("final", value) => changes.final_steps = Some(value.parse()?),
            _ => return Err(format!("unknown setting `{setting}`").into()),
        }
    }
    let params = base.with(changes)?;
    Ok(Box::new(SampleConsensus::new(params)?))
}

fn read(text: &str) -> Result<Vec<Pair>, Error> {
    let mut pairs: Vec<Pair> = Vec::new();
    for (index, line) in text.lines().enumerate() {
        if let Some(name) = line.strip_prefix("pair ") {
            pairs.push(Pair {
                name: name.trim().into(),
                cameras: None,
                points: MatchedPoints::default(),
                changes: Default::default(),
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
            (Some(pair), &[ax, ay, bx, by, ref more @ ..]) if more.len() < 4 => {
                let ambiguity = more.first().map_or(0.0, |&x| x as f32);
                for (column, value) in pair.changes.iter_mut().zip(more.iter().skip(1)) {
                    column.push(*value as f32);
                }
                pair.points
                    .push(Point2::new(ax, ay), Point2::new(bx, by), ambiguity);
            }
            _ => {
                return Err(
                    format!("line {}: expected `pair`, 8, or 4 to 7 numbers", index + 1).into(),
                );
            }
        }
    }
    for pair in &mut pairs {
        let count = pair.points.len();
        let changes = std::mem::take(&mut pair.changes);
        if changes
            .iter()
            .any(|column| ![0, count].contains(&column.len()))
        {
            let what = "a turn (or growth) of every match, or of none";
            return Err(format!("pair {}: {what}", pair.name).into());
        }
        let [turns, growths] = changes.map(|column| (!column.is_empty()).then_some(column));
        pair.points = (std::mem::take(&mut pair.points).with_turns(turns)).with_growths(growths);
    }
    Ok(pairs)
}
