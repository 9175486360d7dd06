//! Every call of the file system fails once, in every way: what is resumed is what was never broken.

use std::collections::BTreeSet;

use super::*;
use crate::files::{Fault, break_calls};
use crate::records::RunFolder;

const FAULTS: [Fault; 4] = [Fault::Error, Fault::Full, Fault::Killed, Fault::PowerLost];

/// Three frames, three pairs, two estimators.
fn small() -> Bench {
    let mut bench = Bench::new(vec![
        Toy::default().contender("bright", &["first", "second"]),
    ]);
    bench.datasets = vec![dataset(bench.folder.path(), "office", 3)];
    bench.threads = 1;
    bench
}

/// Runs with a fault after 0, 1, 2 ... calls until all succeed, each in a folder that was `prepared`, and
/// goes on from there. Returns how many calls there were.
fn break_each(bench: &Bench, fault: Fault, prepare: impl Fn(&str)) -> usize {
    let whole = bench.records("whole");
    for left in 0.. {
        let name = format!("{fault:?}{left}");
        prepare(&name);
        let broken = break_calls(bench.folder.path(), fault, left);
        let ended = bench.run(&name);
        let happened = broken.happened();
        drop(broken);
        let Some((call, path)) = happened else {
            assert_eq!(ended.unwrap().failed, 0);
            return left;
        };
        let at = format!("{fault:?} at call {left}, {call:?} of {}", path.display());
        refers_to_what_is_there(&bench.path(&name), &at);
        let resumed = bench
            .run(&name)
            .unwrap_or_else(|error| panic!("{at}: {error}"));
        assert!(resumed.is_complete() && resumed.failed == 0, "{at}");
        assert!(bench.records(&name) == whole, "{at}: other records");
        assert_eq!(bench.run(&name).unwrap().now, 0, "{at}: something was left");
    }
    unreachable!("a run has an end")
}

/// Whatever happened, records are of images that are noted, and their matches are there.
fn refers_to_what_is_there(folder: &Path, at: &str) {
    let Ok(run) = RunFolder::open(folder) else {
        return;
    };
    let notes = fs::read_to_string(folder.join("images/office.txt")).unwrap_or_default();
    let noted: BTreeSet<&str> = notes
        .lines()
        .filter_map(|line| line.split(' ').next())
        .collect();
    let matches = run.matches_of("office", "bright").unwrap();
    for record in run.records().unwrap_or_default() {
        let task = &record.task;
        if matches!(record.outcome, Outcome::Failed { .. }) {
            continue;
        }
        for frame in [task.a, task.b] {
            assert!(
                noted.contains(&*frame.to_string()),
                "{at}: frame {frame} is not noted"
            );
        }
        let key = (task.a, task.b, task.repetition);
        assert!(matches.contains(key), "{at}: no matches of {key:?}");
    }
}

#[test]
fn a_run_that_breaks_at_any_call_goes_on_as_if_it_had_not() {
    let bench = small();
    bench.run("whole").unwrap();
    for fault in FAULTS {
        let calls = break_each(&bench, fault, |_| {
            let _ = fs::remove_dir_all(bench.path("cache"));
        });
        assert!(calls > 40, "{calls} calls");
    }
}

#[test]
fn a_run_that_goes_on_may_break_again() {
    let bench = small();
    bench.run("whole").unwrap();
    let records = "records/office/bright+first.jsonl";
    for fault in FAULTS {
        let calls = break_each(&bench, fault, |name| {
            // An image that is missing, a line that is torn.
            let image = bench.path("office/0002.raw");
            fs::rename(&image, bench.path("away")).unwrap();
            bench.run(name).unwrap();
            fs::rename(bench.path("away"), &image).unwrap();
            let file = bench.path(name).join(records);
            let text = fs::read(&file).unwrap();
            fs::write(&file, &text[..text.len() - 9]).unwrap();
        });
        assert!(calls > 20, "{calls} calls");
    }
}

#[test]
fn a_run_that_grows_may_break_at_any_call() {
    let mut bench = small();
    bench.settings = repeated(2);
    bench.run("whole").unwrap();
    for fault in FAULTS {
        let calls = break_each(&bench, fault, |name| {
            let done = bench.run_by(repeated(1), name, &Silent, &Cancel::default());
            assert!(done.unwrap().is_complete());
        });
        assert!(calls > 30, "{calls} calls");
    }
}
