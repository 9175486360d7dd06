//! Relative pose, or a homography, from matches of which many are wrong.
//!
//! A [`PoseEstimator`] takes [`TwoViews`] (matched points and two cameras) and returns a [`PoseEstimate`], or
//! says why there is [`NoModel`]. Two are here: [`Ransac`], the reference of the benchmark, and
//! [`SampleConsensus`], put together from parts; [`presets`] has the combinations that have a name.
//!
//! A [`HomographyEstimator`] takes matched points alone, and [`HomographyConsensus`] is one.
//!
//! All run the one sample-consensus loop, [`consensus()`], which has three exchangeable parts: [`Problem`] (what is
//! estimated), [`Scoring`] (which model is best) and [`Sampling`] (which data are tried next).
//!
//! The module of each says how it works, after which paper, and where its values come from.
//!
//! ```
//! use matchbench_vision::geometry::{Camera, MatchedPoints};
//! use matchbench_vision::robust::{NoModel, PoseEstimator, SampleConsensus, TwoViews, presets};
//! use matchbench_vision::seed::Seed;
//!
//! let camera = Camera::pinhole(500.0, 500.0, 320.0, 240.0);
//! let views = TwoViews { points: &MatchedPoints::default(), camera_a: &camera, camera_b: &camera };
//! let estimator = SampleConsensus::new(presets::best())?;
//! let nothing = NoModel::TooFewMatches { found: 0, needed: 5 };
//! assert_eq!(estimator.estimate(views, Seed(0)), Err(nothing));
//! # Ok::<(), matchbench_vision::ParamError>(())
//! ```

mod coarse_pose;
pub mod consensus;
mod degensac;
pub mod essential_problem;
mod estimator;
pub mod even_marginal;
pub mod even_msac;
mod even_weights;
pub mod fundamental_problem;
mod grid;
pub mod homography_consensus;
pub mod homography_problem;
mod hypotheses;
pub mod keypoint_changes;
mod linear;
pub mod lmeds;
pub mod magsac;
pub mod mlesac;
mod noise_scale;
mod parts;
mod plane_poses;
mod plane_rivals;
pub mod pose_probabilities;
pub mod presets;
mod problem;
pub mod prosac;
pub mod ransac;
pub mod sample_consensus;
pub mod sampling;
pub mod scoring;
mod search;
#[cfg(feature = "serde")]
mod settings;
pub mod spread_sampler;
mod sprt;
mod support;
mod turns;

pub use consensus::{Consensus, ConsensusParams, Extras, consensus, consensus_until};
pub use essential_problem::{EssentialProblem, Hopeless};
pub use estimator::{
    HomographyEstimate, HomographyEstimator, NoModel, PoseEstimate, PoseEstimator, TwoViews,
};
pub use even_marginal::EvenMarginal;
pub use even_msac::EvenMsac;
pub use fundamental_problem::FundamentalProblem;
pub use homography_consensus::{HomographyConsensus, HomographyParams};
pub use homography_problem::HomographyProblem;
pub use keypoint_changes::KeypointChanges;
pub use lmeds::MedianOfSquares;
pub use magsac::Magsac;
pub use mlesac::Mlesac;
pub use parts::{EarlyStop, FinalRefinement, Sampler, Score};
pub use pose_probabilities::{PoseProbabilities, RIGHT_POSE};
pub use problem::Problem;
pub use prosac::Prosac;
pub use ransac::{Ransac, RansacParams};
pub use sample_consensus::{Geometry, SampleConsensus, SampleConsensusParams};
pub use sampling::{Sampling, Uniform};
pub use scoring::{InlierCount, Msac, Scoring, Support};
#[cfg(feature = "serde")]
pub use settings::{GeometryName, SamplerName, ScoreName, Settings};
pub use spread_sampler::SpreadSampler;
