//! Runs work without holding the interpreter, so that other Python threads continue.
//!
//! A forked process (`multiprocessing` forks on Linux) has none of the threads of its parent. Work given to the
//! thread pool of the parent would wait for ever. So a forked process gets a pool of its own.

use std::panic::resume_unwind;
use std::process;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread;
use std::time::Duration;

use matchbench::memory::STACK;
use matchbench::run::Cancel;
use pyo3::prelude::*;
use rayon::ThreadPool;

use crate::errors::error;

/// How often the thread of the caller checks for Ctrl-C.
const TICK: Duration = Duration::from_millis(50);

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
    let pool = pool_if_forked()?;
    Ok(py.detach(|| work_in(pool, work)))
}

/// Does the same in a thread of its own, while that of the caller checks for Ctrl-C. At the first one `cancel` is set, by
/// which `work` may end sooner; it is raised when `work` has ended, whose result is dropped.
///
/// # Errors
/// If threads cannot be started; what a signal raises.
pub(crate) fn interruptible<T: Send>(
    py: Python<'_>,
    cancel: &Cancel,
    work: impl FnOnce() -> T + Send,
) -> PyResult<T> {
    let pool = pool_if_forked()?;
    let mut interrupted = None;
    let look = || {
        if interrupted.is_none() {
            interrupted = signalled();
            if interrupted.is_some() {
                cancel.set();
            }
        }
    };
    let ended = watched(py, || work_in(pool, work), look)?;
    let result = ended.unwrap_or_else(|panic| resume_unwind(panic));
    interrupted.map_or(Ok(result), Err)
}

/// Runs `work` in a thread of its own while the interpreter is released, and calls `look` in that of the caller again and
/// again, and once more when `work` has ended. Returns its result, or what it panicked with.
///
/// # Errors
/// If the thread cannot be started.
pub(crate) fn watched<T: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> T + Send,
    mut look: impl FnMut() + Send,
) -> PyResult<thread::Result<T>> {
    py.detach(|| {
        thread::scope(|scope| {
            let (done, waiting) = channel();
            let worker = thread::Builder::new().stack_size(STACK);
            let worker = worker.spawn_scoped(scope, move || {
                // The receiver waits until this is sent.
                let _ = done.send(work());
            })?;
            loop {
                match waiting.recv_timeout(TICK) {
                    Ok(result) => {
                        look();
                        return Ok(Ok(result));
                    }
                    Err(RecvTimeoutError::Timeout) => look(),
                    Err(RecvTimeoutError::Disconnected) => {
                        return Ok(Err(worker.join().expect_err("it ended without a result")));
                    }
                }
            }
        })
    })
}

/// What a signal raises that came since the last look.
pub(crate) fn signalled() -> Option<PyErr> {
    let checked = Python::attach(|py| {
        py.check_signals()?;
        Ok::<_, PyErr>(())
    });
    checked.err()
}

fn work_in<T: Send>(pool: Option<Arc<ThreadPool>>, work: impl FnOnce() -> T + Send) -> T {
    match pool {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

/// The pool of this process, if it was forked from the one that imported the package.
fn pool_if_forked() -> PyResult<Option<Arc<ThreadPool>>> {
    let this = process::id();
    let is_forked = IMPORTED_BY.get().is_some_and(|first| *first != this);
    is_forked.then(|| pool_of(this)).transpose()
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
