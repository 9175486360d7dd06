//! The Extreme View Dataset (Mishkin, Matas, Perdoch: "MODS: Fast and Robust Method for Two-View
//! Matching", CVIU 141, 2015).
//!
//! `1/NAME.png`, `2/NAME.png` and `h/NAME.txt`, a 3x3 matrix that maps pixels of the first image to the second.
//! Pixels are counted from the centre of the first one. Pairs are in the order of their names.

use std::path::Path;

use super::oxford::{Series, image};
use super::{ImportOptions, Imported, base_name};
use crate::datasets::DatasetError;
use crate::datasets::images::files_ending_in;

pub(super) fn read(src: &Path, _: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let folder = src.join("h");
    let mut files = files_ending_in(&["txt"], &folder)?;
    files.sort_by(|one, other| one.file_stem().cmp(&other.file_stem()));
    let mut series = Series::default();
    for file in files {
        let name = file.file_stem().unwrap_or_default().to_string_lossy();
        let side = |side: &str| {
            image(&src.join(side), &name).ok_or_else(|| {
                let path = src.join(side).join(format!("{name}.png"));
                DatasetError::new(path, "the image is missing", "put it there")
            })
        };
        series.pair(side("1")?, side("2")?, &file)?;
    }
    Ok(series.finish(format!("Extreme View Dataset, {}", base_name(src))))
}
