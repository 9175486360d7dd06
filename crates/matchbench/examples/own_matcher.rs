//! A matcher of one's own, written in Rust, run by the benchmark beside two built-in ones.
//!
//! ```text
//! cargo run --release --example own_matcher -- DATASET RUN
//! ```
//!
//! `DATASET` is a folder made by `matchbench import` (or `matchbench demo`), `RUN` the folder of the run, which is
//! resumed where it is there. The table of scores is printed; `matchbench report RUN` makes the page.
//!
//! The matcher is the simplest that works where the camera does not turn: FAST corners, a patch of 11 by 11
//! pixels around each as its descriptor, mutual nearest neighbours.

use std::error::Error;
use std::path::{Path, PathBuf};

use matchbench::matchers::{BuiltMatcher, Extraction};
use matchbench::metrics::{Summary, load};
use matchbench::report::{Format, render};
use matchbench::run::{Cancel, Contender, Dataset, Run, Silent};
use matchbench::{estimators, matchers};
use matchbench_vision::features::{
    DescriptorKind, Descriptors, Detector, Extractor, Fast, FastParams, Features, FloatRows,
};
use matchbench_vision::image::GrayImage;
use matchbench_vision::matching::{MutualCheck, NearestNeighbours, Pipeline, RatioTest};
use serde_json::json;

/// The patch reaches so many pixels from the corner to each side.
const RADIUS: usize = 5;
const SIDE: usize = 2 * RADIUS + 1;

/// Corners, each described by the grey values around it.
struct Patches {
    corners: Fast,
    limit: usize,
}

impl Extractor for Patches {
    fn kind(&self) -> DescriptorKind {
        DescriptorKind::Float { dim: SIDE * SIDE }
    }

    fn extract(&self, image: &GrayImage) -> Features {
        let inside = |x: f32, length: usize| {
            (RADIUS as f32..(length.saturating_sub(RADIUS)) as f32).contains(&x)
        };
        let mut keypoints = self.corners.detect(image);
        keypoints.retain(|k| inside(k.at.x, image.width()) && inside(k.at.y, image.height()));
        keypoints.sort_by(|i, j| j.response.total_cmp(&i.response));
        keypoints.truncate(self.limit);
        let mut rows = FloatRows::new(SIDE * SIDE);
        for keypoint in &keypoints {
            rows.push(&patch(
                image,
                keypoint.at.x as usize,
                keypoint.at.y as usize,
            ));
        }
        Features::new(image.size(), keypoints, Descriptors::Float(rows))
    }
}

/// The grey values around a pixel, with mean 0 and norm 1: brightness and contrast do not matter.
fn patch(image: &GrayImage, x: usize, y: usize) -> Vec<f32> {
    let rows = (y - RADIUS..=y + RADIUS).map(|y| &image.row(y)[x - RADIUS..=x + RADIUS]);
    let mut values: Vec<f32> = rows.flatten().map(|&grey| f32::from(grey)).collect();
    let mean = values.iter().sum::<f32>() / values.len() as f32;
    for value in &mut values {
        *value -= mean;
    }
    let norm = values.iter().map(|value| value * value).sum::<f32>().sqrt();
    if norm > 0.0 {
        for value in &mut values {
            *value /= norm;
        }
    }
    values
}

/// The matcher, and everything that its results depend on: the benchmark writes the parameters into the plan
/// of the run and finds features in its cache by the extraction.
fn patches() -> Result<BuiltMatcher, Box<dyn Error>> {
    let (threshold, limit, ratio) = (10, 5000, 0.8);
    Ok(BuiltMatcher {
        id: "patches".into(),
        params: json!({ "threshold": threshold, "limit": limit, "ratio": ratio }),
        extraction: Extraction {
            extractor: "patches".into(),
            params: json!({ "threshold": threshold, "limit": limit }),
            revision: 1,
        },
        detection: None,
        matcher: Box::new(Pipeline {
            extractor: Box::new(Patches {
                corners: Fast::new(FastParams { threshold }),
                limit,
            }),
            search: Box::new(NearestNeighbours),
            selectors: vec![Box::new(RatioTest::new(ratio)?), Box::new(MutualCheck)],
        }),
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [dataset, folder] = arguments.as_slice() else {
        return Err("usage: own_matcher DATASET RUN".into());
    };
    let mut all = vec![patches()?];
    for id in ["orb", "sift"] {
        all.push(matchers::find(id)?.build(None)?);
    }
    let contenders = (all.into_iter())
        .map(|matcher| {
            Ok(Contender::new(
                matcher,
                [estimators::find("best")?.build(None)?],
            ))
        })
        .collect::<Result<Vec<_>, Box<dyn Error>>>()?;
    let datasets = [Dataset::open(dataset)?];
    Run::new(&datasets, &contenders, folder).execute(&Silent, &Cancel::default())?;
    print!("{}", table(folder)?);
    Ok(())
}

fn table(folder: &Path) -> Result<String, Box<dyn Error>> {
    let sets = load(folder, None)?;
    let scores: Vec<Summary> = sets.iter().map(Summary::new).collect();
    Ok(render(Format::Table, &scores))
}
