//! The plan of shards: what is run, how it was asked for, and the cut; `plan.json` in its folder.

use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::super::growth::difference;
use super::super::{KeepMatches, Plan, RunFolder, ShardOf, Tuned};
use super::{Cut, ShardError};
use crate::files::{read_file, refuse_link, refuse_links, write_whole};
use crate::matchers::MatchesFrom;

/// Version of the format of plans of shards that this program writes, and the only one that it reads.
pub const SHARDS_FORMAT: u32 = 1;

const PLAN: &str = "plan.json";
const SHARDS: &str = "shards";

/// What the shards of a run have in common.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShardPlan {
    format: u32,
    /// BLAKE3 of all that follows, as a list in JSON without white space.
    hash: String,
    /// The plan of the whole run, as it stands in the merged folder.
    plan: Plan,
    asked: Asked,
    keep_matches: KeepMatches,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    tuned: Vec<Tuned>,
    cut: Cut,
}

/// How the matchers and estimators of a plan were asked for, so that another machine can make the same.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Asked {
    /// Ids of matchers and paths of manifests.
    pub matchers: Vec<String>,
    /// Ids of estimators; none where each matcher has its own.
    pub estimators: Vec<String>,
    /// Ids of protocols; none where it is the paper's.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub protocols: Vec<String>,
    /// Changes of parameters, each `ID.NAME=VALUE`.
    pub settings: Vec<String>,
    /// Matches of other tools.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub matches: Vec<MatchesFrom>,
}

impl ShardPlan {
    /// A plan of these parts.
    pub fn new(
        plan: Plan,
        asked: Asked,
        keep_matches: KeepMatches,
        tuned: Vec<Tuned>,
        cut: Cut,
    ) -> Self {
        let mut plan = Self {
            format: SHARDS_FORMAT,
            hash: String::new(),
            plan,
            asked,
            keep_matches,
            tuned,
            cut,
        };
        plan.hash = plan.content_hash();
        plan
    }

    /// The plan in a folder; `path` may also be the file in it.
    ///
    /// # Errors
    /// If there is none, or it is not what [`ShardPlan::write`] wrote.
    pub fn open(path: &Path) -> Result<Self, ShardError> {
        let folder = Self::folder(path);
        let path = folder.join(PLAN);
        let text = match read_file(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                return Err(ShardError::NoPlan { folder });
            }
            text => text.map_err(|error| {
                io::Error::new(error.kind(), format!("{}: {error}", path.display()))
            })?,
        };
        let damaged = |reason: String| ShardError::Damaged {
            path: path.clone(),
            reason,
        };
        let plan: Self = serde_json::from_slice(&text).map_err(|error| {
            if RunFolder::open(&folder).is_ok() {
                let folder = folder.clone();
                return ShardError::OfRun { folder };
            }
            damaged(format!("not a plan of shards ({error})"))
        })?;
        if plan.format != SHARDS_FORMAT {
            let (format, known) = (plan.format, SHARDS_FORMAT);
            return Err(damaged(format!(
                "it is of format {format}, and this program knows {known}"
            )));
        }
        if plan.hash != plan.content_hash() {
            return Err(damaged("its hash is not that of its content".into()));
        }
        if let Some(wrong) = plan.plan.refusal() {
            return Err(damaged(wrong));
        }
        plan.cut.check(&plan.plan).map_err(damaged)?;
        Ok(plan)
    }

    /// The folder of a plan that is named by itself or by its file.
    pub fn folder(path: &Path) -> PathBuf {
        match path.parent() {
            Some(parent) if path.is_file() => parent.into(),
            _ => path.into(),
        }
    }

    /// Writes the plan into a folder, unless it is there already.
    ///
    /// # Errors
    /// [`ShardError::Taken`] if another is there; or if it cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), ShardError> {
        let path = folder.join(PLAN);
        if path.exists() {
            return match Self::open(folder) {
                Ok(there) if there == *self => Ok(()),
                _ => Err(ShardError::Taken {
                    folder: folder.into(),
                }),
            };
        }
        let text = serde_json::to_string_pretty(self).expect("a plan is plain JSON");
        Ok(write_whole(&path, format!("{text}\n").as_bytes())?)
    }

    /// The plan of the whole run.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// By what it is told from others.
    pub fn hash(&self) -> &str {
        &self.hash
    }

    /// How its matchers and estimators were asked for.
    pub fn asked(&self) -> &Asked {
        &self.asked
    }

    /// Which matches the shards keep.
    pub fn keep_matches(&self) -> KeepMatches {
        self.keep_matches
    }

    /// The choices that settings were taken over from.
    pub fn tuned(&self) -> &[Tuned] {
        &self.tuned
    }

    /// Which shard does which pairs.
    pub fn cut(&self) -> &Cut {
        &self.cut
    }

    /// How many shards there are; they are counted from 1.
    pub fn shards(&self) -> u32 {
        u32::try_from(self.cut().parts.len()).unwrap_or(u32::MAX)
    }

    /// The folder of a shard, in that of the plan.
    pub fn shard_folder(folder: &Path, number: u32) -> PathBuf {
        folder.join(SHARDS).join(number.to_string())
    }

    /// The folder of a shard, in that of the plan, to write to.
    ///
    /// # Errors
    /// If a link in the folder of the plan leads elsewhere.
    pub fn default_shard(folder: &Path, number: u32) -> io::Result<PathBuf> {
        refuse_links(folder, &Self::shard_folder(Path::new(""), number))?;
        Ok(Self::shard_folder(folder, number))
    }

    /// Where features are kept unless another place is asked for.
    ///
    /// # Errors
    /// If it is a link, which leads elsewhere.
    pub fn default_cache(folder: &Path) -> io::Result<PathBuf> {
        let cache = folder.join("cache");
        refuse_link(&cache)?;
        Ok(cache)
    }

    /// What the plan of a shard says of itself.
    ///
    /// # Errors
    /// [`ShardError::NoShard`].
    pub fn shard(&self, number: u32) -> Result<ShardOf, ShardError> {
        let shards = self.shards();
        if !(1..=shards).contains(&number) {
            return Err(ShardError::NoShard { number, shards });
        }
        let plan = self.hash.clone();
        Ok(ShardOf { plan, number })
    }

    /// Whether what would be run is what was planned; datasets may have moved.
    ///
    /// # Errors
    /// [`ShardError::NotAsPlanned`].
    pub fn check(&self, plan: &Plan) -> Result<(), ShardError> {
        // A run may grow; a part of one may not.
        match difference(self.plan(), plan).or_else(|| difference(plan, self.plan())) {
            None => Ok(()),
            Some(difference) => Err(ShardError::NotAsPlanned { difference }),
        }
    }

    fn content_hash(&self) -> String {
        let Self {
            plan,
            asked,
            keep_matches,
            tuned,
            cut,
            ..
        } = self;
        let text = serde_json::to_vec(&(plan, asked, keep_matches, tuned, cut));
        let hash = blake3::hash(&text.expect("a plan is plain JSON"));
        hash.to_hex().to_string()
    }
}
