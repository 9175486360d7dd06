//! The Oxford affine covariant regions set (Mikolajczyk, Tuytelaars, Schmid, Zisserman, Matas,
//! Schaffalitzky, Kadir, Van Gool: "A Comparison of Affine Region Detectors", IJCV 65, 2005).
//!
//! A folder (`boat`, `leuven` ...) with `img1` to `img6` (`.ppm`, `.pgm` or `.png`) and `H1to2p` to `H1to6p`,
//! 3x3 each, which map pixels of the first image to the others. Pixels are counted from the centre of the first
//! one. Pairs are the first image with each other image. The source is one such folder, or a folder that
//! contains several; their pairs then become one dataset.

use std::fs;
use std::path::{Path, PathBuf};

use super::list::{self, NamedFrames};
use super::{ImportOptions, Imported, base_name};
use crate::datasets::text::{self, TextFile};
use crate::datasets::{DatasetError, Pair, Turn, read_size};

/// Images of a published series.
const IMAGES: usize = 6;

pub(super) fn read(src: &Path, _: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let name = |k: usize| format!("H1to{k}p");
    let mut series = Series::default();
    let several = if is_series(src, name) {
        Vec::new()
    } else {
        folders_with(src, name)?
    };
    for folder in &several {
        series.add(&src.join(folder), "img", name)?;
    }
    if several.is_empty() {
        series.add(src, "img", name)?;
    }
    Ok(series.finish(format!("Oxford affine, {}", base_name(src))))
}

/// Whether the folder holds a homography of a series.
pub(super) fn is_series(folder: &Path, homography: impl Fn(usize) -> String) -> bool {
    (2..=IMAGES).any(|k| folder.join(homography(k)).is_file())
}

/// The names of the folders in `src` that hold a homography of a series, sorted.
pub(super) fn folders_with(
    src: &Path,
    homography: impl Fn(usize) -> String,
) -> Result<Vec<String>, DatasetError> {
    let entries = fs::read_dir(src).map_err(|error| DatasetError::io(src, &error))?;
    let mut found: Vec<String> = entries
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| is_series(&src.join(name), &homography))
        .collect();
    found.sort();
    Ok(found)
}

/// Series of images of planes. The first image of each series is paired with its other images.
#[derive(Debug, Default)]
pub(super) struct Series {
    frames: NamedFrames,
    pairs: Vec<Pair>,
}

impl Series {
    /// Adds the series of a folder, whose images are called `prefix` and a number from 1.
    ///
    /// # Errors
    /// If the first image, an image that has a homography, or the homography of an image is missing, or if a
    /// homography is invalid.
    pub(super) fn add(
        &mut self,
        folder: &Path,
        prefix: &str,
        homography: impl Fn(usize) -> String,
    ) -> Result<(), DatasetError> {
        let image = |k: usize| {
            image(folder, &format!("{prefix}{k}")).ok_or_else(|| {
                let path = folder.join(format!("{prefix}{k}.ppm"));
                DatasetError::new(path, "the image is missing", "expected ppm, pgm or png")
            })
        };
        let first = image(1)?;
        for k in 2.. {
            let file = folder.join(homography(k));
            if file.is_file() {
                self.pair(first.clone(), image(k)?, &file)?;
                continue;
            }
            // The series ends here, unless something of this or a later image is there.
            let is_there = |k| image(k).is_ok() || folder.join(homography(k)).is_file();
            if (k..=k.max(IMAGES)).any(is_there) {
                let what = "the homography is missing, and its image or later ones are there";
                let remedy = "put it there, or take the images and homographies from here on away";
                return Err(DatasetError::new(file, what, remedy));
            }
            break;
        }
        Ok(())
    }

    /// Adds a pair with the file of its homography.
    pub(super) fn pair(
        &mut self,
        a: PathBuf,
        b: PathBuf,
        homography: &Path,
    ) -> Result<(), DatasetError> {
        let file = TextFile::read(homography)?;
        let b_from_a = text::homography(&file.numbers()?)
            .map_err(|what| file.error(what, "expected three rows of three numbers"))?;
        let (a, b) = (self.frame(a)?, self.frame(b)?);
        self.pairs.push(Pair::with_homography(a, b, b_from_a));
        Ok(())
    }

    fn frame(&mut self, image: PathBuf) -> Result<u32, DatasetError> {
        let size = read_size(&image)?;
        let camera = list::stand_in(size);
        Ok(self.frames.number(image, Turn::None, camera, None))
    }

    /// The series as they were read.
    pub(super) fn finish(self, origin: String) -> Imported {
        let mut imported = Imported::listed(origin, self.frames.into_frames(), self.pairs);
        imported.about.notes.push(list::stand_in_of_planes());
        imported
    }
}

/// The image of this name, with one of the extensions that such datasets use.
pub(super) fn image(folder: &Path, stem: &str) -> Option<PathBuf> {
    let ending = |ending| folder.join(format!("{stem}.{ending}"));
    ["ppm", "pgm", "png", "jpg"]
        .map(ending)
        .into_iter()
        .find(|path| path.is_file())
}
