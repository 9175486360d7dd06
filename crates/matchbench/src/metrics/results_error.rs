//! Why results cannot be scored.

use std::io;
use std::path::PathBuf;

use crate::datasets::DatasetError;
use crate::records::authors::AuthorsError;
use crate::records::{FolderError, StoreError};

/// Why results cannot be scored.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ResultsError {
    /// A file or folder cannot be read.
    #[error("{path}: {error}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        error: io::Error,
    },
    /// A line is not what it should be.
    #[error("{path}:{line}: {problem}")]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong and what to do.
        problem: String,
    },
    /// A list of pairs is wrong.
    #[error(transparent)]
    Pairs(#[from] DatasetError),
    /// A file in the authors' layout is wrong.
    #[error(transparent)]
    Rows(#[from] AuthorsError),
    /// The folder of a run is wrong.
    #[error(transparent)]
    Run(#[from] FolderError),
    /// A file of records is wrong.
    #[error(transparent)]
    Records(#[from] StoreError),
    /// A file or folder is not where it should be.
    #[error("{path}: {problem}")]
    Layout {
        /// Where it was looked for.
        path: PathBuf,
        /// What is wrong and what to do.
        problem: String,
    },
}
