//! A plan, its shards and their merging, as they are typed; and the script for Slurm, whose body is run
//! as an array of jobs runs it.

mod common;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::thread::sleep;
use std::time::{Duration, Instant};

use common::{dataset, matchbench};

fn done(command: &mut Command) -> Output {
    let output = command.output().expect("the program starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{command:?}: {said}");
    output
}

/// The files of a run but for those that are not results, and records without their times.
fn results(run: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![run.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("it is ours") {
            let path = entry.expect("it can be listed").path();
            let inside = path.strip_prefix(run).expect("inside").to_path_buf();
            if ["cache", ".lock"]
                .iter()
                .any(|other| inside.starts_with(other))
            {
                continue;
            }
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let mut bytes = fs::read(&path).expect("readable");
            if inside.starts_with("records") {
                let text = String::from_utf8(bytes).expect("JSON");
                let records = text.lines().map(|line| {
                    let mut record: serde_json::Value = serde_json::from_str(line).expect("JSON");
                    let record = record.as_object_mut().expect("a record");
                    record.remove("times");
                    record.remove("check");
                    serde_json::to_string(record).expect("JSON") + "\n"
                });
                bytes = records.collect::<String>().into_bytes();
            }
            found.insert(inside, bytes);
        }
    }
    found
}

/// A folder with two datasets, a run of both, and a plan of it in so many shards.
fn planned(shards: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| folder.path().join(name);
    let datasets = [
        dataset(folder.path(), "wall", 8),
        dataset(folder.path(), "other", 5),
    ];
    let what = [
        "--matchers",
        "sift,orb",
        "--estimator",
        "ransac-e,best",
        "--repeat",
        "2",
    ];
    done(
        matchbench()
            .arg("run")
            .args(&datasets)
            .args(what)
            .arg("--out")
            .arg(at("single")),
    );
    let plan = || {
        let mut plan = matchbench();
        plan.arg("plan").args(&datasets).args(what);
        plan.args(["--shards", shards, "--out"]).arg(at("plan"));
        plan
    };
    let output = done(&mut plan());
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("13 on one machine"), "{said}");
    done(&mut plan()); // the same plan again is no other plan
    let refused = plan().args(["--seed", "7"]).output().expect("it ran");
    assert_eq!(refused.status.code(), Some(1));
    folder
}

#[test]
fn the_script_for_slurm_does_what_one_machine_does() {
    let folder = planned("3");
    let at = |name: &str| folder.path().join(name);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/scale/slurm.sh");
    let program = Path::new(env!("CARGO_BIN_EXE_matchbench"))
        .parent()
        .expect("a folder");
    let path = format!(
        "{}:{}",
        program.display(),
        std::env::var("PATH").unwrap_or_default()
    );
    if Command::new("bash").arg("--version").output().is_err() {
        return; // no shell, no Slurm
    }
    for task in ["3", "1"] {
        let mut job = Command::new("bash");
        job.arg(&script).arg(at("plan")).env("PATH", &path);
        done(
            job.env("SLURM_ARRAY_TASK_ID", task)
                .env("SLURM_CPUS_PER_TASK", "2"),
        );
    }
    let merge = || {
        let mut merge = matchbench();
        merge
            .arg("merge")
            .arg(at("plan"))
            .arg("--out")
            .arg(at("merged"));
        merge
    };
    let gap = merge().output().expect("it ran");
    let said = String::from_utf8_lossy(&gap.stderr).into_owned();
    assert_eq!(gap.status.code(), Some(1), "{said}");
    assert!(
        said.contains("2 (not begun)") && !at("merged").exists(),
        "{said}"
    );
    let mut job = Command::new("bash");
    job.arg(&script).arg(at("plan")).env("PATH", &path);
    done(
        job.env("SLURM_ARRAY_TASK_ID", "2")
            .env_remove("SLURM_CPUS_PER_TASK"),
    );
    done(&mut merge());
    assert!(results(&at("merged")) == results(&at("single")));
    done(matchbench().arg("eval").arg(at("merged")));
}

#[cfg(unix)] // `sh`
#[test]
fn a_file_that_cannot_be_written_to_its_end_is_named() {
    let folder = planned("2");
    for shard in ["1", "2"] {
        let mut work = matchbench();
        work.args(["work", "plan", "--shard", shard]);
        done(work.current_dir(folder.path()));
    }
    // Files of matches are longer than this limit: 20 or 40 KB, as shells count.
    let limited = "trap '' XFSZ; ulimit -f 40; exec \"$@\"";
    let mut merge = Command::new("sh");
    merge.args(["-c", limited, "sh", env!("CARGO_BIN_EXE_matchbench")]);
    merge.args(["merge", "plan", "--out", "merged"]);
    let output = merge.current_dir(folder.path()).output();
    let said = String::from_utf8(output.expect("it ran").stderr).expect("UTF-8");
    let named = "error: cannot write merged/matches/wall/";
    assert!(said.contains(named), "{said}");
    assert!(!said.contains(".matchbench-"), "what is gone: {said}");
}

