//! Matches that another tool wrote into files, as they are asked for; `exchange` reads them.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// Matches of another tool.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MatchesFrom {
    /// The name that they have in tables.
    pub name: String,
    /// Their files: files, a folder of files, or a folder with one for each dataset.
    pub files: Vec<PathBuf>,
    /// Id of the format. Default: recognised by content.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<String>,
    /// Where the centre of the first pixel is, 0 or 0.5. Default: what the format says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pixel_center: Option<f64>,
    /// Width and height of the images that the points are of, where those were resized.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub resized: Option<[u32; 2]>,
    /// Read the matches that the tool verified. Default: false.
    #[serde(default)]
    pub verified: bool,
    /// What is to be remembered with them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub notes: BTreeMap<String, String>,
}
