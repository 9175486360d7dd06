//! A run in parts, for many machines: the [`ShardPlan`] says what is run and which shard does which pairs,
//! every shard is a run folder of its own, and [`merge`] makes from them the folder that one machine would
//! have written.
//!
//! | in the folder of the plan | what |
//! | --- | --- |
//! | `plan.json` | the [`ShardPlan`] |
//! | `shards/<number>/` | the run folder of a shard, whose plan names the hash of the shard plan and its number |
//! | `cache/` | features, unless another place is asked for; can be deleted |
//!
//! Seeds belong to tasks, so a pair has the same result in any shard. A shard does its pairs in the order
//! in which they stand in the dataset, and the cut says for each stretch of pairs to which shard it
//! belongs. So merging takes the next lines of one shard, then those of another, and keeps none of them in
//! memory.

mod cut;
mod entry_file;
mod error;
mod folders;
mod merge;
mod plan;
mod record_file;

pub use cut::{Cut, Part, Stretch, Stretches};
pub(crate) use cut::{PairsHash, part_of};
pub use error::ShardError;
pub use merge::{Merged, merge};
pub use plan::{Asked, SHARDS_FORMAT, ShardPlan};
