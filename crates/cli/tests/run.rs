//! A run that is killed, stopped, resumed or given other threads leaves the same records.

mod common;
mod planes;

use std::fs;
#[cfg(unix)]
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use common::{dataset, matchbench};
#[cfg(unix)]
use common::{send, stop_signal};
use planes::homographies;

const FRAMES: usize = 12;
const PAIRS: usize = FRAMES * (FRAMES - 1) / 2;

fn start(dataset: &Path, run: &Path, threads: &str) -> Child {
    matchbench()
        .args(["run", "--matchers", "sift", "--threads", threads, "--out"])
        .args([run, dataset])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts")
}

fn lines(run: &Path) -> usize {
    let file = run.join("records/wall/sift+ransac-e.jsonl");
    fs::read_to_string(file).map_or(0, |text| text.matches('\n').count())
}

/// The records of a run, without the times, which no two runs share.
fn records(run: &Path, dataset: &str, matcher: &str) -> Vec<serde_json::Value> {
    let file = run.join(format!("records/{dataset}/{matcher}+ransac-e.jsonl"));
    let text = fs::read_to_string(file).expect("the run has records");
    text.lines()
        .map(|line| {
            let mut record: serde_json::Value = serde_json::from_str(line).expect("a whole record");
            record["times"] = serde_json::Value::Null;
            // The checksum is of the times too.
            record.as_object_mut().expect("a record").remove("check");
            record
        })
        .collect()
}

#[test]
fn a_killed_run_goes_on_to_the_same_records_for_any_number_of_threads() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", FRAMES);
    let whole = folder.path().join("whole");
    assert_eq!(
        start(&wall, &whole, "2").wait().expect("it ran").code(),
        Some(0)
    );
    let expected = records(&whole, "wall", "sift");
    assert_eq!(expected.len(), PAIRS);

    let killed = folder.path().join("killed");
    let mut kills = 0;
    // Each process may add a few records before it is killed, until one is quicker than the kill.
    for goal in (1..PAIRS).step_by(7) {
        let mut child = start(&wall, &killed, "1");
        let patience = Instant::now() + Duration::from_secs(60);
        let finished = loop {
            if let Some(status) = child.try_wait().expect("it ran") {
                break status.success();
            }
            if lines(&killed) >= goal {
                break false;
            }
            assert!(Instant::now() < patience, "no record within a minute");
            sleep(Duration::from_millis(1));
        };
        if finished {
            break;
        }
        child.kill().expect("it can be killed");
        child.wait().expect("it ended");
        kills += 1;
    }
    assert!(kills >= 1, "the run was never interrupted");
    assert_eq!(
        start(&wall, &killed, "1").wait().expect("it ran").code(),
        Some(0)
    );
    assert_eq!(records(&killed, "wall", "sift"), expected);
}

#[test]
fn another_plan_in_the_same_folder_is_refused_by_name() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 3);
    let run = folder.path().join("run");
    assert!(start(&wall, &run, "2").wait().expect("it ran").success());
    let refused = matchbench()
        .args(["run", "--matchers", "sift", "--seed", "5", "--out"])
        .args([&run, &wall])
        .output()
        .expect("it ran");
    assert_eq!(refused.status.code(), Some(1));
    let message = String::from_utf8_lossy(&refused.stderr);
    assert!(message.contains("seed"), "{message}");
    assert_eq!(records(&run, "wall", "sift").len(), 3);
}

#[test]
fn an_image_that_cannot_be_read_is_counted_and_the_exit_code_is_2() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 4);
    let torn = wall.join("Images/0002.pgm");
    let bytes = fs::read(&torn).expect("written just now");
    fs::write(&torn, &bytes[..500]).expect("writable");
    let run = folder.path().join("run");
    assert_eq!(
        start(&wall, &run, "2").wait().expect("it ran").code(),
        Some(2)
    );
    let records = records(&run, "wall", "sift");
    let failed: Vec<_> = records
        .iter()
        .filter(|r| r["outcome"]["kind"] == "failed")
        .collect();
    assert_eq!(
        (records.len(), failed.len()),
        (6, 3),
        "the pairs of image 2 fail, no others"
    );
    for record in failed {
        let reason = record["outcome"]["reason"]
            .as_str()
            .expect("a reason in words");
        assert!(reason.contains("0002.pgm"), "{reason}");
    }
}

