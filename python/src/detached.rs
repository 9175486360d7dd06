//! Work without the interpreter, so that other threads of Python go on meanwhile.
//!
//! A process that was forked (`multiprocessing` does so on Linux) has none of the threads of its parent, and work that
//! is handed to their pool would wait for ever. It has a pool of its own.

use std::process;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use pyo3::prelude::*;
use rayon::ThreadPool;

use crate::errors::error;

/// The process that imported the package.
static IMPORTED_BY: OnceLock<u32> = OnceLock::new();

/// The pool of a process that was forked from it.
static FORKED: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Remembers which process this is.
pub(crate) fn remember() {
    let _ = IMPORTED_BY.set(process::id());
}

/// What `work` comes to, while the interpreter is released.
///
/// # Errors
/// If a forked process gets no threads.
pub(crate) fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let this = process::id();
    if IMPORTED_BY.get().is_none_or(|first| *first == this) {
        return Ok(py.detach(work));
    }
    let pool = pool_of(this)?;
    Ok(py.detach(|| pool.install(work)))
}

fn pool_of(this: u32) -> PyResult<Arc<ThreadPool>> {
    let mut forked = FORKED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((process, pool)) = &*forked
        && *process == this
    {
        return Ok(Arc::clone(pool));
    }
    let pool = matchbench_cli::pool(None).map_err(|broken| error(format!("{broken:#}")))?;
    let pool = Arc::new(pool);
    // That of a parent has no threads here; its end would wait for them.
    std::mem::forget(forked.replace((this, Arc::clone(&pool))));
    Ok(pool)
}
