//! `npz`: a folder of `<a>_<b>.npz`, one for each pair, with the arrays `a` and `b` (n x 2, x and
//! y) and perhaps `score` (n, higher is better). What anybody writes in three lines of Python:
//! `numpy.savez(f"{a}_{b}.npz", a=points_a, b=points_b, score=score)`.
//!
//! The names that other tools give these arrays are understood too:
//!
//! | points | scores | who |
//! | --- | --- | --- |
//! | `a`, `b` | `score` | we |
//! | `mkpts0`, `mkpts1` | `mconf` | LoFTR and its successors |
//! | `matched_kpts0`, `matched_kpts1` | | vismatch |
//! | `keypoints0`, `keypoints1` | `scores` or `confidence` | dense matches of hloc, Kornia |
//!
//! The last names are also those of the keypoints of two images, of which other arrays say which belong together.
//! So the file must have no other arrays (but Kornia's `batch_indexes`), and as many of the one as of the other.
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
    layout: "a folder of <a>_<b>.npz with a, b (n x 2) and perhaps score (n, higher is better); or with mkpts0, \
             mkpts1 (mconf), matched_kpts0, matched_kpts1, or keypoints0, keypoints1 row by row (scores, confidence)",
    pixel_center: None,
    resized: false,
    recognises,
    open,
    write: Some(write),
};

/// Bytes of a point, at most.
const POINT: usize = 2 * size_of::<f64>();

/// What a tool calls the arrays of a file.
struct Names {
    points: [&'static str; 2],
    /// Of these, a file has one at most.
    scores: &'static [&'static str],
    /// The other arrays that a file may have; any where it is `None`.
    others: Option<&'static [&'static str]>,
}

/// The names that are understood; the first that fit a file are taken.
const NAMES: [Names; 4] = [
    Names {
        points: ["a", "b"],
        scores: &["score"],
        others: None,
    },
    Names {
        points: ["mkpts0", "mkpts1"],
        scores: &["mconf"],
        others: None,
    },
    Names {
        points: ["matched_kpts0", "matched_kpts1"],
        scores: &[],
        others: None,
    },
    Names {
        points: ["keypoints0", "keypoints1"],
        scores: &["scores", "confidence"],
        others: Some(&["batch_indexes"]),
    },
];

/// What the arrays of a file that has these are called.
fn names_in(arrays: &[String]) -> Option<&'static Names> {
    let has = |name: &&str| arrays.iter().any(|array| array == name);
    NAMES.iter().find(|names| {
        let may_have = |array: &str| {
            let known = [&names.points[..], names.scores].concat();
            (names.others).is_none_or(|others| known.contains(&array) || others.contains(&array))
        };
        names.points.iter().all(has)
            && names.scores.iter().filter(|name| has(name)).count() < 2
            && arrays.iter().all(|array| may_have(array))
    })
}

fn recognises(probe: &Probe) -> bool {
    matches!(&probe.content, Content::Npz(arrays) if names_in(arrays).is_some())
}

