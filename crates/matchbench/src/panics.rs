//! Code that may panic, called so that a panic is an error in words: decoders, and matchers of users.

use std::any::Any;
use std::panic::{self, AssertUnwindSafe};

/// Does `work`.
///
/// State that a panic leaves half changed must be the work's own, or not be looked at again.
///
/// # Errors
/// If it panics; what the panic said.
pub(crate) fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    panic::catch_unwind(AssertUnwindSafe(work)).map_err(|payload| message(&*payload).to_owned())
}

fn message(payload: &(dyn Any + Send)) -> &str {
    (payload.downcast_ref::<String>().map(String::as_str))
        .or_else(|| payload.downcast_ref::<&str>().copied())
        .unwrap_or("no message")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_what_it_said() {
        assert_eq!(caught(|| 3), Ok(3));
        let broken = |which: usize| caught(|| [1, 2][which]);
        let reason = broken(2).unwrap_err();
        assert!(reason.starts_with("index out of bounds"), "{reason}");
        assert_eq!(caught(|| panic!("plain")), Err::<(), _>("plain".into()));
        let silent = caught(|| -> () { panic::panic_any(7) });
        assert_eq!(silent, Err("no message".into()));
    }
}
