//! `matchbench import`: other people's layouts become a dataset.

use std::io::Write;

use anyhow::{Result, ensure};
use matchbench::datasets::{Association, ImageStorage, ImportOptions, import};

use crate::Ending;
use crate::args::{Images, ImportArgs};

pub(crate) fn run(args: &ImportArgs) -> Result<Ending> {
    let association = Association {
        tolerance: args.tolerance.unwrap_or(Association::default().tolerance),
        interpolate: args.interpolate,
    };
    ensure!(
        association.tolerance >= 0.0,
        "--tolerance must be a number of seconds from 0, not {}",
        association.tolerance
    );
    let options = ImportOptions {
        sequence: args.sequence.clone(),
        pairs: args.pairs.as_deref().map(str::parse).transpose()?,
        camera: args.camera.clone(),
        poses: args.poses.clone(),
        association,
        images: match args.images {
            Images::Reference => ImageStorage::Reference,
            Images::Link => ImageStorage::Link,
            Images::Copy => ImageStorage::Copy,
        },
    };
    let report = import(&args.kind, &args.source, &args.out, &options)?;
    for note in &report.notes {
        eprintln!("note: {note}");
    }
    writeln!(
        std::io::stdout(),
        "{}: {} frames, {} pairs ({})",
        args.out.display(),
        report.frames,
        report.pairs,
        report.rule
    )?;
    Ok(Ending::Done)
}
