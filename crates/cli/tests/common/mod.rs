//! A small dataset with true poses, made on the spot.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The program under test, without the environment's say.
pub(crate) fn matchbench() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_matchbench"));
    command.env_remove("MATCHBENCH_CACHE");
    command
}

/// A dataset called `name` in `folder`: a textured wall, `frames` photographs of it from places
/// side by side, all pairs.
pub(crate) fn dataset(folder: &Path, name: &str, frames: usize) -> PathBuf {
    const STEP: usize = 5; // pixels of image motion between neighbours: 0.05 at depth 1 and f = 100
    let dataset = folder.join(name);
    fs::create_dir_all(dataset.join("Images")).expect("writable");
    let mut pairs = String::new();
    for a in 0..frames {
        let image = wall(a * STEP);
        fs::write(dataset.join(format!("Images/{a:04}.pgm")), image).expect("writable");
        for b in a + 1..frames {
            let t = -0.05 * (b - a) as f64;
            // Irregular white space, as in published files.
            writeln!(pairs, "{a} {b}  1 0 0 {t} 0 1 0 0 0 0 1 0 ").expect("a string");
        }
    }
    fs::write(
        dataset.join("camera.txt"),
        "100 0 79.5\r\n0 100 59.5\r\n0 0 1",
    )
    .expect("writable");
    fs::write(dataset.join("pairs.txt"), pairs).expect("writable");
    dataset
}

/// A PGM file of a wall of grey patches on a grid of 9 x 7 pixels, from `shift` pixels further.
fn wall(shift: usize) -> Vec<u8> {
    let (width, height) = (160, 120);
    let mut file = format!("P5 {width} {height} 255\n").into_bytes();
    for y in 0..height {
        for x in 0..width {
            let patch = ((x + shift) / 9) * 7919 + (y / 7) * 104_729;
            let grey = (patch ^ (patch >> 5)).wrapping_mul(2_654_435_761) >> 13;
            file.push(40 + (grey % 170) as u8);
        }
    }
    file
}

/// 60 matches of neighbouring images of [`dataset`], as programs write them: rows of `xa ya xb yb ambiguity`.
#[cfg(unix)]
#[allow(dead_code)] // by some of the tests
pub(crate) fn wall_matches() -> Vec<u8> {
    let mut rows = Vec::new();
    for i in 0..60_u8 {
        let (x, y) = (
            f32::from(i % 10) * 14.0 + 10.0,
            f32::from(i / 10) * 17.0 + 8.0,
        );
        for value in [x, y, x - 5.0, y, 0.1] {
            rows.extend(value.to_le_bytes());
        }
    }
    rows
}

/// Sends a signal to a process.
#[cfg(unix)]
#[allow(dead_code)] // by some of the tests
pub(crate) fn send(signal: &str, process: u32) {
    let sent = Command::new("kill")
        .args([&format!("-{signal}"), &process.to_string()])
        .status();
    assert!(sent.expect("kill is everywhere").success());
}

/// The signal of Ctrl-C, or one to terminate where Ctrl-C is ignored, as in the background of a script.
#[cfg(unix)]
#[allow(dead_code)] // by some of the tests
pub(crate) fn stop_signal() -> &'static str {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    if mask.unwrap_or(0) & 0b10 == 0 {
        "INT"
    } else {
        "TERM"
    }
}
