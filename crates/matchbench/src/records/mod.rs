//! What a run leaves behind: one record per task, appended as soon as it is known.

pub mod authors;
mod record;
pub mod store;

pub use record::{Counts, MIN_MATCHES, MIN_SUPPORT, Outcome, RunRecord, StageTimes, Task};
pub use store::StoreError;
