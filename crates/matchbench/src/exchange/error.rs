//! What can be wrong with files of matches. An error names the file, often the place in it, and what to do.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::arrays::ArrayError;
use crate::datasets::DatasetError;

/// Something wrong with a file of matches.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{}{}: {what}; {remedy}",
    file.display(),
    place.as_ref().map(|place| format!(", {place}")).unwrap_or_default()
)]
pub struct ExchangeError {
    /// The file or folder.
    pub file: PathBuf,
    /// The place in it where there is one: a pair, an array, a line.
    pub place: Option<String>,
    /// What is wrong.
    pub what: String,
    /// How to mend it.
    pub remedy: String,
}

impl ExchangeError {
    /// An error about `file` as a whole.
    pub fn new(
        file: impl Into<PathBuf>,
        what: impl fmt::Display,
        remedy: impl Into<String>,
    ) -> Self {
        Self {
            file: file.into(),
            place: None,
            what: what.to_string(),
            remedy: remedy.into(),
        }
    }

    /// The same error at a `place` in the file; one that has a place already keeps both.
    #[must_use]
    pub fn at(self, place: impl fmt::Display) -> Self {
        let place = match self.place {
            Some(inner) => format!("{place}, {inner}"),
            None => place.to_string(),
        };
        Self {
            place: Some(place),
            ..self
        }
    }

    /// A file that cannot be opened or read.
    pub(super) fn unreadable(file: &Path, error: impl fmt::Display) -> Self {
        Self::new(file, error, "check the path and the permissions")
    }

    /// A file whose content contradicts its format.
    pub(super) fn damaged(file: &Path, what: impl fmt::Display) -> Self {
        Self::new(
            file,
            what,
            "write the file again with the tool that made it",
        )
    }

    /// A file that cannot be written.
    pub(super) fn unwritable(file: &Path, error: impl fmt::Display) -> Self {
        Self::new(
            file,
            error,
            "check the folder, its permissions and the free space",
        )
    }
}

impl From<ArrayError> for ExchangeError {
    fn from(error: ArrayError) -> Self {
        Self {
            file: error.file,
            place: error.array.map(|name| format!("array `{name}`")),
            what: error.what,
            remedy: error.remedy.into(),
        }
    }
}

impl From<DatasetError> for ExchangeError {
    fn from(error: DatasetError) -> Self {
        Self {
            file: error.file,
            place: error.line.map(|line| format!("line {line}")),
            what: error.what,
            remedy: error.remedy,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::{Fault, break_calls, write_new};

    #[test]
    fn a_file_that_cannot_be_written_is_named_once() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("m.npz");
        let refused = || {
            let error = write_new(&path, &[1; 100]).err()?;
            Some(ExchangeError::unwritable(&path, error).to_string())
        };
        let mut messages = Vec::new();
        for left in 0..6 {
            let _broken = break_calls(folder.path(), Fault::Full, left);
            messages.extend(refused());
        }
        assert!(messages.len() >= 3, "{messages:?}");
        std::fs::write(&path, "of somebody").expect("writable");
        let other = refused().expect("it is not ours");
        assert!(other.contains("other content"), "{other}");
        messages.push(other);
        for message in messages {
            assert_eq!(message.matches("m.npz").count(), 1, "{message}");
        }
    }

    #[test]
    fn the_message_names_file_place_and_remedy() {
        let error = ExchangeError::new("m.h5", "3 columns, not 2", "write x and y");
        assert_eq!(error.to_string(), "m.h5: 3 columns, not 2; write x and y");
        assert_eq!(
            error.at("keypoints").at("pair 0 1").to_string(),
            "m.h5, pair 0 1, keypoints: 3 columns, not 2; write x and y"
        );
    }
}