#[test]
fn failures_are_told_by_the_exit_code_though_nobody_reads_the_table() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 3);
    fs::write(wall.join("Images/0002.pgm"), "P5 160 120 255\n").expect("writable");
    let mut child = matchbench()
        .args(["run", "--matchers", "sift", "--out"])
        .args([&folder.path().join("run"), &wall])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts");
    drop(child.stdout.take());
    assert_eq!(child.wait().expect("it ran").code(), Some(2));
}

#[cfg(unix)]
#[test]
fn ctrl_c_keeps_what_is_done_and_says_how_to_go_on() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 2 * FRAMES);
    let run = folder.path().join("run");
    let child = matchbench()
        .args(["run", "--matchers", "sift", "--threads", "1", "--out"])
        .args([&run, &wall])
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .expect("the program starts");
    let patience = Instant::now() + Duration::from_secs(60);
    while lines(&run) == 0 {
        assert!(Instant::now() < patience, "no record within a minute");
        sleep(Duration::from_millis(1));
    }
    send(stop_signal(), child.id());
    let output = child.wait_with_output().expect("it ended");
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(130), "{message}");
    assert!(
        message.contains("the same command goes on from there"),
        "{message}"
    );
    assert!(
        lines(&run) < FRAMES * (2 * FRAMES - 1),
        "it did not run to its end"
    );
    assert!(start(&wall, &run, "2").wait().expect("it ran").success());
    assert_eq!(
        records(&run, "wall", "sift").len(),
        FRAMES * (2 * FRAMES - 1)
    );
}

#[cfg(unix)]
#[test]
fn times_that_were_measured_before_ctrl_c_are_written() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", FRAMES);
    let table = folder.path().join("times.csv");
    let mut child = matchbench()
        .args(["time", "--matchers", "orb,repmatch", "--csv"])
        .args([&table, &wall])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let printed = BufReader::new(child.stdout.take().expect("it is piped"));
    let mut printed = printed.lines().map(|line| line.expect("it is text"));
    assert!(printed.any(|line| line.starts_with("orb ")));
    send(stop_signal(), child.id());
    let output = child.wait_with_output().expect("it ended");
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(130), "{message}");
    assert!(
        message.contains("stopped after 1 of 2 matchers"),
        "{message}"
    );
    let table = fs::read_to_string(&table).expect("it was written");
    let measured = table.lines().skip(1).map(|row| row.split(',').next());
    assert_eq!(measured.collect::<Vec<_>>(), [Some("orb")]);
}

#[cfg(unix)]
#[test]
fn ctrl_c_leaves_no_temporary_folder() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 2 * FRAMES);
    let temporary = folder.path().join("temporary");
    fs::create_dir(&temporary).expect("writable");
    let child = matchbench()
        .args(["time", "--matchers", "sift"])
        .arg(&wall)
        .env("TMPDIR", &temporary)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts");
    let entries = || fs::read_dir(&temporary).expect("it is ours").count();
    let patience = Instant::now() + Duration::from_secs(60);
    while entries() == 0 {
        assert!(
            Instant::now() < patience,
            "nothing was begun within a minute"
        );
        sleep(Duration::from_millis(1));
    }
    send(stop_signal(), child.id());
    let output = child.wait_with_output().expect("it ended");
    assert_eq!((output.status.code(), entries()), (Some(130), 0));
}

#[cfg(unix)]
#[test]
fn a_signal_that_was_ignored_at_the_start_stops_nothing() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", FRAMES);
    let run = folder.path().join("run");
    // As by `nohup`, and as a script does for what it starts in the background.
    let child = std::process::Command::new("sh")
        .args(["-c", "trap '' HUP INT; exec \"$@\"", "sh"])
        .arg(matchbench().get_program())
        .args(["run", "--matchers", "sift", "--threads", "1", "--out"])
        .args([&run, &wall])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    let mut child = child.expect("there is a shell");
    let patience = Instant::now() + Duration::from_secs(60);
    while lines(&run) == 0 {
        assert!(Instant::now() < patience, "no record within a minute");
        sleep(Duration::from_millis(1));
    }
    for signal in ["HUP", "INT", "HUP"] {
        send(signal, child.id());
    }
    assert_eq!(child.wait().expect("it ran").code(), Some(0));
    assert_eq!(records(&run, "wall", "sift").len(), PAIRS);
}

