//! Matches from files of another tool, as a user asks for them; `exchange` reads the files.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// Matches of another tool.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MatchesFrom {
    /// Their name in tables.
    pub name: String,
    /// The files: files, a folder of files, or a folder with one folder for each dataset.
    pub files: Vec<PathBuf>,
    /// Id of the format. Default: recognised by content.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<String>,
    /// Where the centre of the first pixel is, 0 or 0.5. Default: what the format says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pixel_center: Option<f64>,
    /// Width and height of the images in whose pixels the points are, if these were resized.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub resized: Option<[u32; 2]>,
    /// Whether to read the matches that the tool verified. Default: false.
    #[serde(default)]
    pub verified: bool,
    /// Facts to be recorded with them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub notes: BTreeMap<String, String>,
}
