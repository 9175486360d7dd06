//! What goes wrong, as Python's exceptions.
//!
//! Wrong arguments are Python's own `TypeError` and `ValueError`. Files, datasets, runs and matchers that
//! break raise `matchbench.Error`, matches that determine no pose its subclass `matchbench.NoPose`.

use std::fmt::Display;

use pyo3::PyErr;
use pyo3::exceptions::{PyException, PyValueError};

pyo3::create_exception!(
    matchbench,
    Error,
    PyException,
    "Something outside the arguments is wrong: a file, a dataset, a run, a matcher that broke."
);
pyo3::create_exception!(
    matchbench,
    NoPose,
    Error,
    "The matches determine no pose; the message says why."
);

/// An argument has a value that is not allowed.
pub(crate) fn value_error(error: impl Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Something outside the arguments is wrong.
pub(crate) fn error(error: impl Display) -> PyErr {
    Error::new_err(error.to_string())
}
