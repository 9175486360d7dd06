//! The error that says why a parameter was refused.

use std::fmt;

/// A parameter is out of its range; the text names it, its value and what is allowed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ParamError(pub String);

impl fmt::Display for ParamError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for ParamError {}

impl ParamError {
    /// Returns `Ok` if `allowed`. Otherwise the error says that `name` has a `value` that is not `range`.
    ///
    /// # Errors
    /// If not `allowed`.
    pub fn unless(
        allowed: bool,
        name: &str,
        value: impl fmt::Display,
        range: &str,
    ) -> Result<(), Self> {
        if allowed {
            Ok(())
        } else {
            Err(Self(format!("`{name}` is {value}, but must be {range}")))
        }
    }
}
