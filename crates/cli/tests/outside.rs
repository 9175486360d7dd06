//! Matchers from outside at the command line: a manifest wherever an id is, and what is left when its
//! program breaks or is stopped.
#![cfg(unix)]

mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use common::{dataset, matchbench, send, stop_signal, wall_matches};

/// A program in the language of the shell: every pair has the matches of `matches.f32`, unless there is
/// a file `break`, whose text it runs instead.
const PROGRAM: &str = r#"
echo $$ >> started
while read -r line; do
    case $line in
    *'"type":"hello"'*)
        echo "loading"
        echo '{"type":"ready","protocol":1,"name":"toy","version":"'"$(cat version)"'","pixel_center":0}' ;;
    *'"type":"match"'*)
        if test -e break; then . ./break; fi
        pair=${line#*\"pair\":}; out=${line##*\"out\":\"}
        cp matches.f32 "${out%\"\}}"
        echo '{"type":"matched","pair":'"${pair%%]*}"'],"count":60,"device":"abacus"}' ;;
    *'"type":"bye"'*) exit 0 ;;
    esac
done
"#;

/// A manifest in a folder of its own, and that folder.
fn toy(folder: &Path) -> (PathBuf, PathBuf) {
    let home = folder.join("toy");
    fs::create_dir_all(&home).expect("writable");
    fs::write(home.join("matches.f32"), wall_matches()).expect("writable");
    fs::write(home.join("version"), "1.0").expect("writable");
    fs::write(home.join("toy.sh"), PROGRAM).expect("writable");
    let manifest = home.join("toy.toml");
    let text = "name = \"toy\"\ncommand = [\"sh\", \"toy.sh\"]\ntimeout_s = 20\n";
    fs::write(&manifest, text).expect("writable");
    (manifest, home)
}

fn output(arguments: &[&str], paths: &[&Path]) -> Output {
    let mut command = matchbench();
    command.args(arguments).args(paths);
    command.output().expect("the program starts")
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn lines(path: &Path) -> usize {
    fs::read_to_string(path).map_or(0, |text| text.lines().count())
}

/// The programs that were started end within some seconds; whoever is to reap those that outlived the
/// host may never do it.
fn assert_all_gone(home: &Path) {
    let is_there = |number: &str| {
        let asked = Command::new("kill")
            .args(["-0", number])
            .stderr(Stdio::null())
            .status();
        let state = fs::read_to_string(format!("/proc/{number}/stat"));
        let is_zombie = state.is_ok_and(|state| state.contains(") Z "));
        asked.expect("kill is everywhere").success() && !is_zombie
    };
    let started = fs::read_to_string(home.join("started")).expect("it was started");
    let patience = Instant::now() + Duration::from_secs(20);
    for number in started.lines() {
        while is_there(number) {
            assert!(Instant::now() < patience, "{number} is still there");
            sleep(Duration::from_millis(20));
        }
    }
}

#[test]
fn a_manifest_is_used_wherever_an_id_is() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 3);
    let (manifest, home) = toy(folder.path());
    let (toy, run) = (manifest.to_str().expect("UTF-8"), folder.path().join("run"));

    let both = format!("sift,{toy}");
    let asked = [
        "run",
        "--matchers",
        &both,
        "--estimator",
        "ransac-e",
        "--out",
    ];
    let done = output(&asked, &[&run, &wall]);
    assert_eq!(done.status.code(), Some(0), "{}", said(&done));
    let records = run.join("records/wall/toy+ransac-e.jsonl");
    assert_eq!(lines(&records), 3);
    let text = fs::read_to_string(&records).expect("it was written");
    assert_eq!(text.matches("\"device\":\"abacus\"").count(), 3, "{text}");
    let log = fs::read_to_string(run.join("logs/toy.log")).expect("it was written");
    assert!(log.contains("loading"), "{log}");

    let picture = folder.path().join("pair.svg");
    let shown = output(
        &["show", "--matcher", toy, "--out"],
        &[&picture, &wall, Path::new("0"), Path::new("1")],
    );
    assert_eq!(shown.status.code(), Some(0), "{}", said(&shown));
    let counts = String::from_utf8_lossy(&shown.stdout);
    assert!(
        counts.contains(" putative and ") && !counts.contains("features"),
        "it does not tell them: {counts}"
    );
    assert!(
        fs::read_to_string(&picture)
            .expect("it was written")
            .contains("<svg")
    );

    let tuning = folder.path().join("tuning");
    let values = [
        "tune",
        "--matchers",
        toy,
        "--parameter",
        "ransac-e.threshold_px",
        "--values",
        "1,2",
        "--out",
    ];
    let tuned = output(&values, &[&tuning, &wall]);
    assert_eq!(tuned.status.code(), Some(0), "{}", said(&tuned));
    assert!(tuning.join("tuned.json").is_file());

    let timed = output(&["time", "--matchers", toy], &[&wall]);
    assert_eq!(timed.status.code(), Some(1));
    assert!(
        said(&timed).contains("keeps to neither"),
        "{}",
        said(&timed)
    );

    // Arguments may choose the weights; where the program is installed makes no difference.
    let text = fs::read_to_string(&manifest).expect("it was written");
    for (command, code) in [
        ("\"sh\", \"toy.sh\", \"large\"", 1),
        ("\"/bin/sh\", \"toy.sh\"", 0),
    ] {
        fs::write(&manifest, text.replace("\"sh\", \"toy.sh\"", command)).expect("writable");
        let again = output(&asked, &[&run, &wall]);
        assert_eq!(again.status.code(), Some(code), "{}", said(&again));
        assert_eq!(
            code == 1,
            said(&again).contains("command"),
            "{}",
            said(&again)
        );
    }

    fs::write(home.join("version"), "2.0").expect("writable");
    let other = output(&asked, &[&run, &wall]);
    assert_eq!(
        other.status.code(),
        Some(1),
        "another version is another matcher"
    );
    assert!(said(&other).contains("toy"), "{}", said(&other));

    fs::write(home.join("version"), "1.0").expect("writable");
    let moved = PROGRAM.replace("\"pixel_center\":0", "\"pixel_center\":0.5");
    fs::write(home.join("toy.sh"), moved).expect("writable");
    let other = output(&asked, &[&run, &wall]);
    assert_eq!(other.status.code(), Some(1), "other pixels, other matches");
    assert!(said(&other).contains("centre at 0.5"), "{}", said(&other));
    assert_all_gone(&home);
}

