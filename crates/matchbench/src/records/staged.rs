//! A run that appears in its folder when all of it is written.
//!
//! It is written into a hidden folder first. Where its own folder is not there yet, the hidden one becomes it in one step.
//! Where it is, perhaps with files of others, the parts are moved into it one by one, and the plan last: until then it is
//! the folder of no run.

use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::folder::{Locks, lock, refuse_links};
use super::parts::{LOCK, PLAN, has_plan, in_the_way};
use super::{FolderError, Plan, RunWriter, store};
use crate::files::{HiddenFolder, move_file};

/// A new run that is not complete yet. If it is dropped, nothing is left of it.
pub(super) struct StagedRun {
    writer: RunWriter,
    hidden: HiddenFolder,
    /// The folder that the run gets.
    out: PathBuf,
    /// Those of this folder, if it was there already.
    locks: Option<Locks>,
}

impl StagedRun {
    /// Starts one for the folder `out`, in which no run is.
    ///
    /// # Errors
    /// If something is in the way there, or it cannot be written to.
    pub(super) fn start(out: &Path, plan: Plan) -> Result<Self, FolderError> {
        let is_there = fs::symlink_metadata(out).is_ok();
        let locks = is_there.then(|| taken(out)).transpose()?;
        let hidden = if is_there {
            HiddenFolder::inside(out)
        } else {
            HiddenFolder::beside(out)
        };
        let hidden = hidden.map_err(FolderError::io("make the folder", out))?;
        let writer = RunWriter::start(&hidden.path(), plan);
        Ok(Self {
            writer: writer.map_err(|error| error.staged(&hidden.path(), out))?,
            hidden,
            out: out.into(),
            locks,
        })
    }

    /// Fills it: `write` is given its writer, whose folder is the hidden one. Errors name the files in the folder that the
    /// run gets, since the hidden one is gone when they are read.
    ///
    /// # Errors
    /// Whatever `write` returns.
    pub(super) fn fill<T>(
        &self,
        write: impl FnOnce(&RunWriter) -> Result<T, FolderError>,
    ) -> Result<T, FolderError> {
        write(&self.writer).map_err(|error| error.staged(&self.hidden.path(), &self.out))
    }

    /// Moves the run to its folder.
    ///
    /// # Errors
    /// If that is not possible. No run is there then.
    pub(super) fn finish(self) -> Result<(), FolderError> {
        let Self {
            writer,
            hidden,
            out,
            locks,
        } = self;
        // Windows moves no folder in which a file is open.
        drop(writer);
        let staged = hidden.path();
        let moved = |from: &Path, to: &Path| {
            move_file(from, to).map_err(FolderError::io("move the run to", to))
        };
        if locks.is_none() {
            return moved(&staged, &out);
        }
        let parts = parts(&staged).map_err(FolderError::io("read", &staged))?;
        let others = parts.iter().filter(|name| *name != PLAN && *name != LOCK);
        for name in others {
            moved(&staged.join(name), &out.join(name))?;
        }
        moved(&staged.join(PLAN), &out.join(PLAN))
    }
}

/// Locks a folder that is there, if a run can begin in it.
fn taken(out: &Path) -> Result<Locks, FolderError> {
    let records = out.join(store::FOLDER);
    let in_the_way = in_the_way(out).or_else(|| records.exists().then_some(records));
    if let Some(path) = in_the_way {
        return Err(FolderError::Occupied { path });
    }
    refuse_links(out)?;
    let locks = lock(out)?;
    if has_plan(out) {
        let folder = out.into();
        return Err(FolderError::InUse { folder }); // by a run that has begun meanwhile
    }
    Ok(locks)
}

/// The names of what is in a folder, in order.
fn parts(folder: &Path) -> io::Result<Vec<OsString>> {
    let entries = fs::read_dir(folder)?;
    let names = entries.map(|entry| Ok::<_, io::Error>(entry?.file_name()));
    let mut names = names.collect::<io::Result<Vec<_>>>()?;
    names.sort();
    Ok(names)
}
