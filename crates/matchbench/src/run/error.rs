//! The errors that stop a run.

use std::io;

use crate::records::{FolderError, ShardError, StoreError};

/// Why a run cannot start or go on. What was recorded stays recorded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The datasets, matchers and estimators do not make a run.
    #[error("{0}")]
    Contradiction(String),
    /// The folder of the run cannot be opened, read or written.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// It is not the part of a run that was planned.
    #[error(transparent)]
    Shard(#[from] ShardError),
    /// A source of matches will give no more.
    #[error("{id} has ended: {reason}")]
    SourceEnded {
        /// Its id.
        id: String,
        /// Why, and what to do.
        reason: String,
    },
    /// A source did not begin with a pair, since the run was stopped. [`Run::execute`](super::Run::execute) ends as it
    /// does when it is stopped, and without this error.
    #[error("the run was stopped before")]
    Stopped,
    /// Another file cannot be read or written; the error names it.
    #[error(transparent)]
    Io(#[from] io::Error),
}

impl From<StoreError> for RunError {
    fn from(error: StoreError) -> Self {
        Self::Folder(error.into())
    }
}
