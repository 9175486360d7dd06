//! Memory: how much is left, and which work may take much of it at the same time.
//!
//! An allocation that fails ends the process without a message, and so does a system that has no more memory to
//! give. So work on images, whose need is known from their size, first asks for its memory. `reserve` compares
//! the need with what is left ([`left`]). If other work has reserved memory and not finished yet, it waits for
//! it. If the need is more than there is at all, it returns an error, and the work is not started. Small needs
//! are not reserved.
//!
//! What an allocation costs in time is another matter: `pages` lowers it for the programs ([`HugePages`], [`keep_freed`]).
//!
//! The answer is an estimate. It prevents work that is known not to fit, but does not promise that all other
//! work fits.

mod pages;
mod system;

use std::fmt;
use std::num::NonZeroU64;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

pub use pages::{HugePages, keep_freed};
pub(crate) use system::{forget_peak, peak};

/// Bytes of the stack of a thread that works on images: as many as the system gives the main thread.
pub const STACK: usize = 8 << 20;

/// Needs below this are not reserved, in bytes.
const SMALL: u64 = 32 << 20;

/// The limit that was set; 0 if none was.
static ASKED: AtomicU64 = AtomicU64::new(0);

/// Limits the memory of the whole program to so many bytes, from now on and in all threads, whatever the system
/// allows.
pub fn limit_memory(bytes: NonZeroU64) {
    ASKED.store(bytes.get(), Ordering::Relaxed);
}

/// How much memory is left to this process, and which limit says so.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Left {
    /// In bytes.
    pub bytes: u64,
    /// The limit, in words.
    pub of: &'static str,
}

/// The memory that is left. If a limit was set ([`limit_memory`]), what is left of it. Otherwise the smallest
/// of what is left by the machine, the control groups of the process and its resource limits. `None` if the
/// system does not tell.
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
    /// The memory that is left.
    pub left: Left,
}

/// Reserved memory. It is given back when this value is dropped.
#[derive(Debug)]
#[must_use]
pub(crate) struct Reserved<'a> {
    ledger: &'a Ledger,
    bytes: u64,
}

/// Reserves `bytes`. Waits while other reservations leave too little. A caller that holds a reservation must
/// not ask for another.
///
/// # Errors
/// If it does not fit even without any other reservation.
pub(crate) fn reserve(bytes: usize) -> Result<Reserved<'static>, TooMuch> {
    static LEDGER: Ledger = Ledger {
        held: Mutex::new(0),
        returned: Condvar::new(),
    };
    LEDGER.reserve(bytes as u64, left)
}

/// The sum of all reservations.
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
        // Reserved memory may be in use already, or not yet.
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
        // A number cannot be left half changed, so a poisoned lock is no problem.
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

/// A number of bytes, printed for people.
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
