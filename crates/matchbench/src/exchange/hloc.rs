//! `hloc`: the files of the Hierarchical-Localization toolbox.
//!
//! | file | arrays |
//! | --- | --- |
//! | `features.h5` | `<image>/keypoints` n x 2 (float16 unless told otherwise) |
//! | `matches.h5`, sparse | `<a>/<b>/matches0` (-1 = none), `matching_scores0` |
//! | `matches.h5`, dense | `<a>/<b>/keypoints0`, `keypoints1` m x 2, `scores` |
//!
//! `pairs.list`, which is written beside them, has the names of the images of each pair, `a b` in a line: the list of pairs
//! that hloc's programs ask for. It does not end in `.txt`, so it is not taken for matches.
//!
//! In names of pairs `-` stands for the `/` of image names; older versions write `<a>_<b>`. A pair
//! may be there in either order. Where a file of features is given, sparse matches are read, since
//! that is what hloc's own mapper reads; without one, dense matches. The first pixel's centre is at
//! 0; hloc adds 0.5 when it hands keypoints to COLMAP.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::export::numbered;
use super::names::{PairName, only, splits};
use super::probe::{Content, Probe};
use super::sparse::{certain, keypoints, matched, row_by_row};
use super::{Contents, ExchangeError, Export, Format, RawMatches, ReadOptions, Source};
use crate::arrays::{Hdf5, Hdf5Out};
use crate::files::write_new;

pub(super) const HLOC: Format = Format {
    id: "hloc",
    layout: "features.h5 (<image>/keypoints) and matches.h5 (<a>/<b>/matches0), or matches.h5 with \
             <a>/<b>/keypoints0 and keypoints1",
    pixel_center: Some(0.0),
    resized: false,
    recognises,
    open,
    write: Some(write),
};

fn recognises(probe: &Probe) -> bool {
    let Content::Hdf5(files) = &probe.content else {
        return false;
    };
    match &files[..] {
        [(_, arrays)] => {
            let of_features = ["keypoint_scores0", "descriptors0"];
            has(arrays, "keypoints0")
                && !has_numbers(arrays)
                && !of_features.iter().any(|name| has(arrays, name))
        }
        [(_, one), (_, other)] => {
            has(one, "keypoints") && has(other, "matches0")
                || has(other, "keypoints") && has(one, "matches0")
        }
        _ => false,
    }
}

/// What an HDF5 file lacks that has half of what hloc writes: its matches or its features alone.
pub(super) fn lacks(arrays: &[String]) -> Option<&'static str> {
    let any = |names: [&str; 2]| names.iter().any(|name| has(arrays, name));
    if has(arrays, "matches0") && !any(["keypoints0", "matches1"]) {
        Some("it has hloc's matches, which are numbers of keypoints, and no keypoints")
    } else if has(arrays, "keypoints") && !any(["matches0", "keypoints0"]) {
        Some("it has hloc's keypoints, and no matches")
    } else {
        None
    }
}

/// Whether `matches0` of a file are numbers of its keypoints, as glue-factory writes them. hloc's dense files have such
/// numbers too, those of keypoints in another file, but always beside `scores` of the points, which match row by row.
pub(super) fn has_numbers(arrays: &[String]) -> bool {
    let any = |name| has(arrays, name);
    any("keypoints0") && any("matches0") && (any("matches1") || !any("scores"))
}

/// Whether a group has an array of that name.
fn has(arrays: &[String], name: &str) -> bool {
    groups(arrays, name).next().is_some()
}

/// The groups that have an array called `name`.
fn groups<'a>(arrays: &'a [String], name: &'a str) -> impl Iterator<Item = &'a str> {
    let inside = move |path: &'a String| path.strip_suffix(name)?.strip_suffix('/');
    arrays.iter().filter_map(inside)
}

