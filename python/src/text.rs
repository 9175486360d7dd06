//! Text that classes of this module take. Functions that are called through Python code check theirs there, in the same
//! words (`_params.text`).

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyString;

use crate::arrays::kind_of;

/// The argument `origin` (`from_py_with`).
///
/// # Errors
/// As [`text`].
pub(crate) fn origin<'a>(value: &'a Bound<'_, PyAny>) -> PyResult<&'a str> {
    text(value, "origin", "\"center\" or \"corner\"")
}

/// The argument `model` (`from_py_with`).
///
/// # Errors
/// As [`text`].
pub(crate) fn model<'a>(value: &'a Bound<'_, PyAny>) -> PyResult<&'a str> {
    text(value, "model", "a name, as in \"PINHOLE\"")
}

/// The argument `name` as a text, which is what is `expected`.
///
/// # Errors
/// [`PyTypeError`] for anything else, [`PyValueError`] for a text with surrogates, halves of characters.
fn text<'a>(value: &'a Bound<'_, PyAny>, name: &str, expected: &str) -> PyResult<&'a str> {
    let Ok(given) = value.cast::<PyString>() else {
        let kind = kind_of(value);
        return Err(PyTypeError::new_err(format!(
            "{name}: {kind}; give {expected}"
        )));
    };
    given.to_str().map_err(|_| match given.repr() {
        Ok(shown) => PyValueError::new_err(format!(
            "{name}: {shown} has surrogates, which are no characters; give {expected}"
        )),
        Err(error) => error,
    })
}
