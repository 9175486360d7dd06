//! Import and export of matches: from files of other tools, and to their formats.
//!
//! [`MatchFiles::open`] recognises a format by its content and understands a dataset's pairs in it;
//! [`MatchFiles::matches`] gives those of a pair as the native matchers do: pixels of the original
//! image, the centre of the first pixel at (0, 0), and an ambiguity from 0 (certain) to 1. One file
//! here is one format; [`FORMATS`] lists them, and the tests walk that list.
//!
//! Some formats fix where the centre of the first pixel is (0 or 0.5); for the others the user says it. For
//! matches of resized images the user also says their size. Both are undone by `x = (x_file - centre + 0.5)
//! * width / resized_width - 0.5`.
//!
//! Scores, where a format has them, are better the higher they are. If all scores of a file lie in 0..1,
//! the ambiguity is 1 - score; otherwise it is (1 - s / (1 + |s|)) / 2, which falls strictly from 1 to 0 as
//! s grows. Without scores all matches have ambiguity 0, and estimators that sort by it take them in the
//! order of the file.

#[cfg(test)]
mod center_tests;
#[cfg(test)]
mod changed_tests;
mod colmap;
mod error;
mod export;
mod found;
mod glue_factory;
mod hloc;
mod imc;
mod names;
#[cfg(test)]
mod naming_tests;
mod npz;
mod options;
mod packed;
mod probe;
mod rating;
mod read;
mod recognise;
mod source;
mod sparse;
mod superglue;
#[cfg(test)]
mod tests;
mod text;
mod understood;

use std::path::{Path, PathBuf};

use crate::arrays::Element;
use crate::config::{self, UnknownName};
use crate::matchers::MAX_MATCHES;

pub use error::ExchangeError;
pub use export::{Export, Model, PairExport, Seen, TwoView, check_dataset};
pub use names::NamedBy;
pub(crate) use options::CENTERS;
pub use options::ReadOptions;
pub use read::{FileMatches, MatchFiles, Survey};
pub use source::{MatchSource, is_of_absent_pairs};
pub use understood::{FileRead, Scores, Understood};

use names::PairName;
use probe::Probe;
use rating::Rating;

/// A format that matches are read from, and perhaps written in.
pub struct Format {
    /// What it is called on the command line.
    pub id: &'static str,
    /// The files and what is in them, in one line.
    pub layout: &'static str,
    /// Where its convention puts the centre of the first pixel; `None` where it has none, so that
    /// the user must say.
    pub pixel_center: Option<f64>,
    /// Whether its points are those of resized images, whose size the user must say.
    pub resized: bool,
    recognises: fn(&Probe) -> bool,
    open: fn(Probe, &ReadOptions) -> Result<Contents, ExchangeError>,
    write: Option<Writer>,
}

/// Writes matches into a folder and names the files.
type Writer = fn(&Path, &Export<'_>) -> Result<Vec<PathBuf>, ExchangeError>;

impl std::fmt::Debug for Format {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.id)
    }
}

/// All formats.
pub const FORMATS: &[&Format] = &[
    &npz::NPZ,
    &packed::PACKED,
    &text::TEXT,
    &hloc::HLOC,
    &glue_factory::GLUE_FACTORY,
    &colmap::COLMAP,
    &superglue::SUPERGLUE,
    &imc::IMC,
];

impl Format {
    /// The format called `id`.
    ///
    /// # Errors
    /// If there is none; the error names the nearest, and all.
    pub fn find(id: &str) -> Result<&'static Self, UnknownName> {
        config::find("format", FORMATS, |format| format.id, id)
    }

    /// The formats that matches can be written in.
    pub fn written() -> impl Iterator<Item = &'static Self> {
        FORMATS.iter().copied().filter(|format| format.can_write())
    }

    /// Whether matches can be written in it.
    pub fn can_write(&self) -> bool {
        self.write.is_some()
    }

    /// Whether it names images when it is written, and does not number frames. Names start from
    /// [`Export::image_root`].
    pub fn names_images(&self) -> bool {
        ![npz::NPZ.id, packed::PACKED.id].contains(&self.id)
    }

    /// Writes `export` into `folder` and returns the files.
    ///
    /// # Errors
    /// If it is a format that is only read, or a file cannot be written.
    pub fn write(&self, folder: &Path, export: &Export<'_>) -> Result<Vec<PathBuf>, ExchangeError> {
        if let Some(write) = self.write {
            write(folder, export)
        } else {
            let others: Vec<_> = Self::written().map(|format| format.id).collect();
            Err(ExchangeError::new(
                folder,
                format!("`{}` is only read", self.id),
                format!("choose one of {}", others.join(", ")),
            ))
        }
    }
}

/// What a format found in its files.
struct Contents {
    /// What the file calls its pairs.
    pairs: Vec<PairName>,
    source: Box<dyn Source>,
}

/// Where the matches of a pair are read from.
trait Source: Send + Sync {
    /// The file that pair number `index` of [`Contents::pairs`] stands in.
    fn file(&self, index: usize) -> &Path;

    /// The file that the positions of its points stand in, where that is another.
    fn points_file(&self, index: usize) -> &Path {
        self.file(index)
    }

    /// Its matches.
    fn read(&self, index: usize) -> Result<RawMatches, ExchangeError>;
}

/// The number of matches of a pair, if that many are read: a small file that is compressed can promise any number, so it
/// is asked before there is memory for them.
///
/// # Errors
/// If it is more than [`MAX_MATCHES`].
fn bounded(matches: usize) -> Result<usize, String> {
    if matches > MAX_MATCHES {
        return Err(format!("{matches} matches; {MAX_MATCHES} are the most"));
    }
    Ok(matches)
}

/// Matches of a pair as they are in the file.
#[derive(Debug)]
struct RawMatches {
    /// Points in image a.
    a: Vec<[f64; 2]>,
    /// Points in image b.
    b: Vec<[f64; 2]>,
    /// By how much each keypoint of b is turned against that of a, in radians, where the format knows it of all.
    turns: Option<Vec<f32>>,
    /// The logarithm of how many times as large each keypoint of b is as that of a, where the format knows it of all.
    growths: Option<Vec<f32>>,
    rating: Rating,
    /// How coordinates are stored, which says how far they were rounded.
    element: Element,
    /// Numbers of keypoints of both images, where the format knows them.
    keypoints: Option<[usize; 2]>,
}
