//! What hostile and unlucky users do to the program, and what must not come of it.
#![cfg(unix)]

mod common;

use std::fs::{self, File, OpenOptions};
use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use common::{dataset, matchbench};

fn go(arguments: &[&str], paths: &[&Path]) -> Output {
    let output = matchbench().args(arguments).args(paths).output();
    output.expect("the program starts")
}

fn message(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn refused(output: &Output, named: &str) {
    let message = message(output);
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains(named), "{message}");
}

/// A dataset of three images and a run of SIFT on it.
fn run_of(folder: &Path) -> (PathBuf, PathBuf) {
    let (wall, run) = (dataset(folder, "wall", 3), folder.join("run"));
    let done = go(&["run", "--matchers", "sift", "--out"], &[&run, &wall]);
    assert_eq!(done.status.code(), Some(0), "{}", message(&done));
    (wall, run)
}

#[test]
fn what_is_no_file_is_written_into_and_never_replaced() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (_, run) = run_of(folder.path());
    let printed = go(&["eval"], &[&run]).stdout;
    let [link, file, pipe] = ["link", "file", "pipe"].map(|name| folder.path().join(name));
    fs::write(&file, "before").expect("writable");
    fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).expect("it is ours");
    symlink(&file, &link).expect("writable");
    let eval = |out: &Path| go(&["eval", "--out"], &[out, &run]);
    assert_eq!(eval(&link).status.code(), Some(0));
    assert_eq!(fs::read(&file).expect("readable"), printed);
    let mode = fs::metadata(&file).expect("there").permissions().mode();
    assert_eq!(mode & 0o777, 0o600);
    assert!(fs::symlink_metadata(&link).expect("there").is_symlink());
    assert_eq!(eval(Path::new("-")).stdout, printed);
    assert_eq!(eval(Path::new("/dev/stdout")).stdout, printed);
    assert_eq!(eval(Path::new("/dev/null")).status.code(), Some(0));
    let null = fs::metadata("/dev/null").expect("there").file_type();
    assert!(null.is_char_device());

    let made = Command::new("mkfifo").arg(&pipe).status();
    assert!(made.expect("mkfifo is part of every system").success());
    let reader = Command::new("cat")
        .arg(&pipe)
        .stdout(Stdio::piped())
        .spawn();
    let reader = reader.expect("cat is part of every system");
    assert_eq!(eval(&pipe).status.code(), Some(0));
    assert_eq!(reader.wait_with_output().expect("it ended").stdout, printed);
    assert!(
        fs::symlink_metadata(&pipe)
            .expect("there")
            .file_type()
            .is_fifo()
    );
}

#[test]
fn results_do_not_depend_on_somebody_who_listens() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (wall, run) = run_of(folder.path());
    let full = OpenOptions::new()
        .write(true)
        .open("/dev/full")
        .expect("a device of Linux");
    let (reader, closed) = std::io::pipe().expect("pipes can be made");
    drop(reader);
    for (number, error) in [Stdio::from(full), Stdio::from(closed)]
        .into_iter()
        .enumerate()
    {
        let again = folder.path().join(format!("again{number}"));
        let output = matchbench()
            .args(["run", "--matchers", "sift", "--report", "--out"])
            .args([&again, &wall])
            .stderr(error)
            .output()
            .expect("the program starts");
        assert_eq!(output.status.code(), Some(0));
        assert!(!output.stdout.is_empty() && again.join("report/index.html").is_file());
    }
    assert!(run.join("plan.json").is_file());
}

