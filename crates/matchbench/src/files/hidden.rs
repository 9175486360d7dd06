//! Hidden folders, in which a folder is filled before it gets its place: whatever ends the process, nothing incomplete is
//! seen.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::leftovers::{HELD, PREFIX, hold, remove_leftovers};
use super::write::make_folder;

/// A hidden folder with an empty one in it, which is to be filled and moved. What is left is removed when this value is
/// dropped, and after a process that was killed by the next one that makes such a folder in the same place.
#[derive(Debug)]
pub(crate) struct HiddenFolder {
    _held: File,
    hidden: TempDir,
}

impl HiddenFolder {
    /// One beside `path`; missing folders above it are made.
    ///
    /// # Errors
    /// The error of the file system.
    pub(crate) fn beside(path: &Path) -> io::Result<Self> {
        let absolute = std::path::absolute(path)?;
        Self::inside(absolute.parent().unwrap_or(&absolute))
    }

    /// One inside of `folder`, which is made if it is missing.
    ///
    /// # Errors
    /// The error of the file system.
    pub(crate) fn inside(folder: &Path) -> io::Result<Self> {
        make_folder(folder)?;
        remove_leftovers(folder);
        // Only the user can read the hidden folder. The one in it has ordinary permissions.
        let hidden = tempfile::Builder::new()
            .prefix(&format!("{PREFIX}folder-"))
            .tempdir_in(folder)
            // The error itself names the folder that it did not make.
            .map_err(|error| io::Error::from(error.kind()))?;
        let held = File::create(hidden.path().join(HELD))?;
        hold(&held);
        let this = Self {
            _held: held,
            hidden,
        };
        fs::create_dir(this.path())?;
        Ok(this)
    }

    /// The folder that is to be filled and moved.
    pub(crate) fn path(&self) -> PathBuf {
        self.hidden.path().join("folder")
    }
}
