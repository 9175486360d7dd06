//! Relative pose from correspondences of which many are wrong.
//!
//! One sample-consensus loop, [`consensus`], with three axes: [`Problem`] (what is estimated),
//! [`Score`] (which model is best) and [`Sampler`] (what is tried next). An estimator chooses one of
//! each and is the [`PoseEstimator`] that the benchmark calls.

mod consensus;
mod essential_problem;
mod estimator;
mod problem;
mod ransac;
mod sampler;
mod score;

pub use consensus::{Consensus, ConsensusParams, consensus};
pub use essential_problem::EssentialProblem;
pub use estimator::{NoPose, PoseEstimate, PoseEstimator, TwoViews};
pub use problem::Problem;
pub use ransac::{Ransac, RansacParams};
pub use sampler::{Sampler, Uniform};
pub use score::{InlierCount, Score, Support};
