//! Every call of the file system passes here, so that tests can let each of them fail.
//!
//! In the program these functions do the call and nothing else. A test that [`break_calls`] in a folder
//! decides which of the calls there fails, and how.

use std::fs::File;
use std::io;
use std::path::Path;

/// What is about to be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Call {
    /// A file is opened.
    Open,
    /// A file is read.
    Read,
    /// A file is written to.
    Write,
    /// A file is cut.
    Cut,
    /// What was written is brought to the disk.
    Sync,
    /// A file takes another's place.
    Rename,
    /// A folder is made.
    MakeFolder,
}

/// To be asked before a call.
///
/// # Errors
/// Where a test wants it to fail.
#[cfg(not(test))]
#[inline]
pub(crate) fn before(_: Call, _: &Path) -> io::Result<()> {
    Ok(())
}

/// Writes all `bytes` at the place where the file is.
#[cfg(not(test))]
#[inline]
pub(crate) fn write_all(file: &mut File, path: &Path, bytes: &[u8]) -> io::Result<()> {
    before(Call::Write, path)?;
    io::Write::write_all(file, bytes)
}

/// Waits until what was written is on the disk.
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
        /// It does nothing and says so.
        Error,
        /// The disk is full after half of what is written.
        Full,
        /// The process is killed: a half is written, and nothing happens any more.
        Killed,
        /// The machine loses power: the same, and what was appended but not synced is gone.
        PowerLost,
    }

    /// What happens in a folder as long as this value lives.
    #[derive(Debug)]
    pub(crate) struct Broken(PathBuf);

    #[derive(Debug)]
    struct Plan {
        fault: Fault,
        /// The calls that succeed before.
        left: usize,
        happened: Option<(Call, PathBuf)>,
        /// How long the files were when they were last synced.
        synced: BTreeMap<PathBuf, u64>,
    }

    static PLANS: Mutex<BTreeMap<PathBuf, Plan>> = Mutex::new(BTreeMap::new());

    fn plans() -> MutexGuard<'static, BTreeMap<PathBuf, Plan>> {
        PLANS.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Lets all calls in `folder` succeed but the one after `left` others.
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
        /// The call that failed, if it came so far.
        pub(crate) fn happened(&self) -> Option<(Call, PathBuf)> {
            plans()[&self.0].happened.clone()
        }
    }

    impl Drop for Broken {
        fn drop(&mut self) {
            plans().remove(&self.0);
        }
    }

    /// What is to happen to a call: nothing, or a failure.
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
                    // What was there before is taken to be safe.
                    let length = std::fs::metadata(path).map_or(0, |metadata| metadata.len());
                    plan.synced.entry(path.into()).or_insert(length);
                }
                Call::Sync => {
                    let length = std::fs::metadata(path).map_or(0, |metadata| metadata.len());
                    plan.synced.insert(path.into(), length);
                }
                // A whole file takes the place of what was there.
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
