//! Whole numbers that come from Python. A number that is negative or too large is an invalid argument like any other,
//! and no `OverflowError`.

use pyo3::exceptions::{PyIndexError, PyOverflowError, PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::arrays::{few, kind_of};

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
            PyValueError::new_err(format!(
                "the whole number {value} is negative, or too large for this argument"
            ))
        } else {
            error
        }
    })
}

/// Width and height of an image: two whole numbers, as a tuple, a list or an array. `name` is the name of the argument.
///
/// # Errors
/// [`PyTypeError`] for anything else, [`PyValueError`] for a number out of its range, and for three of them: many give the
/// shape of an image.
pub(crate) fn width_and_height(value: &Bound<'_, PyAny>, name: &str) -> PyResult<(usize, usize)> {
    let refused = || {
        let expected = format!("{name} is (width, height), two whole numbers");
        PyTypeError::new_err(format!("{expected}; this is {}", kind_of(value)))
    };
    let sides: Vec<Bound<'_, PyAny>> = few(value, name, 3).map_err(|_| refused())?;
    let side = |side: &Bound<'_, PyAny>| {
        whole(side).map_err(|error| {
            if error.is_instance_of::<PyTypeError>(value.py()) {
                refused()
            } else {
                error
            }
        })
    };
    match &sides[..] {
        [width, height] => Ok((side(width)?, side(height)?)),
        [_, _, _] => Err(PyValueError::new_err(format!(
            "{name} is (width, height), and not the shape of an image, which is (height, width, 3)"
        ))),
        _ => Err(refused()),
    }
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
