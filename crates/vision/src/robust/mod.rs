//! Relative pose from correspondences of which many are wrong.
//!
//! One sample-consensus loop, [`consensus`], with three axes: [`Problem`] (what is estimated),
//! [`Score`] (which model is best) and [`Sampler`] (what is tried next). An estimator chooses one of
//! each and is the [`PoseEstimator`] that the benchmark calls.

mod consensus;
mod degensac;
mod essential_problem;
mod estimator;
mod even_msac;
mod fundamental_problem;
mod homography_problem;
mod linear;
mod lmeds;
mod magsac;
mod mlesac;
mod problem;
mod prosac;
mod ransac;
mod sample_consensus;
mod sampler;
mod score;
mod spread;
mod sprt;

pub use consensus::{Consensus, ConsensusParams, Extras, consensus, consensus_until};
pub use essential_problem::EssentialProblem;
pub use estimator::{NoPose, PoseEstimate, PoseEstimator, TwoViews};
pub use even_msac::EvenMsac;
pub use fundamental_problem::FundamentalProblem;
pub use homography_problem::HomographyProblem;
pub use lmeds::MedianOfSquares;
pub use magsac::Magsac;
pub use mlesac::Mlesac;
pub use problem::Problem;
pub use prosac::Prosac;
pub use ransac::{Ransac, RansacParams};
pub use sample_consensus::{
    GeometryKind, SampleConsensus, SampleConsensusParams, SamplerKind, ScoreKind,
};
pub use sampler::{Sampler, Uniform};
pub use score::{InlierCount, Msac, Score, Support};
pub use spread::Spread;
