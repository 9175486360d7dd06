//! What is compared: a matcher, with the estimators that judge it.

use crate::estimators::BuiltEstimator;
use crate::matchers::BuiltMatcher;

/// A matcher and the estimators that turn its matches into poses.
pub struct Contender {
    /// The matcher.
    pub matcher: BuiltMatcher,
    /// The estimators, at least one; all get the same matches.
    pub estimators: Vec<BuiltEstimator>,
}
