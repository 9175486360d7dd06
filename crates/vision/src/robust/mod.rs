//! Relative pose from correspondences of which many are wrong.
//!
//! One sample-consensus loop, three axes: problem, score, sampler.

mod estimator;

pub use estimator::{NoPose, PoseEstimate, PoseEstimator, TwoViews};
