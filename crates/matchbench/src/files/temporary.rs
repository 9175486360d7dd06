//! Temporary folders, which are removed also if the process is about to end at once.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::TempDir;

/// Those of this process.
static FOLDERS: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// A folder in that of the system for temporary files, with an absolute path. It is removed when this value is
/// dropped, and by [`remove_temporary_folders`].
#[derive(Debug)]
pub struct TemporaryFolder(TempDir);

impl TemporaryFolder {
    /// A new one.
    ///
    /// # Errors
    /// If it cannot be made.
    pub fn new() -> io::Result<Self> {
        let parent = std::path::absolute(temporary_files())?;
        // Held meanwhile: either it is seen when all are removed, or it is made later.
        let mut all = folders();
        let folder = (tempfile::Builder::new().prefix("matchbench-")).tempdir_in(parent)?;
        all.insert(folder.path().to_owned());
        Ok(Self(folder))
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        self.0.path()
    }

    /// Leaves it where it is.
    pub fn keep(mut self) {
        self.0.disable_cleanup(true);
    }
}

impl Drop for TemporaryFolder {
    fn drop(&mut self) {
        folders().remove(self.path());
    }
}

/// The folder of the system for temporary files. A variable `TMPDIR` that is empty counts as none, as everywhere.
pub fn temporary_files() -> PathBuf {
    let folder = std::env::temp_dir();
    if folder.as_os_str().is_empty() {
        // Of the systems that ask this variable.
        return "/tmp".into();
    }
    folder
}

/// Removes all temporary folders of this process, for one that is about to exit without dropping what it has.
pub fn remove_temporary_folders() {
    for folder in &*folders() {
        // What another thread still writes there may hinder it.
        let _ = fs::remove_dir_all(folder);
    }
}

fn folders() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    FOLDERS.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_known_until_it_goes_or_is_kept() {
        let known = |path: &Path| folders().contains(path);
        let [goes, stays] = [(); 2].map(|()| TemporaryFolder::new().unwrap());
        let paths = [&goes, &stays].map(|folder| folder.path().to_owned());
        assert!(
            paths
                .iter()
                .all(|path| path.is_absolute() && path.is_dir() && known(path))
        );
        drop(goes);
        stays.keep();
        assert!(!paths[0].exists() && paths[1].is_dir());
        assert!(!paths.iter().any(|path| known(path)));
        fs::remove_dir(&paths[1]).unwrap();
    }
}
