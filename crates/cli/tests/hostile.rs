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

/// Output for which there is no room.
fn full() -> Stdio {
    let device = OpenOptions::new().write(true).open("/dev/full");
    Stdio::from(device.expect("a device of Linux"))
}

/// Output whose reader has gone.
fn closed() -> Stdio {
    let (reader, writer) = std::io::pipe().expect("pipes can be made");
    drop(reader);
    Stdio::from(writer)
}

#[test]
fn help_that_cannot_be_written_is_an_error_and_a_reader_may_leave() {
    let all = "--help,-h,--version,help run,run --help,list,completions bash,man";
    for arguments in all.split(',') {
        let to = |out: Stdio| matchbench().args(arguments.split(' ')).stdout(out).output();
        let unwritten = to(full()).expect("the program starts");
        assert_eq!(unwritten.status.code(), Some(1), "{arguments:?}");
        let message = message(&unwritten);
        assert!(
            message.starts_with("error: standard output: "),
            "{arguments:?}: {message}"
        );
        let unread = to(closed()).expect("the program starts");
        assert_eq!(unread.status.code(), Some(0), "{arguments:?}");
        assert!(unread.stderr.is_empty(), "{arguments:?}");
    }
}

#[test]
fn results_do_not_depend_on_somebody_who_listens() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (wall, run) = run_of(folder.path());
    // Where the table goes, where messages go, and how the program ends.
    let listeners = [
        (Stdio::piped(), full(), 0),
        (Stdio::piped(), closed(), 0),
        (closed(), closed(), 0),
        (full(), full(), 1),
    ];
    for (number, (table, messages, code)) in listeners.into_iter().enumerate() {
        let again = folder.path().join(format!("again{number}"));
        let output = matchbench()
            .args(["run", "--matchers", "sift", "--report", "--out"])
            .args([&again, &wall])
            .stdout(table)
            .stderr(messages)
            .output()
            .expect("the program starts");
        assert_eq!(output.status.code(), Some(code), "{number}");
        assert_eq!(!output.stdout.is_empty(), number < 2, "{number}");
        assert!(again.join("report/index.html").is_file(), "{number}");
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
    refused(&go(&more, &[&run, &wall]), "0002.pgm is not the file");
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
    for (command, code) in [("validate", 2), ("run", 1)] {
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
        assert_eq!(output.status.code(), Some(code));
    }
}

#[test]
fn more_threads_than_are_useful_are_not_started() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (_, run) = run_of(folder.path());
    let output = go(&["eval", "--threads", "1024"], &[&run]);
    assert_eq!(output.status.code(), Some(0), "{}", message(&output));
}

#[test]
fn an_image_for_which_there_is_no_memory_fails_with_numbers_and_what_to_do() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (wall, run) = (dataset(folder.path(), "wall", 2), folder.path().join("run"));
    // A smooth image of 1.8 megapixels, for which SIFT takes more than is given.
    let image = [&b"P5 1500 1200 255\n"[..], &vec![90; 1500 * 1200]].concat();
    for name in ["0000.pgm", "0001.pgm"] {
        fs::write(wall.join("Images").join(name), &image).expect("writable");
    }
    let camera = "1000 0 749.5 0 1000 599.5 0 0 1";
    fs::write(wall.join("camera.txt"), camera).expect("writable");
    let start = |limit: &str| {
        let output = (matchbench().env("MATCHBENCH_MAX_MEMORY", limit))
            .args(["run", "--matchers", "sift", "--out"])
            .args([&run, &wall])
            .output();
        output.expect("the program starts")
    };
    let output = start("20M");
    assert_eq!(output.status.code(), Some(2), "{}", message(&output));
    let records = run.join("records/wall/sift+ransac-e.jsonl");
    let text = fs::read_to_string(&records).expect("readable");
    for named in [
        "0000.pgm",
        "1500x1200",
        "max_size",
        "--threads",
        "MATCHBENCH_MAX_MEMORY",
        " MB",
    ] {
        assert!(text.contains(named), "{named}: {text}");
    }
    // There is more another time.
    assert_eq!(start("8G").status.code(), Some(0), "{}", message(&output));
    for wrong in ["0", "much", "-1", "99999999999999999999G"] {
        refused(&start(wrong), "MATCHBENCH_MAX_MEMORY");
    }
}

#[test]
fn instructions_that_there_are_not_are_an_error_at_the_start() {
    let output = matchbench()
        .env("MATCHBENCH_SIMD", "mmx")
        .arg("list")
        .output();
    refused(
        &output.expect("the program starts"),
        "MATCHBENCH_SIMD is `mmx`",
    );
}

