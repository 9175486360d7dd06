//! One file per subcommand, and `job`, which executes runs for several of them.

pub(crate) mod check;
pub(crate) mod compare;
pub(crate) mod completions;
pub(crate) mod convert;
pub(crate) mod demo;
pub(crate) mod eval;
pub(crate) mod export;
pub(crate) mod import;
pub(crate) mod job;
pub(crate) mod join;
pub(crate) mod leaderboard;
pub(crate) mod list;
pub(crate) mod man;
pub(crate) mod matches;
pub(crate) mod merge;
pub(crate) mod paper;
pub(crate) mod plan;
pub(crate) mod report;
pub(crate) mod run;
pub(crate) mod show;
pub(crate) mod time;
pub(crate) mod tune;
pub(crate) mod validate;
pub(crate) mod work;
