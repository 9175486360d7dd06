//! One problem of a dataset, and how severe it is.

use std::fmt;

use super::DatasetError;

/// One problem of a dataset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// How severe it is.
    pub severity: Severity,
    /// File, line, what is wrong and how to correct it.
    pub error: DatasetError,
}

/// How severe a problem is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// The dataset can be run, but the results may be misleading.
    Warning,
    /// The dataset, or part of it, cannot be run.
    Error,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Warning => "warning",
            Self::Error => "error",
        })
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.severity, self.error)
    }
}

impl From<DatasetError> for Problem {
    fn from(error: DatasetError) -> Self {
        Self {
            severity: Severity::Error,
            error,
        }
    }
}

impl Problem {
    pub(super) fn warning(error: DatasetError) -> Self {
        Self {
            severity: Severity::Warning,
            error,
        }
    }
}

/// The first error among problems, if there is one.
pub(super) fn first_error(problems: Vec<Problem>) -> Result<(), DatasetError> {
    let is_error = |problem: &Problem| problem.severity == Severity::Error;
    match problems.into_iter().find(is_error) {
        Some(problem) => Err(problem.error),
        None => Ok(()),
    }
}
