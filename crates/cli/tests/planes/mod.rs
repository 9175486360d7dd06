//! The true homographies of the wall.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Writes those of some pairs of a [`dataset`](crate::common::dataset), whose images move by 5 pixels from one to the next.
pub(crate) fn homographies(wall: &Path, pairs: &[(i32, i32)]) {
    let mut rows = String::new();
    for &(a, b) in pairs {
        writeln!(rows, "{a} {b} 1 0 {} 0 1 0 0 0 1", 5 * (a - b)).expect("a string");
    }
    fs::write(wall.join("homographies.txt"), rows).expect("writable");
}
