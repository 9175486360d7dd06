//! What is compared: a matcher, with the estimators that judge it.

use matchbench_vision::robust::PoseEstimator;
use serde_json::Value;

use crate::matchers::BuiltMatcher;

/// A matcher and the estimators that turn its matches into poses.
pub struct Contender {
    /// The matcher.
    pub matcher: BuiltMatcher,
    /// The estimators, at least one; all get the same matches.
    pub estimators: Vec<BuiltEstimator>,
}

/// An estimator ready to be run, and everything that its results depend on.
pub struct BuiltEstimator {
    /// Id of its entry.
    pub id: String,
    /// Every parameter, also those left at their defaults.
    pub params: Value,
    /// The estimator.
    pub estimator: Box<dyn PoseEstimator>,
}
