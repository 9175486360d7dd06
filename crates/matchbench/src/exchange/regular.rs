//! Files, and nothing else that a path may lead to.

use std::fs::{self, File};
use std::path::Path;

use super::ExchangeError;

/// Opens a file, if it is one: a pipe or a device may never end.
///
/// # Errors
/// If it is none or cannot be opened.
pub(super) fn open_regular(path: &Path) -> Result<File, ExchangeError> {
    let unreadable = |error| ExchangeError::unreadable(path, error);
    if !fs::metadata(path).map_err(unreadable)?.is_file() {
        return Err(ExchangeError::new(
            path,
            "it is no regular file",
            "name a file",
        ));
    }
    File::open(path).map_err(unreadable)
}
