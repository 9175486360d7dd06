//! Matches from outside that are mostly copies of each other, which raise scores, are told by `check`, `run` and the report.
#![cfg(unix)]

mod common;

use std::fs;
use std::path::Path;
use std::process::Output;

use common::{dataset, matchbench, wall_matches};

/// A program in the language of the shell: every pair has the matches of `matches.f32`, COUNT of them.
const PROGRAM: &str = r#"
while read -r line; do
    case $line in
    *'"type":"hello"'*)
        echo '{"type":"ready","protocol":1,"name":"toy","version":"1","pixel_center":0}' ;;
    *'"type":"match"'*)
        pair=${line#*\"pair\":}; out=${line##*\"out\":\"}
        cp matches.f32 "${out%\"\}}"
        echo '{"type":"matched","pair":'"${pair%%]*}"'],"count":COUNT}' ;;
    esac
done
"#;

/// The manifest of a program in `folder` that has 60 matches, each so many times.
fn toy(folder: &Path, times: usize) -> String {
    let program = PROGRAM.replace("COUNT", &(60 * times).to_string());
    fs::write(folder.join("matches.f32"), wall_matches().repeat(times)).expect("writable");
    fs::write(folder.join("toy.sh"), program).expect("writable");
    let manifest = folder.join("toy.toml");
    fs::write(
        &manifest,
        "name = \"toy\"\ncommand = [\"sh\", \"toy.sh\"]\n",
    )
    .expect("writable");
    manifest.to_str().expect("UTF-8").to_owned()
}

fn output(arguments: &[&str]) -> Output {
    matchbench()
        .args(arguments)
        .output()
        .expect("the program starts")
}

#[test]
fn copies_of_matches_are_told_by_check_run_and_report() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 3);
    let wall = wall.to_str().expect("UTF-8");
    for (times, is_told) in [(1, false), (100, true)] {
        let toy = toy(folder.path(), times);
        let checked = output(&["check", &toy, wall]);
        let checked = String::from_utf8_lossy(&checked.stdout).into_owned();
        let words = "doubtful  pair 0 1: of 6000 matches only 60 are different";
        assert_eq!(checked.contains(words), is_told, "{checked}");

        let run = folder.path().join(format!("run-{times}"));
        let run = run.to_str().expect("UTF-8");
        let words = "most matches of toy on wall are copies of others in 3 of 3 pairs that were looked at (0 1: 6000 matches, \
                     60 of them different)";
        let done = output(&["run", wall, "--matchers", &toy, "--out", run]);
        let told = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(told.contains(words), is_told, "{told}");
        assert!(output(&["report", run]).status.success());
        let page = fs::read_to_string(Path::new(run).join("report/index.html"));
        let page = page.expect("it was written");
        assert_eq!(page.contains(words), is_told);
    }
}
