//! From two sets of features to correspondences: search, selection, and the two together.

mod correspondence;
mod pipeline;

pub use correspondence::{Correspondence, Correspondences};
pub use pipeline::{Matcher, MatcherError, Pipeline, Search, Selector, View};
