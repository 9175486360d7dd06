//! A leaderboard of runs and results of many people, some of them damaged, some of them not honest.

mod common;
mod planes;
mod steps;

use std::fs;
use std::path::{Path, PathBuf};

use common::dataset;
use planes::homographies;
use serde_json::{Value, json};
use steps::{go, succeeds};

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("writable");
    for entry in fs::read_dir(from).expect("readable") {
        let path = entry.expect("readable").path();
        let to = to.join(path.file_name().expect("it has a name"));
        if path.is_dir() {
            copy(&path, &to);
        } else {
            fs::copy(&path, &to).expect("writable");
        }
    }
}

/// Rewrites the records of a run.
fn rewrite(run: &Path, change: impl Fn(String) -> String) {
    let file = run.join("records/wall/sift+ransac-e.jsonl");
    let text = fs::read_to_string(&file).expect("readable");
    fs::write(&file, change(text)).expect("writable");
}

/// Two runs, results in the authors' layout, a dataset of the same name with another truth; a damaged run, an
/// unfinished one, one that praises itself.
fn entries(folder: &Path) {
    dataset(folder, "data/wall", 4);
    dataset(folder, "elsewhere/wall", 3);
    let run = |data: &str, matchers: &str, more: &[&str], out: &str| {
        let words = ["run", data, "--matchers", matchers, "--out", out];
        succeeds(folder, &[&words[..], more].concat());
    };
    run("data/wall", "sift,orb", &[], "entries/anna");
    run(
        "data/wall",
        "sift",
        &["--set", "sift.ratio=0.6"],
        "entries/ben/strict",
    );
    run("elsewhere/wall", "sift", &[], "entries/other");
    run("data/wall", "sift", &["--limit", "3"], "entries/short");
    succeeds(folder, &["export", "entries/anna", "entries/files"]);
    fs::copy(
        folder.join("data/wall/pairs.txt"),
        folder.join("entries/files/wall/groundtruth.txt"),
    )
    .expect("writable");
    fs::write(
        folder.join("entries/files/wall/broken.txt"),
        "0 1 nonsense\n",
    )
    .expect("writable");
    // Nobody knows the truth of a street.
    fs::create_dir_all(folder.join("entries/untold/street")).expect("writable");
    let unknown = folder.join("entries/untold/street/sift.txt");
    fs::copy(results_of_sift(folder), unknown).expect("writable");
    // What lies below is of the same kind, and is not told again.
    let deeper = folder.join("entries/untold/street/older");
    fs::create_dir_all(&deeper).expect("writable");
    fs::copy(results_of_sift(folder), deeper.join("sift.txt")).expect("writable");
    let ben = folder.join("entries/ben/strict");
    copy(&ben, &folder.join("entries/planless"));
    fs::remove_file(folder.join("entries/planless/plan.json")).expect("it is there");
    for name in ["damaged", "unfinished", "praised"] {
        copy(&ben, &folder.join("entries").join(name));
    }
    rewrite(&folder.join("entries/damaged"), |text| {
        text.replacen("\"inliers\":1", "\"inliers\":2", 1)
    });
    rewrite(&folder.join("entries/unfinished"), |text| {
        text.split_inclusive('\n').take(4).collect()
    });
    state_other_errors(&folder.join("entries/praised"));
    fs::create_dir_all(folder.join("entries/<img src=x>")).expect("writable");
    fs::write(folder.join("entries/<img src=x>/plan.json"), "{}").expect("writable");
}

/// Makes all records of a run state the same error of the rotation.
fn state_other_errors(run: &Path) {
    forge(run, json!({}), |mut all| {
        for record in &mut all {
            record["outcome"]["rotation_error"] = 12.5.into();
        }
        all
    });
}

