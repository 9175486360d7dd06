//! Several estimators, repetitions, and a parameter chosen on one scene and used on another.

mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use common::{dataset, matchbench};

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn succeeded(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    text(&output.stdout)
}

/// A scene to tune on, and another one.
fn scenes(folder: &Path) -> [PathBuf; 2] {
    let training = dataset(folder, "training", 4);
    let wall = dataset(folder, "wall", 5);
    for frame in 0..5 {
        let image = wall.join(format!("Images/{frame:04}.pgm"));
        let mut bytes = fs::read(&image).expect("it was written");
        bytes.reverse(); // the wall upside down, under its header
        bytes.splice(..0, *b"P5 160 120 255\n");
        fs::write(&image, bytes).expect("writable");
    }
    [training, wall]
}

#[test]
fn what_is_tuned_on_one_scene_is_used_on_another_and_refused_on_the_same() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [scene, other] = scenes(folder.path());
    let tuning = folder.path().join("tuning");
    let tune = matchbench()
        .args(["tune", "--matchers", "sift,orb", "--values", "0.01,1,2"])
        .args(["--parameter", "ransac-e.threshold_px", "--repeat", "2"])
        .arg("--out")
        .args([&tuning, &scene])
        .output()
        .expect("the program starts");
    let table = succeeded(&tune);
    assert_eq!(table.matches("<- best").count(), 1, "{table}");
    // Scores stand below each other.
    for value in ["  0.01         ", "  1            ", "  2            "] {
        let mut scores = table.lines().filter_map(|line| line.strip_prefix(value));
        let is_number = |score: &str| score.starts_with(|c: char| c.is_ascii_digit());
        assert!(scores.any(is_number), "{table}");
    }
    let tuned = tuning.join("tuned.json");
    let chosen = fs::read_to_string(&tuned).expect("it was written");
    assert!(chosen.contains("ransac-e.threshold_px="), "{chosen}");
    let parsed: serde_json::Value = serde_json::from_str(&chosen).expect("JSON");
    let tried = parsed["auc"].as_array().expect("what was tried");
    let auc = |row: &serde_json::Value| row[1].as_f64().expect("an AUC");
    let best = (tried.iter().max_by(|x, y| auc(x).total_cmp(&auc(y)))).expect("some value");
    assert_eq!(
        parsed["setting"],
        format!("ransac-e.threshold_px={}", best[0])
    );

    let run = |estimator, dataset| {
        matchbench()
            .args([
                "run",
                "--matchers",
                "sift",
                "--estimator",
                estimator,
                "--tuned",
            ])
            .arg(&tuned)
            .arg("--out")
            .args([&folder.path().join("run"), dataset])
            .output()
            .expect("the program starts")
    };
    let refused = run("ransac-e", &scene);
    assert_eq!(refused.status.code(), Some(1));
    let message = text(&refused.stderr);
    assert!(message.contains("was tuned on training"), "{message}");
    // Other pairs of the same images are the same scene.
    let fewer = dataset(folder.path(), "fewer", 3);
    let message = text(&run("ransac-e", &fewer).stderr);
    assert!(message.contains("was tuned on training"), "{message}");
    let message = text(&run("best", &other).stderr);
    assert!(
        message.contains("tuned.json: `ransac-e` was tuned but is not part of this run"),
        "{message}"
    );
    succeeded(&run("ransac-e", &other));
    let plan = fs::read_to_string(folder.path().join("run/plan.json")).expect("it was written");
    let planned = format!(
        "\"threshold_px\": {:?}",
        best[0].as_f64().expect("a number")
    );
    assert!(plan.contains(&planned), "{plan}");
    let reported = matchbench()
        .arg("report")
        .arg(folder.path().join("run"))
        .output()
        .expect("the program starts");
    succeeded(&reported);
    let page = folder.path().join("run/report/index.html");
    let page = fs::read_to_string(page).expect("it was written");
    assert!(page.contains("was chosen on training"), "the report tells");
}

