//! `superglue`: what SuperGlue's `match_pairs.py` writes, `<stemA>_<stemB>_matches.npz` for each
//! pair: `keypoints0`, `keypoints1` (n x 2), `matches` (-1 = none), `match_confidence`.
//!
//! With `--eval` it writes `<stemA>_<stemB>_evaluation.npz` beside each, and pictures; these are passed over.
//!
//! Points are pixels of the images that the network saw, 640 x 480 unless told otherwise, without
//! keeping the aspect; the file does not say. The first pixel's centre is at 0.

use std::path::{Path, PathBuf};

use super::names::PairName;
use super::probe::{Content, Probe, pair_of_matches};
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
        let Some(pair) = pair_of_matches(path) else {
            let what = "its name does not end in `_matches.npz`, after the names of two images";
            return Err(ExchangeError::new(path, what, "call it as SuperGlue does"));
        };
        pairs.push(PairName::Joined(pair, '_'));
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

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::tests::dataset;
    use super::super::{MatchFiles, ReadOptions};

    #[test]
    fn evaluations_and_pictures_beside_matches_are_passed_over() {
        let (folder, sequence) = dataset();
        let dump = folder.path().join("superglue");
        let options = ReadOptions {
            resized: Some([200, 200]),
            ..ReadOptions::default()
        };
        let open = || MatchFiles::open(std::slice::from_ref(&dump), &sequence, &options);
        let alone = open().expect("matches");
        assert!(!alone.understood().to_string().contains("passed over"));
        fs::create_dir(dump.join("logs")).expect("writable");
        // By name, an evaluation would be the first file.
        for name in ["a_b_evaluation.npz", "a_b_matches.png", "log.txt"] {
            fs::write(dump.join(name), "no matches").expect("writable");
        }
        let beside = open().expect("matches");
        assert_eq!(beside.survey(), alone.survey());
        assert_eq!(beside.understood().files, alone.understood().files);
        let said = beside.understood().to_string();
        assert!(
            said.contains("; passed over: 3 other files; frames"),
            "{said}"
        );
        assert_eq!(beside.matches(0, 1), alone.matches(0, 1));
    }
}
