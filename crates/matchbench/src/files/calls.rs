//! Every call to the file system goes through this file, so that tests can make each of them fail.
//!
//! In the program these functions only make the call. In a test, [`break_calls`] decides which call in a folder
//! fails, and how.

use std::fs::File;
use std::io;
use std::path::Path;

/// The kinds of calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Call {
    /// A file is opened.
    Open,
    /// A file is read.
    Read,
    /// A file is written to.
    Write,
    /// A file is truncated.
    Cut,
    /// Written data are flushed to the disk.
    Sync,
    /// A file replaces another.
    Rename,
    /// A folder is made.
    MakeFolder,
}

/// Must be called before each call to the file system.
///
/// # Errors
/// If a test wants the call to fail.
#[cfg(not(test))]
#[inline]
pub(crate) fn before(_: Call, _: &Path) -> io::Result<()> {
    Ok(())
}

/// Writes all `bytes` at the current position of the file.
#[cfg(not(test))]
#[inline]
pub(crate) fn write_all(file: &mut File, path: &Path, bytes: &[u8]) -> io::Result<()> {
    before(Call::Write, path)?;
    io::Write::write_all(file, bytes)
}

/// Waits until written data are on the disk.
#[cfg(not(test))]
#[inline]
pub(crate) fn sync(file: &File, path: &Path) -> io::Result<()> {
    before(Call::Sync, path)?;
    file.sync_data()
}

#[cfg(test)]
pub(crate) use faults::{Fault, before, break_calls, sync, write_all};

#[cfg(test)]
mod faults {
    use std::collections::BTreeMap;
    use std::io::Write;
    use std::path::PathBuf;
    use std::sync::{Mutex, MutexGuard, PoisonError};

    use super::*;

    /// How a call fails.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub(crate) enum Fault {
        /// The call does nothing and returns an error.
        Error,
        /// The disk becomes full after half of the data were written.
        Full,
        /// The process is killed: half of the data are written, and all later calls do nothing.
        Killed,
        /// The machine loses power: as when killed, and appended data that were not synced are lost.
        PowerLost,
    }

    /// Faults in a folder, active as long as this value lives.
    #[derive(Debug)]
    pub(crate) struct Broken(PathBuf);

    #[derive(Debug)]
    struct Plan {
        fault: Fault,
        /// Number of calls that still succeed.
        left: usize,
        happened: Option<(Call, PathBuf)>,
        /// Lengths of the files when they were last synced.
        synced: BTreeMap<PathBuf, u64>,
    }

    static PLANS: Mutex<BTreeMap<PathBuf, Plan>> = Mutex::new(BTreeMap::new());

    fn plans() -> MutexGuard<'static, BTreeMap<PathBuf, Plan>> {
        PLANS.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Makes one call in `folder` fail: the one after `left` successful calls.
    pub(crate) fn break_calls(folder: &Path, fault: Fault, left: usize) -> Broken {
        let plan = Plan {
            fault,
            left,
            happened: None,
            synced: BTreeMap::new(),
        };
        plans().insert(folder.into(), plan);
        Broken(folder.into())
    }

    impl Broken {
        /// The call that failed, if it was reached.
        pub(crate) fn happened(&self) -> Option<(Call, PathBuf)> {
            plans()[&self.0].happened.clone()
        }
    }

    impl Drop for Broken {
        fn drop(&mut self) {
            plans().remove(&self.0);
        }
    }

    /// The failure of a call; `None` if it succeeds.
    fn verdict(call: Call, path: &Path) -> Option<Fault> {
        let mut plans = plans();
        let (_, plan) = plans
            .iter_mut()
            .find(|(folder, _)| path.starts_with(folder))?;
        let is_final = matches!(plan.fault, Fault::Killed | Fault::PowerLost);
        if plan.happened.is_some() {
            return is_final.then_some(Fault::Error);
        }
        if plan.left > 0 {
            plan.left -= 1;
            match call {
                Call::Open => {
                    // Data that existed before are assumed to be on the disk.
                    let length = std::fs::metadata(path).map_or(0, |metadata| metadata.len());
                    plan.synced.entry(path.into()).or_insert(length);
                }
                Call::Sync => {
                    let length = std::fs::metadata(path).map_or(0, |metadata| metadata.len());
                    plan.synced.insert(path.into(), length);
                }
                // A complete file replaces the old one.
                Call::Rename => drop(plan.synced.remove(path)),
                _ => {}
            }
            return None;
        }
        plan.happened = Some((call, path.into()));
        if plan.fault == Fault::PowerLost {
            for (path, &length) in &plan.synced {
                if let Ok(file) = File::options().write(true).open(path) {
                    file.set_len(length).expect("it is a test's file");
                }
            }
            return Some(Fault::Error);
        }
        Some(plan.fault)
    }

    fn refused(fault: Fault) -> io::Error {
        match fault {
            Fault::Full => io::Error::new(io::ErrorKind::StorageFull, "the disk is full"),
            _ => io::Error::other("as the test wants"),
        }
    }

    pub(crate) fn before(call: Call, path: &Path) -> io::Result<()> {
        verdict(call, path).map_or(Ok(()), |fault| Err(refused(fault)))
    }

    /// Tests do not wait for a disk.
    pub(crate) fn sync(_: &File, path: &Path) -> io::Result<()> {
        before(Call::Sync, path)
    }

    pub(crate) fn write_all(file: &mut File, path: &Path, bytes: &[u8]) -> io::Result<()> {
        match verdict(Call::Write, path) {
            None => file.write_all(bytes),
            Some(Fault::Error) => Err(refused(Fault::Error)),
            Some(fault) => {
                file.write_all(&bytes[..bytes.len() / 2])?;
                Err(refused(fault))
            }
        }
    }
}
