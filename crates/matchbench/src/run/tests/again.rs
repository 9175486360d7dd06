//! What is tried again, and what must be as it was for that.

use super::*;

#[test]
fn an_image_that_was_mended_is_tried_again_and_one_that_changed_is_refused_by_name() {
    let bench = Bench::new(vec![
        Toy::default().contender("bright", &["first", "second"]),
    ]);
    bench.run("whole").unwrap();
    let image = bench.path("street/0003.raw");
    let sound = fs::read(&image).unwrap();
    fs::write(&image, &sound[..7]).unwrap();
    let missing = bench.path("street/0006.raw");
    fs::rename(&missing, bench.path("away")).unwrap();
    let broken = bench.run("run").unwrap();
    assert!(broken.is_complete() && broken.failed > 0);
    fs::write(&image, &sound).unwrap();
    let again = bench.run("run").unwrap();
    assert!(again.now > 0 && again.failed > 0 && again.failed < broken.failed);
    fs::rename(bench.path("away"), &missing).unwrap();
    assert_eq!(bench.run("run").unwrap().failed, 0);
    assert_eq!(bench.records("run"), bench.records("whole"));
    assert_eq!(bench.run("run").unwrap().now, 0, "nothing is left");

    let mut other = sound;
    let last = other.len() - 1;
    other[last] ^= 1;
    fs::write(&image, &other).unwrap();
    let mut more = Bench {
        contenders: vec![],
        ..bench
    };
    more.contenders = vec![Toy::default().contender("bright", &["first", "second", "third"])];
    let error = more.run("run").unwrap_err().to_string();
    assert!(
        error.contains("0003.raw") && error.contains("changed"),
        "{error}"
    );
    // It is the run that it was, and not one that lacks an estimator.
    more.contenders = vec![Toy::default().contender("bright", &["first", "second"])];
    assert_eq!(more.run("run").unwrap().now, 0);
}

#[test]
fn an_image_that_changes_while_a_run_is_stopped_is_refused_by_name() {
    let mut bench = Bench::new(vec![Toy::default().contender("bright", &["first"])]);
    bench.settings.limit = Some(1);
    bench.run("run").unwrap();
    let image = bench.path("street/0001.raw");
    let mut other = fs::read(&image).unwrap();
    let last = other.len() - 1;
    other[last] ^= 1;
    fs::write(&image, &other).unwrap();
    bench.settings.limit = None;
    let error = bench.run("run").unwrap_err().to_string();
    assert!(error.contains("0001.raw"), "{error}");
}

#[test]
fn what_a_matcher_breaks_is_tried_again_only_where_that_is_asked_for() {
    let trouble = Toy {
        trouble: Trouble::ErrorInSearch,
        ..Toy::default()
    };
    let mut bench = Bench::new(vec![trouble.contender("toy", &["first"])]);
    bench.settings.limit = Some(4);
    let failed = bench.run("run").unwrap().failed;
    assert!(failed > 0);
    assert_eq!(bench.run("run").unwrap().now, 0);
    bench.retry_failed = true;
    let again = bench.run("run").unwrap();
    assert_eq!((again.now, again.failed), (failed, failed));
    bench.contenders = vec![Toy::default().contender("toy", &["first"])];
    assert_eq!(bench.run("run").unwrap().failed, 0);
    bench.run("whole").unwrap();
    assert_eq!(bench.records("run"), bench.records("whole"));
}

/// Writes the first record of a file in other words than a run would, which holds its records; returns its line.
pub(super) fn reword(file: &Path) -> String {
    let text = fs::read_to_string(file).unwrap();
    let (first, others) = text.split_once('\n').unwrap();
    let (body, _) = first.rsplit_once(",\"check\"").unwrap();
    let body = body.replacen('{', "{ ", 1);
    let check = blake3::hash(body.as_bytes()).to_hex();
    let first = format!("{body},\"check\":\"{}\"}}", &check[..16]);
    fs::write(file, format!("{first}\n{others}")).unwrap();
    first
}

#[test]
fn records_beside_those_that_are_tried_again_stay_as_they_stand() {
    let bench = Bench::new(vec![Toy::default().contender("bright", &["first"])]);
    let image = bench.path("street/0006.raw");
    fs::rename(&image, bench.path("away")).unwrap();
    bench.run("run").unwrap();
    fs::rename(bench.path("away"), &image).unwrap();
    let file = store::path(&bench.path("run"), "street", "bright", "first");
    let first = reword(&file);
    let again = bench.run("run").unwrap();
    assert!(again.now > 0 && again.failed == 0, "{again:?}");
    let now = fs::read_to_string(&file).unwrap();
    assert_eq!(now.lines().next(), Some(&*first));
}

/// Stops the run after some records.
struct Stop(Cancel, AtomicUsize);
impl Observer for Stop {
    fn on_record(&self, _: &RunRecord) {
        if self.1.fetch_add(1, Ordering::Relaxed) == 300 {
            self.0.set();
        }
    }
}