#[test]
fn a_program_that_breaks_costs_no_other_matcher() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 4);
    let (manifest, home) = toy(folder.path());
    let (toy, run) = (manifest.to_str().expect("UTF-8"), folder.path().join("run"));
    fs::write(home.join("break"), "echo 'no more memory' >&2; exit 3\n").expect("writable");
    let both = format!("{toy},sift");
    let asked = [
        "run",
        "--matchers",
        &both,
        "--estimator",
        "ransac-e",
        "--threads",
        "1",
        "--out",
    ];
    let broken = output(&asked, &[&run, &wall]);
    // Not everything was tried.
    assert_eq!(broken.status.code(), Some(1), "{}", said(&broken));
    let message = said(&broken);
    for part in ["3 images in a row", "no more memory", "logs/toy.log"] {
        assert!(message.contains(part), "{part}: {message}");
    }
    assert_eq!(lines(&run.join("records/wall/sift+ransac-e.jsonl")), 6);

    // Mended, it does what is left and what failed.
    fs::remove_file(home.join("break")).expect("it was written");
    let mended = output(&asked, &[&run, &wall]);
    assert_eq!(mended.status.code(), Some(0), "{}", said(&mended));
    let eval = output(&["eval", "--format", "csv"], &[&run]);
    let table = String::from_utf8_lossy(&eval.stdout).into_owned();
    let row = table
        .lines()
        .find(|line| line.contains("toy"))
        .expect("a row of it");
    assert!(row.contains(",6,0,"), "six pairs and none failed: {row}");
    assert_all_gone(&home);
}