#[test]
fn a_choice_stays_refused_on_its_scene_when_runs_grow_or_are_joined() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    scenes(folder.path());
    let go = |args: &[&str]| {
        let mut program = matchbench();
        let output = program.current_dir(folder.path()).args(args).output();
        output.expect("the program starts")
    };
    let refused = |args: &[&str]| {
        let output = go(args);
        assert_eq!(output.status.code(), Some(1), "{args:?}");
        text(&output.stderr)
    };
    let sift = ["--matchers", "sift", "--estimator", "ransac-e"];
    let tune = ["tune", "training", "--matchers", "sift", "--out", "tuning"];
    let values = ["--parameter", "ransac-e.threshold_px", "--values", "0.01,1"];
    succeeded(&go(&[&tune[..], &values].concat()));
    let file = "tuning/tuned.json";
    let chosen = fs::read(folder.path().join(file)).expect("it was written");
    let chosen: serde_json::Value = serde_json::from_slice(&chosen).expect("JSON");
    let set = ["--set", chosen["setting"].as_str().expect("a setting")];
    let run = ["run", "wall", "--tuned", file, "--out", "run"];
    succeeded(&go(&[&run[..], &sift].concat()));

    let grown = ["run", "wall", "training", "--out", "run"];
    let message = refused(&[&grown[..], &sift, &set].concat());
    assert!(message.contains("was tuned on training"), "{message}");
    let apart = ["run", "training", "--out", "apart"];
    succeeded(&go(&[&apart[..], &sift, &set].concat()));
    let message = refused(&["join", "run", "apart", "--out", "joined"]);
    assert!(message.contains("was tuned on training"), "{message}");
    assert!(!folder.path().join("joined").exists());
    let other = ["run", "wall", "--tuned", file, "--out", "other"];
    let otherwise = ["--set", "ransac-e.threshold_px=5"];
    let message = refused(&[&other[..], &sift, &otherwise].concat());
    assert!(
        message.contains("tuning/tuned.json: it chose ransac-e.threshold_px=")
            && message.contains("leave one of the two out"),
        "{message}"
    );
}

#[test]
fn matches_from_files_are_tuned_on_beside_matchers_or_alone() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "training", 3);
    fs::create_dir(folder.join("mine")).expect("writable");
    for (a, b) in [(0, 1), (0, 2), (1, 2)] {
        let rows = (0..60).map(|i| (12 * (i % 8) + 30, 14 * (i / 8) + 10));
        let rows = rows.map(|(x, y)| format!("{x} {y} {} {y} 0.25\n", x - 5 * (b - a)));
        let file = folder.join(format!("mine/{a}_{b}.txt"));
        fs::write(file, rows.collect::<String>()).expect("writable");
    }
    let tuned = |asked: &[&str], out: &str| {
        let mut tune = matchbench();
        tune.current_dir(folder).args(["tune", "training"]);
        tune.args(["--parameter", "ransac-e.threshold_px", "--values", "1,2"]);
        tune.args([
            "--matches",
            "mine=mine",
            "--pixel-center",
            "0",
            "--out",
            out,
        ]);
        let output = tune.args(asked).output().expect("the program starts");
        let read = text(&output.stderr);
        assert!(read.contains("mine on training: "), "{read}");
        succeeded(&output);
        let file = fs::read(folder.join(out).join("tuned.json")).expect("it was written");
        serde_json::from_slice::<serde_json::Value>(&file).expect("JSON")["matchers"].clone()
    };
    assert_eq!(
        tuned(&["--matchers", "sift"], "both"),
        serde_json::json!(["sift", "mine"])
    );
    assert_eq!(tuned(&[], "alone"), serde_json::json!(["mine"]));
    assert!(!folder.join("alone/cache").exists(), "nothing is extracted");
}

#[test]
fn a_run_grows_by_matchers_and_repetitions_are_shown() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let wall = dataset(folder.path(), "wall", 4);
    let run = |matchers: &str| {
        let output = matchbench()
            .args(["run", "--repeat", "3", "--matchers", matchers, "--out"])
            .args([&folder.path().join("run"), &wall])
            .output()
            .expect("the program starts");
        (text(&output.stderr), output)
    };
    succeeded(&run("sift").1);
    let (progress, grown) = run("orb,sift");
    let table = succeeded(&grown);
    assert!(table.contains("sd runs"), "{table}");
    assert!(
        progress.contains("36 tasks done, 18 of them earlier"),
        "{progress}"
    );
    assert!(folder.path().join("run/matches/wall/orb.bin").is_file());

    let (message, shrunk) = run("orb");
    assert_eq!(shrunk.status.code(), Some(1));
    assert!(
        message.contains("is `sift` there and absent here"),
        "{message}"
    );
}
