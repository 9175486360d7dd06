//! A run file is a run by its arguments, written down.

mod common;

use std::fs;
use std::path::Path;
use std::process::Output;

use common::{dataset, matchbench};

fn run(arguments: &[&str], folder: &Path) -> Output {
    let mut command = matchbench();
    command.arg("run").args(arguments).current_dir(folder);
    command.output().expect("the program starts")
}

/// What `folder/run` holds of one matcher, without the times and what follows from them.
fn poses(run: &Path, dataset: &str, matcher: &str) -> Vec<serde_json::Value> {
    let file = run.join(format!("records/{dataset}/{matcher}+ransac-e.jsonl"));
    let text = fs::read_to_string(file).unwrap_or_default();
    let record = |line: &str| -> serde_json::Value {
        let record: serde_json::Value = serde_json::from_str(line).expect("a record");
        serde_json::json!([record["task"], record["outcome"], record["counts"]])
    };
    text.lines().map(record).collect()
}

const STUDY: &str = "out = 'written'\nmatchers = ['sift']\nestimators = ['ransac-e']\nseed = 3\n\
    [set]\nsift.ratio = 0.7\n\
    [[dataset]]\npath = 'wall'\n[[dataset]]\npath = 'tower'\nmatchers = ['orb']\n";

#[test]
fn a_run_file_and_arguments_make_the_same_records() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| folder.path().join(name);
    dataset(folder.path(), "wall", 4);
    dataset(folder.path(), "tower", 3);
    fs::write(at("study.toml"), STUDY).expect("writable");
    let output = run(&["study.toml"], folder.path());
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let typed = [
        "wall",
        "--matchers",
        "sift",
        "--estimator",
        "ransac-e",
        "--seed",
        "3",
    ];
    let typed = [&typed[..], &["--set", "sift.ratio=0.7", "--out", "typed"]].concat();
    assert!(run(&typed, folder.path()).status.success());
    let written = poses(&at("written"), "wall", "sift");
    assert_eq!(written.len(), 6);
    assert_eq!(written, poses(&at("typed"), "wall", "sift"));
    assert_eq!(poses(&at("written"), "tower", "orb").len(), 3);
    assert!(!at("written/records/tower/sift+ransac-e.jsonl").exists());

    // Arguments take the place of what the file says.
    let quick = run(
        &["study.toml", "--sample", "2", "--out", "quick"],
        folder.path(),
    );
    assert!(quick.status.success(), "{quick:?}");
    assert_eq!(poses(&at("quick"), "wall", "sift").len(), 2);
    // And the file alone resumes.
    let again = run(&["study.toml"], folder.path());
    let told = String::from_utf8_lossy(&again.stderr);
    assert!(told.contains("9 of them earlier"), "{told}");
}

