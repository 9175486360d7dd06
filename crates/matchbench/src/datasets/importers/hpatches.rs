//! HPatches' full images (Balntas, Lenc, Vedaldi, Mikolajczyk: "HPatches: A Benchmark and Evaluation
//! of Handcrafted and Learned Local Descriptors", CVPR 2017).
//!
//! 116 folders, `i_*` with changes of illumination and `v_*` with changes of viewpoint. Each has `1.ppm` to
//! `6.ppm` and `H_1_2` to `H_1_6`, 3x3 each, which map pixels of the first image to the others. Pixels are
//! counted from the centre of the first one. Pairs are the first image of a folder with each other image: 580
//! in all. The source is the folder that contains these folders, or one of them. The option of a sequence takes
//! `i`, `v` or the name of one folder.
//!
//! Many papers leave out eight scenes with large images (those that D2-Net could not process); all
//! are imported here.

use std::path::Path;

use super::oxford::{Series, folders_with, is_series};
use super::{ImportOptions, Imported, base_name};
use crate::datasets::DatasetError;

pub(super) fn read(src: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let mut series = Series::default();
    let mut sequence = options.sequence.clone();
    if is_series(src, name) && sequence.is_none() {
        series.add(src, "", name)?;
    } else {
        let folders = folders(src, sequence.as_deref())?;
        for folder in &folders {
            series.add(&src.join(folder), "", name)?;
        }
        if let [only] = &folders[..] {
            sequence.get_or_insert_with(|| only.clone());
        }
    }
    Ok(Imported {
        sequence,
        ..series.finish(format!("HPatches, {}", base_name(src)))
    })
}

/// The name of a homography.
fn name(k: usize) -> String {
    format!("H_1_{k}")
}

/// The wanted folders that hold a homography, sorted by name.
fn folders(src: &Path, wanted: Option<&str>) -> Result<Vec<String>, DatasetError> {
    let mut found = folders_with(src, name)?;
    found.retain(|name| {
        wanted.is_none_or(|wanted| name == wanted || name.split('_').next() == Some(wanted))
    });
    if found.is_empty() {
        let which = wanted.map_or(String::new(), |wanted| {
            format!(" of the sequence `{wanted}`")
        });
        return Err(DatasetError::new(
            src,
            format!("there is no folder{which} with 1.ppm and H_1_2"),
            "give hpatches-sequences-release; a sequence is i, v or the name of a folder",
        ));
    }
    Ok(found)
}
