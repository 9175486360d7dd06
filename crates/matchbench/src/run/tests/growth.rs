//! Runs that grow.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::again::reword;
use super::*;
use crate::files::{Fault, break_calls};
use crate::records::RunFolder;

/// Cancels a run after so many records.
struct After<'c> {
    records: AtomicUsize,
    cancel: &'c Cancel,
}

impl Observer for After<'_> {
    fn on_record(&self, _: &RunRecord) {
        if self.records.fetch_sub(1, Ordering::Relaxed) == 1 {
            self.cancel.set();
        }
    }
}

fn sampled(sample: Option<usize>, repetitions: u32) -> RunSettings {
    RunSettings {
        sample,
        ..repeated(repetitions)
    }
}

fn earlier_files(bench: &Bench) -> usize {
    let folder = bench.path("grown").join("earlier");
    if folder.exists() {
        files(&folder).len()
    } else {
        0
    }
}

#[test]
fn a_run_can_grow_and_another_estimator_costs_only_itself() {
    let toy = Toy::default();
    let extractions = || toy.extractions.swap(0, Ordering::Relaxed);
    let dark = || {
        let dark = Toy {
            threshold: 140,
            ..toy.clone()
        };
        dark.contender("dark", &["first"])
    };
    let all = || vec![dark(), toy.contender("bright", &["first", "second"])];
    let mut bench = Bench::new(all());
    bench.settings = repeated(2);
    bench.run("whole").unwrap();
    let expected = bench.records("whole");
    extractions();

    // A few pairs of one dataset with one estimator; then more of each.
    let datasets = bench.datasets.clone();
    bench.datasets.truncate(1);
    bench.contenders = vec![toy.contender("bright", &["second"])];
    bench.settings.limit = Some(3);
    bench.run("grown").unwrap();
    bench.settings.limit = None;
    bench.run("grown").unwrap();
    assert!(extractions() > 0);
    bench.contenders = vec![toy.contender("bright", &["first", "second"])];
    let summary = bench.run("grown").unwrap();
    assert_eq!(
        (summary.before, summary.now, extractions()),
        (2 * 21, 2 * 21, 0)
    );
    bench.contenders = all();
    bench.datasets = datasets;
    bench.run("grown").unwrap();
    assert_eq!(bench.records("grown"), expected);
}

#[test]
fn more_repetitions_and_more_pairs_than_a_sample_keep_what_is_done() {
    let mut bench = Bench::new(two_by_two());
    bench.settings = repeated(3);
    let whole = bench.run("whole").unwrap();
    let expected = bench.records("whole");
    assert_eq!(expected.len(), whole.total);

    let mut before = 0;
    for settings in [
        sampled(Some(2), 1),
        sampled(Some(4), 2),
        sampled(None, 2),
        sampled(None, 3),
    ] {
        bench.settings = settings;
        let summary = bench.run("grown").unwrap();
        assert_eq!(summary.before, before, "nothing is done twice");
        assert!(summary.now > 0 && summary.is_complete());
        assert_eq!(earlier_files(&bench), 0, "all is taken over");
        before = summary.total;
    }
    assert_eq!(bench.records("grown"), expected);
    assert!(!bench.path("grown").join("earlier").exists());
}

#[test]
fn a_run_of_other_images_does_not_begin_to_grow() {
    let mut bench = Bench::new(two_by_two());
    bench.settings = sampled(Some(2), 1);
    bench.run("grown").unwrap();
    let expected = bench.records("grown");
    let noted = bench.path("grown/images/street.txt");
    let first = fs::read_to_string(noted).unwrap();
    let frame: u32 = first.split(' ').next().unwrap().parse().unwrap();
    let image = bench.path(&format!("street/{frame:04}.raw"));
    let sound = fs::read(&image).unwrap();
    fs::write(&image, [7; 64]).unwrap();
    bench.settings = sampled(None, 2);
    let error = bench.run("grown").unwrap_err().to_string();
    assert!(
        error.contains(".raw") && error.contains("changed"),
        "{error}"
    );
    // As it was: it is scored, and what it was begun with goes on.
    assert_eq!(earlier_files(&bench), 0);
    assert_eq!(bench.records("grown"), expected);
    // Whether images have changed is asked by whoever holds the folder.
    let plan = RunFolder::open(&bench.path("grown"))
        .unwrap()
        .plan()
        .clone();
    let other = RunWriter::start(&bench.path("grown"), plan).unwrap();
    let error = bench.run("grown").unwrap_err().to_string();
    assert!(error.contains("in use"), "{error}");
    drop(other);
    bench.settings = sampled(Some(2), 1);
    assert_eq!(bench.run("grown").unwrap().now, 0);
    fs::write(&image, sound).unwrap();
    bench.settings = sampled(None, 2);
    assert!(bench.run("grown").unwrap().is_complete());
}

