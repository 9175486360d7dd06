//! What is exchanged, lost or removed between runs, or while one goes on, is noticed.

use super::*;
use crate::records::{RunFolder, join};

/// The toys of [`two_by_two`], the first with a third estimator.
fn grown() -> Vec<Contender> {
    let mut contenders = two_by_two();
    contenders[0] = Toy::default().contender("bright", &["first", "second", "third"]);
    contenders
}

#[test]
fn matches_of_another_matcher_are_not_taken_for_those_of_the_records() {
    let mut bench = Bench::new(two_by_two());
    bench.settings = repeated(2);
    for run in ["whole", "same", "more"] {
        bench.run(run).unwrap();
    }
    let matches = |run: &str| {
        let file = RunFolder::open(&bench.path(run)).unwrap();
        let file = file.matches_of("street", "bright").unwrap();
        let pairs = bench.datasets[0].sequence.pairs.iter();
        let all: Vec<_> = (pairs
            .flat_map(|pair| [0, 1].map(|repetition| (pair.a, pair.b, repetition))))
        .map(|key| file.read(key).unwrap().unwrap())
        .collect();
        all
    };
    let expected = matches("whole");
    for run in ["same", "more"] {
        let file = |matcher: &str| bench.path(&format!("{run}/matches/street/{matcher}.bin"));
        fs::copy(file("dark"), file("bright")).unwrap();
        assert_ne!(matches(run), expected);
    }
    bench.run("same").unwrap();
    assert_eq!(matches("same"), expected, "they are made again");
    let again = fs::metadata(bench.path("same/matches/street/bright.bin")).unwrap();
    bench.run("same").unwrap();
    let after = fs::metadata(bench.path("same/matches/street/bright.bin")).unwrap();
    assert_eq!(again.len(), after.len(), "and are not lost any more");

    let grown = Bench {
        contenders: grown(),
        ..bench
    };
    grown.run("whole").unwrap();
    grown.run("more").unwrap();
    assert_eq!(grown.records("more"), grown.records("whole"));
}

/// Records of one estimator may be those of a time when the matches were others.
#[test]
fn matches_that_records_of_one_estimator_follow_from_are_not_foreign() {
    let bench = Bench::new(two_by_two());
    bench.run("run").unwrap();
    let file = store::path(&bench.path("run"), "street", "bright", "first");
    let mut records = store::read(&file).unwrap();
    for record in &mut records {
        record.counts.putative += 1;
    }
    store::rewrite(&file, &records).unwrap();
    let length = || {
        let file = bench.path("run/matches/street/bright.bin");
        fs::metadata(file).unwrap().len()
    };
    let before = length();
    bench.run("run").unwrap();
    assert_eq!(length(), before);
}

#[test]
fn a_run_that_has_lost_the_notes_of_its_images_does_not_go_on() {
    let mut bench = Bench::new(two_by_two());
    bench.run("run").unwrap();
    bench.run("other").unwrap();
    let notes = bench.path("run/images/street.txt");
    fs::remove_file(&notes).unwrap();
    assert_eq!(bench.run("run").unwrap().now, 0, "no image is used");
    let refused = |message: &str| {
        let named = notes.display().to_string();
        assert!(
            message.contains(&named) && message.contains("is gone"),
            "{message}"
        );
    };
    let runs = ["other", "run"].map(|run| bench.path(run));
    refused(&join(&runs, &bench.path("both")).unwrap_err().to_string());
    assert!(!bench.path("both").exists());
    bench.contenders = grown();
    let plan = || fs::read_to_string(bench.path("run/plan.json")).unwrap();
    let before = plan();
    refused(&bench.run("run").unwrap_err().to_string());
    assert_eq!(plan(), before, "it has not begun to grow");
    // As the message says.
    fs::write(&notes, "").unwrap();
    bench.run("run").unwrap();
    bench.run("other").unwrap();
    assert_eq!(bench.records("run"), bench.records("other"));
}

/// Removes a file when so many records are written.
struct Remover(PathBuf, AtomicUsize);

impl Observer for Remover {
    fn on_record(&self, _: &RunRecord) {
        if self.1.fetch_sub(1, Ordering::Relaxed) == 1 {
            fs::remove_file(&self.0).unwrap();
        }
    }
}

#[test]
fn records_that_are_removed_while_a_run_writes_are_an_error() {
    let bench = Bench::new(two_by_two());
    // While they are written, and those of a matcher that is done.
    for (run, after) in [("now", 3), ("later", 60)] {
        let file = bench.path(&format!("{run}/records/street/bright+first.jsonl"));
        let observer = Remover(file.clone(), AtomicUsize::new(after));
        let error = bench.run_with(run, &observer, &Cancel::default());
        let message = error.unwrap_err().to_string();
        let named = file.display().to_string();
        assert!(
            message.contains(&named) && message.contains("it was removed while"),
            "{message}"
        );
        bench.run(run).unwrap();
    }
    bench.run("whole").unwrap();
    assert_eq!(bench.records("later"), bench.records("whole"));
}
