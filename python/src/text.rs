//! Text that comes from Python. A surrogate, half of a character, is an invalid argument like any other.

use pyo3::exceptions::{PyUnicodeEncodeError, PyValueError};
use pyo3::prelude::*;

/// A text, for arguments (`from_py_with`).
///
/// # Errors
/// [`PyValueError`] for one with surrogates, and what PyO3 says of anything else.
pub(crate) fn text(value: &Bound<'_, PyAny>) -> PyResult<String> {
    value.extract().map_err(|error: PyErr| {
        if error.is_instance_of::<PyUnicodeEncodeError>(value.py()) {
            match value.repr() {
                Ok(shown) => PyValueError::new_err(format!(
                    "the text {shown} has surrogates, which are no characters"
                )),
                Err(error) => error,
            }
        } else {
            error
        }
    })
}