/// How a command ended in a folder, and what it said.
fn ended(folder: &Path, words: &[&str]) -> (Option<i32>, String) {
    let done = matchbench().current_dir(folder).args(words).output();
    let done = done.expect("the program starts");
    let said = [done.stdout, done.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    (done.status.code(), said.concat())
}

#[test]
fn runs_of_several_matchers_are_joined_and_go_on_as_one() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 4);
    let go = |words: &[&str]| ended(folder.path(), words);
    assert!(wall.is_dir());
    for matcher in ["sift", "orb"] {
        let (code, said) = go(&["run", "wall", "--matchers", matcher, "--out", matcher]);
        assert_eq!(code, Some(0), "{said}");
    }
    let (code, said) = go(&["join", "sift", "orb", "--out", "both"]);
    assert!(
        code == Some(0) && said.contains("12 tasks of 2 runs; records in both"),
        "{said}"
    );
    let (code, said) = go(&["join", "sift", "orb", "--out", "both"]);
    assert!(
        code == Some(1) && said.contains("both holds a run already"),
        "{said}"
    );
    let (code, said) = go(&[
        "run",
        "wall",
        "--matchers",
        "sift,orb",
        "--repeat",
        "2",
        "--out",
        "both",
    ]);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(lines(&folder.path().join("both")), 12);
    for out in ["wall", "wall/Images/x", "sift/records/x"] {
        let (code, said) = go(&["join", "sift", "orb", "--out", out]);
        assert!(
            code == Some(1) && said.contains("which it would damage"),
            "{out}: {said}"
        );
    }
    let (_, said) = go(&["join", "sift", "--out", "alone"]);
    assert!(said.contains("2 values required"), "{said}");

    // Failed tasks of one run do not take the place of the results of another, though these are fewer.
    let lost = fs::read(wall.join("Images/0001.pgm")).expect("it is there");
    fs::write(wall.join("Images/0001.pgm"), &lost[..lost.len() / 2]).expect("writable");
    let (_, said) = go(&["run", "wall", "--matchers", "orb", "--out", "broken"]);
    assert!(said.contains("failed"), "{said}");
    fs::write(wall.join("Images/0001.pgm"), lost).expect("writable");
    let records = folder.path().join("orb/records/wall/orb+ransac-e.jsonl");
    let text = fs::read_to_string(&records).expect("readable");
    let fewer: Vec<&str> = text.lines().take(5).collect();
    fs::write(&records, fewer.join("\n") + "\n").expect("writable");
    let (code, said) = go(&["join", "broken", "orb", "--out", "mixed"]);
    assert_eq!(code, Some(0), "{said}");
    let mixed = folder.path().join("mixed/records/wall/orb+ransac-e.jsonl");
    assert_eq!(
        fs::read_to_string(mixed).expect("readable"),
        fewer.join("\n") + "\n"
    );
}

#[test]
fn records_that_no_run_writes_are_not_joined() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    dataset(folder.path(), "wall", 3);
    let go = |words: &[&str]| {
        let done = matchbench().current_dir(&folder).args(words).output();
        let done = done.expect("the program starts");
        (
            done.status.code(),
            String::from_utf8_lossy(&done.stderr).into_owned(),
        )
    };
    for matcher in ["sift", "orb"] {
        let (code, said) = go(&["run", "wall", "--matchers", matcher, "--out", matcher]);
        assert_eq!(code, Some(0), "{said}");
    }
    let file = folder.path().join("sift/records/wall/sift+ransac-e.jsonl");
    let sound = fs::read_to_string(&file).expect("readable");
    let lines: Vec<&str> = sound.split_inclusive('\n').collect();
    for (text, named) in [
        (
            [lines[0], lines[0], lines[1]].concat(),
            "sift+ransac-e.jsonl:2: pair 0 1 is there twice, first on line 1",
        ),
        (
            [&*sound, lines[0]].concat(),
            "sift+ransac-e.jsonl:4: 3 tasks are planned; delete the file from this line on",
        ),
    ] {
        fs::write(&file, text).expect("writable");
        let (code, said) = go(&["join", "sift", "orb", "--out", "both"]);
        assert!(code == Some(1) && said.contains(named), "{said}");
        assert!(!folder.path().join("both").exists());
    }
    fs::write(&file, sound).expect("writable");
    let (code, said) = go(&["join", "sift", "orb", "--out", "both"]);
    assert_eq!(code, Some(0), "{said}");
}