#[test]
fn an_image_that_breaks_a_program_costs_its_own_pairs_alone() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 6);
    let (manifest, home) = toy(folder.path());
    let (toy, run) = (manifest.to_str().expect("UTF-8"), folder.path().join("run"));
    let break_over = |image: &str| {
        let text = format!("case $line in *'\"pair\":['{image},*) exit 3 ;; esac\n");
        fs::write(home.join("break"), text).expect("writable");
    };
    break_over("0");
    let asked = [
        "run",
        "--threads",
        "1",
        "--matchers",
        toy,
        "--estimator",
        "ransac-e",
        "--out",
    ];
    let records = run.join("records/wall/toy+ransac-e.jsonl");
    let failed = || {
        let text = fs::read_to_string(&records).expect("it was written");
        let is_failed = |line: &&str| line.contains("failed");
        (text.lines().filter(is_failed).count(), text.lines().count())
    };
    let broken = output(&asked, &[&run, &wall]);
    assert_eq!(broken.status.code(), Some(2), "{}", said(&broken));
    assert_eq!(failed(), (5, 15), "{}", said(&broken));
    assert!(
        said(&broken).contains("not asked any more"),
        "{}",
        said(&broken)
    );
    // One for three questions, and one for all others.
    assert_eq!(lines(&home.join("started")), 4);

    // Three such images end it. The next start goes on behind them, before it tries again what failed.
    fs::remove_dir_all(&run).expect("it was written");
    break_over("[012]");
    for (expected, ends) in [((9, 9), true), ((12, 15), false)] {
        let broken = output(&asked, &[&run, &wall]);
        let message = said(&broken);
        let code = if ends { 1 } else { 2 };
        assert_eq!(broken.status.code(), Some(code), "{message}");
        assert_eq!(message.contains("3 images in a row"), ends, "{message}");
        assert_eq!(failed(), expected, "{message}");
    }

    fs::remove_file(home.join("break")).expect("it was written");
    let mended = output(&asked, &[&run, &wall]);
    assert_eq!(mended.status.code(), Some(0), "{}", said(&mended));
    assert_eq!(failed(), (0, 15));
    assert_all_gone(&home);
}

/// Waits until the program is at work, as `break` says it.
fn wait_for(file: &Path) {
    let patience = Instant::now() + Duration::from_secs(60);
    while !file.exists() {
        assert!(
            Instant::now() < patience,
            "it was not asked within a minute"
        );
        sleep(Duration::from_millis(5));
    }
}

/// Stops the host as often as this, and returns its exit code.
fn stopped(mut host: Child, times: usize) -> Option<i32> {
    for _ in 0..times {
        send(stop_signal(), host.id());
        sleep(Duration::from_millis(300));
    }
    host.wait().expect("it ended").code()
}

#[test]
fn ctrl_c_twice_ends_the_program_too() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 3);
    let (manifest, home) = toy(folder.path());
    let (run, temporary) = (folder.path().join("run"), folder.path().join("temporary"));
    fs::create_dir(&temporary).expect("writable");
    fs::write(home.join("break"), "touch waiting; sleep 600\n").expect("writable");
    let host = matchbench()
        .args(["run", "--threads", "1", "--matchers"])
        .arg(&manifest)
        .arg("--out")
        .args([&run, &wall])
        .env("TMPDIR", &temporary)
        .stderr(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .expect("the program starts");
    wait_for(&home.join("waiting"));
    let left = || fs::read_dir(&temporary).expect("it is there").count();
    assert_eq!(left(), 1, "the folder of its answers");
    assert_eq!(stopped(host, 2), Some(130));
    assert_all_gone(&home);
    assert_eq!(left(), 0);
}

#[test]
fn ctrl_c_ends_the_program_also_where_nothing_is_to_be_finished_and_while_it_starts() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 3);
    let (manifest, home) = toy(folder.path());
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (toy, wall) = (manifest.display().to_string(), wall.display().to_string());
    let (plan, picture) = (at("plan"), at("pair.svg"));
    let planned = [
        "plan",
        &wall,
        "--matchers",
        &toy,
        "--shards",
        "1",
        "--out",
        &plan,
    ];
    assert_eq!(output(&planned, &[]).status.code(), Some(0));
    let waiting = home.join("waiting");
    // The program starts, and does not get ready.
    let version = "touch waiting; sleep 600; cat version";
    let slow = PROGRAM.replace("cat version", version);
    for (command, times) in [
        (&["check", &toy][..], 1),
        (
            &[
                "show",
                &wall,
                "0",
                "1",
                "--matcher",
                &toy,
                "--out",
                &picture,
            ],
            1,
        ),
        (&[&planned[..7], &[&at("other")]].concat(), 1),
        (&["work", &plan, "--shard", "1"], 2),
        (&["run", &wall, "--matchers", &toy, "--out", &at("run")], 2),
    ] {
        fs::write(home.join("toy.sh"), &slow).expect("writable");
        let host = matchbench()
            .args(command)
            .stderr(Stdio::null())
            .stdout(Stdio::null())
            .spawn()
            .expect("the program starts");
        wait_for(&waiting);
        fs::remove_file(&waiting).expect("it was there");
        assert_eq!(stopped(host, times), Some(130), "{command:?}");
        assert_all_gone(&home);
    }
}