fn open(probe: Probe, _: &ReadOptions) -> Result<Contents, ExchangeError> {
    let Content::Hdf5(mut files) = probe.content else {
        unreachable!("only HDF5 files are recognised");
    };
    let features = (files.iter())
        .position(|(_, arrays)| has(arrays, "keypoints"))
        .map(|index| files.remove(index));
    let Some((matches, arrays)) = files.pop() else {
        unreachable!("a file of matches was recognised");
    };
    let marker = if features.is_some() {
        "matches0"
    } else {
        "keypoints0"
    };
    let pairs: Vec<String> = groups(&arrays, marker).map(str::to_owned).collect();
    let features = features.map(|(file, arrays)| Features::new(file, &arrays));
    let names = pairs.iter().map(|pair| {
        // The groups of keypoints have the names as they are, with `/`.
        let groups = (features.as_ref()).and_then(|known| only(known.of_pair(pair)));
        match groups {
            Some([a, b]) => PairName::Two(a.into(), b.into()),
            None => PairName::Joined(pair.clone(), separator(pair)),
        }
    });
    let scores = match marker {
        "matches0" => "matching_scores0",
        _ => "scores",
    };
    let names = names.collect();
    Ok(Contents {
        pairs: names,
        source: Box::new(Hloc {
            scored: has(&arrays, scores),
            features,
            matches,
            pairs,
        }),
    })
}

/// What is between the names of a pair.
fn separator(pair: &str) -> char {
    if pair.contains('/') { '/' } else { '_' }
}

struct Hloc {
    features: Option<Features>,
    matches: Hdf5,
    /// Groups of the pairs.
    pairs: Vec<String>,
    /// Whether matches have scores.
    scored: bool,
}

/// A file of keypoints.
struct Features {
    file: Hdf5,
    /// The groups of images, by the name that stands for them in names of pairs: there `x/1.png` and `x-1.png` are one.
    groups: BTreeMap<String, Vec<String>>,
}

impl Features {
    fn new(file: Hdf5, arrays: &[String]) -> Self {
        let mut of_names = BTreeMap::<_, Vec<_>>::new();
        for group in groups(arrays, "keypoints") {
            let of_name = of_names.entry(group.replace('/', "-")).or_default();
            of_name.push(group.to_owned());
        }
        Self {
            groups: of_names,
            file,
        }
    }

    /// The groups of both images of a pair, however its name can be split, and whichever groups each part stands for; none
    /// where it is longer than two paths.
    fn of_pair(&self, pair: &str) -> impl Iterator<Item = [&str; 2]> {
        let groups = |name: &str| self.groups.get(name).map(Vec::as_slice);
        // Once, and not for each split.
        let dashed = pair.replace('/', "-");
        let both = splits(pair, separator(pair)).filter_map(move |[a, _]| {
            let [a, b] = [&dashed[..a.len()], &dashed[a.len() + 1..]];
            Some((groups(a)?, groups(b)?))
        });
        both.flat_map(|(of_a, of_b)| {
            (of_a.iter()).flat_map(|a| of_b.iter().map(move |b| [&**a, &**b]))
        })
    }
}

impl Source for Hloc {
    fn file(&self, _: usize) -> &Path {
        self.matches.path()
    }

    fn points_file(&self, _: usize) -> &Path {
        let features = self.features.as_ref().map(|features| &features.file);
        features.unwrap_or(&self.matches).path()
    }

    fn read(&self, index: usize) -> Result<RawMatches, ExchangeError> {
        let pair = &self.pairs[index];
        let array = |name: &str| self.matches.array(&format!("{pair}/{name}"));
        let scores = |name| self.scored.then(|| array(name)).transpose();
        let matches = match &self.features {
            None => row_by_row(
                &array("keypoints0")?,
                &array("keypoints1")?,
                scores("scores")?.as_ref(),
            ),
            Some(features) => {
                let [a, b] = certain(pair, features.of_pair(pair), &features.file)?;
                let keypoints = |image| keypoints(&features.file, &format!("{image}/keypoints"));
                matched(
                    &keypoints(a)?,
                    &keypoints(b)?,
                    &array("matches0")?,
                    scores("matching_scores0")?.as_ref(),
                )
            }
        };
        matches.map_err(|what| {
            ExchangeError::damaged(self.file(index), what).at(format!("group `{pair}`"))
        })
    }
}

