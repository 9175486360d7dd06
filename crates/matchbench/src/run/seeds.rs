//! The seed of a task: it depends on what is done, never on when, where or in which order.
//!
//! A seed is derived from: the root seed, dataset, matcher, frame a, frame b, repetition; then `select`, or
//! `estimate` and the id of the estimator. The name that a variant of an estimator has in a run is not
//! used. So all variants make the same draws, and a comparison of values of a parameter does not depend on
//! luck.

use matchbench_vision::seed::Seed;

/// The seed of a pair and repetition with one matcher on one dataset, from the seed of
/// the run ([`RunSettings::seed`](crate::records::RunSettings)).
///
/// Whoever gives it to [`evaluate`](super::evaluate) gets what a run records.
pub fn pair_seed(
    root: u64,
    dataset: &str,
    matcher: &str,
    frames: (u32, u32),
    repetition: u32,
) -> Seed {
    Seed(root)
        .child(dataset)
        .child(matcher)
        .number(frames.0.into())
        .number(frames.1.into())
        .number(repetition.into())
}

/// The seed of the selection, or of a source of points, from that of the pair.
pub fn selection_seed(pair: Seed) -> Seed {
    pair.child("select")
}

/// The seed of an estimation, from that of the pair, by the id of the estimator's entry.
pub fn estimation_seed(pair: Seed, estimator: &str) -> Seed {
    pair.child("estimate").child(estimator)
}
