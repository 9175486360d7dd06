//! Renders the built-in dataset into a folder: `cargo run --release -p matchbench-compare --bin render -- FOLDER`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use matchbench::datasets::rendered;

fn main() -> ExitCode {
    let Some(folder) = std::env::args_os().nth(1).map(PathBuf::from) else {
        eprintln!("usage: render FOLDER");
        return ExitCode::FAILURE;
    };
    let start = Instant::now();
    match rendered::ensure(&folder, &|progress| {
        eprint!("\r{} of {} frames", progress.done, progress.total);
    }) {
        Ok(sequences) => {
            eprintln!("\r{} sequences in {:.1?}", sequences.len(), start.elapsed());
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("\n{error}");
            ExitCode::FAILURE
        }
    }
}