/// Changes the records of a run that is handed in, and what its plan says. Checksums are no obstacle: everybody can
/// compute them, and the first format has none.
fn forge(run: &Path, settings: Value, records: impl Fn(Vec<Value>) -> Vec<Value>) {
    of_first_format(run);
    let plan = run.join("plan.json");
    let mut forged = json_of(&plan);
    for (name, value) in settings.as_object().expect("settings") {
        forged["settings"][name] = value.clone();
    }
    fs::write(&plan, forged.to_string()).expect("writable");
    rewrite(run, |text| {
        let forged = records(text.lines().map(unsealed).collect());
        let lines = forged.iter().map(|record| format!("{record}\n"));
        lines.collect()
    });
}

/// A record without its checksum.
fn unsealed(line: &str) -> Value {
    let (body, _) = line.split_once(",\"check\"").expect("it has one");
    serde_json::from_str(&format!("{body}}}")).expect("a record")
}

/// Says that a run is of the first format, whose records have no checksum.
fn of_first_format(run: &Path) {
    let plan = run.join("plan.json");
    let text = fs::read_to_string(&plan).expect("it was written");
    assert!(text.contains("\"format\": 2"));
    fs::write(&plan, text.replacen("\"format\": 2", "\"format\": 1", 1)).expect("writable");
}

/// What a file of JSON holds.
fn json_of(file: &Path) -> Value {
    let text = fs::read_to_string(file).expect("it was written");
    serde_json::from_str(&text).expect("JSON")
}

/// A file of results that was exported.
fn results_of_sift(folder: &Path) -> PathBuf {
    let files = fs::read_dir(folder.join("entries/files/wall")).expect("it was exported");
    let mut paths = files.map(|file| file.expect("listed").path());
    let is_sift = |path: &PathBuf| path.to_string_lossy().contains("sift");
    paths.find(is_sift).expect("sift was run")
}

/// SIFT on the wall with these options, as the only entry.
fn one_run(folder: &Path, options: &[&str]) {
    let words = [
        "run",
        "data/wall",
        "--matchers",
        "sift",
        "--out",
        "entries/a",
    ];
    succeeds(folder, &[&words[..], options].concat());
}

/// The leaderboard of all entries, which refuses some.
fn board(folder: &Path) -> Value {
    entries(folder);
    let words = [
        "leaderboard",
        "entries",
        "--datasets",
        "data",
        "--out",
        "site",
    ];
    let output = go(folder, &words);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{said}");
    let damaged = "damaged/records/wall/sift+ransac-e.jsonl";
    assert_eq!(said.matches(damaged).count(), 1, "{said}");
    json_of(&folder.join("site/leaderboard.json"))
}

fn list(value: &Value) -> &[Value] {
    value.as_array().expect("a list")
}

fn text(value: &Value) -> &str {
    value.as_str().expect("a text")
}

#[test]
fn what_is_wrong_is_refused_with_the_reason_and_stops_no_other() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let site = folder.join("site");
    fs::create_dir(&site).expect("writable");
    fs::write(site.join("mine.txt"), "mine").expect("writable");
    let board = board(folder);
    let refused: Vec<(&str, &str)> = (list(&board["refused"]).iter())
        .map(|it| (text(&it["place"]), text(&it["reason"])))
        .collect();
    for (place, reason) in [
        ("<img src=x>", "not a plan"),
        ("damaged/records/wall/sift+ransac-e.jsonl", "checksum"),
        ("files/wall/broken.txt", "broken.txt:1"),
        ("untold", "without a truth"),
        ("planless", "without its plan.json"),
        (
            "praised/records/wall/sift+ransac-e.jsonl",
            "states errors of 12.5000",
        ),
        (
            "unfinished/records/wall/sift+ransac-e.jsonl",
            "4 of 6 planned",
        ),
    ] {
        let found = (refused.iter()).any(|(at, why)| *at == place && why.contains(reason));
        assert!(found, "{place}: {refused:?}");
    }
    assert_eq!(refused.len(), 7, "{refused:?}");
    let page = fs::read_to_string(site.join("index.html")).expect("it was written");
    assert!(!page.contains("<img src=x") && page.contains("&lt;img src=x&gt;"));
    assert!(page.contains("of this name</strong>") && page.contains("Refused"));
    for outside in ["src=\"http", "href=\"http", "<link", "fetch("] {
        assert!(!page.contains(outside), "{outside}");
    }
    assert!(site.join("mine.txt").is_file(), "files of others stay");
}

