//! Errors as Python exceptions.
//!
//! Invalid arguments raise Python's own `TypeError` and `ValueError`. Problems with files, datasets, runs and
//! matchers raise `matchbench.Error`. Matches that determine no pose raise its subclass `matchbench.NoModel`.

use std::fmt::Display;

use matchbench_cli::plain;
use pyo3::PyErr;
use pyo3::exceptions::{PyException, PyValueError};

pyo3::create_exception!(
    matchbench,
    Error,
    PyException,
    "A problem outside the arguments: with a file, a dataset or a run, or a matcher that failed."
);
pyo3::create_exception!(
    matchbench,
    NoModel,
    Error,
    "The matches determine no pose; the message says why."
);

/// The error for an argument with a value that is not allowed.
pub(crate) fn value_error(error: impl Display) -> PyErr {
    PyValueError::new_err(plain(&error.to_string()))
}

/// The error for a problem outside the arguments.
pub(crate) fn error(error: impl Display) -> PyErr {
    Error::new_err(plain(&error.to_string()))
}
