//! One thing that is wrong with a dataset, and how bad that is.

use std::fmt;

use super::DatasetError;

/// One thing that is wrong with a dataset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// How bad it is.
    pub severity: Severity,
    /// File, line, what is wrong and how to mend it.
    pub error: DatasetError,
}

/// How bad a problem is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// The dataset can be run; the results may not mean what they seem to.
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
