//! A selection that draws no random numbers is shared by the repetitions of a pair.

use super::*;

/// The records of three repetitions, and how often a pair was selected.
fn repetitions(uses_seed: bool) -> (Vec<RunRecord>, usize) {
    let toy = Toy {
        uses_seed,
        ..Toy::default()
    };
    let mut bench = Bench::new(vec![toy.contender("bright", &["first", "second"])]);
    bench.settings = repeated(3);
    bench.run("run").unwrap();
    let pairs: usize = (bench.datasets.iter())
        .map(|dataset| dataset.sequence.pairs.len())
        .sum();
    let selections = toy.selections.load(Ordering::Relaxed);
    assert_eq!(selections % pairs, 0);
    (bench.records("run"), selections / pairs)
}

#[test]
fn one_that_uses_no_seed_is_made_once_for_all_repetitions() {
    let (anew, selections) = repetitions(true);
    assert_eq!(selections, 3);
    let (shared, selections) = repetitions(false);
    assert_eq!(selections, 1);
    assert!(std::iter::zip(&anew, &shared).any(|(x, y)| x.counts != y.counts));
    // Records stand pair by pair. The matches of a pair are always the same, the seeds of its estimators are not.
    assert_eq!(shared.len(), anew.len());
    for of_pair in shared.chunks_exact(3) {
        let pair = |record: &RunRecord| (record.task.a, record.task.b);
        assert!(
            of_pair
                .iter()
                .all(|record| pair(record) == pair(&of_pair[0]))
        );
        assert!(
            of_pair
                .iter()
                .all(|record| record.counts == of_pair[0].counts)
        );
        assert_ne!(of_pair[0].outcome, of_pair[1].outcome);
    }
}
