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

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_part_of_a_task_gives_it_another_seed() {
        let pair = |root, dataset, matcher, frames, repetition| {
            pair_seed(root, dataset, matcher, frames, repetition).0
        };
        let one = pair_seed(1, "room", "sift", (3, 5), 0);
        let all = [
            one.0,
            pair(2, "room", "sift", (3, 5), 0),
            pair(1, "hall", "sift", (3, 5), 0),
            pair(1, "room", "orb", (3, 5), 0),
            pair(1, "room", "sift", (4, 5), 0),
            pair(1, "room", "sift", (3, 6), 0),
            pair(1, "room", "sift", (5, 3), 0),
            pair(1, "room", "sift", (3, 5), 1),
            selection_seed(one).0,
            estimation_seed(one, "best").0,
            estimation_seed(one, "ransac-e").0,
        ];
        assert_eq!(BTreeSet::from(all).len(), all.len());
    }
}
