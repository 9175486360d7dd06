//! The results of a run on disk: its folder ([`RunFolder`]) with the plan, one record per task, appended as
//! soon as it is known, and the selected matches. A run that many machines share is cut into [`shards`].
//! Each is a run folder of its own, and they are merged at the end.

pub mod authors;
mod broken;
mod earlier;
mod earlier_plans;
mod error;
mod folder;
mod growth;
pub(crate) mod images;
mod joined;
mod line;
mod lost_notes;
pub mod matches;
mod outcome;
mod parts;
mod plan;
mod record;
pub mod shards;
mod staged;
pub mod store;
mod tasks;
mod tuned;

pub use broken::BrokenTasks;
pub use error::FolderError;
pub use folder::{RunFolder, RunWriter};
pub use joined::{JoinError, Joined, join};
pub use matches::{KeepMatches, MatchesFile, SelectedMatches};
pub use outcome::{MIN_MATCHES, MIN_SUPPORT, Outcome};
pub use parts::{kept_otherwise, run_of_part, stranger_in};
pub use plan::{
    DatasetPlan, EstimatorPlan, FORMAT, IN_PYTHON, MatcherPlan, Plan, RunSettings, ShardOf,
};
pub use record::{ByDepth, Counts, Repeated, RunRecord, StageTimes, Task};
pub use shards::{ShardError, ShardPlan};
pub use store::StoreError;
pub(crate) use tasks::{check_tasks, is_twice};
pub use tuned::{Tuned, TunedOn};