#[test]
fn why_tasks_failed_is_said_at_the_end_of_a_run() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 3);
    let (manifest, home) = toy(folder.path());
    let refuse = r#"
pair=${line#*\"pair\":}
echo '{"type":"failed","pair":'"${pair%%]*}"'],"reason":"out of memory"}'
continue
"#;
    fs::write(home.join("break"), refuse).expect("writable");
    let toy = manifest.to_str().expect("UTF-8");
    let run = folder.path().join("run");
    let broken = output(&["run", "--matchers", toy, "--out"], &[&run, &wall]);
    assert_eq!(broken.status.code(), Some(2), "{}", said(&broken));
    let message = said(&broken);
    assert!(message.contains("3 tasks FAILED"), "{message}");
    assert!(message.contains("3 tasks of toy on wall: "), "{message}");
    assert!(message.contains("out of memory"), "{message}");
}

#[test]
fn a_matcher_that_ends_while_the_user_stops_the_run_hides_nothing() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 4);
    let (manifest, home) = toy(folder.path());
    let run = folder.path().join("run");
    // It does none, and its third process in a row that does not start, with which it is given up, is lost after the run
    // is stopped.
    fs::write(home.join("break"), "exit 3\n").expect("writable");
    let starts = "case $(($(wc -l < started))) in 1) ;; 4) kill -TERM $PPID; sleep 1; exit 3 ;; *) exit 3 ;; esac\n";
    fs::write(
        home.join("toy.sh"),
        PROGRAM.replace(">> started\n", &format!(">> started\n{starts}")),
    )
    .expect("writable");
    let toy = manifest.to_str().expect("UTF-8");
    let asked = ["run", "--threads", "4", "--matchers", toy, "--out"];
    let done = output(&asked, &[&run, &wall]);
    assert!(said(&done).contains("toy has ended"), "{}", said(&done));
    assert_eq!(done.status.code(), Some(130), "{}", said(&done));
}

#[test]
fn a_program_that_crashes_while_the_user_stops_the_run_is_not_started_again() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 4);
    let (manifest, home) = toy(folder.path());
    let run = folder.path().join("run");
    // Three pairs wait for it.
    fs::write(home.join("break"), "kill -TERM $PPID; sleep 1; exit 3\n").expect("writable");
    let toy = manifest.to_str().expect("UTF-8");
    let asked = ["run", "--threads", "4", "--matchers", toy, "--out"];
    let done = output(&asked, &[&run, &wall]);
    assert_eq!(done.status.code(), Some(130), "{}", said(&done));
    assert_eq!(lines(&home.join("started")), 1, "{}", said(&done));
}

#[test]
fn a_program_that_hangs_while_the_user_stops_the_run_is_waited_for_once() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 4);
    let (manifest, home) = toy(folder.path());
    let run = folder.path().join("run");
    let text = fs::read_to_string(&manifest).expect("readable");
    fs::write(&manifest, text.replace("= 20", "= 2")).expect("writable");
    // Three pairs wait for it.
    fs::write(home.join("break"), "kill -TERM $PPID; sleep 60\n").expect("writable");
    let toy = manifest.to_str().expect("UTF-8");
    let asked = ["run", "--threads", "4", "--matchers", toy, "--out"];
    let done = output(&asked, &[&run, &wall]);
    assert_eq!(done.status.code(), Some(130), "{}", said(&done));
    assert!(!said(&done).contains("toy has ended"), "{}", said(&done));
    assert_eq!(lines(&home.join("started")), 1, "{}", said(&done));
    assert_all_gone(&home);
    fs::remove_file(home.join("break")).expect("it is there");
    let done = output(&asked, &[&run, &wall]);
    assert_eq!(done.status.code(), Some(0), "{}", said(&done));
}