#[test]
fn what_can_be_compared_is_ranked_and_can_be_computed_again() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let board = board(folder);
    let groups = list(&board["groups"]);
    let of = |pairs: u64, listed: u64| {
        (groups.iter()).find(|group| group["pairs"] == pairs && group["listed_pairs"] == listed)
    };
    let all = of(6, 6).expect("the whole dataset");
    let rows = list(&all["rows"]);
    let mut names: Vec<String> = (rows.iter())
        .map(|row| {
            format!(
                "{} {}",
                text(&row["entry"]),
                text(&row["scores"]["matcher"])
            )
        })
        .collect();
    names.sort();
    let expected = [
        "anna orb",
        "anna sift",
        "ben/strict sift",
        "files orb",
        "files sift",
    ];
    assert_eq!(names, expected);
    // The wall of three frames is another dataset of the same name, and three of six pairs are another group.
    assert!(all["others_of_this_name"] == 1 && of(3, 3).is_some() && of(3, 6).is_some());
    let auc = |row: &Value| row["scores"]["auc"]["value"].as_f64().expect("a number");
    assert!(rows.iter().map(auc).is_sorted_by(|one, other| one >= other));
    for row in rows {
        assert_eq!(text(&row["blake3"]).len(), 64);
        assert_eq!(row["errors_checked"], true);
    }
    let csv = fs::read_to_string(folder.join("site/leaderboard.csv")).expect("it was written");
    let count: usize = groups.iter().map(|group| list(&group["rows"]).len()).sum();
    assert_eq!(csv.lines().count(), 1 + count);

    let ben = rows
        .iter()
        .find(|row| row["entry"] == "ben/strict")
        .expect("it is there");
    let command = text(&ben["commands"][0]);
    assert!(command.contains("--set sift.ratio=0.6"), "{command}");
    let words: Vec<&str> = command.split_whitespace().skip(1).collect();
    let data = folder.join("data");
    succeeds(&data, &words);
    let scores = succeeds(&data, &["eval", "again", "--format", "json"]);
    let scores: Value = serde_json::from_str(&scores).expect("JSON");
    assert_eq!(scores[0]["auc"], ben["scores"]["auc"]);
}

#[test]
fn corner_errors_are_computed_again_where_the_images_are() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let wall = dataset(folder, "data/wall", 4);
    fs::remove_file(wall.join("pairs.txt")).expect("it is there");
    homographies(&wall, &[(0, 1), (0, 2), (1, 3)]);
    one_run(folder, &["--estimator", "best-h"]);
    copy(&folder.join("entries/a"), &folder.join("entries/praised"));
    let file = folder.join("entries/praised/records/wall/sift+best-h.jsonl");
    let mut praised = String::new();
    for line in fs::read_to_string(&file).expect("readable").lines() {
        let mut record = unsealed(line);
        let error = &mut record["outcome"]["corner_error"];
        *error = (error.as_f64().expect("an estimate") + 0.5).into();
        praised.extend([record.to_string(), "\n".to_owned()]);
    }
    fs::write(&file, praised).expect("writable");
    of_first_format(&folder.join("entries/praised"));
    let board = |images: bool| -> Value {
        let output = go(folder, &["leaderboard", "entries", "--out", "site"]);
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(said.starts_with("wall, homographies, 3 pairs, "), "{said}");
        let page = fs::read_to_string(folder.join("site/index.html")).expect("it was written");
        assert!(page.contains("</bdi>, homographies</h2>") && page.contains(">AUC 3 px<"));
        assert_eq!(output.status.code(), Some(if images { 2 } else { 0 }));
        json_of(&folder.join("site/leaderboard.json"))
    };
    let with_images = board(true);
    let rows = list(&with_images["groups"][0]["rows"]);
    assert!(rows.len() == 1 && rows[0]["errors_checked"] == true);
    let refused = list(&with_images["refused"]);
    assert!(refused.len() == 1 && text(&refused[0]["reason"]).contains("a corner error of"));
    let eval = || go(folder, &["eval", "entries/praised", "--datasets", "data"]);
    let said = String::from_utf8_lossy(&eval().stderr).into_owned();
    assert!(said.contains("a corner error of"), "{said}");
    // Of what size the images were, nobody knows any more; the dataset can still be opened.
    for frame in 0..4 {
        fs::write(wall.join(format!("Images/{frame:04}.pgm")), "").expect("writable");
    }
    let without = board(false);
    assert_eq!(eval().status.code(), Some(0));
    let rows = list(&without["groups"][0]["rows"]);
    assert!(rows.len() == 2 && rows.iter().all(|row| row["errors_checked"] == false));
}

