//! Runs AdaLAM on a file of matches and measures its time.
//!
//! ```text
//! adalam MATCHES SAMPLES REFIT
//! ```
//!
//! `MATCHES` is little-endian: `u32` width and height of image a, then of image b. Then there are eleven `f32`
//! per match: x, y, size and angle (radians) in a, the same in b, distance, second distance, and 1 if the two
//! features are each other's nearest, else 0. `SAMPLES` is the number of samples per neighbourhood; `REFIT` is
//! 0 or 1. Prints the median time of nine selections in milliseconds, and a digit for each match: 1 if it is
//! kept, else 0.

use std::error::Error;
use std::fs;
use std::time::Instant;

use matchbench::memory::{HugePages, keep_freed};
use matchbench_vision::features::{Descriptors, Features, FloatRows, Keypoint};
use matchbench_vision::image::Size;
use matchbench_vision::matching::{Adalam, AdalamParams, Correspondence};
use nalgebra::Point2;

// As in the program.
#[global_allocator]
static ALLOCATOR: HugePages = HugePages;

fn main() -> Result<(), Box<dyn Error>> {
    keep_freed(1);
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, samples, refit] = arguments.as_slice() else {
        return Err("usage: adalam MATCHES SAMPLES REFIT".into());
    };
    let file = fs::read(path).map_err(|error| format!("{path}: {error}"))?;
    let (numbers, _) = file.as_chunks::<4>();
    let (sizes, rows) = numbers
        .split_first_chunk::<4>()
        .ok_or_else(|| format!("{path}: shorter than its header"))?;
    let [width_a, height_a, width_b, height_b] = sizes.map(|n| u32::from_le_bytes(n) as usize);
    let (rows, _) = rows.as_chunks::<11>();
    let (mut keypoints_a, mut keypoints_b) = (Vec::new(), Vec::new());
    let (mut matches, mut mutual) = (Vec::new(), Vec::new());
    for (i, row) in (0..).zip(rows) {
        let row = row.map(f32::from_le_bytes);
        keypoints_a.push(keypoint(&row[..4]));
        keypoints_b.push(keypoint(&row[4..8]));
        matches.push(Correspondence {
            a: i,
            b: i,
            distance: row[8],
            second: row[9],
        });
        mutual.push(row[10] == 1.0);
    }
    let a = features(Size::new(width_a, height_a), keypoints_a);
    let b = features(Size::new(width_b, height_b), keypoints_b);
    let adalam = Adalam::new(AdalamParams {
        samples: samples.parse()?,
        refit: refit == "1",
        ..AdalamParams::default()
    })?;
    let mut times = Vec::new();
    let mut mask = Vec::new();
    for _ in 0..9 {
        let start = Instant::now();
        mask = adalam.mask(&a, &b, &matches, Some(&mutual));
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    let digits: String = mask
        .iter()
        .map(|&kept| if kept { '1' } else { '0' })
        .collect();
    println!("{:.3} {digits}", times[times.len() / 2]);
    Ok(())
}

/// From x, y, size and angle.
fn keypoint(row: &[f32]) -> Keypoint {
    Keypoint {
        at: Point2::new(row[0], row[1]),
        size: row[2],
        angle: Some(row[3]),
        response: 1.0,
        octave: 0,
    }
}

/// Keypoints with descriptors that are not used.
fn features(size: Size, keypoints: Vec<Keypoint>) -> Features {
    let rows = FloatRows::from_vec(1, vec![0.0; keypoints.len()]);
    Features::new(size, keypoints, Descriptors::Float(rows))
}