#[test]
fn repetitions_without_end_take_no_memory() {
    let mut bench = Bench::new(vec![Toy::default().contender("bright", &["first"])]);
    bench.settings = repeated(u32::MAX);
    let stop = Stop(Cancel::default(), AtomicUsize::new(0));
    let summary = bench.run_with("run", &stop, &stop.0).unwrap();
    assert!(summary.now >= 300 && summary.now < 2000, "{summary:?}");
    let resumed = Stop(Cancel::default(), AtomicUsize::new(250));
    let again = bench.run_with("run", &resumed, &resumed.0).unwrap();
    assert_eq!(again.before, summary.now);
    let repetitions: Vec<u32> = (bench.records("run").iter())
        .map(|r| r.task.repetition)
        .collect();
    assert!(
        (0..)
            .zip(&repetitions)
            .all(|(expected, found)| expected == *found)
    );
}

#[test]
fn an_image_that_cannot_be_read_fails_its_pairs_alone() {
    let bench = Bench::new(vec![Toy::default().contender("bright", &["first"])]);
    fs::write(bench.path("street/0003.raw"), [0; 7]).unwrap();
    fs::remove_file(bench.path("street/0006.raw")).unwrap();
    bench.run("run").unwrap();
    for record in bench.records("run") {
        let task = &record.task;
        let missing = |frame| task.dataset == "street" && (task.a == frame || task.b == frame);
        match &record.outcome {
            Outcome::Failed { reason, .. } if missing(3) => {
                assert!(reason.contains("0003.raw failed: the last row"), "{reason}");
            }
            Outcome::Failed { reason, .. } => {
                assert!(missing(6) && reason.contains("cannot read"), "{reason}");
                assert!(reason.contains("0006.raw"), "{reason}");
            }
            _ => assert!(!missing(3) && !missing(6)),
        }
    }
}

#[test]
fn matches_that_are_gone_are_made_again_and_records_stay() {
    let mut bench = Bench::new(vec![
        Toy::default().contender("bright", &["first", "second"]),
    ]);
    bench.settings = repeated(2);
    let before = bench.run("run").unwrap();
    let file = bench.path("run").join("matches/street/bright.bin");
    let records = fs::read(bench.path("run").join("records/street/bright+first.jsonl")).unwrap();
    let whole = fs::read(&file).unwrap();
    for cut in [0, 8, 100, whole.len() / 2, whole.len() - 1] {
        fs::write(&file, &whole[..cut]).unwrap();
        let again = bench.run("run").unwrap();
        assert_eq!((again.now, again.total), (0, before.total));
        assert_eq!(fs::read(&file).unwrap(), whole, "cut at {cut}");
    }
    fs::remove_file(&file).unwrap();
    bench.run("run").unwrap();
    assert_eq!(fs::read(&file).unwrap(), whole);
    let now = fs::read(bench.path("run").join("records/street/bright+first.jsonl")).unwrap();
    assert_eq!(now, records);
}

/// Cancels a run as soon as it is told of lost matches.
struct Hasty(Cancel);
impl Observer for Hasty {
    fn on_lost_matches(&self, _: &str, _: &str, _: usize) {
        self.0.set();
    }
}

#[test]
fn a_run_that_is_stopped_before_lost_matches_are_there_again_is_not_complete() {
    let mut bench = Bench::new(two_by_two());
    bench.settings = repeated(2);
    let whole = bench.run("run").unwrap();
    assert_eq!(whole.lost, 0);
    let all = files(&bench.path("run").join("matches"));
    let bytes: Vec<_> = all.iter().map(|file| fs::read(file).unwrap()).collect();
    fs::remove_dir_all(bench.path("run").join("matches")).unwrap();
    let hasty = Hasty(Cancel::default());
    let stopped = bench.run_with("run", &hasty, &hasty.0).unwrap();
    assert_eq!((stopped.before, stopped.lost), (whole.total, 2 * (21 + 7)));
    assert!(!stopped.is_complete());
    let again = bench.run("run").unwrap();
    assert!(again.is_complete() && again.now == 0, "{again:?}");
    for (file, bytes) in all.iter().zip(bytes) {
        assert_eq!(fs::read(file).unwrap(), bytes);
    }
}

#[test]
fn the_order_of_datasets_matchers_and_estimators_makes_no_other_plan() {
    let mut bench = Bench::new(two_by_two());
    bench.run("run").unwrap();
    let records = bench.records("run");
    bench.datasets.reverse();
    bench.contenders.reverse();
    bench.contenders[1].estimators.reverse();
    let again = bench.run("run").unwrap();
    assert!(again.is_complete() && again.now == 0, "{again:?}");
    assert_eq!(bench.records("run"), records);
    // What else differs is refused by its place in the plan that was written last.
    set_threshold(&mut bench.contenders[0], 65);
    let message = bench.run("run").unwrap_err().to_string();
    assert!(
        message.contains("`matchers[0].params.threshold` is 140 there and 65 here"),
        "{message}"
    );
}
