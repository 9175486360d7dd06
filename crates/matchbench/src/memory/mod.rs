//! Memory: what is left of it, and who may take much of it at once.
//!
//! An allocation that fails ends the process without a message, and so does a system that has no more memory to
//! give. So work on images, whose need is known from their size, asks first. `reserve` compares the need with
//! what is left ([`left`]). If others have asked and not ended yet, it waits for them. If the need is more than
//! there is, it says so, and nothing was begun. Small needs are not asked for.
//!
//! The answer is an estimate. It keeps a run from work that is known not to fit, but does not promise that all other work fits.

mod system;

use std::fmt;
use std::num::NonZeroU64;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

pub(crate) use system::{forget_peak, peak};

/// What is not worth asking for, in bytes.
const SMALL: u64 = 32 << 20;

/// The limit that was asked for; 0 where none was.
static ASKED: AtomicU64 = AtomicU64::new(0);

/// Lets the program have so many bytes in all, from now on and in all threads, whatever the system says.
pub fn limit_memory(bytes: NonZeroU64) {
    ASKED.store(bytes.get(), Ordering::Relaxed);
}

/// How much memory is left to this process, and by which limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Left {
    /// In bytes.
    pub bytes: u64,
    /// Of what, in words.
    pub of: &'static str,
}

/// The memory that is left: of the limit that was asked for ([`limit_memory`]), else the least of what
/// the machine, the control groups of the process and its resource limits leave. `None` where the system
/// does not tell.
pub fn left() -> Option<Left> {
    match NonZeroU64::new(ASKED.load(Ordering::Relaxed)) {
        Some(asked) => Some(Left {
            bytes: asked.get().saturating_sub(system::resident().unwrap_or(0)),
            of: "MATCHBENCH_MAX_MEMORY",
        }),
        None => system::left(),
    }
}

/// More memory is needed than there is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "about {} of memory are needed, and {} are left of {}",
    Amount(*needed), Amount(left.bytes), left.of
)]
pub struct TooMuch {
    /// In bytes, estimated.
    pub needed: u64,
    /// What there is.
    pub left: Left,
}

/// What somebody may use up, until this value is dropped.
#[derive(Debug)]
#[must_use]
pub(crate) struct Reserved<'a> {
    ledger: &'a Ledger,
    bytes: u64,
}

/// Asks for `bytes`. Waits while others hold so much that it does not fit beside theirs; whoever holds
/// some must not ask for more.
///
/// # Errors
/// If it does not fit even if nobody else holds any.
pub(crate) fn reserve(bytes: usize) -> Result<Reserved<'static>, TooMuch> {
    static LEDGER: Ledger = Ledger {
        held: Mutex::new(0),
        returned: Condvar::new(),
    };
    LEDGER.reserve(bytes as u64, left)
}

/// What all have asked for.
#[derive(Debug)]
struct Ledger {
    held: Mutex<u64>,
    returned: Condvar,
}

impl Ledger {
    fn reserve(
        &self,
        bytes: u64,
        left: impl Fn() -> Option<Left>,
    ) -> Result<Reserved<'_>, TooMuch> {
        if bytes < SMALL {
            return Ok(Reserved {
                ledger: self,
                bytes: 0,
            });
        }
        let mut held = self.held();
        // What is held may be in use already or not yet.
        while let Some(left) = left()
            && bytes > left.bytes.saturating_sub(*held)
        {
            if *held == 0 {
                let needed = bytes;
                return Err(TooMuch { needed, left });
            }
            held = (self.returned.wait(held)).unwrap_or_else(PoisonError::into_inner);
        }
        *held = held.saturating_add(bytes);
        Ok(Reserved {
            ledger: self,
            bytes,
        })
    }

    fn held(&self) -> MutexGuard<'_, u64> {
        // A number cannot be left half changed.
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Reserved<'_> {
    fn drop(&mut self) {
        if self.bytes > 0 {
            let mut held = self.ledger.held();
            *held = held.saturating_sub(self.bytes);
            drop(held);
            self.ledger.returned.notify_all();
        }
    }
}

/// So many bytes, as people say it.
struct Amount(u64);

impl fmt::Display for Amount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bytes = self.0 as f64;
        if bytes >= 1e9 {
            write!(f, "{:.1} GB", bytes * 1e-9)
        } else {
            write!(f, "{:.0} MB", bytes * 1e-6)
        }
    }
}

#[cfg(test)]
mod tests {
    use std::thread;
    use std::time::Duration;

    use super::*;

    const GIB: u64 = 1 << 30;

    fn ledger() -> Ledger {
        Ledger {
            held: Mutex::new(0),
            returned: Condvar::new(),
        }
    }

    fn there(bytes: u64) -> impl Fn() -> Option<Left> {
        move || {
            Some(Left {
                bytes,
                of: "a test",
            })
        }
    }

    #[test]
    fn what_does_not_fit_is_refused_with_numbers_and_what_is_small_is_not_asked_for() {
        let (ledger, left) = (ledger(), there(GIB));
        let error = ledger.reserve(3 * GIB, &left).unwrap_err().to_string();
        assert_eq!(
            error,
            "about 3.2 GB of memory are needed, and 1.1 GB are left of a test"
        );
        assert!(ledger.reserve(GIB, &left).is_ok());
        assert!(ledger.reserve(SMALL - 1, there(0)).is_ok());
        assert!(ledger.reserve(u64::MAX, || None).is_ok(), "nobody knows");
        assert_eq!(*ledger.held(), 0);
    }

    #[test]
    fn what_fits_alone_waits_for_the_others() {
        let (ledger, left) = (ledger(), there(GIB));
        let first = ledger.reserve(GIB / 2, &left).unwrap();
        let second = ledger.reserve(GIB / 2, &left).unwrap();
        thread::scope(|scope| {
            let third = scope.spawn(|| ledger.reserve(GIB, &left).map(|_| *ledger.held()));
            thread::sleep(Duration::from_millis(20));
            assert!(!third.is_finished());
            drop(first);
            thread::sleep(Duration::from_millis(20));
            assert!(!third.is_finished());
            drop(second);
            assert_eq!(third.join().unwrap(), Ok(GIB));
        });
    }
}