#[test]
fn the_shards_of_a_run_file_are_its_run() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 4);
    dataset(folder, "tower", 3);
    let text = "out = 'run'\nmatchers = ['gms']\nestimators = ['ransac-e']\nrepeat = 2\n\
        [set]\nsift.extractor = { contrast_threshold = 0.01 }\nransac-e.threshold_px = 2\n\
        [[dataset]]\npath = 'data/wall'\nmatchers = ['sift']\n\
        [[dataset]]\npath = 'data/tower'\nmatchers = ['sift']\n";
    fs::create_dir_all(folder.join("studies/data")).expect("writable");
    for name in ["wall", "tower"] {
        fs::rename(folder.join(name), folder.join("studies/data").join(name)).expect("writable");
    }
    fs::write(folder.join("studies/study.toml"), text).expect("writable");
    // The second is one of several parts, whose others stay what the file says.
    let mut set = vec!["--set", "ransac-e.threshold_px=3"];
    set.extend(["--set", r#"sift.extractor={"sigma":1.7}"#]);
    let ends = |words: &[&str]| {
        let mut command = matchbench();
        let output = command.current_dir(folder).args(words).output();
        output.expect("the program starts")
    };
    let succeeds = |words: &[&str]| {
        let output = ends(words);
        assert!(output.status.success(), "{words:?}: {output:?}");
    };
    succeeds(&[&["run", "studies/study.toml"], &set[..]].concat());
    let plan = ["plan", "studies/study.toml", "--shards", "2", "--out", "p"];
    succeeds(&[&plan[..], &set].concat());
    for shard in ["1", "2"] {
        succeeds(&["work", "p", "--shard", shard]);
    }
    succeeds(&["merge", "p", "--out", "merged"]);
    let plan_of = |run: &str| fs::read_to_string(folder.join(run).join("plan.json"));
    let planned = plan_of("merged").expect("a plan");
    assert_eq!(planned, plan_of("studies/run").expect("a plan"));
    for set in [
        "threshold_px\": 3.0",
        "contrast_threshold\": 0.01",
        "sigma\": 1.7",
    ] {
        assert!(planned.contains(set), "{set}: {planned}");
    }
    for (name, pairs) in [("wall", 6), ("tower", 3)] {
        let merged = poses(&folder.join("merged"), name, "sift");
        assert_eq!(merged.len(), 2 * pairs);
        assert_eq!(merged, poses(&folder.join("studies/run"), name, "sift"));
    }

    // What cannot be cut is refused, and says so.
    for (other, named) in [
        (text.replacen("['sift']", "['orb']", 1), "not all matchers"),
        (format!("sample = 2\n{text}"), "a sample"),
    ] {
        fs::write(folder.join("studies/study.toml"), other).expect("writable");
        let output = ends(&["plan", "studies/study.toml", "--shards", "2", "--out", "q"]);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains(named), "{said}");
    }
    let output = ends(&["plan", "absent.toml", "--shards", "2", "--out", "q"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        said.contains("absent.toml") && said.contains("check its path"),
        "{said}"
    );
}

#[test]
fn mistakes_are_told_by_file_and_line() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    dataset(folder.path(), "wall", 3);
    dataset(folder.path(), "tower", 3);
    for (text, told) in [
        (STUDY.replace("seed", "sead"), "study.toml:4: "),
        (STUDY.replace("'orb'", "'orbb'"), "study.toml:11: "),
        (STUDY.replace("ratio", "ratoi"), "study.toml:6: "),
        (
            STUDY.replace("sift.ratio", "surf.ratio"),
            "study.toml:6: `surf` is given a setting",
        ),
        (STUDY.replace("out = 'written'\n", ""), "--out"),
        (STUDY.replace("path = 'wall'", "path = 'absent'"), "absent"),
    ] {
        fs::write(folder.path().join("study.toml"), text).expect("writable");
        let output = run(&["study.toml"], folder.path());
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(message.contains(told), "{told}: {message}");
        assert!(!folder.path().join("written").exists(), "nothing was begun");
    }
    let both = run(&["wall", "study.toml", "--out", "x"], folder.path());
    let message = String::from_utf8_lossy(&both.stderr);
    assert!(message.contains("stands alone"), "{message}");
}

#[test]
fn matches_that_are_given_replace_those_of_the_same_name() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| folder.path().join(name);
    dataset(folder.path(), "wall", 2);
    let rows = (0..60).map(|i| (12 * (i % 8) + 30, 14 * (i / 8) + 10 + i % 3));
    let rows: Vec<String> = rows
        .map(|(x, y)| format!("{x} {y} {} {y} 0.25", x - 5))
        .collect();
    fs::create_dir(at("there")).expect("writable");
    fs::write(at("there/0_1.txt"), rows.join("\n")).expect("writable");
    let study = "out = 'run'\nestimators = ['ransac-e']\n[[dataset]]\npath = 'wall'\n\
        [[matches]]\nname = 'mine'\nfiles = ['absent']\n";
    fs::write(at("study.toml"), study).expect("writable");
    let moved = [
        "study.toml",
        "--matches",
        "mine=there",
        "--pixel-center",
        "0",
    ];
    let output = run(&moved, folder.path());
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert_eq!(poses(&at("run"), "wall", "mine").len(), 1);
}