#[test]
fn runs_that_are_joined_can_be_finished() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| folder.path().join(name);
    let go = |words: &[&str]| ended(folder.path(), words);
    dataset(folder.path(), "views", 3);
    let plane = dataset(folder.path(), "plane", 3);
    homographies(&plane, &[(0, 1), (0, 2)]);
    fs::remove_file(plane.join("pairs.txt")).expect("it was there");
    homographies(
        &dataset(folder.path(), "both", 3),
        &[(0, 1), (0, 2), (1, 2)],
    );
    for (dataset, matcher, estimator) in [
        ("views", "sift", "best"),
        ("plane", "sift", "best-h"),
        ("plane", "orb", "best-h"),
        ("both", "sift", "best"),
        ("both", "sift", "best-h"),
        ("both", "sift", "ransac-e"),
    ] {
        let out = format!("{dataset}-{matcher}-{estimator}");
        let what = ["--matchers", matcher, "--estimator", estimator];
        let (code, said) = go(&[&["run", dataset, "--out", &out][..], &what].concat());
        assert_eq!(code, Some(0), "{said}");
    }
    // There are neither homographies of the views nor poses of the plane.
    for (runs, truth) in [
        (["views-sift-best", "plane-sift-best-h"], "homographies"),
        (["plane-sift-best-h", "views-sift-best"], "poses"),
    ] {
        let (code, said) = go(&["join", runs[0], runs[1], "--out", "no"]);
        assert!(
            code == Some(1) && said.contains(&format!("none of them estimated {truth}")),
            "{said}"
        );
        assert!(!at("no").exists());
    }
    for (name, runs) in [
        ("apart", ["views-sift-best", "plane-orb-best-h"]),
        ("whole", ["both-sift-best", "both-sift-best-h"]),
    ] {
        let (code, said) = go(&["join", runs[0], runs[1], "--out", name]);
        assert!(code == Some(0) && !said.contains("missing"), "{said}");
    }
    // Each was finished, and both estimators are planned on both datasets.
    let (code, said) = go(&[
        "join",
        "views-sift-best",
        "both-sift-ransac-e",
        "--out",
        "grown",
    ]);
    let why = "6 of 12 planned tasks are missing: the joined run has each matcher with all of its estimators";
    assert!(code == Some(0) && said.contains(why), "{said}");
    let (code, said) = go(&["report", "grown"]);
    assert_eq!(code, Some(0), "{said}");
    let page = fs::read_to_string(at("grown/report/index.html")).expect("it was written");
    let command = "run views both --matchers sift --estimator best,ransac-e --seed 0 --out grown";
    let shown = format!("<code>matchbench {command}</code>");
    assert!(page.contains(&shown), "{page}");
    let (code, said) = go(&command.split(' ').collect::<Vec<_>>());
    let all = "12 tasks done, 6 of them earlier";
    assert!(code == Some(0) && said.contains(all), "{said}");
}

#[cfg(unix)]
#[test]
fn a_file_that_may_not_grow_is_an_error_and_the_run_goes_on_without_that_limit() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 6);
    let run = ["run", "wall", "--matchers", "orb", "--out", "out"];
    // Two to four kilobytes, whichever blocks the shell counts.
    let script = "ulimit -f 4 && exec \"$0\" \"$@\"";
    let mut limited = std::process::Command::new("sh");
    limited.args(["-c", script, env!("CARGO_BIN_EXE_matchbench")]);
    let limited = limited.args(run).current_dir(folder).output();
    let limited = limited.expect("there is a shell");
    let said = String::from_utf8_lossy(&limited.stderr);
    assert_eq!(limited.status.code(), Some(1), "{said}");
    assert!(said.contains("File too large"), "{said}");
    let (code, said) = ended(folder, &run);
    assert_eq!(code, Some(0), "{said}");
    assert_eq!(records(&folder.join("out"), "wall", "orb").len(), 15);
}
