//! Runs that are joined are the run that would have done all.

use super::outside::Flaky;
use super::*;
use crate::files::{Fault, break_calls};
use crate::records::{JoinError, Joined, RunFolder, join};

/// Runs these contenders.
fn run(bench: &mut Bench, contenders: Vec<Contender>, name: &str) {
    bench.contenders = contenders;
    bench.run(name).unwrap();
}

fn joined(bench: &Bench, runs: &[&str], out: &str) -> Result<Joined, JoinError> {
    let runs: Vec<PathBuf> = runs.iter().map(|run| bench.path(run)).collect();
    join(&runs, &bench.path(out))
}

fn refused(bench: &Bench, runs: &[&str]) -> String {
    let message = joined(bench, runs, "refused").unwrap_err().to_string();
    assert!(!bench.path("refused").exists(), "nothing is written");
    message
}

#[test]
fn matchers_estimators_and_datasets_of_several_runs_come_together() {
    let toy = Toy::default();
    let dark = || {
        let dark = Toy {
            threshold: 140,
            ..Toy::default()
        };
        dark.contender("dark", &["first"])
    };
    let mut bench = Bench::new(vec![toy.contender("bright", &["first", "second"]), dark()]);
    bench.settings = repeated(2);
    let total = bench.run("whole").unwrap().total;
    let all = bench.datasets.clone();

    run(&mut bench, vec![toy.contender("bright", &["first"])], "a");
    bench.datasets.truncate(1);
    let both = vec![toy.contender("bright", &["second"]), dark()];
    run(&mut bench, both, "b");
    bench.datasets = all[1..].to_vec();
    run(
        &mut bench,
        vec![dark(), toy.contender("bright", &["second", "first"])],
        "c",
    );
    let done = joined(&bench, &["a", "b", "c"], "all").unwrap();
    assert_eq!(
        (done.recorded, done.planned, done.failed),
        (total as u64, total as u64, 0)
    );
    let (mut records, mut expected) = (bench.records("all"), bench.records("whole"));
    for records in [&mut records, &mut expected] {
        records.sort_by_key(|record| serde_json::to_string(&record.task).unwrap());
    }
    assert_eq!(records, expected);

    // It is a run like any other: nothing is left, and it may grow.
    bench.datasets = all;
    bench.contenders = vec![toy.contender("bright", &["first", "second"]), dark()];
    assert_eq!(bench.run("all").unwrap().now, 0);
    bench.contenders = vec![
        toy.contender("bright", &["first", "second", "third"]),
        dark(),
    ];
    let grown = bench.run("all").unwrap();
    assert_eq!(grown.now, total / 3, "a third estimator");
    let message = joined(&bench, &["a"], "all").unwrap_err().to_string();
    assert!(message.contains("holds a run already"), "{message}");
}

#[test]
fn what_several_have_is_taken_from_the_one_that_has_more() {
    let bench = Bench::new(vec![Toy::default().contender("bright", &["first"])]);
    let total = bench.run("whole").unwrap().total;
    for run in ["less", "more"] {
        bench.run(run).unwrap();
        let file = store::path(&bench.path(run), "street", "bright", "first");
        let mut records = store::read(&file).unwrap();
        records.truncate(if run == "less" { 3 } else { 7 });
        store::rewrite(&file, &records).unwrap();
    }
    let missing = 21 - 7;
    let done = joined(&bench, &["less", "more"], "all").unwrap();
    assert_eq!(
        (done.recorded, done.planned),
        ((total - missing) as u64, total as u64)
    );
    assert_eq!(bench.run("all").unwrap().now, missing);
    assert_eq!(bench.records("all"), bench.records("whole"));
}

