//! What a report prints under its numbers: the command of one cell, run where nothing else is, gives the cell.

mod common;
mod steps;

use std::fs;
use std::path::Path;

use common::dataset;
use serde_json::Value;
use steps::{go, succeeds};

/// The row of one matcher in the scores of a run, without the times.
fn scores(folder: &Path, run: &str, matcher: &str) -> Vec<(String, String)> {
    let csv = succeeds(folder, &["eval", run, "--format", "csv"]);
    let mut lines = csv.lines();
    let heads = lines.next().expect("a head").split(',');
    let row = lines.find(|line| line.split(',').nth(1) == Some(matcher));
    let row = row.expect("the matcher was run").split(',');
    let is_score = |(head, _): &(String, String)| !head.ends_with("_s") && head != "group";
    // What is undefined is nothing where the column has numbers of others, and NaN where it has none.
    let value = |text: &str| text.replace("NaN", "");
    (heads.map(str::to_owned).zip(row.map(value)))
        .filter(is_score)
        .collect()
}

#[test]
fn a_cell_of_the_demo_is_computed_again_from_the_bundle_alone() {
    const SCENE: &str = "cabinet";
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [here, there] = ["here", "there"].map(|name| folder.path().join(name));
    for place in [&here, &there] {
        fs::create_dir(place).expect("a folder can be made");
    }
    succeeds(&here, &["import", "rendered", SCENE, SCENE]);
    let choices = [
        "--sample",
        "5",
        "--repeat",
        "2",
        "--seed",
        "3",
        "--set",
        "orb.ratio=0.75",
    ];
    let run = ["run", SCENE, "--matchers", "brisk,orb", "--out", "first"];
    succeeds(&here, &[&run[..], &choices].concat());
    succeeds(&here, &["report", "first", "--bundle", "page.html"]);
    let page = fs::read_to_string(here.join("page.html")).expect("it was written");
    let page = page.replace("&#x2f;", "/").replace("&#x27;", "'");

    let lines = page.lines().map(str::trim);
    let import = lines
        .clone()
        .find_map(|line| line.split_once("matchbench import "));
    let (_, import) = import.expect("the page says what makes the data");
    let cell = lines
        .clone()
        .find(|line| line.contains("orb + ransac-e</th>") && line.contains("<code>"));
    let cell = cell.expect("the page has a command for each method");
    let (_, cell) = cell.split_once("<code>matchbench ").expect("it is one");
    let (cell, _) = cell.split_once("</code>").expect("it ends");
    let import: Vec<&str> = import.split_whitespace().collect();
    succeeds(&there, &[&["import"], &import[..]].concat());
    succeeds(&there, &cell.split_whitespace().collect::<Vec<_>>());
    assert_eq!(scores(&here, "first", "orb"), scores(&there, "cell", "orb"));

    // Data are the same where they have the fingerprint that the page states.
    let said = succeeds(&there, &["validate", SCENE]);
    let fingerprint = said
        .lines()
        .find_map(|line| line.strip_prefix("fingerprint "));
    assert!(page.contains(fingerprint.expect("it is sound")), "{said}");
}

#[test]
fn the_command_of_a_pair_draws_it_as_the_run_saw_it() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 4);
    let run = ["run", "wall", "--matchers", "orb", "--out", "run"];
    let choices = ["--estimator", "best", "--seed", "5", "--report"];
    let few = ["--set", "orb.extractor.features=200"];
    succeeds(folder, &[&run[..], &choices, &few].concat());
    let page = fs::read_to_string(folder.join("run/report/index.html")).expect("it was written");
    let data = page.split("id=\"pair-data\">").nth(1);
    let data = data.and_then(|rest| rest.split("</script>").next());
    let data: Value = serde_json::from_str(data.expect("the page lists its pairs")).expect("JSON");
    let show = &data["datasets"][0]["methods"][0]["show"];
    let [pair, chosen] = [0, 1].map(|at| show[at].as_str().expect("a command"));
    let records = fs::read_to_string(folder.join("run/records/wall/orb+best.jsonl"));
    let records = records.expect("it was written");
    let record = (records.lines()).find(|line| line.contains("\"kind\":\"pose\""));
    let record: Value = serde_json::from_str(record.expect("there are poses")).expect("JSON");
    let task = &record["task"];
    let command = format!("{pair} {} {} {chosen}", task["a"], task["b"]);
    let words: Vec<&str> = command.split_whitespace().skip(1).collect();
    let said = succeeds(folder, &words);
    let number = |name: &str| record["outcome"][name].as_f64().expect("a pose");
    let (rotation, translation) = (number("rotation_error"), number("translation_error"));
    let expected = format!("(rotation {rotation:.2}°, translation {translation:.2}°)");
    assert!(said.contains(&expected), "{command}: {said}\n{expected}");
    assert!(folder.join("pair.png").is_file());
}

#[test]
fn what_comes_from_files_is_scored_again_by_the_command_that_the_report_prints() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "data/my wall", 4);
    let run = ["run", "data/my wall", "--matchers", "sift", "--out", "run"];
    succeeds(folder, &run);
    succeeds(folder, &["export", "run", "files"]);
    let chosen = ["--datasets", "data", "--pairs", "window:2"];
    succeeds(
        folder,
        &[&["report", "files", "--out", "page"], &chosen[..]].concat(),
    );
    let script = fs::read_to_string(folder.join("page/cite/commands.sh")).expect("it was written");
    let eval = script
        .lines()
        .find_map(|line| line.strip_prefix("matchbench eval "));
    let words: Vec<&str> = eval.expect("it says how").split_whitespace().collect();
    let csv = succeeds(folder, &[&["eval"], &words[..]].concat());
    let reported =
        fs::read_to_string(folder.join("page/tables/scores.csv")).expect("it was written");
    assert_eq!(csv, reported);
    assert!(csv.contains(",5,"), "five of six pairs: {csv}");
    // These files hold no matches that could be drawn.
    for of_pictures in [["--pictures", "16"], ["--cache", "run/cache"]] {
        let report = [&["report", "files"], &chosen[..], &of_pictures].concat();
        let output = go(folder, &report);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(
            output.status.code() == Some(1) && said.contains("leave out --pictures and --cache"),
            "{said}"
        );
    }
}
