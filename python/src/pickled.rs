//! How values are pickled (and copied): as a call that makes them again, bit for bit.

use pyo3::PyTypeInfo;
use pyo3::call::PyCallArgs;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyType};

/// A function and its arguments, as `__reduce__` returns them.
pub(crate) type Reduced<'py> = (Bound<'py, PyAny>, (Bound<'py, PyType>,));

/// A call of a static method of `T`; `call` is its name and its arguments.
pub(crate) fn by_method<'py, T: PyTypeInfo>(
    py: Python<'py>,
    call: impl PyCallArgs<'py>,
    keywords: Option<&Bound<'py, PyDict>>,
) -> PyResult<Reduced<'py>> {
    let caller = py.import("operator")?.getattr("methodcaller")?;
    Ok((caller.call(call, keywords)?, (py.get_type::<T>(),)))
}
