//! What a run finds in its folder: files of others, and matches that an earlier start kept.

mod common;
mod steps;

use std::fs;

use common::dataset;
use steps::{go, succeeds};

#[test]
fn files_of_others_are_told_and_never_written_into() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 3);
    let run = || {
        let run = go(
            folder,
            &["run", "wall", "--matchers", "orb", "--out", "out"],
        );
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        (run.status.success(), said)
    };
    fs::create_dir_all(folder.join("out/images")).expect("writable");
    let photograph = folder.join("out/images/wall.txt");
    fs::write(&photograph, "of mine").expect("writable");
    let (done, said) = run();
    let path = "error: out/images is there, but no plan.json";
    assert!(!done && said.contains(path), "{said}");
    assert!(said.contains("choose another folder"), "{said}");
    assert!(!folder.join("out/plan.json").exists());
    let kept = fs::read_to_string(&photograph).expect("it is there");
    assert_eq!(kept, "of mine");

    fs::rename(folder.join("out/images"), folder.join("out/mine")).expect("it is ours");
    let (done, said) = run();
    assert!(
        done && said.contains("note: out/mine is not of a run"),
        "{said}"
    );
    let (done, said) = run();
    assert!(done && !said.contains("note:"), "{said}");
}

#[test]
fn matches_that_an_earlier_start_kept_are_told() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 3);
    let run = |keep: &[&str]| {
        let run = ["run", "wall", "--matchers", "orb", "--out", "out"];
        let run = go(folder, &[&run[..], keep].concat());
        String::from_utf8_lossy(&run.stderr).into_owned()
    };
    let told = |said: &str| said.contains("note: out/matches was kept by an earlier start");
    assert!(!told(&run(&[])));
    assert!(!told(&run(&[])));
    let said = run(&["--keep-matches", "none"]);
    assert!(told(&said) && said.contains("--keep-matches"), "{said}");
    assert!(folder.join("out/matches/wall/orb.bin").is_file());
    succeeds(folder, &["eval", "out"]);
    fs::remove_dir_all(folder.join("out/matches")).expect("it is ours");
    assert!(!told(&run(&["--keep-matches", "none"])));
    assert!(!folder.join("out/matches").exists());
}