#[test]
fn an_entry_that_hides_its_dataset_is_judged_where_another_has_it() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "data/wall", 3);
    one_run(folder, &[]);
    for name in ["b", "c"] {
        copy(
            &folder.join("entries/a"),
            &folder.join("entries").join(name),
        );
    }
    for name in ["a", "b"] {
        state_other_errors(&folder.join("entries").join(name));
    }
    let plan = folder.join("entries/a/plan.json");
    let mut hidden = json_of(&plan);
    hidden["datasets"][0]["path"] = "nowhere".into();
    fs::write(&plan, hidden.to_string()).expect("writable");
    let output = go(folder, &["leaderboard", "entries", "--out", "site"]);
    assert_eq!(output.status.code(), Some(2));
    let board = json_of(&folder.join("site/leaderboard.json"));
    let rows = list(&board["groups"][0]["rows"]);
    assert!(rows.len() == 1 && rows[0]["entry"] == "c" && rows[0]["errors_checked"] == true);
    let refused = list(&board["refused"]);
    assert_eq!(refused.len(), 2, "{refused:?}");
    for refused in refused {
        assert!(text(&refused["reason"]).contains("states errors of 12.5000"));
    }
}

#[test]
fn who_hands_in_the_file_of_another_is_told() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "data/wall", 3);
    one_run(folder, &[]);
    copy(&folder.join("entries/a"), &folder.join("entries/b"));
    succeeds(folder, &["leaderboard", "entries", "--out", "site"]);
    let json = fs::read_to_string(folder.join("site/leaderboard.json")).expect("it was written");
    assert!(
        json.contains("the same file, to the byte, as that of b"),
        "{json}"
    );
}

#[test]
fn a_folder_without_results_is_an_error_and_so_is_a_page_of_somebody_else() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "data/wall", 3);
    let none = go(folder, &["leaderboard", "data", "--out", "site"]);
    assert_eq!(none.status.code(), Some(1));
    assert!(!folder.join("site").exists());
    one_run(folder, &[]);
    fs::create_dir(folder.join("mine")).expect("writable");
    fs::write(folder.join("mine/index.html"), "my page").expect("writable");
    let refused = go(folder, &["leaderboard", "entries", "--out", "mine"]);
    assert_eq!(refused.status.code(), Some(1));
    let page = fs::read_to_string(folder.join("mine/index.html")).expect("it is there");
    assert_eq!(page, "my page");
    succeeds(folder, &["leaderboard", "entries", "--out", "site"]);
}

