//! `packed`: one `.npz` for all pairs: `pairs` (P x 2, numbers of frames), `offsets` (P + 1, where
//! the matches of each pair begin, and the end of the last) and `xy` (M x 5: x and y in a, x and y
//! in b, ambiguity from 0, certain, to 1). Pixels of the original image, the first pixel's centre
//! at 0. Ours: compact, and written by numpy alone.

use std::path::{Path, PathBuf};

use super::names::PairName;
use super::probe::{Content, Probe};
use super::{
    Contents, ExchangeError, Export, Format, Rating, RawMatches, ReadOptions, Source, bounded,
};
use crate::arrays::{Array, Npz, npz};
use crate::counted::counted;
use crate::files::write_new;

pub(super) const PACKED: Format = Format {
    id: "packed",
    layout: "one .npz with pairs (P x 2), offsets (P + 1), xy (M x 5: x_a y_a x_b y_b ambiguity)",
    pixel_center: Some(0.0),
    resized: false,
    recognises,
    open,
    write: Some(write),
};

/// Name of the file that is written.
const FILE: &str = "matches.npz";

fn recognises(probe: &Probe) -> bool {
    let Content::Npz(names) = &probe.content else {
        return false;
    };
    (["pairs", "offsets", "xy"].iter()).all(|name| names.iter().any(|known| known == name))
}

fn open(probe: Probe, _: &ReadOptions) -> Result<Contents, ExchangeError> {
    let [path] = &probe.files[..] else {
        let what = format!(
            "{} where there is to be one",
            counted(probe.files.len(), "file")
        );
        return Err(ExchangeError::new(&probe.files[0], what, "name one file"));
    };
    let mut file = Npz::open(path)?;
    let (pairs, offsets, xy) = (
        file.array("pairs")?,
        file.array("offsets")?,
        file.array("xy")?,
    );
    let damaged = |what: String| ExchangeError::damaged(path, what);
    let pairs = frames(&pairs).map_err(|what| damaged(what).at("array `pairs`"))?;
    let rows = xy.rows(5).map_err(|what| damaged(what).at("array `xy`"))?;
    let offsets =
        bounds(&offsets, pairs.len(), rows).map_err(|what| damaged(what).at("array `offsets`"))?;
    Ok(Contents {
        pairs,
        source: Box::new(Packed {
            path: path.clone(),
            offsets,
            xy,
        }),
    })
}

struct Packed {
    path: PathBuf,
    /// One more than there are pairs, ascending from 0 to the number of rows.
    offsets: Vec<usize>,
    xy: Array,
}

impl Source for Packed {
    fn file(&self, _: usize) -> &Path {
        &self.path
    }

    fn read(&self, index: usize) -> Result<RawMatches, ExchangeError> {
        let rows = self.offsets[index]..self.offsets[index + 1];
        bounded(rows.len()).map_err(|what| ExchangeError::damaged(&self.path, what))?;
        let point = |row: usize, column: usize| {
            [
                self.xy.get(5 * row + column),
                self.xy.get(5 * row + column + 1),
            ]
        };
        let ambiguity = rows.clone().map(|row| self.xy.get(5 * row + 4));
        Ok(RawMatches {
            a: rows.clone().map(|row| point(row, 0)).collect(),
            b: rows.clone().map(|row| point(row, 2)).collect(),
            turns: None,
            growths: None,
            rating: Rating::Ambiguity(ambiguity.collect()),
            element: self.xy.element(),
            keypoints: None,
        })
    }
}

/// The most pairs of a file, whose names need many times its bytes if it is compressed.
const MAX_PAIRS: usize = 10_000_000;

fn frames(pairs: &Array) -> Result<Vec<PairName>, String> {
    let frame = |index: usize| {
        let number = pairs.index(index, u32::MAX as usize)?;
        number
            .map(|number| number as u32)
            .ok_or_else(|| format!("entry {index} is -1"))
    };
    let count = pairs.rows(2)?;
    if count > MAX_PAIRS {
        return Err(format!("{count} pairs; {MAX_PAIRS} are the most"));
    }
    (0..count)
        .map(|row| Ok(PairName::Frames(frame(2 * row)?, frame(2 * row + 1)?)))
        .collect()
}

fn bounds(offsets: &Array, pairs: usize, rows: usize) -> Result<Vec<usize>, String> {
    let length = offsets.length()?;
    if length != pairs + 1 {
        return Err(format!(
            "{} for {}, needed {}",
            counted(length, "number"),
            counted(pairs, "pair"),
            pairs + 1
        ));
    }
    let mut before = 0;
    let bounds: Vec<usize> = (0..length)
        .map(|index| match offsets.index(index, rows + 1)? {
            Some(offset) if offset >= before => {
                before = offset;
                Ok(offset)
            }
            _ => Err(format!("entry {index} is smaller than the one before")),
        })
        .collect::<Result<_, String>>()?;
    if (bounds[0], before) != (0, rows) {
        return Err(format!(
            "they go from {} to {before}, not from 0 to {rows}: some rows of `xy` belong to no pair",
            bounds[0]
        ));
    }
    Ok(bounds)
}

/// Coordinates and ambiguities are float32, as they are here.
fn write(folder: &Path, export: &Export<'_>) -> Result<Vec<PathBuf>, ExchangeError> {
    let (mut frames, mut offsets, mut xy) = (Vec::new(), vec![0_i64], Vec::new());
    for pair in &export.pairs {
        frames.extend([pair.frames.0, pair.frames.1]);
        let [a, b] = pair.coordinates();
        let places = a.chunks_exact(2).zip(b.chunks_exact(2));
        for ((a, b), ambiguity) in places.zip(pair.ambiguities()) {
            xy.extend([a[0], a[1], b[0], b[1], ambiguity]);
        }
        offsets.push((xy.len() / 5) as i64);
    }
    let bytes = npz(&[
        (
            "pairs",
            &[export.pairs.len(), 2],
            "<u4",
            frames.iter().flat_map(|n| n.to_le_bytes()).collect(),
        ),
        (
            "offsets",
            &[offsets.len()],
            "<i8",
            offsets.iter().flat_map(|n| n.to_le_bytes()).collect(),
        ),
        (
            "xy",
            &[xy.len() / 5, 5],
            "<f4",
            xy.iter().flat_map(|x| x.to_le_bytes()).collect(),
        ),
    ]);
    let path = folder.join(FILE);
    write_new(&path, &bytes).map_err(|error| ExchangeError::unwritable(&path, error))?;
    Ok(vec![path])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arrays::Element;

    #[test]
    fn offsets_that_leave_rows_out_are_refused() {
        let bounds_of = |offsets: [i64; 3]| {
            let bytes = offsets.iter().flat_map(|n| n.to_le_bytes()).collect();
            let element = Element::of_numpy("<i8").expect("numpy has it");
            let array = Array::new(vec![3], element, bytes).expect("as many bytes");
            bounds(&array, 2, 9)
        };
        assert_eq!(bounds_of([0, 4, 9]), Ok(vec![0, 4, 9]));
        assert_eq!(bounds_of([0, 0, 9]), Ok(vec![0, 0, 9]));
        for (offsets, what) in [
            ([1, 4, 9], "from 1 to 9, not from 0 to 9"),
            ([0, 4, 8], "from 0 to 8, not from 0 to 9"),
            ([0, 5, 4], "entry 2 is smaller"),
        ] {
            let error = bounds_of(offsets).unwrap_err();
            assert!(error.contains(what), "{error}");
        }
        assert!(bounds_of([0, 4, 10]).is_err() && bounds_of([-1, 4, 9]).is_err());
    }
}
