//! The error type for files of arrays.

use std::fmt;
use std::path::{Path, PathBuf};

/// Something wrong with a file of arrays, or with one of them.
#[derive(Debug)]
pub(crate) struct ArrayError {
    /// The file.
    pub(crate) file: PathBuf,
    /// The array in it, if the error is about one.
    pub(crate) array: Option<String>,
    /// What is wrong.
    pub(crate) what: String,
    /// How to correct it.
    pub(crate) remedy: &'static str,
}

impl ArrayError {
    /// The error for a file that cannot be opened or read.
    pub(super) fn unreadable(file: &Path, error: impl fmt::Display) -> Self {
        Self {
            file: file.into(),
            array: None,
            what: error.to_string(),
            remedy: "check the path and the permissions",
        }
    }

    /// The error for a file whose content contradicts its format.
    pub(super) fn damaged(file: &Path, what: impl fmt::Display) -> Self {
        Self {
            remedy: "write the file again with the tool that made it",
            ..Self::unreadable(file, what)
        }
    }

    /// The same error for the array called `name`.
    pub(super) fn of(self, name: &str) -> Self {
        Self {
            array: Some(name.to_owned()),
            ..self
        }
    }

    /// What is wrong, with the name of the array but without the file.
    pub(crate) fn what(&self) -> String {
        match &self.array {
            Some(array) => format!("array `{array}`: {}", self.what),
            None => self.what.clone(),
        }
    }
}