/// Coordinates are float32 rather than hloc's float16, which rounds to 1 or 2 pixels in large
/// images; scores are 1 - ambiguity as float64, which is exact.
fn write(folder: &Path, export: &Export<'_>) -> Result<Vec<PathBuf>, ExchangeError> {
    let names = export.distinct_names(|name| name.replace('/', "-"))?;
    for pair in &export.pairs {
        for frame in [pair.frames.0, pair.frames.1].map(|frame| frame as usize) {
            if names[frame].contains(char::is_whitespace) {
                return Err(ExchangeError::new(
                    &*export.sequence.frames[frame].image,
                    "the name of the image has a space or a line break, which hloc's list of pairs cannot say",
                    "rename the image or its folder, or export in another format",
                ));
            }
        }
    }
    let numbered = numbered(export);
    let mut features = Hdf5Out::default();
    for (frame, keypoints) in numbered.keypoints.iter().enumerate() {
        let coordinates: Vec<f32> = keypoints.iter().flat_map(|p| [p.x, p.y]).collect();
        let size = export.sizes[frame];
        let group = &names[frame];
        features.floats(
            format!("{group}/keypoints"),
            &[keypoints.len(), 2],
            &coordinates,
        );
        let size = [size.width as i32, size.height as i32];
        features.integers(format!("{group}/image_size"), &[2], &size);
    }
    let mut matches = Hdf5Out::default();
    for (pair, indices) in export.pairs.iter().zip(&numbered.matches) {
        let [a, b] = [pair.frames.0, pair.frames.1].map(|frame| frame as usize);
        let count = numbered.keypoints[a].len();
        let (mut b_of_a, mut scores) = (vec![-1; count], vec![0.0; count]);
        for (&[i, j], score) in indices.iter().zip(pair.scores()) {
            b_of_a[i as usize] = j as i32;
            scores[i as usize] = score;
        }
        let group = format!(
            "{}/{}",
            names[a].replace('/', "-"),
            names[b].replace('/', "-")
        );
        matches.integers(format!("{group}/matches0"), &[count], &b_of_a);
        matches.doubles(format!("{group}/matching_scores0"), &[count], &scores);
    }
    let paths = ["features.h5", "matches.h5", "pairs.list"].map(|name| folder.join(name));
    let unwritable = |path: &Path, error| ExchangeError::unwritable(path, error);
    for (out, path) in [features, matches].into_iter().zip(&paths) {
        out.write(path).map_err(|error| unwritable(path, error))?;
    }
    let name = |frame: u32| &*names[frame as usize];
    let pairs: String = (export.pairs.iter())
        .map(|pair| [name(pair.frames.0), " ", name(pair.frames.1), "\n"].concat())
        .collect();
    write_new(&paths[2], pairs.as_bytes()).map_err(|error| unwritable(&paths[2], error))?;
    Ok(paths.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pair_is_not_split_where_its_name_is_longer_than_two_paths() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("features.h5");
        let mut out = Hdf5Out::default();
        out.integers("none".into(), &[1], &[0]);
        out.write(&path).unwrap();
        let images = [
            "db/1.jpg",
            "q-2.jpg",
            &"n/".repeat(2048),
            &"n".repeat(4097),
            "x/1.jpg",
            "x-1.jpg",
        ];
        let arrays = images.map(|image| format!("{image}/keypoints"));
        let features = Features::new(Hdf5::open(&path).unwrap(), &arrays);
        let [one, two, long, longer, slashed, dashed] = images;
        for (pair, of_pair) in [
            ("db-1.jpg/q-2.jpg".to_owned(), vec![[one, two]]),
            ("db/1.jpg/q/2.jpg".to_owned(), vec![[one, two]]),
            ("q-2.jpg_db-1.jpg".to_owned(), vec![[two, one]]),
            ("db-1.jpg/q-3.jpg".to_owned(), Vec::new()),
            (format!("{}/{}", &longer[2..], &long[1..]), Vec::new()),
            (format!("{long}/q-2.jpg"), vec![[long, two]]),
            (format!("{longer}/{longer}"), Vec::new()),
            (
                "x-1.jpg/q-2.jpg".to_owned(),
                vec![[slashed, two], [dashed, two]],
            ),
        ] {
            assert!(features.of_pair(&pair).eq(of_pair), "{pair:.40}");
        }
    }
}
