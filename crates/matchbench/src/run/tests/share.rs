//! A run of some matchers on some datasets, and of a sample of the pairs.

use super::*;

fn only(bench: &mut Bench, dataset: usize, ids: &[&str]) {
    let ids = ids.iter().map(|id| (*id).to_owned()).collect();
    bench.datasets[dataset].matchers = Some(ids);
}

#[test]
fn a_dataset_has_the_matchers_that_it_names_and_may_gain_more() {
    let mut bench = Bench::new(two_by_two());
    bench.run("whole").unwrap();
    only(&mut bench, 1, &["dark"]);
    let summary = bench.run("run").unwrap();
    let street = bench.datasets[0].sequence.pairs.len();
    let office = bench.datasets[1].sequence.pairs.len();
    assert_eq!(summary.total, 3 * street + office);
    let records = bench.records("run");
    let of = |dataset: &str, matcher: &str| {
        let its =
            |record: &&RunRecord| record.task.dataset == dataset && record.task.matcher == matcher;
        records.iter().filter(its).count()
    };
    assert_eq!((of("office", "bright"), of("office", "dark")), (0, office));
    assert_eq!(of("street", "bright"), 2 * street);

    bench.datasets[1].matchers = None;
    assert_eq!(bench.run("run").unwrap().now, 2 * office);
    assert_eq!(bench.records("run"), bench.records("whole"));
    only(&mut bench, 1, &["dark"]);
    let message = bench.run("run").unwrap_err().to_string();
    assert!(message.contains("`datasets[1].matchers[0]`"), "{message}");
}

#[test]
fn a_sample_is_spread_over_the_pairs_and_a_smaller_one_is_refused() {
    let mut bench = Bench::new(vec![Toy::default().contender("bright", &["first"])]);
    bench.run("whole").unwrap();
    bench.settings.sample = Some(3);
    let summary = bench.run("run").unwrap();
    assert_eq!(summary.total, 6);
    let (some, all) = (bench.records("run"), bench.records("whole"));
    assert!(
        some.iter().all(|record| all.contains(record)),
        "the same tasks"
    );
    let pairs = &bench.datasets[0].sequence.pairs;
    let third = (some.iter())
        .filter(|record| record.task.dataset == "street")
        .nth(2);
    let expected = &pairs[2 * pairs.len() / 3];
    assert_eq!(
        third.map(|r| (r.task.a, r.task.b)),
        Some((expected.a, expected.b))
    );
    assert_eq!(bench.run("run").unwrap().now, 0);
    bench.settings.sample = Some(2);
    let message = bench.run("run").unwrap_err().to_string();
    assert!(message.contains("`settings.sample`"), "{message}");
}
