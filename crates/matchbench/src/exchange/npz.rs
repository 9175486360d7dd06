//! `npz`: a folder of `<a>_<b>.npz`, one for each pair, with the arrays `a` and `b` (n x 2, x and
//! y) and perhaps `score` (n, higher is better). What anybody writes in three lines of Python:
//! `numpy.savez(f"{a}_{b}.npz", a=points_a, b=points_b, score=score)`.
//!
//! It says nothing about the centre of the first pixel.

use std::path::{Path, PathBuf};

use super::names::PairName;
use super::probe::{Content, Probe};
use super::{
    Contents, ExchangeError, Export, Format, Rating, RawMatches, ReadOptions, Source, bounded,
};
use crate::arrays::{self, Array};
use crate::counted::counted;
use crate::files::write_new;
use crate::matchers::MAX_MATCHES;

pub(super) const NPZ: Format = Format {
    id: "npz",
    layout: "a folder of <a>_<b>.npz with a, b (n x 2) and perhaps score (n, higher is better)",
    pixel_center: None,
    resized: false,
    recognises,
    open,
    write: Some(write),
};

/// Bytes of a point, at most.
const POINT: usize = 2 * size_of::<f64>();

fn recognises(probe: &Probe) -> bool {
    let has = |names: &[String], name: &str| names.iter().any(|known| known == name);
    matches!(&probe.content, Content::Npz(names) if has(names, "a") && has(names, "b"))
}

fn open(probe: Probe, _: &ReadOptions) -> Result<Contents, ExchangeError> {
    let pairs = (probe.files.iter())
        .map(|path| {
            let stem = path.file_stem().unwrap_or_default();
            PairName::Joined(stem.to_string_lossy().into_owned(), '_')
        })
        .collect();
    Ok(Contents {
        pairs,
        source: Box::new(Npz { files: probe.files }),
    })
}

struct Npz {
    files: Vec<PathBuf>,
}

impl Source for Npz {
    fn file(&self, index: usize) -> &Path {
        &self.files[index]
    }

    fn read(&self, index: usize) -> Result<RawMatches, ExchangeError> {
        let path = &self.files[index];
        let mut file = arrays::Npz::open(path)?.with_arrays_of(MAX_MATCHES * POINT);
        let (a, b, score) = (file.array("a")?, file.array("b")?, file.find("score")?);
        matches(&a, &b, score.as_ref()).map_err(|what| ExchangeError::damaged(path, what))
    }
}

fn matches(a: &Array, b: &Array, score: Option<&Array>) -> Result<RawMatches, String> {
    let count = a.rows(2).map_err(|what| format!("array `a`: {what}"))?;
    let count_b = b.rows(2).map_err(|what| format!("array `b`: {what}"))?;
    if count != count_b {
        return Err(format!(
            "{} in `a`, {count_b} in `b`",
            counted(count, "point")
        ));
    }
    bounded(count)?;
    let rating = score.map_or(Ok(Rating::None), |score| Rating::of_scores(score, count))?;
    Ok(RawMatches {
        a: (0..count).map(|row| a.point(row, 2)).collect(),
        b: (0..count).map(|row| b.point(row, 2)).collect(),
        turns: None,
        rating,
        element: a.element(),
        keypoints: None,
    })
}

/// Frames are named by number. Coordinates are float32; scores are 1 - ambiguity as float64, which
/// is exact. The first pixel's centre is at 0.
fn write(folder: &Path, export: &Export<'_>) -> Result<Vec<PathBuf>, ExchangeError> {
    let mut files = Vec::new();
    for pair in &export.pairs {
        let count = pair.points.len();
        let [a, b] = (pair.coordinates())
            .map(|coordinates| coordinates.into_iter().flat_map(f32::to_le_bytes).collect());
        let score = pair.scores().flat_map(f64::to_le_bytes).collect();
        let bytes = arrays::npz(&[
            ("a", &[count, 2], "<f4", a),
            ("b", &[count, 2], "<f4", b),
            ("score", &[count], "<f8", score),
        ]);
        let (a, b) = pair.frames;
        let path = folder.join(format!("{a}_{b}.npz"));
        write_new(&path, &bytes).map_err(|error| ExchangeError::unwritable(&path, error))?;
        files.push(path);
    }
    Ok(files)
}