#[test]
fn an_export_keeps_what_is_not_its_own() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (_, run) = run_of(folder.path());
    for format in ["authors", "colmap", "hloc", "glue-factory", "npz", "packed"] {
        let out = folder.path().join(format);
        let export = || go(&["export", "--format", format], &[&run, &out]);
        assert_eq!(export().status.code(), Some(0), "{format}");
        let again = export();
        assert_eq!(
            again.status.code(),
            Some(0),
            "{format}: {}",
            message(&again)
        );
        let file = files(&out).pop().expect("something was written");
        fs::write(&file, "mine").expect("writable");
        refused(&export(), "already");
        assert_eq!(fs::read(&file).expect("readable"), b"mine", "{format}");
    }
}

/// The files below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("readable") {
        let path = entry.expect("readable").path();
        if path.is_dir() {
            found.append(&mut files(&path));
        } else {
            found.push(path);
        }
    }
    found.sort();
    found
}

#[test]
fn a_report_keeps_a_page_that_is_not_its_own_and_goes_to_standard_output() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (_, run) = run_of(folder.path());
    let site = folder.path().join("site");
    fs::create_dir(&site).expect("writable");
    fs::write(site.join("index.html"), "<p>mine</p>").expect("writable");
    refused(
        &go(&["report", "--out"], &[&site, &run]),
        "is not of an earlier report",
    );
    let page = fs::read_to_string(site.join("index.html")).expect("readable");
    assert_eq!(page, "<p>mine</p>");
    let out = folder.path().join("out");
    for _ in 0..2 {
        assert_eq!(
            go(&["report", "--out"], &[&out, &run]).status.code(),
            Some(0)
        );
    }
    let printed = go(&["report", "--bundle", "-"], &[&run]);
    assert!(printed.stdout.starts_with(b"<!DOCTYPE html>"));
}

#[test]
fn names_that_control_a_terminal_or_are_too_long_are_refused_by_validate_and_run() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for name in ["a\nb", "a\u{1b}[31m", &"x".repeat(230)] {
        let wall = dataset(folder.path(), name, 2);
        let run = folder.path().join("run");
        for (output, code) in [
            (go(&["validate"], &[&wall]), 2),
            (
                go(&["run", "--matchers", "orb", "--out"], &[&run, &wall]),
                1,
            ),
        ] {
            let said = [output.stdout, output.stderr].concat();
            assert_eq!(output.status.code(), Some(code));
            assert!(!said.contains(&0x1b));
            assert!(String::from_utf8_lossy(&said).contains("the dataset's name"));
        }
    }
}

#[test]
fn leftovers_of_killed_processes_go_with_the_next_run_and_report() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (wall, run) = run_of(folder.path());
    assert_eq!(go(&["report"], &[&run]).status.code(), Some(0));
    let places = ["", "records/wall", "cache/00", "report", "report/tables"];
    let old = std::time::SystemTime::now() - std::time::Duration::from_secs(60);
    let left = places.map(|place| run.join(place).join(".matchbench-left"));
    for file in &left {
        fs::create_dir_all(file.parent().expect("it has a folder")).expect("writable");
        let file = File::create(file).expect("writable");
        file.set_modified(old).expect("it is ours");
    }
    assert_eq!(
        go(&["run", "--matchers", "sift", "--out"], &[&run, &wall])
            .status
            .code(),
        Some(0)
    );
    assert_eq!(go(&["report"], &[&run]).status.code(), Some(0));
    for file in left {
        assert!(!file.exists(), "{}", file.display());
    }
}

#[test]
fn nothing_waits_for_a_pipe_that_nobody_writes_into() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let pipe = folder.path().join("pipe");
    let made = Command::new("mkfifo").arg(&pipe).status();
    assert!(made.expect("mkfifo is part of every system").success());
    let kinds = [
        "tum",
        "kitti",
        "strecha",
        "7scenes",
        "folder",
        "superglue",
        "image-pairs",
        "scannet",
        "scannet-raw",
        "megadepth",
        "colmap",
        "nerf",
        "imc",
        "euroc",
        "zeb",
        "hpatches",
        "oxford",
        "evd",
    ];
    for kind in kinds {
        let out = folder.path().join(kind);
        let ended = code_within_a_minute(matchbench().args(["import", kind]).args([&pipe, &out]));
        assert_eq!(ended, Some(1), "{kind} waits");
    }
}

