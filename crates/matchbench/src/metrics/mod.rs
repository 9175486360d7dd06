//! Scores: pure functions of what a run left behind, or of anybody's results in the authors' layout.
//!
//! [`load`] turns a folder of results into one [`ResultSet`] per dataset, matcher and estimator;
//! [`Summary::new`] scores it. The definitions stand in one file each: [`SuccessCurve`] (SP and the
//! paper's AUC), [`exact_auc`] and [`maa`] (what others call AUC and mAA), [`average_matches`] (AP),
//! [`Bootstrap`] (intervals) and [`Failures`].

mod auc;
mod average_matches;
mod bootstrap;
mod failures;
mod pair_result;
mod results;
mod success;
mod summary;
mod times;

pub use auc::{exact_auc, maa};
pub use average_matches::average_matches;
pub use bootstrap::{Bootstrap, Interval, Term};
pub use failures::{Failure, Failures};
pub use pair_result::{Angle, AngularError, PairResult};
pub use results::{ResultSet, ResultsError, load};
pub use success::{SuccessCurve, THRESHOLDS};
pub use summary::{Score, Summary, auc_difference};
pub use times::{Spread, StageSpreads};
