//! `glue-factory`: the `predictions.h5` of its evaluations, a group for each pair with the
//! keypoints of both images and the matches in both directions.
//!
//! | array | |
//! | --- | --- |
//! | `<a>/<b>/keypoints0`, `keypoints1` | n x 2, pixels of the original images |
//! | `<a>/<b>/matches0`, `matches1` | index in the other image, -1 = none |
//! | `<a>/<b>/matching_scores0`, `matching_scores1` | higher is better |
//!
//! Which arrays are written is said to its program; `matches1` may be absent. In names of pairs `-` stands for the `/` of
//! image names. The first pixel's centre is at 0.5.

use std::path::{Path, PathBuf};

use super::hloc;
use super::names::PairName;
use super::probe::{Content, Probe};
use super::sparse::matched;
use super::{Contents, ExchangeError, Export, Format, RawMatches, ReadOptions, Source};
use crate::arrays::{Hdf5, Hdf5Out};

pub(super) const GLUE_FACTORY: Format = Format {
    id: "glue-factory",
    layout: "predictions.h5 with <a>/<b>/keypoints0, keypoints1, matches0 and perhaps matches1",
    pixel_center: Some(CENTER),
    resized: false,
    recognises,
    open,
    write: Some(write),
};

const CENTER: f64 = 0.5;

fn recognises(probe: &Probe) -> bool {
    let Content::Hdf5(files) = &probe.content else {
        return false;
    };
    let [(_, arrays)] = &files[..] else {
        return false;
    };
    hloc::has_numbers(arrays)
}

fn open(probe: Probe, _: &ReadOptions) -> Result<Contents, ExchangeError> {
    let Content::Hdf5(mut files) = probe.content else {
        unreachable!("only HDF5 files are recognised");
    };
    let (file, arrays) = files.pop().expect("one file was recognised");
    let pairs: Vec<String> = (arrays.iter())
        .filter_map(|array| array.strip_suffix("/matches0"))
        .map(str::to_owned)
        .collect();
    let joined = pairs.iter().map(|pair| PairName::Joined(pair.clone(), '/'));
    Ok(Contents {
        pairs: joined.collect(),
        source: Box::new(GlueFactory {
            scored: arrays
                .iter()
                .any(|array| array.ends_with("/matching_scores0")),
            file,
            pairs,
        }),
    })
}

struct GlueFactory {
    file: Hdf5,
    pairs: Vec<String>,
    scored: bool,
}

impl Source for GlueFactory {
    fn file(&self, _: usize) -> &Path {
        self.file.path()
    }

    fn read(&self, index: usize) -> Result<RawMatches, ExchangeError> {
        let pair = &self.pairs[index];
        let array = |name: &str| self.file.array(&format!("{pair}/{name}"));
        let scores = self.scored.then(|| array("matching_scores0")).transpose()?;
        matched(
            &array("keypoints0")?,
            &array("keypoints1")?,
            &array("matches0")?,
            scores.as_ref(),
        )
        .map_err(|what| {
            ExchangeError::damaged(self.file.path(), what).at(format!("group `{pair}`"))
        })
    }
}

/// The matched points are the keypoints, so that match `i` joins keypoints `i`. Coordinates are
/// float64: adding 0.5 would round float32.
fn write(folder: &Path, export: &Export<'_>) -> Result<Vec<PathBuf>, ExchangeError> {
    let names = export.distinct_names(|name| name.replace('/', "-"))?;
    let mut out = Hdf5Out::default();
    for pair in &export.pairs {
        let name = |frame: u32| names[frame as usize].replace('/', "-");
        let group = format!("{}/{}", name(pair.frames.0), name(pair.frames.1));
        let count = pair.points.len();
        let itself: Vec<i32> = (0..count as i32).collect();
        let scores: Vec<f64> = pair.scores().collect();
        for (number, coordinates) in pair.coordinates().into_iter().enumerate() {
            let coordinates = coordinates.into_iter().map(|x| f64::from(x) + CENTER);
            let coordinates: Vec<f64> = coordinates.collect();
            out.doubles(
                format!("{group}/keypoints{number}"),
                &[count, 2],
                &coordinates,
            );
            out.integers(format!("{group}/matches{number}"), &[count], &itself);
            out.doubles(
                format!("{group}/matching_scores{number}"),
                &[count],
                &scores,
            );
        }
    }
    let path = folder.join("predictions.h5");
    (out.write(&path)).map_err(|error| ExchangeError::unwritable(&path, error))?;
    Ok(vec![path])
}