#[test]
fn what_waits_in_a_run_that_grew_waits_in_the_joined_one() {
    let toy = Toy::default();
    let mut bench = Bench::new(vec![toy.contender("bright", &["first"])]);
    bench.settings = repeated(2);
    bench.run("whole").unwrap();
    bench.contenders = vec![toy.contender("bright", &["second"])];
    bench.run("other").unwrap();
    bench.contenders = vec![toy.contender("bright", &["first"])];
    bench.settings = repeated(1);
    let done = bench.run("grown").unwrap().total;
    bench.run("less").unwrap();
    // It begins to grow, and is stopped before it does anything.
    bench.settings = repeated(2);
    let cancel = Cancel::default();
    cancel.set();
    for run in ["grown", "less"] {
        bench.run_with(run, &Silent, &cancel).unwrap();
    }
    let aside = files(&bench.path("less").join("earlier"));
    let mut records = store::read(&aside[0]).unwrap();
    records.pop();
    store::rewrite(&aside[0], &records).unwrap();

    joined(&bench, &["less", "grown", "other"], "all").unwrap();
    let waiting = RunFolder::open(&bench.path("all")).unwrap().waiting();
    assert_eq!(waiting.unwrap(), done, "of the run that has more");
    bench.contenders = vec![toy.contender("bright", &["first", "second"])];
    let summary = bench.run("all").unwrap();
    assert_eq!((summary.now, summary.is_complete()), (done, true));
    let mut records = bench.records("all");
    records.retain(|record| record.task.estimator == "first");
    assert_eq!(records, bench.records("whole"));

    records[1].task.repetition = 2;
    store::rewrite(&aside[0], &records).unwrap();
    let message = refused(&bench, &["less", "other"]);
    assert!(
        message.contains("earlier") && message.contains(":2: the plan has no such task"),
        "{message}"
    );
}

#[test]
fn a_run_that_is_written_is_not_joined() {
    struct Joining<'b>(&'b Bench);
    impl Observer for Joining<'_> {
        fn on_record(&self, _: &RunRecord) {
            let message = refused(self.0, &["a", "b"]);
            assert!(message.contains("in use by another process"), "{message}");
        }
    }
    let toy = Toy::default();
    let mut bench = Bench::new(vec![toy.contender("bright", &["first"])]);
    bench.datasets.truncate(1);
    bench.run("a").unwrap();
    bench.contenders = vec![toy.contender("bright", &["second"])];
    bench
        .run_with("b", &Joining(&bench), &Cancel::default())
        .unwrap();
    // A copy need not have the file that processes lock.
    fs::remove_file(bench.path("a").join(".lock")).unwrap();
    joined(&bench, &["a", "b"], "both").unwrap();
    assert!(!bench.path("a").join(".lock").exists());
}

#[test]
fn runs_that_contradict_each_other_are_not_joined() {
    let toy = Toy::default();
    let mut bench = Bench::new(vec![toy.contender("bright", &["first"])]);
    bench.run("a").unwrap();
    bench.settings.seed = 1;
    bench.run("seed").unwrap();
    bench.settings = repeated(2);
    bench.run("twice").unwrap();
    bench.settings = RunSettings::default();
    set_threshold(&mut bench.contenders[0], 65);
    bench.run("threshold").unwrap();
    set_threshold(&mut bench.contenders[0], 64);
    assert!(refused(&bench, &["a", "seed"]).contains("`settings.seed` is 1 there and 0 here"));
    // "There" is the run that is named last.
    assert!(refused(&bench, &["a", "seed"]).contains("seed: `settings.seed` is 1 there"));
    assert!(refused(&bench, &["a", "twice"]).contains("`settings.repetitions` is 2 there"));
    assert!(
        refused(&bench, &["a", "threshold"]).contains("`matchers.bright.params.threshold` is 65")
    );
    assert!(refused(&bench, &["a", "absent"]).contains("not the folder of a run"));

    let pair = &mut bench.datasets[1].sequence.pairs[2];
    let mut b_from_a = *pair.pose().unwrap();
    b_from_a.translation.x += 1e-9;
    *pair = Pair::with_pose(pair.a, pair.b, b_from_a);
    bench.run("moved").unwrap();
    assert!(refused(&bench, &["a", "moved"]).contains("dataset `office` are others there"));

    // The same dataset, with another image.
    let other = Bench::new(vec![toy.contender("dark", &["first"])]);
    fs::write(&other.datasets[0].sequence.frames[3].image, [7; 64]).unwrap();
    other.run("b").unwrap();
    let runs = [bench.path("a"), other.path("b")];
    let message = join(&runs, &bench.path("refused")).unwrap_err().to_string();
    assert!(
        message.contains("the image of frame 3 of street was another"),
        "{message}"
    );
    assert!(!RunFolder::is_at(&bench.path("refused")));
}

