//! Runs grid-based motion statistics (GMS) on a file of matches and measures its time.
//!
//! ```text
//! gms MATCHES SCALES ROTATIONS
//! ```
//!
//! `MATCHES` is little-endian: `u32` width and height of image a, then of image b. Then there are four `f32`
//! per match: x and y in a, x and y in b. `SCALES` and `ROTATIONS` are 0 or 1. Prints the median time of nine
//! selections in milliseconds, and a digit for each match: 1 if it is kept, else 0.

use std::error::Error;
use std::fs;
use std::time::Instant;

use matchbench::memory::{HugePages, keep_freed};
use matchbench_vision::image::Size;
use matchbench_vision::matching::{Gms, GmsParams};
use nalgebra::Point2;

// As in the program.
#[global_allocator]
static ALLOCATOR: HugePages = HugePages;

fn main() -> Result<(), Box<dyn Error>> {
    keep_freed(1);
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, scales, rotations] = arguments.as_slice() else {
        return Err("usage: gms MATCHES SCALES ROTATIONS".into());
    };
    let file = fs::read(path).map_err(|error| format!("{path}: {error}"))?;
    let (numbers, _) = file.as_chunks::<4>();
    let (sizes, rows) = numbers
        .split_first_chunk::<4>()
        .ok_or_else(|| format!("{path}: shorter than its header"))?;
    let [width_a, height_a, width_b, height_b] = sizes.map(|n| u32::from_le_bytes(n) as usize);
    let (rows, _) = rows.as_chunks::<4>();
    let (a, b): (Vec<_>, Vec<_>) = rows
        .iter()
        .map(|row| {
            let [ax, ay, bx, by] = row.map(f32::from_le_bytes);
            (Point2::new(ax, ay), Point2::new(bx, by))
        })
        .unzip();
    let gms = Gms::new(GmsParams {
        scales: scales == "1",
        rotations: rotations == "1",
        ..GmsParams::default()
    })?;
    let (size_a, size_b) = (Size::new(width_a, height_a), Size::new(width_b, height_b));
    let mut times = Vec::new();
    let mut mask = Vec::new();
    for _ in 0..9 {
        let start = Instant::now();
        mask = gms.mask(&a, size_a, &b, size_b);
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
