//! A study: everything that is asked of a run, by arguments of the command line or by a run file.
//!
//! ```toml
//! # matchbench run study.toml          paths start from this file's folder
//! out = "runs/study"
//! matchers = ["sift", "orb", "mine/matcher.toml"]
//! estimators = ["ransac-e", "best"]    # absent: each matcher's own
//!
//! [set]                                # parameters, as `matchbench list` shows them
//! sift.ratio = 0.7
//!
//! [[dataset]]
//! path = "office"                      # a dataset that is there
//!
//! [[dataset]]
//! path = "datasets/05-castle"          # one that is imported if it is not there
//! import = { kind = "strecha", source = "castle-P30", pairs = "all" }
//! matchers = ["sift"]                  # instead of those above
//! ```
//!
//! Both ways fill in one [`Study`]. [`Study::prepare`] opens and builds what it names. The result, a
//! [`Prepared`], is run. Keys and their defaults are those of [`Study`], [`StudyDataset`], [`StudyImport`] and
//! [`MatchesFrom`]; an unknown key is an error.

mod error;
mod file;
mod names;
mod prepare;

use std::collections::BTreeMap;
use std::num::{NonZeroU32, NonZeroUsize};
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::config::{Changes, UnknownName};
use crate::datasets::{DatasetError, ImportOptions, PairRule, import_once};
use crate::protocols;
use crate::records::{KeepMatches, RunSettings};

pub use crate::matchers::MatchesFrom;
pub use error::StudyError;
pub use prepare::{News, Prepared, sources_as_planned, sources_for};

/// Everything that is asked of a run.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Study {
    /// The folder of the run. If it exists, the run is resumed.
    #[serde(deserialize_with = "names::some_path")]
    pub out: Option<PathBuf>,
    /// The matchers: ids, manifests of matchers from outside, or `all`.
    #[serde(deserialize_with = "names::matchers")]
    pub matchers: Vec<String>,
    /// The estimators that are run with each matcher. If empty, each matcher has its own.
    #[serde(deserialize_with = "names::estimators")]
    pub estimators: Vec<String>,
    /// The protocols that the estimators are run under, or `all`. If empty, that of the paper.
    #[serde(deserialize_with = "names::protocols")]
    pub protocols: Vec<String>,
    /// Seed of all random choices. Default: 0.
    pub seed: u64,
    /// How often every pair is run, each time with other random choices. Default: 1, or as often as a protocol
    /// requires.
    pub repeat: Option<NonZeroU32>,
    /// Only the first so many pairs of each dataset. Default: all.
    pub limit: Option<NonZeroUsize>,
    /// Of these pairs only so many, evenly spread. Default: all.
    pub sample: Option<NonZeroUsize>,
    /// Milliseconds for which an estimator may draw samples for a pair. Default: no limit besides its own
    /// rules.
    pub time_budget: Option<NonZeroU32>,
    /// Changed parameters, by the id of their matcher or estimator.
    #[serde(deserialize_with = "names::parameters")]
    pub set: Changes,
    /// The run file, and the line in it of each id in `set`, if the settings came from a run file.
    #[serde(skip)]
    pub set_at: BTreeMap<String, (PathBuf, usize)>,
    /// The run file, and the line in it of each manifest among its matchers.
    #[serde(skip)]
    pub manifests_at: BTreeMap<String, (PathBuf, usize)>,
    /// Files of `matchbench tune` whose choices are used; `set` wins over them.
    #[serde(deserialize_with = "names::paths")]
    pub tuned: Vec<PathBuf>,
    /// The folder of the feature cache. Default: `cache` in the folder of the run.
    #[serde(deserialize_with = "names::some_path")]
    pub cache: Option<PathBuf>,
    /// Which matches are kept: `all`, `inliers` or `none`. Default: all.
    pub keep_matches: KeepMatches,
    /// Whether the report is written at the end. Default: false.
    pub report: bool,
    /// Whether all that failed is run again. A run file cannot ask for this, since it is meant for one time.
    #[serde(skip)]
    pub retry_failed: bool,
    /// The datasets, in the order in which they are run.
    #[serde(rename = "dataset")]
    pub datasets: Vec<StudyDataset>,
    /// Matches of other tools, which are used on every dataset.
    #[serde(deserialize_with = "names::matches")]
    pub matches: Vec<MatchesFrom>,
}

impl Default for Study {
    fn default() -> Self {
        Self {
            out: None,
            matchers: Vec::new(),
            estimators: Vec::new(),
            protocols: Vec::new(),
            seed: 0,
            repeat: None,
            limit: None,
            sample: None,
            time_budget: None,
            set: Changes::default(),
            set_at: BTreeMap::new(),
            manifests_at: BTreeMap::new(),
            tuned: Vec::new(),
            cache: None,
            keep_matches: KeepMatches::All,
            report: false,
            retry_failed: false,
            datasets: Vec::new(),
            matches: Vec::new(),
        }
    }
}

