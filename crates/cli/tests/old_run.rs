//! The folder of a run of matchbench 0.1.0, before its format had a number, still opens and goes on.
//!
//! `old_run/run` is what that version wrote for the dataset that the test makes again (its path cut
//! short, without the feature cache):
//!
//! ```sh
//! matchbench tune training --matchers sift --parameter ransac-e.threshold_px --values 0.5,1 --out tuning
//! matchbench run wall --matchers sift --tuned tuning/tuned.json --limit 3 --repeat 2 --out run
//! ```

mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use common::{dataset, matchbench};
use serde_json::Value;

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("writable");
    for entry in fs::read_dir(from).expect("part of the repository") {
        let path = entry.expect("it can be listed").path();
        let to = to.join(path.file_name().expect("an entry has a name"));
        if path.is_dir() {
            copy(&path, &to);
        } else {
            fs::copy(&path, &to).expect("writable");
        }
    }
}

fn fixture() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/old_run")
}

fn go(arguments: &[&str], paths: &[&Path]) -> Output {
    let output = matchbench().args(arguments).args(paths).output();
    output.expect("the program starts")
}

fn succeeded(output: &Output) -> String {
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{message}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// The records of a run without their times.
fn records(run: &Path) -> Vec<Value> {
    let text = fs::read_to_string(run.join("records/wall/sift+ransac-e.jsonl"));
    (text.expect("the run has records").lines())
        .map(|line| {
            let mut record: Value = serde_json::from_str(line).expect("a whole record");
            record["times"] = Value::Null;
            // The checksum is of the times too.
            record.as_object_mut().expect("a record").remove("check");
            // Poses of that version did not state one.
            if let Some(outcome) = record["outcome"].as_object_mut() {
                outcome.remove("pose_probability");
                outcome.remove("overlap_probability");
            }
            record
        })
        .collect()
}

#[test]
fn it_is_scored_and_reported_as_it_is() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let run = folder.path().join("run");
    copy(&fixture().join("run"), &run);
    let table = succeeded(&go(&["eval"], &[&run]));
    let row = table.lines().find(|line| line.starts_with("wall"));
    let row: Vec<&str> = row.expect("a row").split_whitespace().collect();
    assert_eq!(row[..5], ["wall", "sift", "ransac-e", "6", "0"], "{table}");
    succeeded(&go(&["report"], &[&run]));
    let page = fs::read_to_string(run.join("report/index.html")).expect("it was written");
    assert!(page.contains("threshold_px=0.5 was chosen on training"));
    // Where it was run is not known: here it is only reported.
    assert!(page.contains("<dt>seed</dt>") && !page.contains("<dt>platform</dt>"));
    let authors = folder.path().join("authors");
    succeeded(&go(&["export"], &[&run, &authors]));
    let rows = fs::read_to_string(authors.join("wall/sift.txt")).expect("it was written");
    assert_eq!(rows.lines().count(), 3, "one row a pair");
}

#[test]
fn it_goes_on_where_it_was_torn_to_the_records_of_a_run_in_one_piece() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 4);
    let [old, new] = ["old", "new"].map(|name| folder.path().join(name));
    copy(&fixture().join("run"), &old);
    let file = old.join("records/wall/sift+ransac-e.jsonl");
    let text = fs::read(&file).expect("part of the fixture");
    fs::write(&file, &text[..text.len() - 100]).expect("writable");
    let tuned = fixture().join("tuned.json");
    let run = |out: &Path| {
        let run = ["run", "--matchers", "sift", "--repeat", "2", "--tuned"];
        succeeded(&go(&run, &[&tuned, Path::new("--out"), out, &wall]));
    };
    run(&old);
    run(&new);
    assert_eq!(records(&new).len(), 12);
    assert_eq!(records(&old), records(&new));
    let plan = |run: &Path| fs::read_to_string(run.join("plan.json")).expect("a plan");
    assert_eq!(plan(&old), plan(&new), "it has the number now");
}

#[test]
fn a_folder_of_a_later_format_is_refused_by_its_number() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let run = folder.path().join("run");
    copy(&fixture().join("run"), &run);
    let plan = r#"{"format": 99, "what comes then": []}"#;
    fs::write(run.join("plan.json"), plan).expect("writable");
    for command in ["eval", "report"] {
        let refused = go(&[command], &[&run]);
        assert_eq!(refused.status.code(), Some(1));
        let message = String::from_utf8_lossy(&refused.stderr);
        assert!(message.contains("format 99"), "{message}");
    }
}
