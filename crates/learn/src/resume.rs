//! The saved state of a training, from which a stopped run continues: a file beside the table that is learned.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use matchbench::files::write_whole;
use serde::Serialize;

use crate::patches::PatchSet;

/// Bytes of a key.
const KEY: usize = blake3::OUT_LEN;

/// The state of a training, in `<table>.part`. It begins with a key, a hash of everything that the state
/// depends on. So a training is never continued with other data or other parameters.
#[derive(Clone, Debug)]
pub(crate) struct Checkpoint {
    path: PathBuf,
    key: [u8; KEY],
}

impl Checkpoint {
    /// The checkpoint of a training of `table` from `set` with `params`.
    ///
    /// # Errors
    /// If the parameters cannot be written as JSON.
    pub(crate) fn new(table: &Path, set: &PatchSet, params: &impl Serialize) -> Result<Self> {
        let mut path = table.as_os_str().to_owned();
        path.push(".part");
        let key = blake3::hash(&serde_json::to_vec(&(&set.hashes, params))?);
        Ok(Self {
            path: path.into(),
            key: key.into(),
        })
    }

    /// The state that was saved last, `None` if there is none.
    ///
    /// # Errors
    /// If the file belongs to another training or cannot be read.
    pub(crate) fn load(&self) -> Result<Option<Vec<u8>>> {
        if !self.path.exists() {
            return Ok(None);
        }
        let mut bytes = fs::read(&self.path).with_context(|| format!("{}", self.path.display()))?;
        ensure!(
            bytes.starts_with(&self.key),
            "{}: was begun with other parameters or another set; delete it to begin anew",
            self.path.display()
        );
        Ok(Some(bytes.split_off(KEY)))
    }

    /// Saves a state in place of the one before.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub(crate) fn save(&self, state: &[u8]) -> Result<()> {
        Ok(write_whole(&self.path, &[&self.key[..], state].concat())?)
    }

    /// Removes what was saved, when the table is written.
    pub(crate) fn remove(&self) {
        let _ = fs::remove_file(&self.path); // there is none if the training was short
    }

    /// The file.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The message if a state is invalid.
    pub(crate) fn damaged(&self) -> String {
        format!("{}: damaged; delete it to begin anew", self.path.display())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_is_only_continued_by_the_same_training() -> Result<()> {
        let folder = tempfile::tempdir()?;
        let table = folder.path().join("table.bin");
        let mut set = PatchSet::default();
        let first = Checkpoint::new(&table, &set, &(1, "a"))?;
        assert_eq!(first.load()?, None);
        first.save(b"state")?;
        assert_eq!(first.load()?.as_deref(), Some(&b"state"[..]));
        let other = Checkpoint::new(&table, &set, &(2, "a"))?;
        let error = other.load().unwrap_err().to_string();
        assert!(
            error.contains("table.bin.part") && error.contains("delete"),
            "{error}"
        );
        set.hashes.push("another".into());
        assert!(Checkpoint::new(&table, &set, &(1, "a"))?.load().is_err());
        first.remove();
        assert_eq!(first.load()?, None);
        Ok(())
    }
}