#[cfg(unix)]
#[test]
fn links_are_not_followed() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "data/wall", 3);
    one_run(folder, &[]);
    copy(&folder.join("entries/a"), &folder.join("entries/b"));
    let records = folder.join("entries/b/records/wall/sift+ransac-e.jsonl");
    fs::remove_file(&records).expect("it is there");
    std::os::unix::fs::symlink("/etc/hostname", &records).expect("writable");
    std::os::unix::fs::symlink(folder.join("entries/a"), folder.join("entries/c"))
        .expect("writable");
    let output = go(folder, &["leaderboard", "entries", "--out", "site"]);
    assert_eq!(output.status.code(), Some(2));
    let board = json_of(&folder.join("site/leaderboard.json"));
    assert_eq!(board["groups"][0]["rows"].as_array().map(Vec::len), Some(1));
    assert_eq!(board["refused"].as_array().map(Vec::len), Some(1));
    assert!(
        board["refused"][0]["reason"]
            .as_str()
            .is_some_and(|reason| reason.contains("is a link"))
    );
}

#[test]
fn who_repeats_the_pairs_that_went_well_or_chooses_them_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "data/wall", 4);
    one_run(folder, &[]);
    for name in ["chosen", "honest", "repeated"] {
        copy(
            &folder.join("entries/a"),
            &folder.join("entries").join(name),
        );
    }
    fs::remove_dir_all(folder.join("entries/a")).expect("it is there");
    // Of six pairs, each planned twice, one is recorded seven times and the others once.
    let repeated = folder.join("entries/repeated");
    forge(&repeated, json!({"repetitions": 2}), |mut all| {
        assert_eq!(all.len(), 6);
        for repetition in 1..7 {
            let mut again = all[0].clone();
            again["task"]["repetition"] = repetition.into();
            all.push(again);
        }
        all
    });
    // A sample of two would be the first and the fourth.
    let chosen = folder.join("entries/chosen");
    forge(&chosen, json!({"sample": 2}), |all| all[1..3].to_vec());
    let output = go(folder, &["leaderboard", "entries", "--out", "site"]);
    assert_eq!(output.status.code(), Some(2));
    let board = json_of(&folder.join("site/leaderboard.json"));
    let rows = list(&board["groups"][0]["rows"]);
    assert!(rows.len() == 1 && rows[0]["entry"] == "honest", "{rows:?}");
    let reasons: Vec<&str> = list(&board["refused"])
        .iter()
        .map(|refused| text(&refused["reason"]))
        .collect();
    assert_eq!(reasons.len(), 2, "{reasons:?}");
    let named = [
        "its plan does not choose the pair 0 2 of the 6 that the dataset lists",
        "repetition 6 of the pair 0 1, of 2 planned repetitions",
    ];
    for (reason, named) in reasons.iter().zip(named) {
        assert!(reason.contains(named), "{reason}");
    }
}

#[test]
fn errors_that_are_stated_a_little_too_small_gain_nothing() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "data/wall", 4);
    one_run(folder, &[]);
    let shaved = folder.join("entries/shaved");
    copy(&folder.join("entries/a"), &shaved);
    forge(&shaved, json!({}), |mut all| {
        for record in &mut all {
            for which in ["rotation_error", "translation_error"] {
                if let Some(error) = record["outcome"][which].as_f64() {
                    record["outcome"][which] = (error - 9e-4).max(0.0).into();
                }
            }
        }
        all
    });
    succeeds(folder, &["leaderboard", "entries", "--out", "site"]);
    let board = json_of(&folder.join("site/leaderboard.json"));
    let rows = list(&board["groups"][0]["rows"]);
    let scores = |row: &Value| {
        let value = |id: &str| row["scores"][id]["value"].as_f64().expect("a number");
        ["exact_auc_5", "exact_auc_20"].map(value)
    };
    let [honest, praised] = [scores(&rows[0]), scores(&rows[1])];
    for (honest, praised) in honest.iter().zip(praised) {
        assert!(*honest > 0.0, "the test sees nothing");
        assert!((honest - praised).abs() < 1e-9, "{honest} and {praised}");
    }
}

