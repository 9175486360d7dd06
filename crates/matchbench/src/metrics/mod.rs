//! Scores: pure functions of what a run left behind, or of anybody's results in the authors' layout.
//!
//! [`load`] turns a folder of results into one [`ResultSet`] per dataset, matcher and estimator, and
//! [`load_errors`] one of published pose errors; [`Summary::new`] scores it by the list [`SCORES`].
//! The definitions stand in one file each: [`SuccessCurve`] (SP and the
//! paper's AUC), [`exact_auc`] and [`maa`] (what others call AUC and mAA), [`average_matches`] (AP),
//! [`Interval`]s and [`Failures`]. [`compare`] sets two sets of results side by side,
//! pair by pair, [`groups`](groups()) those of a dataset all at once; [`under_protocols`] scores as other benchmarks do; [`strata`] tells easy pairs from hard ones by their [`PairGeometry`],
//! [`hard_pairs`](hard_pairs()) kinds of hard ones. [`doubts`](doubts()) says where the truth itself looks wrong.

mod auc;
mod average_matches;
mod broken;
mod comparison;
mod depth_scores;
mod doubts;
mod errors;
mod failure;
mod failures;
mod gains;
mod groups;
mod hard_pairs;
mod intervals;
mod judge;
mod listed;
mod load;
mod pair_choice;
mod pair_geometry;
mod pair_result;
mod portion;
mod protocol_scores;
mod published;
mod quantiles;
mod ranks;
mod reliability;
mod result_set;
mod results;
mod results_error;
mod score_kind;
mod scores;
mod significance;
mod strata;
mod students_t;
mod success;
mod summary;
mod times;
mod unfinished;

pub use auc::{corner_auc, exact_auc, maa};
pub use average_matches::average_matches;
pub use comparison::{Comparison, Lead, auc_difference, compare, leads, twins};
pub use doubts::doubts;
pub use errors::{ErrorTableError, is_without_sign, load_errors};
pub use failure::Failure;
pub use failures::Failures;
pub use groups::{GROUP_LEVEL_NOTE, Groups, NO_LETTERS_NOTE, groups};
pub use hard_pairs::{HardPairs, Hardship, LITTLE_OVERLAP, WIDE_ANGLE, hard_pairs};
pub use intervals::{Interval, MIN_IMAGES, Term};
pub(crate) use judge::Judge;
pub use load::{load, load_chosen, load_each, load_run};
pub use pair_choice::{PairChoice, frames_at_hand};
pub use pair_geometry::{DatasetGeometry, PairGeometry};
pub use pair_result::{Angle, AngularError, Deviation, Model, PairResult};
pub use portion::Portion;
pub use protocol_scores::{ProtocolScore, ProtocolScores, under_protocols};
pub use ranks::{is_above, ranks};
pub use reliability::{MIN_FOR_CURVE, Reliability, ReliabilityRange};
pub use result_set::{ResultSet, method};
pub use results::FileResults;
pub use results_error::ResultsError;
pub use score_kind::{Detail, Notation, ScoreKind, Spread, Subject};
pub use scores::{SCORES, Score, Scores, ranking_auc, score_kind};
pub use significance::Difference;
pub use strata::{Stratum, auc_by_stratum, strata};
pub use success::{HEADLINE_PX, SuccessCurve, THRESHOLDS};
pub use summary::{Summary, shown_scores};
pub use times::{Quartiles, StageQuartiles};
pub use unfinished::Unfinished;