/// The exit code of a program that ends.
fn code_within_a_minute(program: &mut Command) -> Option<i32> {
    let quiet = program.stdout(Stdio::null()).stderr(Stdio::null());
    let mut child = quiet.spawn().expect("the program starts");
    let start = std::time::Instant::now();
    while start.elapsed().as_secs() < 60 {
        if let Some(status) = child.try_wait().expect("it can be asked") {
            return status.code();
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    child.kill().expect("it is ours");
    child.wait().expect("it was killed");
    None
}

#[test]
fn nothing_waits_for_a_pipe_in_the_folder_of_a_run() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (wall, run) = run_of(folder.path());
    let again = || {
        let mut again = matchbench();
        again.args(["run", "--matchers", "sift", "--out"]);
        again.args([&run, &wall]);
        again
    };
    let make = |pipe: &Path| {
        let made = Command::new("mkfifo").arg(pipe).status();
        assert!(made.expect("mkfifo is part of every system").success());
    };

    let left = run.join(".matchbench-left");
    fs::create_dir(&left).expect("writable");
    make(&left.join(".held"));
    let old = std::time::SystemTime::now() - std::time::Duration::from_secs(60);
    (File::open(&left).and_then(|folder| folder.set_modified(old))).expect("ours");
    assert_eq!(code_within_a_minute(&mut again()), Some(0));

    let lock = run.join(".lock");
    fs::remove_file(&lock).expect("there");
    make(&lock);
    assert_eq!(code_within_a_minute(&mut again()), Some(1));
    let message = message(&again().output().expect("the program starts"));
    assert!(
        message.contains(".lock: a device or a pipe where a file is needed"),
        "{message}"
    );
    fs::remove_file(&lock).expect("there");

    let report = || {
        let mut report = matchbench();
        report.arg("report").arg(&run);
        report
    };
    assert_eq!(code_within_a_minute(&mut report()), Some(0));
    let table = run.join("report/tables/scores.csv");
    fs::remove_file(&table).expect("there");
    make(&table);
    assert_eq!(code_within_a_minute(&mut report()), Some(1));
}

#[test]
fn names_of_a_plan_lead_to_no_other_folder() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (_, run) = run_of(folder.path());
    let plan = run.join("plan.json");
    let text = fs::read_to_string(&plan).expect("it was written");
    let text = text.replacen("\"id\": \"sift\"", "\"id\": \"../elsewhere\"", 1);
    fs::write(&plan, text).expect("writable");
    fs::rename(
        run.join("matches/wall/sift.bin"),
        run.join("matches/elsewhere.bin"),
    )
    .expect("there");
    let out = folder.path().join("out");
    let export = go(&["export", "--format", "npz"], &[&run, &out]);
    refused(
        &export,
        "plan.json: the name `../elsewhere` is empty, begins with a dot or has a slash",
    );
    assert!(!folder.path().join("elsewhere").exists());
}

#[test]
fn records_that_were_edited_moved_or_lost_are_told() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (_, run) = run_of(folder.path());
    let records = run.join("records/wall");
    let file = records.join("sift+ransac-e.jsonl");
    let whole = fs::read_to_string(&file).expect("it was written");

    let unchecked = whole.lines().map(|line| {
        let (body, _) = line.split_once(",\"check\"").expect("it has one");
        format!("{body}}}\n")
    });
    fs::write(&file, unchecked.collect::<String>()).expect("writable");
    refused(
        &go(&["eval"], &[&run]),
        "sift+ransac-e.jsonl:1: not a record of this version (it has no checksum)",
    );

    fs::write(&file, &whole).expect("writable");
    let moved = records.join("orb+best.jsonl");
    fs::copy(&file, &moved).expect("writable");
    refused(
        &go(&["eval"], &[&run]),
        "orb+best.jsonl:1: this is a record of sift with ransac-e on wall",
    );
    fs::remove_file(&moved).expect("it is there");

    let fewer: String = whole.split_inclusive('\n').skip(1).collect();
    fs::write(&file, fewer).expect("writable");
    for words in [&["eval"][..], &["report"]] {
        let told = message(&go(words, &[&run]));
        assert!(
            told.contains("sift with ransac-e on wall: 2 of 3 planned tasks"),
            "{told}"
        );
    }
    let told = message(&go(&["compare"], &[&run, &run]));
    assert!(told.contains("2 of 3 planned tasks"), "{told}");
}

#[test]
fn a_dataset_that_cannot_be_meant_is_told_before_it_is_run() {
    use std::os::unix::ffi::OsStrExt as _;

    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 2);
    let run =
        |dataset: &Path, out: &Path| go(&["run", "--matchers", "sift", "--out"], &[out, dataset]);
    refused(&run(&wall, &wall), "a run needs a folder of its own");
    fs::write(wall.join("camera.txt"), "100 0 300\n0 100 59.5\n0 0 1").expect("writable");
    let done = run(&wall, &folder.path().join("run"));
    let told = message(&done);
    assert!(
        told.contains("the principal point 300 59.5 is outside"),
        "{told}"
    );

    let odd = folder.path().join(std::ffi::OsStr::from_bytes(b"bad\xff"));
    // Not every system has such names.
    if fs::rename(&wall, &odd).is_ok() {
        refused(
            &run(&odd, &folder.path().join("odd")),
            "the path is not UTF-8",
        );
        refused(
            &go(&["time", "--matchers", "sift"], &[&odd]),
            "the path is not UTF-8",
        );
    }
}
