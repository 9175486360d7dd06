//! The error type of datasets: it names a file, often a line, and says what to do about it.

use std::io;
use std::path::{Path, PathBuf};

use crate::arrays::ArrayError;

/// Something wrong with one file of a dataset.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{}: {what}; {remedy}", .file.display(), .line.map(|n| format!(":{n}")).unwrap_or_default())]
pub struct DatasetError {
    /// The file or folder.
    pub file: PathBuf,
    /// The line in it, counted from 1, where there is one.
    pub line: Option<usize>,
    /// What is wrong.
    pub what: String,
    /// How to correct it.
    pub remedy: String,
}

impl DatasetError {
    /// An error about `file` as a whole.
    pub fn new(
        file: impl Into<PathBuf>,
        what: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self {
            file: file.into(),
            line: None,
            what: what.into(),
            remedy: remedy.into(),
        }
    }

    /// The same error, placed at `line`.
    #[must_use]
    pub fn at(self, line: usize) -> Self {
        Self {
            line: Some(line),
            ..self
        }
    }

    /// Something is wrong with a file of arrays.
    pub(super) fn of_array(error: ArrayError) -> Self {
        let what = error.what();
        Self::new(error.file, what, error.remedy)
    }

    /// The system could not read or write `file`.
    pub(super) fn io(file: &Path, error: &io::Error) -> Self {
        let remedy = match error.kind() {
            io::ErrorKind::NotFound => "check the path",
            io::ErrorKind::PermissionDenied => "check the permissions",
            io::ErrorKind::InvalidData => "save it as text in UTF-8",
            io::ErrorKind::StorageFull => "free some space and try again",
            // With a NUL in it, or too long.
            io::ErrorKind::InvalidInput | io::ErrorKind::InvalidFilename => {
                "no file can have this name; correct it in the file that lists it"
            }
            _ => "check the file and the disk",
        };
        Self::new(file, error.to_string(), remedy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_name_that_no_file_can_have_is_to_be_corrected() {
        let folder = tempfile::tempdir().unwrap();
        let remedy = |path: &Path| {
            let error = crate::files::read_file(path).unwrap_err();
            DatasetError::io(path, &error).remedy
        };
        assert_eq!(remedy(folder.path()), "check the file and the disk");
        assert!(remedy(Path::new("a\0b")).contains("correct it"));
    }

    #[test]
    fn the_message_names_file_line_and_remedy() {
        let error = DatasetError::new("a/pairs.txt", "13 columns, not 14", "add one");
        assert_eq!(
            error.to_string(),
            "a/pairs.txt: 13 columns, not 14; add one"
        );
        assert_eq!(
            error.at(7).to_string(),
            "a/pairs.txt:7: 13 columns, not 14; add one"
        );
    }
}