#[test]
fn a_run_that_grows_hashes_its_images_once() {
    let mut bench = Bench::new(two_by_two());
    bench.settings = sampled(Some(2), 1);
    bench.run("grown").unwrap();
    let noted = fs::read_to_string(bench.path("grown/images/street.txt")).unwrap();
    let frame: u32 = noted.split(' ').next().unwrap().parse().unwrap();
    let image = bench.path(&format!("street/{frame:04}.raw"));
    // It begins to grow, and is stopped before it matches anything.
    let stopped = Cancel::default();
    stopped.set();
    bench.settings = sampled(None, 2);
    // The image is opened and read.
    let broken = break_calls(&image, Fault::Error, 2);
    bench.run_with("grown", &Silent, &stopped).unwrap();
    assert_eq!(broken.happened(), None, "it is read again");
    drop(broken);
    assert!(bench.run("grown").unwrap().is_complete());
}

#[test]
fn a_run_that_grows_may_be_cut_off_anywhere_and_grow_again() {
    let mut bench = Bench::new(two_by_two());
    bench.settings = repeated(3);
    bench.run("whole").unwrap();
    let expected = bench.records("whole");
    for stop in [1, 2, 7, 20, 64] {
        let _ = fs::remove_dir_all(bench.path("grown"));
        bench.settings = sampled(Some(3), 1);
        let done = bench.run("grown").unwrap().total;
        bench.settings = sampled(None, 2);
        let cancel = Cancel::default();
        let observer = After {
            records: AtomicUsize::new(stop),
            cancel: &cancel,
        };
        bench.run_with("grown", &observer, &cancel).unwrap();
        assert!(earlier_files(&bench) > 0);
        // What stands there is complete pairs in order at all times.
        let records = store::files(&bench.path("grown")).unwrap();
        for file in records {
            let repetitions = store::read(&file).unwrap();
            let numbers: Vec<u32> = repetitions.iter().map(|r| r.task.repetition).collect();
            assert!(
                numbers
                    .iter()
                    .zip([0, 1].iter().cycle())
                    .all(|(a, b)| a == b)
            );
        }
        if stop == 64 {
            // All of before is taken over in one file, which is not complete.
            bench.run("grown").unwrap();
            assert_eq!(earlier_files(&bench), 0);
        }
        bench.settings = repeated(3);
        let summary = bench.run("grown").unwrap();
        assert!(summary.before >= done + stop, "{} {stop}", summary.before);
        assert!(summary.is_complete());
        assert_eq!(bench.records("grown"), expected);
        assert_eq!(earlier_files(&bench), 0);
    }
}

#[test]
fn records_of_before_a_run_grew_stay_as_they_stood() {
    let mut bench = Bench::new(vec![Toy::default().contender("bright", &["first"])]);
    bench.settings = sampled(Some(3), 1);
    bench.run("grown").unwrap();
    let file = store::path(&bench.path("grown"), "street", "bright", "first");
    let first = reword(&file);
    // It is stopped before it has taken over all of it, and grows again.
    bench.settings = sampled(None, 2);
    let cancel = Cancel::default();
    let observer = After {
        records: AtomicUsize::new(1),
        cancel: &cancel,
    };
    bench.run_with("grown", &observer, &cancel).unwrap();
    assert!(file.exists() && earlier_files(&bench) > 0);
    bench.settings = repeated(3);
    assert!(bench.run("grown").unwrap().is_complete());
    let text = fs::read_to_string(&file).unwrap();
    assert!(text.lines().any(|line| line == first));
    bench.run("whole").unwrap();
    assert_eq!(bench.records("grown"), bench.records("whole"));
}

#[test]
fn a_process_that_is_killed_while_records_are_set_aside_loses_none() {
    let mut bench = Bench::new(two_by_two());
    bench.settings = repeated(2);
    bench.run("whole").unwrap();
    let expected = bench.records("whole");
    bench.settings = repeated(1);
    let done = bench.run("grown").unwrap().total;
    // One file of three was moved, and another is in both places.
    let run = bench.path("grown");
    let all = store::files(&run).unwrap();
    let aside = |file: &Path| {
        run.join("earlier")
            .join(file.strip_prefix(run.join("records")).unwrap())
    };
    for file in &all[..2] {
        fs::create_dir_all(aside(file).parent().unwrap()).unwrap();
    }
    fs::rename(&all[0], aside(&all[0])).unwrap();
    fs::copy(&all[1], aside(&all[1])).unwrap();
    let moved = store::read(&aside(&all[0])).unwrap().len();
    let waiting = RunFolder::open(&run).unwrap().waiting().unwrap();
    assert_eq!(waiting, moved, "those of the other file are records");
    for repetitions in [1, 2] {
        bench.settings = repeated(repetitions);
        let summary = bench.run("grown").unwrap();
        assert_eq!(summary.before, done);
    }
    assert_eq!(bench.records("grown"), expected);
    assert_eq!(earlier_files(&bench), 0);
}

