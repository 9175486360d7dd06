//! The program in a folder of its own, step by step.

use std::path::Path;
use std::process::Output;

use crate::common::matchbench;

/// Runs the program in `folder`.
pub(crate) fn go(folder: &Path, words: &[&str]) -> Output {
    let output = matchbench().args(words).current_dir(folder).output();
    output.expect("the program starts")
}

/// Runs the program in `folder`, where it succeeds, and gives what it printed.
pub(crate) fn succeeds(folder: &Path, words: &[&str]) -> String {
    let output = go(folder, words);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{words:?}\n{said}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}