#[test]
fn a_killed_shard_goes_on_and_copied_folders_serve() {
    let folder = planned("2");
    let at = |name: &str| folder.path().join(name);
    // Another machine: a copy of the plan, the datasets at another place.
    fs::create_dir_all(at("node/data")).expect("writable");
    fs::copy(at("plan/plan.json"), at("node/plan.json")).expect("writable");
    for name in ["wall", "other"] {
        fs::rename(at(name), at("node/data").join(name)).expect("writable");
    }
    let lost = (matchbench()
        .arg("work")
        .arg(at("plan"))
        .args(["--shard", "1"])
        .output())
    .expect("it ran");
    let said = String::from_utf8_lossy(&lost.stderr).into_owned();
    assert!(
        lost.status.code() == Some(1) && said.contains("--data"),
        "{said}"
    );
    let work = |place: &str, shard: &str| {
        let mut work = matchbench();
        work.arg("work")
            .arg(at(place))
            .args(["--shard", shard, "--threads", "1"]);
        for name in ["other", "wall"] {
            work.arg("--data").arg(at("node/data").join(name));
        }
        work
    };
    let records = at("node/shards/2/records");
    let mut child = work("node", "2").spawn().expect("the program starts");
    let patience = Instant::now() + Duration::from_secs(60);
    let begun = |folder: &Path| folder.is_dir() && !results(folder).values().all(Vec::is_empty);
    while !begun(&records) {
        assert!(Instant::now() < patience, "no record within a minute");
        sleep(Duration::from_millis(1));
    }
    child.kill().expect("it can be killed");
    child.wait().expect("it ended");
    done(&mut work("node", "2"));
    let again = done(&mut work("node", "2"));
    let said = String::from_utf8_lossy(&again.stderr).into_owned();
    assert!(said.contains("earlier"), "{said}");
    done(work("plan", "1").arg("--out").arg(at("elsewhere")));
    let mut merge = matchbench();
    merge
        .arg("merge")
        .arg(at("plan/plan.json"))
        .args([at("node"), at("elsewhere")]);
    done(merge.arg("--out").arg(at("merged")));
    assert!(results(&at("merged")) == results(&at("single")));
}

#[test]
fn matches_from_files_are_shared_out_too() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| folder.path().join(name);
    let wall = dataset(folder.path(), "wall", 5);
    // Scores beyond 1 stand in the last pair alone, and say how those of all others are read; one pair is absent.
    for (index, (a, b)) in [(0, 1), (0, 2), (1, 3), (2, 3), (0, 4), (3, 4)]
        .into_iter()
        .enumerate()
    {
        let score = if index == 5 { "7.5" } else { "0.25" };
        let shift = 5 * (b - a);
        let rows = (0..60).map(|i| (12 * (i % 8) + 30, 14 * (i / 8) + 10 + i % 3));
        let rows = rows.map(|(x, y)| format!("{x} {y} {} {y} {score}", x - shift));
        fs::create_dir_all(at("mine")).expect("writable");
        fs::write(
            at("mine").join(format!("{a}_{b}.txt")),
            rows.collect::<Vec<_>>().join("\n"),
        )
        .expect("writable");
    }
    let asked = |command: &str| {
        let mut asked = matchbench();
        asked.arg(command).arg(&wall).arg("--matches");
        asked.arg(format!("mine={}", at("mine").display()));
        asked.args(["--pixel-center", "0", "--estimator", "best"]);
        asked
    };
    let single = (asked("run").arg("--out").arg(at("single")).output()).expect("it ran");
    assert_eq!(
        single.status.code(),
        Some(2),
        "absent pairs count as failed"
    );
    let records = at("single/records/wall/mine+best.jsonl");
    let records = fs::read_to_string(records).expect("it was written");
    assert_eq!(records.matches("the files have no matches").count(), 4);
    assert!(!records.contains("may_pass"), "they never will: {records}");
    let planned = done(
        asked("plan")
            .args(["--shards", "3", "--out"])
            .arg(at("plan")),
    );
    let said = String::from_utf8_lossy(&planned.stdout);
    assert!(
        said.contains("3 shards") && !said.contains("extract"),
        "{said}"
    );
    // On another machine they are elsewhere, in a folder of the same name.
    fs::create_dir(at("node")).expect("writable");
    fs::rename(at("mine"), at("node/mine")).expect("writable");
    let work = |shard: &str, matches: &Path| {
        let mut work = matchbench();
        work.arg("work").arg(at("plan")).args(["--shard", shard]);
        work.arg("--matches")
            .arg(format!("mine={}", matches.display()));
        work.output().expect("it ran")
    };
    for shard in ["1", "2", "3"] {
        let output = work(shard, &at("node/mine"));
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(matches!(output.status.code(), Some(0 | 2)), "{said}");
    }
    let mut merge = matchbench();
    merge
        .arg("merge")
        .arg(at("plan"))
        .arg("--out")
        .arg(at("merged"));
    assert_eq!(merge.output().expect("it ran").status.code(), Some(2));
    assert!(results(&at("merged")) == results(&at("single")));
    // Other files are another plan.
    let file = at("node/mine/0_1.txt");
    let changed = fs::read_to_string(&file)
        .expect("readable")
        .replacen("30 10", "31 10", 1);
    fs::write(&file, changed).expect("writable");
    fs::remove_dir_all(at("plan/shards")).expect("ours");
    let refused = work("1", &at("node/mine"));
    let said = String::from_utf8_lossy(&refused.stderr);
    assert!(
        refused.status.code() == Some(1) && said.contains("blake3"),
        "{said}"
    );
}
