//! Patches around keypoints, with triplets that say which show the same point and which only look similar.
//!
//! A set is a folder:
//!
//! | file | what it holds |
//! | --- | --- |
//! | `manifest.json` | how it was made, how many of everything, hashes; written last |
//! | `<part>/patches-64.bin`, `<part>/patches-32.bin` | the patches that DLCO and BinBoost see |
//! | `<part>/sift.bin` | SIFT's 128 values of each patch's keypoint, as bytes |
//! | `<part>/triplets.bin` | anchor, positive, negative, source: 4 little-endian `u32` each |
//!
//! The parts are `train`, `validation` and `test`; no scene is in two of them. While a set is being made, each
//! finished scene is a small set of its own in `unfinished/`.

mod epipolar;
mod exact;
mod make;
mod warp;

pub(crate) use make::{Recipe, make};

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use matchbench::files::write_whole;
use matchbench_vision::features::{binboost, dlco};
use serde::{Deserialize, Serialize};

/// Bytes of a large patch, of a small one, and of SIFT's descriptor.
const LENGTHS: [usize; 3] = [
    dlco::SIDE * dlco::SIDE,
    binboost::SIDE * binboost::SIDE,
    128,
];
const FILES: [&str; 4] = [
    "patches-64.bin",
    "patches-32.bin",
    "sift.bin",
    "triplets.bin",
];

/// The parts of a set.
pub(crate) const PARTS: [&str; 3] = ["train", "validation", "test"];

/// Three patches: two of the same point, and one of another point that looks similar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Triplet {
    pub(crate) anchor: u32,
    pub(crate) positive: u32,
    pub(crate) negative: u32,
    /// Index of the scene and method that it comes from.
    pub(crate) source: u32,
}

/// The content of `manifest.json`.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Manifest {
    pub(crate) version: u32,
    pub(crate) recipe: Recipe,
    pub(crate) parts: Vec<PartManifest>,
}

impl Manifest {
    fn read(folder: &Path) -> Result<Self> {
        let path = folder.join("manifest.json");
        let text = fs::read_to_string(&path).with_context(|| {
            format!(
                "{}: cannot be read; is this a set made by `matchbench-learn patches`?",
                path.display()
            )
        })?;
        serde_json::from_str(&text).with_context(|| format!("{}: not a manifest", path.display()))
    }

    fn write(&self, folder: &Path) -> Result<()> {
        let text = serde_json::to_string_pretty(self)?;
        Ok(write_whole(&folder.join("manifest.json"), text.as_bytes())?)
    }
}

/// One part of a set.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct PartManifest {
    pub(crate) name: String,
    pub(crate) patches: usize,
    /// Names of the sources, and how many triplets come from each.
    pub(crate) sources: Vec<(String, usize)>,
    /// BLAKE3 of the four files.
    pub(crate) hashes: Vec<String>,
}

/// The patches of one part.
#[derive(Debug, Default)]
pub(crate) struct PatchSet {
    /// Large patches, small patches and SIFT's descriptors, one after the other.
    data: [Vec<u8>; 3],
    pub(crate) triplets: Vec<Triplet>,
    pub(crate) sources: Vec<String>,
    /// BLAKE3 of the files it was read from.
    pub(crate) hashes: Vec<String>,
}

impl PatchSet {
    /// Number of patches.
    pub(crate) fn len(&self) -> usize {
        self.data[2].len() / LENGTHS[2]
    }

    /// The patch of 64 x 64 pixels.
    pub(crate) fn large(&self, index: usize) -> &[u8] {
        &self.data[0][index * LENGTHS[0]..][..LENGTHS[0]]
    }

    /// The patch of 32 x 32 pixels.
    pub(crate) fn small(&self, index: usize) -> &[u8] {
        &self.data[1][index * LENGTHS[1]..][..LENGTHS[1]]
    }

    /// SIFT's descriptor of the patch's keypoint.
    pub(crate) fn sift(&self, index: usize) -> &[u8] {
        &self.data[2][index * LENGTHS[2]..][..LENGTHS[2]]
    }

