//! `imc`: the files of a submission to the Image Matching Challenge, for each sequence
//! `keypoints.h5` with `<image>` (n x 2) and `matches.h5` with `<a>-<b>` (2 x m, indices of
//! keypoints). Images are named without ending, usually a > b. No scores; the first pixel's centre
//! is at 0.

use std::collections::BTreeSet;
use std::path::Path;

use super::names::{PairName, only, splits};
use super::probe::{Content, Probe};
use super::sparse::{certain, columns, keypoints};
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
        let is_known = |names: [&str; 2]| names.iter().all(|name| keypoints.contains(*name));
        (matches.first()).is_some_and(|pair| splits(pair, '-').any(is_known))
    };
    match (joins(other, one), joins(one, other)) {
        (true, _) => Some([0, 1]),
        (_, true) => Some([1, 0]),
        _ => None,
    }
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
    let source = Imc {
        images: images.into_iter().collect(),
        keypoints,
        matches,
        pairs,
    };
    let name = |pair: &String| match only(source.of_pair(pair)) {
        Some([a, b]) => PairName::Two(a.into(), b.into()),
        None => PairName::Joined(pair.clone(), '-'),
    };
    Ok(Contents {
        pairs: source.pairs.iter().map(name).collect(),
        source: Box::new(source),
    })
}

struct Imc {
    keypoints: Hdf5,
    images: BTreeSet<String>,
    matches: Hdf5,
    pairs: Vec<String>,
}

impl Imc {
    /// Both images of a pair, however its name can be split: names may have hyphens themselves.
    fn of_pair(&self, pair: &str) -> impl Iterator<Item = [&str; 2]> {
        let image = |name: &str| self.images.get(name).map(String::as_str);
        splits(pair, '-').filter_map(move |[a, b]| Some([image(a)?, image(b)?]))
    }
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
        let [a, b] = certain(pair, self.of_pair(pair), &self.keypoints)?;
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
