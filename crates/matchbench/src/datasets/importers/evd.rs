//! The Extreme View Dataset (Mishkin, Matas, Perdoch: "MODS: Fast and Robust Method for Two-View
//! Matching", CVIU 141, 2015).
//!
//! `1/NAME.png`, `2/NAME.png` and `h/NAME.txt`, a 3x3 matrix that maps pixels of the first image to the second.
//! Pixels are counted from the centre of the first one. Pairs are in the order of their names.

use std::fs;
use std::path::Path;

use super::oxford::{Series, image};
use super::{ImportOptions, Imported, base_name};
use crate::datasets::DatasetError;

pub(super) fn read(src: &Path, _: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let folder = src.join("h");
    let entries = fs::read_dir(&folder).map_err(|error| DatasetError::io(&folder, &error))?;
    let mut names: Vec<String> = entries
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter_map(|name| Some(name.strip_suffix(".txt")?.to_owned()))
        .collect();
    names.sort();
    let mut series = Series::default();
    for name in names {
        let side = |side: &str| {
            image(&src.join(side), &name).ok_or_else(|| {
                let path = src.join(side).join(format!("{name}.png"));
                DatasetError::new(path, "the image is missing", "put it there")
            })
        };
        series.pair(side("1")?, side("2")?, &folder.join(format!("{name}.txt")))?;
    }
    Ok(series.finish(format!("Extreme View Dataset, {}", base_name(src))))
}