#[test]
fn all_that_an_outside_matcher_found_on_a_dataset_comes_from_one_run() {
    let mut bench = Bench::new(vec![Flaky::default().with(&["first"])]);
    bench.run("first").unwrap();
    run(
        &mut bench,
        vec![Flaky::default().with(&["second"])],
        "second",
    );
    run(&mut bench, vec![Flaky::default().contender()], "both");
    let message = refused(&bench, &["first", "second"]);
    assert!(
        message.contains("flaky is in") && message.contains("on street"),
        "{message}"
    );
    // What is there and was not planned is nobody's.
    let file = |run: &str| store::path(&bench.path(run), "street", "flaky", "second");
    fs::copy(file("both"), file("first")).unwrap();
    let done = joined(&bench, &["first", "both"], "all").unwrap();
    assert_eq!(done.recorded, done.planned);
    assert_eq!(bench.records("all"), bench.records("both"));
    assert_eq!(bench.run("all").unwrap().now, 0);
}

#[test]
fn a_join_that_breaks_off_leaves_no_run_and_can_be_repeated() {
    let toy = Toy::default();
    let mut bench = Bench::new(vec![toy.contender("bright", &["first"])]);
    bench.datasets = vec![dataset(bench.folder.path(), "office", 3)];
    bench.run("a").unwrap();
    bench.contenders = vec![toy.contender("bright", &["second"])];
    bench.run("b").unwrap();
    joined(&bench, &["a", "b"], "whole").unwrap();
    let whole = bench.records("whole");
    let mut interrupted = [0; 2];
    for is_there in [false, true] {
        for fault in [Fault::Error, Fault::Killed] {
            for left in 0.. {
                let out = format!("{is_there} {fault:?} {left}");
                let note = bench.path(&out).join("note.txt");
                if is_there {
                    fs::create_dir(bench.path(&out)).unwrap();
                    fs::write(&note, "ours").unwrap();
                }
                let broken = break_calls(bench.folder.path(), fault, left);
                let ended = joined(&bench, &["a", "b"], &out);
                let happened = broken.happened();
                drop(broken);
                if let Err(error) = &ended {
                    let said = error.to_string();
                    assert!(!said.contains(".matchbench-"), "what is gone: {said}");
                }
                if ended.is_ok() {
                    assert_eq!(bench.records(&out), whole, "{out}, {happened:?}");
                    assert_eq!(note.exists(), is_there);
                    if happened.is_none() {
                        break;
                    }
                    continue;
                }
                interrupted[usize::from(is_there)] += 1;
                assert!(!RunFolder::is_at(&bench.path(&out)), "{out}, {happened:?}");
                assert_eq!(bench.path(&out).exists(), is_there, "{out}");
                match joined(&bench, &["a", "b"], &out) {
                    Ok(_) => assert_eq!(bench.records(&out), whole, "{out}"),
                    // Among the files of others, parts are moved one by one.
                    Err(error) => assert!(
                        is_there && error.to_string().contains("no plan.json beside it"),
                        "{out}: {error}"
                    ),
                }
            }
        }
    }
    assert!(
        interrupted.iter().all(|&times| times > 20),
        "{interrupted:?}"
    );
}
