//! `matchbench import`: makes a dataset from data in another layout.

use std::io::Write;

use anyhow::Result;
use matchbench::counted::counted;
use matchbench::datasets::{ImageStorage, ImportOptions, import};

use crate::Ending;
use crate::args::{Images, ImportArgs};
use crate::output::{say, stdout};

pub(crate) fn run(args: &ImportArgs) -> Result<Ending> {
    let options = ImportOptions {
        sequence: args.sequence.clone(),
        sensor: args.sensor.clone(),
        pairs: args.pairs.as_deref().map(str::parse).transpose()?,
        camera: args.camera.clone(),
        poses: args.poses.clone(),
        body_from_camera: args.body_from_camera.clone(),
        tolerance: args.tolerance,
        interpolate: args.interpolate,
        image_root: args.image_root.clone(),
        intrinsics: args.intrinsics.clone(),
        property: args.property.clone(),
        images: match args.images {
            Images::Reference => ImageStorage::Reference,
            Images::Link => ImageStorage::Link,
            Images::Copy => ImageStorage::Copy,
        },
    };
    let report = import(&args.kind, &args.source, &args.out, &options)?;
    for note in &report.notes {
        say!("note: {note}");
    }
    let pairs = match &report.rule {
        Some(rule) => rule.to_string(),
        None => "as listed".to_owned(),
    };
    writeln!(
        stdout(),
        "{}: {}, {} ({pairs})",
        args.out.display(),
        counted(report.frames, "frame"),
        counted(report.pairs, "pair"),
    )?;
    Ok(Ending::Done)
}
