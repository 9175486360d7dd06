//! Links in the folders of other people: nothing is written or deleted where they lead.
#![cfg(unix)]

mod common;
mod steps;

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use common::dataset;
use steps::{go, succeeds};

const RUN: [&str; 6] = ["run", "wall", "--matchers", "sift", "--out", "run"];

/// A dataset of three images and a run of SIFT on it.
fn run_in(folder: &Path) {
    dataset(folder, "wall", 3);
    succeeds(folder, &RUN);
}

/// The first file of features in a cache.
fn cached(cache: &Path) -> PathBuf {
    let first = |folder: &Path| {
        let mut entries = fs::read_dir(folder).expect("it is there");
        entries
            .next()
            .expect("it is not empty")
            .expect("readable")
            .path()
    };
    first(&first(cache))
}

fn refused(folder: &Path, words: &[&str], named: &str) {
    let output = go(folder, words);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains(named), "{said}");
}

#[test]
fn a_report_neither_writes_nor_deletes_where_links_in_its_folder_lead() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    run_in(folder);
    let (report, other) = (folder.join("run/report"), folder.join("other"));
    succeeds(folder, &["report", "run"]);
    fs::create_dir(&other).expect("writable");
    let theirs = other.join("theirs");
    fs::write(&theirs, "theirs").expect("writable");

    symlink(&other, report.join("link")).expect("writable");
    let list = fs::read_to_string(report.join(".files")).expect("written");
    fs::write(report.join(".files"), list + "link/theirs\n").expect("writable");
    succeeds(folder, &["report", "run"]);
    assert!(theirs.exists());

    let table = report.join("tables/scores.csv");
    fs::remove_file(&table).expect("there");
    symlink(&theirs, &table).expect("writable");
    refused(folder, &["report", "run"], "scores.csv: it is a link");
    assert_eq!(fs::read(&theirs).expect("there"), b"theirs");

    // A folder of the report, too.
    let scores = other.join("scores.csv");
    fs::write(&scores, "theirs").expect("writable");
    fs::remove_dir_all(report.join("tables")).expect("there");
    symlink(&other, report.join("tables")).expect("writable");
    refused(folder, &["report", "run"], "tables: it is a link");
    assert_eq!(fs::read(&scores).expect("there"), b"theirs");
}

#[test]
fn the_folder_of_a_report_inside_a_run_or_results_may_be_no_link() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    run_in(folder);
    let other = folder.join("other");
    fs::create_dir(&other).expect("writable");
    symlink(&other, folder.join("run/report")).expect("writable");
    refused(folder, &["report", "run"], "report: it is a link");
    assert_eq!(fs::read_dir(&other).expect("there").count(), 0);
    // A place that the user chose may be one.
    succeeds(folder, &["report", "run", "--out", "run/report"]);
    assert!(other.join("index.html").exists());
}

#[test]
fn a_cache_of_somebody_else_is_not_written_through_its_links() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    run_in(folder);
    let (cache, theirs) = (folder.join("cache"), folder.join("theirs"));
    fs::rename(folder.join("run/cache"), &cache).expect("a run has it");
    let features = cached(&cache);
    fs::remove_file(&features).expect("it was just found");
    fs::write(&theirs, "theirs").expect("writable");
    symlink(&theirs, &features).expect("writable");
    let again = [
        "run",
        "wall",
        "--matchers",
        "sift",
        "--out",
        "again",
        "--cache",
        "cache",
    ];
    refused(folder, &again, "features: it is a link");
    assert_eq!(fs::read(&theirs).expect("there"), b"theirs");
}

#[test]
fn a_run_goes_on_through_no_link_in_its_folder() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    run_in(folder);
    let (run, theirs) = (folder.join("run"), folder.join("theirs"));
    let records = run.join("records/wall/sift+ransac-e.jsonl");
    for own in [records, run.join("images/wall.txt"), run.join("plan.json")] {
        let kept = folder.join("kept");
        fs::rename(&own, &kept).expect("a run has it");
        fs::write(&theirs, "theirs, without an end of line").expect("writable");
        symlink(&theirs, &own).expect("writable");
        let name = own.file_name().expect("a file").to_string_lossy();
        refused(folder, &RUN, &format!("{name} is a link"));
        assert_eq!(
            fs::read(&theirs).expect("there"),
            b"theirs, without an end of line"
        );
        fs::rename(&kept, &own).expect("both are ours");
    }
    // What its cache writes, too: there another matcher begins.
    let (features, kept) = (cached(&run.join("cache")), folder.join("kept"));
    fs::rename(&features, &kept).expect("it was just found");
    symlink(&theirs, &features).expect("writable");
    refused(folder, &RUN, "features is a link");
    fs::rename(&kept, &features).expect("both are ours");
    // A folder of the run, too; the run's own folder may be a link, which its owner made.
    fs::rename(run.join("matches"), folder.join("matches")).expect("there");
    symlink(folder.join("matches"), run.join("matches")).expect("writable");
    refused(folder, &RUN, "matches is a link");
    fs::remove_file(run.join("matches")).expect("there");
    fs::rename(folder.join("matches"), run.join("matches")).expect("there");
    fs::rename(&run, folder.join("elsewhere")).expect("there");
    symlink("elsewhere", &run).expect("writable");
    succeeds(folder, &RUN);
}

#[test]
fn a_shard_is_written_through_no_link_in_the_folder_of_its_plan() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 3);
    let what = ["wall", "--matchers", "sift", "--shards", "2"];
    succeeds(folder, &[&["plan", "--out", "plan"], &what[..]].concat());
    let (plan, theirs) = (folder.join("plan"), folder.join("theirs"));
    fs::create_dir(&theirs).expect("writable");
    let work = ["work", "plan", "--shard", "1"];
    for link in ["shards", "shards/1", "cache"].map(|link| plan.join(link)) {
        fs::create_dir_all(link.parent().expect("it has one")).expect("writable");
        symlink(&theirs, &link).expect("writable");
        let named = link.file_name().expect("it has one").to_string_lossy();
        refused(folder, &work, &format!("{named}: it is a link"));
        assert_eq!(fs::read_dir(&theirs).expect("there").count(), 0);
        fs::remove_file(&link).expect("there");
    }
    // A place that the user chose may be one.
    symlink(&theirs, plan.join("cache")).expect("writable");
    succeeds(folder, &[&work[..], &["--cache", "plan/cache"]].concat());
    assert!(plan.join("shards/1/records").is_dir());
}
