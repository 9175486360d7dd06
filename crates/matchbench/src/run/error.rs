//! What stops a run.

use std::io;
use std::path::PathBuf;

use crate::records::StoreError;

/// Why a run cannot start or go on. What was recorded stays recorded.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The datasets, matchers and estimators do not make a run.
    #[error("{0}")]
    Contradiction(String),
    /// The folder holds a run of another plan.
    #[error(
        "{} holds a run of another plan: {difference}; to go on with it give at least what it was \
         started with, for a new run choose another folder",
        folder.display()
    )]
    OtherPlan {
        /// The folder of the run.
        folder: PathBuf,
        /// The first field that differs, and how.
        difference: String,
    },
    /// `plan.json` is missing beside records, or is not what a run writes.
    #[error("{}: {reason}; choose another folder, or delete this one to start anew", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// Another process writes into the folder.
    #[error("{} is in use by another process; wait until it ends, or choose another folder", folder.display())]
    InUse {
        /// The folder of the run.
        folder: PathBuf,
    },
    /// The records cannot be read or written.
    #[error(transparent)]
    Records(#[from] StoreError),
    /// Another file cannot be read or written; the error names it.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The system gives no threads.
    #[error("cannot start the threads: {0}")]
    Threads(String),
}