#[test]
fn a_run_that_is_suspended_blames_no_program() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 2);
    let (manifest, home) = toy(folder.path());
    let text = fs::read_to_string(&manifest).expect("readable");
    fs::write(&manifest, text.replace("= 20", "= 4")).expect("writable");
    let suspend = "(sleep 5; kill -CONT $PPID) & kill -STOP $PPID; sleep 6\n";
    fs::write(home.join("break"), suspend).expect("writable");
    let toy = manifest.to_str().expect("UTF-8");
    let asked = ["run", "--matchers", toy, "--out"];
    let done = output(&asked, &[&folder.path().join("run"), &wall]);
    assert_eq!(done.status.code(), Some(0), "{}", said(&done));
}

#[test]
fn a_program_that_ended_is_not_waited_for_though_another_holds_its_output() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 2);
    let (manifest, home) = toy(folder.path());
    // It leaves the group and keeps what it inherited.
    fs::write(home.join("break"), "setsid sleep 8 & exit 3\n").expect("writable");
    let start = Instant::now();
    let run = folder.path().join("run");
    let matcher = manifest.to_str().expect("plain");
    output(&["run", "--matchers", matcher, "--out"], &[&run, &wall]);
    assert!(
        start.elapsed() < Duration::from_secs(6),
        "{:?}",
        start.elapsed()
    );
    let record =
        fs::read_to_string(run.join("records/wall/toy+ransac-e.jsonl")).expect("it was written");
    assert!(
        record.contains("it ended without an answer (exit status: 3"),
        "{record}"
    );
}

#[test]
fn a_check_keeps_its_log_where_the_folder_of_temporary_files_is_a_link() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (manifest, home) = toy(folder.path());
    let (real, link) = (folder.path().join("real"), folder.path().join("link"));
    fs::create_dir(&real).expect("writable");
    std::os::unix::fs::symlink(&real, &link).expect("writable");
    let check = || {
        let mut check = matchbench();
        check.arg("check").arg(&manifest).env("TMPDIR", &link);
        check.output().expect("the program starts")
    };
    let told_once = |checked: &Output| {
        let printed = String::from_utf8_lossy(&checked.stdout);
        let times = printed.matches("what it printed is in").count();
        assert_eq!(times, 1, "{printed}{}", said(checked));
    };
    told_once(&check());
    // A program that does not start may have said why.
    fs::write(home.join("toy.sh"), "exit 1\n").expect("writable");
    told_once(&check());
}

#[test]
fn an_empty_name_of_the_folder_of_temporary_files_counts_as_none() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 2);
    let (manifest, _) = toy(folder.path());
    let mut run = matchbench();
    run.arg("run")
        .args([&wall, Path::new("--matchers"), &manifest])
        .args([Path::new("--out"), &folder.path().join("run")]);
    let done = run.env("TMPDIR", "").output().expect("the program starts");
    assert_eq!(done.status.code(), Some(0), "{}", said(&done));
}

#[test]
fn while_a_program_starts_one_ctrl_c_ends_it_and_the_run() {
    assert_ends_while_it_starts(&["run", "--matchers"]);
}

#[test]
fn while_a_program_starts_one_ctrl_c_ends_it_and_the_tuning() {
    let parameter = "--parameter=best.threshold_px";
    assert_ends_while_it_starts(&["tune", parameter, "--values=1,2", "--matchers"]);
}

/// One Ctrl-C ends this command and the program that is its last argument, which does not get ready.
fn assert_ends_while_it_starts(command: &[&str]) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 3);
    let (manifest, home) = toy(folder.path());
    fs::write(home.join("toy.sh"), "echo $$ >> started; sleep 60\n").expect("writable");
    let mut child = matchbench()
        .args(command)
        .arg(&manifest)
        .arg("--out")
        .args([&folder.path().join("run"), &wall])
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts");
    let patience = Instant::now() + Duration::from_secs(30);
    while lines(&home.join("started")) == 0 {
        assert!(Instant::now() < patience, "it is started");
        sleep(Duration::from_millis(5));
    }
    send(stop_signal(), child.id());
    let status = child.wait().expect("it ended");
    assert_eq!(status.code(), Some(130));
    assert!(Instant::now() < patience, "the program was not waited for");
    assert_all_gone(&home);
}
