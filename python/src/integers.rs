//! Whole numbers that come from Python. A number that is negative or too large is an invalid argument like any other,
//! and no `OverflowError`.

use pyo3::exceptions::{PyIndexError, PyOverflowError, PyValueError};
use pyo3::prelude::*;

/// Whole numbers of a type that holds none below 0, for arguments (`from_py_with`).
///
/// # Errors
/// [`PyValueError`] for a number out of its range, and what PyO3 says of anything else.
pub(crate) fn whole<'py, T>(value: &Bound<'py, PyAny>) -> PyResult<T>
where
    T: FromPyObjectOwned<'py>,
{
    value.extract().map_err(|error: T::Error| {
        let error = error.into();
        if error.is_instance_of::<PyOverflowError>(value.py()) {
            PyValueError::new_err("a whole number is negative, or too large for this argument")
        } else {
            error
        }
    })
}

/// The index of an item. One that no list can have is out of range like any other.
///
/// # Errors
/// [`PyIndexError`] for such an index, and what PyO3 says of anything else.
pub(crate) fn index(value: &Bound<'_, PyAny>) -> PyResult<isize> {
    value.extract().map_err(|error: PyErr| {
        if error.is_instance_of::<PyOverflowError>(value.py()) {
            PyIndexError::new_err("the index is out of range")
        } else {
            error
        }
    })
}
