//! One file per subcommand.

pub(crate) mod demo;
pub(crate) mod eval;
pub(crate) mod export;
pub(crate) mod import;
pub(crate) mod list;
pub(crate) mod report;
pub(crate) mod run;
pub(crate) mod tune;
pub(crate) mod validate;
