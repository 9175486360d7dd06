//! Parameters as they are passed from Python: JSON objects, as text.

use pyo3::PyResult;
use serde_json::Value;

use crate::errors::value_error;

/// The parameters in `text`.
///
/// # Errors
/// If it is not valid JSON.
pub(crate) fn parse(text: &str) -> PyResult<Value> {
    serde_json::from_str(text).map_err(value_error)
}