#[test]
fn an_image_that_is_another_is_refused_and_one_that_was_mended_is_tried_again() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (wall, run) = (dataset(folder.path(), "wall", 3), folder.path().join("run"));
    let start = || go(&["run", "--matchers", "sift", "--out"], &[&run, &wall]);
    let image = wall.join("Images/0002.pgm");
    let sound = fs::read(&image).expect("readable");
    fs::write(&image, &sound[..100]).expect("writable");
    assert_eq!(start().status.code(), Some(2), "two pairs failed");
    let records = run.join("records/wall/sift+ransac-e.jsonl");
    let text = fs::read_to_string(&records).expect("readable");
    assert!(
        text.contains("0002.pgm") && text.contains("truncated"),
        "{text}"
    );
    fs::write(&image, &sound).expect("writable");
    let mended = start();
    assert_eq!(mended.status.code(), Some(0), "{}", message(&mended));
    let text = fs::read_to_string(&records).expect("readable");
    assert!(
        !text.contains("failed") && text.lines().count() == 3,
        "{text}"
    );

    fs::copy(wall.join("Images/0000.pgm"), &image).expect("writable");
    let more = [
        "run",
        "--matchers",
        "sift",
        "--estimator",
        "ransac-e,lmeds-e",
        "--out",
    ];
    refused(&go(&more, &[&run, &wall]), "0002.pgm is not the image");
}

#[test]
fn records_that_were_changed_are_refused_by_line() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (_, run) = run_of(folder.path());
    let file = run.join("records/wall/sift+ransac-e.jsonl");
    let text = fs::read_to_string(&file).expect("readable");
    for (from, to) in [
        ("\"rotation_error\":", "\"rotation_error\":1"),
        ("\"repetition\":0", "\"repetition\":4294967295"),
        ("\"inliers\":", "\"inliers\":1"),
    ] {
        assert!(text.contains(from), "{text}");
        fs::write(&file, text.replacen(from, to, 1)).expect("writable");
        refused(&go(&["eval"], &[&run]), "sift+ransac-e.jsonl:1:");
    }
}

#[test]
fn a_folder_whose_lock_was_deleted_is_still_in_use() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (wall, run) = run_of(folder.path());
    let held = File::open(&run).expect("folders can be opened here");
    held.try_lock().expect("nobody holds it");
    fs::remove_file(run.join(".lock")).expect("it is ours");
    let output = go(&["run", "--matchers", "orb,sift", "--out"], &[&run, &wall]);
    refused(&output, "in use by another process");
}

#[test]
fn runs_on_another_truth_of_the_same_name_are_not_compared() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (wall, run) = run_of(folder.path());
    let pairs = fs::read_to_string(wall.join("pairs.txt")).expect("readable");
    fs::write(wall.join("pairs.txt"), pairs.replace("-0.05", "0.05")).expect("writable");
    let other = folder.path().join("other");
    let done = go(&["run", "--matchers", "sift", "--out"], &[&other, &wall]);
    assert_eq!(done.status.code(), Some(0), "{}", message(&done));
    refused(
        &go(&["compare"], &[&run, &other]),
        "different datasets called wall",
    );
    let report = go(&["report"], &[&run]);
    assert_eq!(report.status.code(), Some(0));
    assert!(
        message(&report).contains("is another dataset now"),
        "{}",
        message(&report)
    );
}

#[test]
fn a_terminal_does_not_obey_a_file() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 2);
    let word = "y".repeat(1 << 20);
    fs::write(
        wall.join("pairs.txt"),
        format!("0 1 \u{1b}[2J{word} 0 0 0 0 1 0 0 0 0 1 0"),
    )
    .expect("writable");
    for command in ["validate", "run"] {
        let output = match command {
            "run" => go(&["run", "--matchers", "sift", "--out", "x"], &[&wall]),
            _ => go(&[command], &[&wall]),
        };
        let said = [output.stdout, output.stderr].concat();
        assert!(
            !said.contains(&0x1b) && said.len() < 5000,
            "{} bytes",
            said.len()
        );
        assert_eq!(output.status.code(), Some(1));
    }
}

#[test]
fn more_threads_than_are_useful_are_not_started() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (_, run) = run_of(folder.path());
    let output = go(&["eval", "--threads", "1024"], &[&run]);
    assert_eq!(output.status.code(), Some(0), "{}", message(&output));
}
