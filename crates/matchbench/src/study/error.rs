//! Why a study cannot be run.

use std::path::PathBuf;

use crate::config::ConfigError;
use crate::datasets::DatasetError;
use crate::exchange::ExchangeError;
use crate::external::ManifestError;
use crate::records::FolderError;
use crate::run::ContenderError;

/// What to do where a run file says something that cannot be.
pub(super) const CORRECT: &str = "correct this file, docs/formats.md lists all keys";

/// Why a study cannot be run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StudyError {
    /// A run file is wrong.
    #[error("{}{}: {what}; {remedy}", .file.display(), .line.map(|n| format!(":{n}")).unwrap_or_default())]
    File {
        /// The run file.
        file: PathBuf,
        /// The line, counted from 1, if the error is in one.
        line: Option<usize>,
        /// What is wrong.
        what: String,
        /// What to do.
        remedy: &'static str,
    },
    /// Something that every run needs was not given.
    #[error("no {what} is named; give {remedy}")]
    Incomplete {
        /// What it is.
        what: &'static str,
        /// How to give it.
        remedy: &'static str,
    },
    /// A dataset cannot be opened or imported.
    #[error("{}{error}", .at.as_ref().map(|(file, line)| format!("{}:{line}: ", file.display())).unwrap_or_default())]
    Dataset {
        /// The run file and the line that names it, if one does.
        at: Option<(PathBuf, usize)>,
        /// What is wrong.
        error: Box<DatasetError>,
    },
    /// The run would be written into a dataset.
    #[error("{} is a dataset, and a run needs a folder of its own; choose another", folder.display())]
    OutIsDataset {
        /// The folder.
        folder: PathBuf,
    },
    /// A matcher, an estimator or a parameter is wrong.
    #[error(transparent)]
    Contender(#[from] ContenderError),
    /// A setting is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The manifest of a matcher from outside is wrong.
    #[error(transparent)]
    Manifest(#[from] ManifestError),
    /// A file of a tuning cannot be read.
    #[error(transparent)]
    Tuned(#[from] FolderError),
    /// A tuned matcher or estimator is not part of this run.
    #[error("{}: `{id}` was tuned but is not part of this run; ask for it too, or leave this file out", file.display())]
    NothingTuned {
        /// The file of the tuning.
        file: PathBuf,
        /// The matcher or estimator.
        id: String,
    },
    /// A parameter that was tuned is given another value too.
    #[error("{}: it chose {setting}, and this run gives that parameter another value too; leave one of the two out", file.display())]
    TunedOtherwise {
        /// The file of the tuning.
        file: PathBuf,
        /// What it chose.
        setting: String,
    },
    /// Matches of another tool cannot be read.
    #[error("matches of {name}: {error}")]
    Matches {
        /// The name that they have.
        name: String,
        /// What is wrong.
        error: ExchangeError,
    },
    /// Matches of another tool cannot have this name.
    #[error("matches of another tool cannot be called `{name}`: {what}")]
    Name {
        /// The name.
        name: String,
        /// Why not.
        what: &'static str,
    },
    /// No matcher could be started.
    #[error("no matcher could be started: {0}")]
    NotStarted(String),
}