#[test]
fn an_estimator_under_the_rules_of_another_protocol_than_its_name_says_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "data/wall", 3);
    one_run(folder, &[]);
    succeeds(
        folder,
        &[
            "run",
            "data/wall",
            "--matchers",
            "sift",
            "--protocol",
            "loftr",
            "--out",
            "entries/b",
        ],
    );
    for name in ["c", "d"] {
        copy(
            &folder.join("entries/b"),
            &folder.join("entries").join(name),
        );
        let plan = folder.join("entries").join(name).join("plan.json");
        let mut forged = json_of(&plan);
        let protocol = &mut forged["matchers"][0]["estimators"][0]["protocol"];
        match name {
            "c" => protocol["min_matches"] = 0.into(),
            _ => *protocol = Value::Null,
        }
        fs::write(&plan, forged.to_string()).expect("writable");
    }
    let output = go(folder, &["leaderboard", "entries", "--out", "site"]);
    assert_eq!(output.status.code(), Some(2));
    let board = json_of(&folder.join("site/leaderboard.json"));
    let of = |group: &Value| {
        let entries = list(&group["rows"])
            .iter()
            .map(|row| text(&row["entry"]).to_owned());
        entries.collect::<Vec<_>>().concat()
    };
    let entries: String = list(&board["groups"]).iter().map(of).collect();
    assert!(entries == "ab" || entries == "ba", "{entries}");
    for refused in list(&board["refused"]) {
        assert!(
            text(&refused["reason"]).contains("other rules for the estimator"),
            "{refused}"
        );
    }
    assert_eq!(list(&board["refused"]).len(), 2);
}

#[test]
fn sizes_of_images_that_are_handed_in_judge_nobody() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let wall = dataset(folder, "data/wall", 3);
    fs::remove_file(wall.join("pairs.txt")).expect("it is there");
    homographies(&wall, &[(0, 1), (0, 2)]);
    one_run(folder, &["--estimator", "best-h"]);
    fs::create_dir_all(folder.join("entries/data")).expect("writable");
    fs::rename(&wall, folder.join("entries/data/wall")).expect("writable");
    let plan = folder.join("entries/a/plan.json");
    let mut moved = json_of(&plan);
    moved["datasets"][0]["path"] = "entries/data/wall".into();
    fs::write(&plan, moved.to_string()).expect("writable");
    let is_checked = |more: &[&str]| {
        let words = ["leaderboard", "entries", "--out", "site"];
        succeeds(folder, &[&words[..], more].concat());
        let board = json_of(&folder.join("site/leaderboard.json"));
        board["groups"][0]["rows"][0]["errors_checked"] == true
    };
    assert!(!is_checked(&[]));
    assert!(is_checked(&["--datasets", "entries/data"]));
}

#[test]
fn an_estimator_of_poses_has_no_homographies_and_the_name_of_an_entry_is_no_option() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "data/wall", 3);
    one_run(folder, &[]);
    let entry = folder.join("entries/a");
    copy(&entry, &folder.join("entries/--out=x"));
    let third = 1.0 / 3f64.sqrt();
    let exact = json!({
        "kind": "homography", "homography": [third, 0, 0, 0, third, 0, 0, 0, third], "inliers": 0, "iterations": 1,
        "corner_error": 0.0
    });
    forge(&entry, json!({}), |mut all| {
        for record in &mut all {
            record["outcome"] = exact.clone();
        }
        all
    });
    let output = go(folder, &["leaderboard", "entries", "--out", "site"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    let reason = "sift+ransac-e.jsonl:1: ";
    let parts = [reason, "of a homography, which ransac-e does not estimate"];
    assert!(parts.iter().all(|part| said.contains(part)), "{said}");
    let board = json_of(&folder.join("site/leaderboard.json"));
    let commands = list(&board["groups"][0]["rows"][0]["commands"]);
    let again = text(commands.last().expect("there are some"));
    assert_eq!(again, "matchbench eval ./--out=x --format csv");
}