#[test]
fn a_sample_without_the_pairs_that_are_done_and_a_strange_record_are_refused() {
    let mut bench = Bench::new(two_by_two());
    bench.settings = sampled(Some(4), 1);
    bench.run("grown").unwrap();
    let refused = |bench: &Bench| bench.run("grown").unwrap_err().to_string();
    bench.settings = sampled(Some(5), 1);
    let message = refused(&bench);
    assert!(
        message.contains("one of 8, or all pairs, has them all"),
        "{message}"
    );
    bench.settings = sampled(Some(2), 1);
    assert!(refused(&bench).contains("`settings.sample` is 4 there and 2 here"));
    bench.settings = sampled(None, 2);
    let cancel = Cancel::default();
    cancel.set();
    bench.run_with("grown", &Silent, &cancel).unwrap();
    bench.settings = sampled(None, 1);
    assert!(refused(&bench).contains("`settings.repetitions` is 2 there and 1 here"));

    // Records of pairs that the dataset does not list.
    bench.settings = sampled(None, 2);
    let file = files(&bench.path("grown").join("earlier")).remove(0);
    let mut records = store::read(&file).unwrap();
    records[1].task.b = 999;
    store::rewrite(&file, &records).unwrap();
    let message = refused(&bench);
    assert!(
        message.contains(":2: ") && message.contains("no such task"),
        "{message}"
    );
}

#[test]
fn what_failed_before_a_run_grew_is_tried_again_as_ever() {
    let toy = Toy::default();
    let mut bench = Bench::new(vec![toy.contender("bright", &["first"])]);
    bench.run("grown").unwrap();
    let file = store::files(&bench.path("grown")).unwrap().remove(0);
    let mut records = store::read(&file).unwrap();
    for (place, may_pass) in [(0, true), (1, false)] {
        records[place].outcome = Outcome::Failed {
            reason: "broken".into(),
            may_pass,
        };
    }
    store::rewrite(&file, &records).unwrap();
    bench.settings = repeated(2);
    let summary = bench.run("grown").unwrap();
    assert_eq!(summary.failed, 1, "the one that cannot pass");
    assert_eq!(summary.before, summary.total / 2 - 1);
    assert!(summary.is_complete());
}

#[test]
fn another_protocol_alone_is_refused_with_the_way_to_have_both() {
    let toy = Toy::default();
    let mut bench = Bench::new(vec![toy.contender("bright", &["first"])]);
    bench.run("grown").unwrap();
    let mut under = toy.contender("bright", &["first"]);
    under.estimators[0].name = "first@superglue".into();
    bench.contenders = vec![under];
    let message = bench.run("grown").unwrap_err().to_string();
    assert!(
        message.contains("`--protocol matchbench,superglue` has both"),
        "{message}"
    );
}

#[test]
fn what_a_run_would_lose_is_named_wherever_it_stands() {
    let mut bench = Bench::new(two_by_two());
    bench.run("run").unwrap();
    let refused = |bench: &Bench, named: &str| {
        let message = bench.run("run").unwrap_err().to_string();
        assert!(message.contains(named), "{message}");
    };
    let bright = bench.contenders.remove(0);
    refused(&bench, "`matchers[0]` is `bright` there and absent here");
    let others = Toy::default().contender("other", &["first"]);
    bench.contenders.insert(0, others);
    set_threshold(&mut bench.contenders[1], 65);
    refused(&bench, "`matchers[0]` is `bright` there and absent here");
    set_threshold(&mut bench.contenders[1], 140);
    bench.contenders[0] = Toy::default().contender("bright", &["second"]);
    refused(
        &bench,
        "`matchers[0].estimators[0]` is `first` there and absent here",
    );
    bench.contenders[0] = bright;
    let first = bench.datasets.remove(0);
    refused(
        &bench,
        &format!(
            "`datasets[0]` is `{}` there and absent here",
            first.sequence.name
        ),
    );
    bench.datasets.push(first);
    assert!(bench.run("run").unwrap().is_complete());
}
