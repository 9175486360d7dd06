//! Runs work without holding the interpreter, so that other Python threads continue.
//!
//! A forked process (`multiprocessing` forks on Linux) has none of the threads of its parent. Work given to the
//! thread pool of the parent would wait for ever. So a forked process gets a pool of its own.

use std::process;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use pyo3::prelude::*;
use rayon::ThreadPool;

use crate::errors::error;

/// The process that imported the package.
static IMPORTED_BY: OnceLock<u32> = OnceLock::new();

/// The pool of a process that was forked from it.
static FORKED: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Remembers the id of this process.
pub(crate) fn remember() {
    let _ = IMPORTED_BY.set(process::id());
}

/// Runs `work` while the interpreter is released, and returns its result.
///
/// # Errors
/// If a forked process cannot start threads.
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
    // The pool of a parent has no threads in this process; dropping it would wait for them for ever.
    std::mem::forget(forked.replace((this, Arc::clone(&pool))));
    Ok(pool)
}
