//! The folder of a run: one process writes into it, for one plan.
//!
//! | file | what |
//! | --- | --- |
//! | `plan.json` | the [`Plan`], for people and for the next start |
//! | `.lock` | held by the process that writes; a lock ends with its process, however that ends |
//! | `records/` | see [`crate::records`] |

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::plan::difference;
use super::{Plan, RunError};
use crate::files::write_whole;

/// A folder that is ours as long as this value lives.
#[derive(Debug)]
pub(super) struct RunFolder {
    path: PathBuf,
    _lock: File,
}

impl RunFolder {
    /// The folder at `path`: a new one, which is given the `plan`, or one that has it already.
    ///
    /// # Errors
    /// If it has another plan, is in use, damaged, or cannot be written to.
    pub(super) fn open(path: &Path, plan: &Plan) -> Result<Self, RunError> {
        fs::create_dir_all(path).map_err(named("make the folder", path))?;
        let lock = lock(path)?;
        let plan_file = path.join("plan.json");
        let plan = serde_json::to_value(plan).expect("a plan is plain JSON");
        let written = read_plan(&plan_file)?;
        match &written {
            Some(written) => {
                if let Some(difference) = difference(written, &plan) {
                    return Err(RunError::OtherPlan {
                        folder: path.into(),
                        difference,
                    });
                }
            }
            None if path.join("records").exists() => {
                return Err(RunError::Damaged {
                    path: plan_file,
                    reason: "there are records, but not the plan that they belong to".into(),
                });
            }
            None => {}
        }
        if written.as_ref() != Some(&plan) {
            let text = serde_json::to_string_pretty(&plan).expect("a plan is plain JSON");
            write_whole(&plan_file, format!("{text}\n").as_bytes())?;
        }
        Ok(Self {
            path: path.into(),
            _lock: lock,
        })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }
}

fn lock(folder: &Path) -> Result<File, RunError> {
    let path = folder.join(".lock");
    let file = (File::options().write(true).create(true).truncate(false))
        .open(&path)
        .map_err(named("open", &path))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(RunError::InUse {
            folder: folder.into(),
        }),
        Err(TryLockError::Error(error)) => Err(named("lock", &path)(error)),
    }
}

fn read_plan(path: &Path) -> Result<Option<Value>, RunError> {
    let text = match fs::read(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        text => text.map_err(named("read", path))?,
    };
    (serde_json::from_slice(&text).map(Some)).map_err(|error| RunError::Damaged {
        path: path.into(),
        reason: format!("not a plan ({error})"),
    })
}

fn named(action: &str, path: &Path) -> impl FnOnce(io::Error) -> RunError {
    move |error| {
        let message = format!("cannot {action} {}: {error}", path.display());
        RunError::Io(io::Error::new(error.kind(), message))
    }
}
