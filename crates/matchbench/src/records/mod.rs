//! What a run leaves behind: one record per task, appended as soon as it is known.

pub mod authors;
pub mod matches;
mod record;
pub mod store;

pub use matches::{MatchesFile, SelectedMatches};
pub use record::{Counts, MIN_MATCHES, MIN_SUPPORT, Outcome, RunRecord, StageTimes, Task};
pub use store::StoreError;
