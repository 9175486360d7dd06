//! `imc`: the files of a submission to the Image Matching Challenge, for each sequence
//! `keypoints.h5` with `<image>` (n x 2) and `matches.h5` with `<a>-<b>` (2 x m, indices of
//! keypoints). Images are named without ending, usually a > b. No scores; the first pixel's centre
//! is at 0.

use std::collections::BTreeSet;
use std::path::Path;

use super::names::PairName;
use super::probe::{Content, Probe};
use super::sparse::{columns, keypoints};
use super::{Contents, ExchangeError, Format, Rating, RawMatches, ReadOptions, Source, bounded};
use crate::arrays::{Array, Hdf5};

pub(super) const IMC: Format = Format {
    id: "imc",
    layout: "keypoints.h5 (<image>: n x 2) and matches.h5 (<a>-<b>: 2 x m indices)",
    pixel_center: Some(0.0),
    resized: false,
    recognises: |probe| order(probe).is_some(),
    open,
    write: None,
};

/// Numbers of the file of keypoints and the file of matches.
fn order(probe: &Probe) -> Option<[usize; 2]> {
    let Content::Hdf5(files) = &probe.content else {
        return None;
    };
    let [(_, one), (_, other)] = &files[..] else {
        return None;
    };
    let flat = |arrays: &[String]| arrays.iter().all(|array| !array.contains('/'));
    if !flat(one) || !flat(other) {
        return None;
    }
    let joins = |matches: &[String], keypoints: &[String]| {
        let keypoints: BTreeSet<_> = keypoints.iter().map(String::as_str).collect();
        (matches.first()).is_some_and(|pair| split(pair, |name| keypoints.contains(name)).is_some())
    };
    match (joins(other, one), joins(one, other)) {
        (true, _) => Some([0, 1]),
        (_, true) => Some([1, 0]),
        _ => None,
    }
}

/// Both names of a pair, which may have hyphens themselves.
fn split(pair: &str, is_image: impl Fn(&str) -> bool) -> Option<[&str; 2]> {
    (pair.match_indices('-'))
        .map(|(at, _)| [&pair[..at], &pair[at + 1..]])
        .find(|names| names.iter().all(|name| is_image(name)))
}

fn open(probe: Probe, _: &ReadOptions) -> Result<Contents, ExchangeError> {
    let order = order(&probe).expect("it was recognised");
    let Content::Hdf5(mut files) = probe.content else {
        unreachable!("only HDF5 files are recognised");
    };
    if order == [1, 0] {
        files.swap(0, 1);
    }
    let (matches, pairs) = files.pop().expect("there are two");
    let (keypoints, images) = files.pop().expect("there are two");
    Ok(Contents {
        pairs: pairs
            .iter()
            .map(|pair| PairName::Joined(pair.clone(), '-'))
            .collect(),
        source: Box::new(Imc {
            images: images.into_iter().collect(),
            keypoints,
            matches,
            pairs,
        }),
    })
}

struct Imc {
    keypoints: Hdf5,
    images: BTreeSet<String>,
    matches: Hdf5,
    pairs: Vec<String>,
}

impl Source for Imc {
    fn file(&self, _: usize) -> &Path {
        self.matches.path()
    }

    fn points_file(&self, _: usize) -> &Path {
        self.keypoints.path()
    }

    fn read(&self, index: usize) -> Result<RawMatches, ExchangeError> {
        let pair = &self.pairs[index];
        let [a, b] = split(pair, |name| self.images.contains(name)).ok_or_else(|| {
            let what = format!("it lacks the keypoints of an image of `{pair}`");
            ExchangeError::damaged(self.keypoints.path(), what)
        })?;
        let [a, b] = [
            keypoints(&self.keypoints, a)?,
            keypoints(&self.keypoints, b)?,
        ];
        indexed(&a, &b, &self.matches.array(pair)?).map_err(|what| {
            ExchangeError::damaged(self.file(index), what).at(format!("array `{pair}`"))
        })
    }
}

/// Matches as two rows of indices.
fn indexed(a: &Array, b: &Array, indices: &Array) -> Result<RawMatches, String> {
    let (columns_a, columns_b) = (columns(a)?, columns(b)?);
    let counts = [a.len() / columns_a, b.len() / columns_b];
    let count = match indices.shape() {
        [2, count] => *count,
        _ if indices.len() == 0 => 0,
        shape => return Err(format!("its shape is {shape:?}, not [2, n]")),
    };
    let index = |place: usize, end: usize| {
        indices
            .index(place, end)?
            .ok_or_else(|| format!("entry {place} is -1"))
    };
    let mut raw = RawMatches {
        a: Vec::new(),
        b: Vec::new(),
        turns: None,
        growths: None,
        rating: Rating::None,
        element: a.element(),
        keypoints: Some(counts),
    };
    for i in 0..bounded(count)? {
        raw.a.push(a.point(index(i, counts[0])?, columns_a));
        raw.b.push(b.point(index(count + i, counts[1])?, columns_b));
    }
    Ok(raw)
}
