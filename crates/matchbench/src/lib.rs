//! Which feature matcher should I use? Datasets in, a report out.
//!
//! The way of the data: a [`datasets::Sequence`] is run by [`run`] with [`matchers`] and
//! [`estimators`] into [`records`]; [`metrics`] are pure functions of records, and [`report`]
//! writes them down. `ARCHITECTURE.md` in the repository draws it.

pub mod cache;
pub mod config;
pub mod datasets;
pub mod estimators;
pub mod exchange;
pub mod external;
pub mod files;
pub mod matchers;
pub mod metrics;
pub mod records;
pub mod report;
pub mod run;
pub mod time;
pub mod tune;