fn open(probe: Probe, _: &ReadOptions) -> Result<Contents, ExchangeError> {
    Ok(Contents {
        pairs: (probe.files.iter())
            .map(|path| PairName::of_file(path))
            .collect(),
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
        let names = names_in(&file.names()).unwrap_or(&NAMES[0]);
        let [a, b] = names.points.map(|name| file.array(name));
        // Which image of a batch each row is of: a file is of one pair.
        if let Some(batch) = file.find("batch_indexes")?
            && (1..batch.len()).any(|row| batch.get(row) != batch.get(0))
        {
            let what = "its `batch_indexes` are of several pairs; write a file for each pair";
            return Err(ExchangeError::damaged(path, what.to_owned()));
        }
        let mut score = None;
        for name in names.scores {
            score = score.or(file.find(name)?);
        }
        matches(names.points, [&a?, &b?], score.as_ref())
            .map_err(|what| ExchangeError::damaged(path, what))
    }
}

fn matches(
    names: [&str; 2],
    [a, b]: [&Array; 2],
    score: Option<&Array>,
) -> Result<RawMatches, String> {
    let rows = |array: &Array, name: &str| {
        let rows = array.rows(2);
        rows.map_err(|what| format!("array `{name}`: {what}"))
    };
    let (count, count_b) = (rows(a, names[0])?, rows(b, names[1])?);
    if count != count_b {
        return Err(format!(
            "{} in `{}`, {count_b} in `{}`, where a row of one matches the same row of the other",
            counted(count, "point"),
            names[0],
            names[1]
        ));
    }
    bounded(count)?;
    let rating = score.map_or(Ok(Rating::None), |score| Rating::of_scores(score, count))?;
    Ok(RawMatches {
        a: (0..count).map(|row| a.point(row, 2)).collect(),
        b: (0..count).map(|row| b.point(row, 2)).collect(),
        turns: None,
        growths: None,
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

#[cfg(test)]
mod tests {
    use super::*;

    /// What is read of a file with these arrays of so many points or scores, if it is recognised.
    fn read(sides: &[(&str, &[usize])]) -> Option<Result<RawMatches, String>> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("0_1.npz");
        let arrays: Vec<_> = (sides.iter())
            .map(|&(name, shape)| {
                let numbers = (0..shape.iter().product()).map(|number| number as f32);
                (
                    name,
                    shape,
                    "<f4",
                    numbers.flat_map(f32::to_le_bytes).collect(),
                )
            })
            .collect();
        std::fs::write(&path, arrays::npz(&arrays)).expect("writable");
        let probe = Probe::new(std::slice::from_ref(&path), "room").expect("an archive");
        let files = vec![path];
        recognises(&probe).then(|| Npz { files }.read(0).map_err(|error| error.to_string()))
    }

    #[test]
    fn usual_names_of_points_and_scores_are_understood() {
        let with = |arrays: &[(&str, &[usize])]| {
            let found = read(arrays)?.expect("sound");
            assert_eq!(
                (found.a[1], found.b[2]),
                ([2.0, 3.0], [4.0, 5.0]),
                "{arrays:?}"
            );
            Some(matches!(found.rating, Rating::Score(scores) if scores == [0.0, 1.0, 2.0]))
        };
        for ([a, b], score) in [
            (["a", "b"], "score"),
            (["mkpts0", "mkpts1"], "mconf"),
            (["keypoints0", "keypoints1"], "scores"),
            (["keypoints0", "keypoints1"], "confidence"),
        ] {
            let mut arrays = vec![(a, &[3, 2][..]), (b, &[3, 2]), (score, &[3])];
            assert_eq!(with(&arrays), Some(true), "{arrays:?}");
            arrays.truncate(2);
            assert_eq!(with(&arrays), Some(false), "{arrays:?}");
        }
        // Our own names, and those of matches before those of keypoints.
        let many = ["keypoints0", "keypoints1", "matched_kpts0", "matched_kpts1"];
        let shapes = [&[9, 2][..], &[8, 2], &[3, 2], &[3, 2]];
        let arrays: Vec<_> = many.into_iter().zip(shapes).collect();
        assert_eq!(with(&arrays), Some(false));
    }

    #[test]
    fn keypoints_of_which_other_arrays_say_how_they_match_are_not_taken_row_by_row() {
        let [a, b] = ["keypoints0", "keypoints1"].map(|name| (name, &[3, 2][..]));
        for other in ["matches0", "matches", "descriptors0", "scores0"] {
            assert!(read(&[a, b, (other, &[3])]).is_none(), "{other}");
        }
        let batch = |count| read(&[a, b, ("batch_indexes", &[count])]).expect("the names");
        assert!(batch(1).is_ok());
        let error = batch(3).expect_err("rows of three pairs");
        assert!(error.contains("of several pairs"), "{error}");
        assert!(read(&[a, b, ("scores", &[3]), ("confidence", &[3])]).is_none());
        let error = read(&[a, ("keypoints1", &[4, 2])])
            .expect("the names")
            .unwrap_err();
        assert!(
            error.contains("3 points in `keypoints0`, 4 in `keypoints1`, where a row"),
            "{error}"
        );
    }
}
