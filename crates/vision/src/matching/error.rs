//! Why a stage of a matcher failed, in words.

/// Why a stage of a matcher failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MatcherError(pub String);

impl std::fmt::Display for MatcherError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for MatcherError {}
