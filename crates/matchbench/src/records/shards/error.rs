//! Why shards cannot be planned, worked or merged.

use std::io;
use std::path::PathBuf;

use super::super::{FolderError, StoreError};
use crate::counted::counted;

/// Why shards cannot be planned, worked or merged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ShardError {
    /// There is no plan of shards.
    #[error(
        "{} is not the folder of a plan: it has no plan.json; make one with `matchbench plan`",
        folder.display()
    )]
    NoPlan {
        /// The folder.
        folder: PathBuf,
    },
    /// The folder is that of a run or of one shard.
    #[error(
        "{} is the folder of a run, or of one shard, and no plan of shards; give the folder that `matchbench plan` \
         made",
        folder.display()
    )]
    OfRun {
        /// The folder.
        folder: PathBuf,
    },
    /// The plan is not one that `matchbench plan` wrote.
    #[error("{}: {reason}; plan again, into another folder", path.display())]
    Damaged {
        /// The plan.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The folder holds another plan of shards.
    #[error(
        "{} holds another plan, which its shards belong to; choose another folder",
        folder.display()
    )]
    Taken {
        /// The folder.
        folder: PathBuf,
    },
    /// What was to be run is not what was planned.
    #[error(
        "this is not what was planned: {difference}; a shard needs the datasets, the matchers and the \
         version of matchbench that the plan was made with"
    )]
    NotAsPlanned {
        /// The first field that differs, and how.
        difference: String,
    },
    /// There is no shard of this number.
    #[error("there is no shard {number}: the plan has 1 to {shards}")]
    NoShard {
        /// What was asked for.
        number: u32,
        /// How many there are.
        shards: u32,
    },
    /// Shards are not there, or not done.
    #[error(
        "not all shards are done: {}; run `matchbench work PLAN --shard K` for each of these, or name the \
         folders that they are in, and merge again",
        numbers(shards)
    )]
    Gaps {
        /// Their numbers and what there is of them.
        shards: Vec<(u32, String)>,
    },
    /// A folder is not that of a shard of this plan.
    #[error("{} is no shard of this plan: {reason}", folder.display())]
    Foreign {
        /// The folder.
        folder: PathBuf,
        /// What tells.
        reason: String,
    },
    /// Two folders of one shard hold different results.
    #[error(
        "{} and {} are both shard {number}, and differ in line {line} of {file}; find out which is right and \
         delete the other",
        folders[0].display(),
        folders[1].display()
    )]
    Differs {
        /// The number of the shard.
        number: u32,
        /// Both folders.
        folders: [PathBuf; 2],
        /// The file, within them.
        file: PathBuf,
        /// The line, from 1.
        line: usize,
    },
    /// Two shards worked with different images, or with different depth of one.
    #[error(
        "{} and {} have not worked with the same {what} of frame {frame} of {dataset}; see which is right, \
         delete the folder of the other shard and run it again",
        folders[0].display(),
        folders[1].display()
    )]
    OtherImage {
        /// What they have not in common: `image` or `depth`.
        what: &'static str,
        /// Name of the dataset.
        dataset: String,
        /// Index of the frame.
        frame: u32,
        /// The folders of the shards.
        folders: [PathBuf; 2],
    },
    /// A shard is not what a run writes.
    #[error("{}: {reason}; delete it and run shard {number} again", folder.display())]
    Broken {
        /// The number of the shard.
        number: u32,
        /// Its folder.
        folder: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A shard lacks matches of a native matcher, which a run makes again.
    #[error(
        "{}: it has lost the matches of {} {}; run shard {number} again, which makes them again, and merge then",
        folder.display(), frames[0], frames[1]
    )]
    Lost {
        /// The number of the shard.
        number: u32,
        /// Its folder.
        folder: PathBuf,
        /// The frames of the first pair.
        frames: [u32; 2],
    },
    /// The run has fewer failures than the shards: it was continued after an earlier merge.
    #[error(
        "{}: {} failed in the shards and not here, where the run was continued since; what was repaired would be lost. Merge \
         into another folder, or delete this one",
        path.display(),
        counted(*repaired, "record")
    )]
    Repaired {
        /// The file of records.
        path: PathBuf,
        /// How many more records of it did not fail.
        repaired: u64,
    },
    /// The shards could not be merged to the end.
    #[error(
        "{error}; {} is unfinished: once this is mended, merge again into it",
        out.display()
    )]
    Unfinished {
        /// The folder of the run that was to be made.
        out: PathBuf,
        /// Why not.
        error: Box<ShardError>,
    },
    /// A folder of a run cannot be read or written.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// Another file cannot be read or written; the error names it.
    #[error(transparent)]
    Io(#[from] io::Error),
}

impl From<StoreError> for ShardError {
    fn from(error: StoreError) -> Self {
        Self::Folder(error.into())
    }
}

/// Shards that are named; more of them are counted.
const NAMED: usize = 40;

fn numbers(shards: &[(u32, String)]) -> String {
    let named = (shards.iter().take(NAMED)).map(|(number, found)| format!("{number} ({found})"));
    let text = named.collect::<Vec<_>>().join(", ");
    match shards.len().saturating_sub(NAMED) {
        0 => text,
        more => format!("{text} and {more} more"),
    }
}
