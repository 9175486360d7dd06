//! What a run leaves behind: one record per task, appended as soon as it is known.

mod record;

pub use record::{Counts, Outcome, RunRecord, StageTimes, Task};
