//! How files of matches were understood: everything that a plan or a report says of them.

use std::collections::BTreeMap;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::ExchangeError;
use super::names::NamedBy;
use crate::counted::counted;
use crate::files::open_file;

/// Files that are listed one by one; more of them are one line.
const LISTED: usize = 4;

/// How files of matches were understood.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Understood {
    /// Id of the format.
    pub format: String,
    /// Where the centre of the first pixel is in these files: 0 or 0.5.
    pub pixel_center: f64,
    /// Width and height of the images that the points belong to, if not the original ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resized: Option<[u32; 2]>,
    /// Whether the matches that the tool itself verified were read, rather than all.
    #[serde(default)]
    pub verified: bool,
    /// How frames are named.
    pub named_by: NamedBy,
    /// What the files say about how certain matches are.
    pub scores: Scores,
    /// The files.
    pub files: Vec<FileRead>,
    /// How many files of the folder were passed over, since others are called as files of matches are. No part of
    /// a plan: no result depends on it.
    #[serde(skip)]
    pub passed_over: usize,
    /// What the user noted: model, weights, device ...
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub notes: BTreeMap<String, String>,
}

/// What files say about how certain their matches are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scores {
    /// Nothing: all matches have ambiguity 0.
    None,
    /// Scores that all lie in 0..1, higher is better: the ambiguity is 1 - score.
    Unit,
    /// Other scores s, higher is better: the ambiguity is (1 - s / (1 + |s|)) / 2.
    Unbounded,
    /// The ambiguity itself.
    Ambiguity,
}

/// A file that was read, or a folder of them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FileRead {
    /// Its name, without the folders above.
    pub name: String,
    /// How many files: 1, or those of the folder.
    pub count: usize,
    /// BLAKE3 hash of the content; of a folder, the hash of the names and hashes of its files.
    pub blake3: String,
}

impl Understood {
    /// The files that were read, with their hashes.
    ///
    /// # Errors
    /// If one cannot be read.
    pub(super) fn hashed(files: &[PathBuf]) -> Result<Vec<FileRead>, ExchangeError> {
        let read = (files.iter())
            .map(|path| {
                Ok(FileRead {
                    name: name(path),
                    count: 1,
                    blake3: hash(path)?,
                })
            })
            .collect::<Result<Vec<_>, ExchangeError>>()?;
        if read.len() <= LISTED {
            return Ok(read);
        }
        let mut hasher = blake3::Hasher::new();
        for FileRead { name, blake3, .. } in &read {
            hasher.update(name.as_bytes());
            hasher.update(b"\0");
            hasher.update(blake3.as_bytes());
        }
        Ok(vec![FileRead {
            name: files[0].parent().map(name).unwrap_or_default(),
            count: read.len(),
            blake3: hasher.finalize().to_hex().to_string(),
        }])
    }
}

impl fmt::Display for Understood {
    /// One line: `hloc: features.h5 (blake3 0123456789ab), matches.h5 (..); frames by image name;
    /// first pixel's centre at 0; scores in 0..1`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let file = |file: &FileRead| {
            let files = match file.count {
                1 => String::new(),
                count => format!("{count} files, "),
            };
            let hash = file.blake3.get(..12).unwrap_or(&file.blake3);
            format!("{} ({files}blake3 {hash})", file.name)
        };
        let files: Vec<_> = self.files.iter().map(file).collect();
        write!(f, "{}: {}", self.format, files.join(", "))?;
        if self.passed_over > 0 {
            write!(
                f,
                "; passed over: {}",
                counted(self.passed_over, "other file")
            )?;
        }
        f.write_str(match self.named_by {
            NamedBy::Frame => "; frames by number",
            NamedBy::Image => "; frames by image name",
            NamedBy::ImageEnd => {
                "; frames by image name, without the first folders, which the dataset does not have"
            }
            NamedBy::Former => "; frames by the names of the images before they were copied or linked",
            NamedBy::FormerEnd => {
                "; frames by the names of the images before they were copied or linked, without the first folders"
            }
        })?;
        write!(f, "; first pixel's centre at {}", self.pixel_center)?;
        if let Some([width, height]) = self.resized {
            write!(f, "; points of images resized to {width}x{height}")?;
        }
        if self.verified {
            f.write_str("; verified matches")?;
        }
        f.write_str(match self.scores {
            Scores::None => "; no scores",
            Scores::Unit => "; scores in 0..1",
            Scores::Unbounded => "; scores beyond 0..1",
            Scores::Ambiguity => "; ambiguities",
        })?;
        for (key, value) in &self.notes {
            write!(f, "; {key} = {value}")?;
        }
        Ok(())
    }
}

fn name(path: &Path) -> String {
    (path.file_name()).map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

fn hash(path: &Path) -> Result<String, ExchangeError> {
    let mut hasher = blake3::Hasher::new();
    open_file(path)
        .and_then(|mut file| io::copy(&mut file, &mut hasher))
        .map_err(|error| ExchangeError::unreadable(path, error))?;
    Ok(hasher.finalize().to_hex().to_string())
}
