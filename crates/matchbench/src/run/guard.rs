//! Runs the work of matchers and estimators, takes its time, and turns a panic or an error into a reason
//! why there is no result.

use std::fmt::Display;
use std::time::Instant;

use crate::panics::caught;
use crate::records::Outcome;

/// Most letters of a reason that are recorded: what breaks may say anything, and longer lines of records are refused.
const MAX_LETTERS: usize = 4096;

/// Why there is no result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Broken {
    /// In words.
    pub(super) reason: String,
    /// Whether another try may do better: see [`Outcome::Failed`].
    pub(super) may_pass: bool,
}

impl Broken {
    /// What may be different another time: a file, a program beside this one.
    pub(super) fn for_now(reason: String) -> Self {
        Self {
            reason,
            may_pass: true,
        }
    }

    /// What a record says of it.
    pub(super) fn outcome(self) -> Outcome {
        let Self {
            mut reason,
            may_pass,
        } = self;
        if let Some((end, _)) = reason.char_indices().nth(MAX_LETTERS) {
            reason.truncate(end);
            reason.push_str(" ...");
        }
        Outcome::Failed { reason, may_pass }
    }
}

impl From<String> for Broken {
    /// What would break again: the same bits come of the same work.
    fn from(reason: String) -> Self {
        Self {
            reason,
            may_pass: false,
        }
    }
}

/// Does `work`; an error or a panic becomes a reason in words that begin with `what` broke.
///
/// State that a panic leaves half changed is the matcher's own, and all that can come of it is
/// caught here again.
pub(super) fn guard<T, E: Display>(
    what: impl Display,
    work: impl FnOnce() -> Result<T, E>,
) -> Result<T, String> {
    match caught(work) {
        Ok(result) => result.map_err(|error| format!("{what} failed: {error}")),
        Err(message) => Err(format!("{what} panicked: {message}")),
    }
}

/// Does `work` and notes how many `seconds` it took, by the one clock of a run.
pub(super) fn timed<T>(seconds: &mut Option<f64>, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    *seconds = Some(start.elapsed().as_secs_f64());
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_of_any_length_is_recorded_by_its_beginning() {
        let told = |reason: String| match Broken::from(reason).outcome() {
            Outcome::Failed { reason, .. } => reason,
            other => panic!("{other:?}"),
        };
        assert_eq!(told("ä".repeat(MAX_LETTERS)), "ä".repeat(MAX_LETTERS));
        let long = told("ä".repeat(9 << 20));
        assert_eq!(long, "ä".repeat(MAX_LETTERS) + " ...");
    }

    #[test]
    fn errors_and_panics_become_reasons() {
        assert_eq!(guard("search", || Ok::<_, String>(3)), Ok(3));
        assert_eq!(
            guard("search", || Err::<(), _>("no index")),
            Err("search failed: no index".into())
        );
        let broken = |which: usize| guard("search", || Ok::<_, String>([1, 2][which]));
        let reason = broken(2).unwrap_err();
        assert!(
            reason.starts_with("search panicked: index out of bounds"),
            "{reason}"
        );
    }
}