    /// Reads one part of the set in `folder`.
    pub(crate) fn read(folder: &Path, part: &str) -> Result<Self> {
        let manifest = Manifest::read(folder)?;
        let about =
            (manifest.parts.iter().find(|about| about.name == part)).with_context(|| {
                format!(
                    "{}: has no part `{part}`; use {}",
                    folder.display(),
                    PARTS.join(", ")
                )
            })?;
        let read = |file: usize| -> Result<Vec<u8>> {
            let path = folder.join(part).join(FILES[file]);
            let bytes = fs::read(&path).with_context(|| format!("{}", path.display()))?;
            ensure!(
                about.hashes.get(file) == Some(&hash(&bytes)),
                "{}: is not the file that the manifest describes; make the set again",
                path.display()
            );
            Ok(bytes)
        };
        let triplets = read(3)?;
        let number = |bytes: [u8; 4]| u32::from_le_bytes(bytes);
        let triplets = triplets.as_chunks::<4>().0.as_chunks::<4>().0.iter();
        let set = Self {
            data: [read(0)?, read(1)?, read(2)?],
            triplets: triplets
                .map(|&[anchor, positive, negative, source]| Triplet {
                    anchor: number(anchor),
                    positive: number(positive),
                    negative: number(negative),
                    source: number(source),
                })
                .collect(),
            sources: about.sources.iter().map(|(name, _)| name.clone()).collect(),
            hashes: about.hashes.clone(),
        };
        ensure!(
            set.is_consistent(),
            "{}: the files of its part `{part}` contradict each other; make the set again",
            folder.display()
        );
        Ok(set)
    }

    /// Whether every patch has all its data, and every triplet has its patches and its source. The hashes say
    /// only that the files are those of the manifest, and anybody can write a manifest.
    fn is_consistent(&self) -> bool {
        let patches = self.len();
        let whole = (self.data.iter().zip(LENGTHS)).all(|(data, one)| data.len() == patches * one);
        let known = |triplet: &Triplet| {
            let Triplet {
                anchor,
                positive,
                negative,
                source,
            } = *triplet;
            let is_patch = |index: u32| (index as usize) < patches;
            [anchor, positive, negative].into_iter().all(is_patch)
                && (source as usize) < self.sources.len()
        };
        whole && self.triplets.iter().all(known)
    }

    /// Adds the patches, triplets and sources of another set.
    fn append(&mut self, other: Self) {
        let (patches, sources) = (self.len() as u32, self.sources.len() as u32);
        for (data, more) in self.data.iter_mut().zip(other.data) {
            data.extend(more);
        }
        self.triplets.extend(other.triplets.iter().map(|t| Triplet {
            anchor: t.anchor + patches,
            positive: t.positive + patches,
            negative: t.negative + patches,
            source: t.source + sources,
        }));
        self.sources.extend(other.sources);
    }

    /// Writes the four files of part `name` and returns their description.
    fn write(&self, folder: &Path, name: &str) -> Result<PartManifest> {
        let folder = folder.join(name);
        fs::create_dir_all(&folder).with_context(|| format!("{}", folder.display()))?;
        let triplets: Vec<u8> = (self.triplets.iter())
            .flat_map(|t| [t.anchor, t.positive, t.negative, t.source])
            .flat_map(u32::to_le_bytes)
            .collect();
        let contents = [&self.data[0], &self.data[1], &self.data[2], &triplets];
        let mut hashes = Vec::new();
        for (file, bytes) in FILES.iter().zip(contents) {
            let path = folder.join(file);
            fs::write(&path, bytes).with_context(|| format!("{}", path.display()))?;
            hashes.push(hash(bytes));
        }
        let count = |source: usize| {
            let from = |t: &&Triplet| t.source as usize == source;
            self.triplets.iter().filter(from).count()
        };
        Ok(PartManifest {
            name: name.into(),
            patches: self.len(),
            sources: (self.sources.iter().enumerate())
                .map(|(i, source)| (source.clone(), count(i)))
                .collect(),
            hashes,
        })
    }
}

fn hash(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_whose_files_contradict_each_other_is_refused() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let read = |change: &dyn Fn(&mut PatchSet)| {
            let mut set = PatchSet {
                data: LENGTHS.map(|one| vec![7; 3 * one]),
                triplets: vec![Triplet {
                    anchor: 0,
                    positive: 1,
                    negative: 2,
                    source: 0,
                }],
                sources: vec!["wall/poses".into()],
                hashes: Vec::new(),
            };
            change(&mut set);
            let part = set.write(folder.path(), PARTS[0]).expect("writable");
            let manifest = Manifest {
                version: 1,
                recipe: Recipe {
                    scenes: [const { Vec::new() }; 3],
                    per_pair: 1,
                    warps: 0,
                    blurred: false,
                    seed: 1,
                },
                parts: vec![part],
            };
            manifest.write(folder.path()).expect("writable");
            PatchSet::read(folder.path(), PARTS[0]).map(|set| set.triplets.len())
        };
        assert_eq!(read(&|_| ()).expect("it is consistent"), 1);
        let changes: [&dyn Fn(&mut PatchSet); 5] = [
            &|set| set.triplets[0].anchor = 3,
            &|set| set.triplets[0].negative = u32::MAX,
            &|set| set.triplets[0].source = 1,
            &|set| set.data[0].truncate(LENGTHS[0]),
            &|set| set.data[2].truncate(1),
        ];
        for change in changes {
            let error = read(change).unwrap_err().to_string();
            assert!(error.contains("contradict each other"), "{error}");
        }
    }
}
