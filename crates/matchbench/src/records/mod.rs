//! What a run leaves behind: its folder ([`RunFolder`]), with the plan, one record per task, appended
//! as soon as it is known, and the selected matches.

pub mod authors;
mod earlier_plans;
mod error;
mod folder;
mod growth;
pub(crate) mod images;
mod line;
pub mod matches;
mod plan;
mod record;
pub mod store;
mod tuned;

pub use error::FolderError;
pub use folder::{FORMAT, RunFolder, RunWriter};
pub use matches::{MatchesFile, SelectedMatches};
pub use plan::{DatasetPlan, EstimatorPlan, MatcherPlan, Plan, Settings};
pub use record::{Counts, MIN_MATCHES, MIN_SUPPORT, Outcome, RunRecord, StageTimes, Task};
pub use store::StoreError;
pub use tuned::{Tuned, TunedOn};