impl Study {
    /// The settings that the records depend on, besides datasets, matchers and estimators.
    ///
    /// # Errors
    /// If a protocol does not exist.
    pub fn settings(&self) -> Result<RunSettings, UnknownName> {
        let protocols = protocols::find_all(&self.protocols)?;
        let shuffles = protocols.iter().map(|protocol| protocol.shuffles).max();
        let shuffles = shuffles
            .and_then(NonZeroU32::new)
            .unwrap_or(NonZeroU32::MIN);
        Ok(RunSettings {
            seed: self.seed,
            repetitions: self.repeat.unwrap_or(shuffles),
            limit: self.limit.map(NonZeroUsize::get),
            sample: self.sample.map(NonZeroUsize::get),
            time_budget_ms: self.time_budget,
        })
    }
}

/// A dataset of a study.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyDataset {
    /// Its folder. The name of the folder is the name of the dataset, unless its `dataset.toml` has another.
    #[serde(deserialize_with = "names::path")]
    pub path: PathBuf,
    /// How it is made if it does not exist. If it exists, it must be the same.
    pub import: Option<StudyImport>,
    /// The matchers that are run on it, instead of those of the study.
    #[serde(default, deserialize_with = "names::some_matchers")]
    pub matchers: Option<Vec<String>>,
    /// The run file, and the line in it of the folder, if a run file names it.
    #[serde(skip)]
    pub at: Option<(PathBuf, usize)>,
}

impl StudyDataset {
    /// A dataset that exists.
    pub fn at(path: impl Into<PathBuf>) -> Self {
        Self {
            path: path.into(),
            ..Self::default()
        }
    }
}

/// How a dataset is made: the options of `matchbench import`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyImport {
    /// Id of the layout, see [`KINDS`](crate::datasets::KINDS).
    #[serde(deserialize_with = "names::kind")]
    pub kind: String,
    /// The data as their authors publish them.
    #[serde(deserialize_with = "names::path")]
    pub source: PathBuf,
    /// Which pairs of images are matched. Default: the pairs that the paper uses for this kind.
    #[serde(default, deserialize_with = "names::pair_rule")]
    pub pairs: Option<PairRule>,
    /// Which sequence, if the source holds several.
    pub sequence: Option<String>,
    /// Which camera of the source, if it has several.
    pub sensor: Option<String>,
    /// The calibration, if the source has none or another one shall be used.
    #[serde(default, deserialize_with = "names::some_path")]
    pub camera: Option<PathBuf>,
    /// The poses.
    #[serde(default, deserialize_with = "names::some_path")]
    pub poses: Option<PathBuf>,
    /// The pose of the camera on the body whose poses the source has.
    #[serde(default, deserialize_with = "names::some_path")]
    pub body_from_camera: Option<PathBuf>,
    /// Largest difference in time between an image and its pose, in seconds.
    #[serde(default, deserialize_with = "names::tolerance")]
    pub tolerance: Option<f64>,
    /// Interpolate between poses instead of taking the nearest. Default: false.
    #[serde(default)]
    pub interpolate: bool,
    /// Folder to which image names are relative.
    #[serde(default, deserialize_with = "names::some_path")]
    pub image_root: Option<PathBuf>,
    /// The calibration matrices.
    #[serde(default, deserialize_with = "names::some_path")]
    pub intrinsics: Option<PathBuf>,
    /// What the images show, in a few words.
    pub property: Option<String>,
}

impl StudyImport {
    /// Makes the dataset in the folder `path` if it does not exist, and tells `tell` that it was imported. If
    /// it exists, it must be the same.
    ///
    /// # Errors
    /// As [`import_once`].
    pub fn once(&self, path: &Path, tell: &dyn Fn(News<'_>)) -> Result<(), DatasetError> {
        if let Some(report) = import_once(&self.kind, &self.source, path, &self.options())? {
            tell(News::Imported(path, &report));
        }
        Ok(())
    }

    fn options(&self) -> ImportOptions<'static> {
        ImportOptions {
            sequence: self.sequence.clone(),
            sensor: self.sensor.clone(),
            pairs: self.pairs.clone(),
            camera: self.camera.clone(),
            poses: self.poses.clone(),
            body_from_camera: self.body_from_camera.clone(),
            tolerance: self.tolerance,
            interpolate: self.interpolate,
            image_root: self.image_root.clone(),
            intrinsics: self.intrinsics.clone(),
            property: self.property.clone(),
            ..ImportOptions::default()
        }
    }
}
