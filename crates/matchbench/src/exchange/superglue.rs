//! `superglue`: what SuperGlue's `match_pairs.py` writes, `<stemA>_<stemB>_matches.npz` for each
//! pair: `keypoints0`, `keypoints1` (n x 2), `matches` (-1 = none), `match_confidence`.
//!
//! Points are pixels of the images that the network saw, 640 x 480 unless told otherwise, without
//! keeping the aspect; the file does not say. The first pixel's centre is at 0.

use std::path::{Path, PathBuf};

use super::names::PairName;
use super::probe::{Content, Probe};
use super::sparse::matched;
use super::{Contents, ExchangeError, Format, RawMatches, ReadOptions, Source};
use crate::arrays::Npz;

pub(super) const SUPERGLUE: Format = Format {
    id: "superglue",
    layout: "a folder of <stemA>_<stemB>_matches.npz with keypoints0, keypoints1, matches, \
             match_confidence; needs the size of the resized images",
    pixel_center: Some(0.0),
    resized: true,
    recognises,
    open,
    write: None,
};

fn recognises(probe: &Probe) -> bool {
    let Content::Npz(names) = &probe.content else {
        return false;
    };
    (["keypoints0", "keypoints1", "matches"].iter())
        .all(|name| names.iter().any(|known| known == name))
}

fn open(probe: Probe, _: &ReadOptions) -> Result<Contents, ExchangeError> {
    let mut pairs = Vec::new();
    for path in &probe.files {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let Some(pair) = stem.strip_suffix("_matches") else {
            let what = "its name does not end in `_matches.npz`";
            return Err(ExchangeError::new(path, what, "move other files elsewhere"));
        };
        pairs.push(PairName::Joined(pair.to_owned(), '_'));
    }
    Ok(Contents {
        pairs,
        source: Box::new(SuperGlue { files: probe.files }),
    })
}

struct SuperGlue {
    files: Vec<PathBuf>,
}

impl Source for SuperGlue {
    fn file(&self, index: usize) -> &Path {
        &self.files[index]
    }

    fn read(&self, index: usize) -> Result<RawMatches, ExchangeError> {
        let path = &self.files[index];
        let mut file = Npz::open(path)?;
        let [a, b, matches] = ["keypoints0", "keypoints1", "matches"].map(|name| file.array(name));
        let confidence = file.find("match_confidence")?;
        matched(&a?, &b?, &matches?, confidence.as_ref())
            .map_err(|what| ExchangeError::damaged(path, what))
    }
}
