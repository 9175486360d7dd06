//! Searches nearest neighbours between two files of descriptors and measures the time.
//!
//! ```text
//! search A B OUT [REPETITIONS [exact | kdforest | ratio] [kept]]
//! ```
//!
//! prints the median time of a first search in milliseconds (without reading and writing) and writes the
//! correspondences; with `ratio` those that pass the ratio test, for which the search is made. With `kept` all searches but
//! the first find what was prepared of B. All numbers are little-endian.
//!
//! - Descriptors: `u32` kind (0 real values, 1 bits), `u32` values or bits in a row, `u32` rows; then the rows:
//!   `f32` values, or whole bytes whose least significant bit comes first.
//! - Correspondences, one after the other: `u32` a, `u32` b, `f32` distance, `f32` distance to the second
//!   nearest.

use std::error::Error;
use std::fs;
use std::time::{Duration, Instant};

use matchbench::memory::{HugePages, keep_freed};
use matchbench_vision::features::{BinaryRows, Descriptors, FloatRows};
use matchbench_vision::matching::{
    Correspondence, KdForest, KdForestParams, RatioTest, two_nearest, two_nearest_below,
};

// As in the program.
#[global_allocator]
static ALLOCATOR: HugePages = HugePages;

fn main() -> Result<(), Box<dyn Error>> {
    keep_freed(1);
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [a, b, out, options @ ..] = arguments.as_slice() else {
        return Err("usage: search A B OUT [REPETITIONS [exact | kdforest | ratio] [kept]]".into());
    };
    let repetitions = options
        .first()
        .map_or(Ok(5), |text| text.parse::<usize>())?;
    let is_kept = options.get(2).is_some_and(|option| option == "kept");
    let test = (options.get(1))
        .filter(|option| *option == "ratio")
        .map(|_| RatioTest::default());
    let kdforest = match options.get(1).map(String::as_str) {
        None | Some("exact" | "ratio") => None,
        Some("kdforest") => Some(KdForest::new(KdForestParams::default())?),
        Some(other) => return Err(format!("no search `{other}`").into()),
    };
    let (a, b) = (read(a)?, read(b)?);
    if a.kind() != b.kind() {
        return Err(format!("cannot compare {:?} with {:?}", a.kind(), b.kind()).into());
    }

    let mut times: Vec<Duration> = Vec::new();
    let mut matches = Vec::new();
    for _ in 0..repetitions.max(1) {
        // What a search prepares is kept with the descriptors for the next one, so a first search needs a copy.
        let copy = (!is_kept).then(|| b.clone());
        let b = copy.as_ref().unwrap_or(&b);
        let start = Instant::now();
        matches = match (&kdforest, &a, b) {
            (None, ..) => match &test {
                Some(test) => two_nearest_below(&a, b, test.ratio),
                None => two_nearest(&a, b),
            },
            (Some(forest), Descriptors::Float(a), Descriptors::Float(b)) => {
                forest.two_nearest(a, b)
            }
            _ => return Err("kd-trees need real-valued descriptors".into()),
        };
        times.push(start.elapsed());
    }
    times.sort_unstable();
    println!("{:.3}", times[times.len() / 2].as_secs_f64() * 1e3);

    let passes = |found: &&Correspondence| test.is_none_or(|test| test.keeps(found));
    let bytes: Vec<u8> = matches
        .iter()
        .filter(passes)
        .flat_map(|m| [m.a, m.b, m.distance.to_bits(), m.second.to_bits()])
        .flat_map(u32::to_le_bytes)
        .collect();
    fs::write(out, bytes)?;
    Ok(())
}

/// Reads a file of descriptors.
fn read(path: &str) -> Result<Descriptors, Box<dyn Error>> {
    let bytes = fs::read(path).map_err(|error| format!("{path}: {error}"))?;
    let (header, body) = bytes
        .split_first_chunk::<12>()
        .ok_or_else(|| format!("{path}: shorter than its header"))?;
    let (header, _) = header.as_chunks::<4>();
    let header = [0, 1, 2].map(|i| u32::from_le_bytes(header[i]) as usize);
    let [kind, length, rows] = header;
    let row_bytes = match kind {
        0 => 4 * length,
        1 => length.div_ceil(8),
        _ => return Err(format!("{path}: kind {kind}, not 0 or 1").into()),
    };
    if length == 0 || body.len() != rows * row_bytes {
        return Err(format!("{path}: {rows} rows of {row_bytes} bytes expected").into());
    }
    Ok(if kind == 0 {
        let (values, _) = body.as_chunks();
        let values = values.iter().copied().map(f32::from_le_bytes).collect();
        Descriptors::Float(FloatRows::from_vec(length, values))
    } else {
        Descriptors::Binary(BinaryRows::from_bytes(length, body))
    })
}
