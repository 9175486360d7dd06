//! What is said of mistakes: which file or option, what is wrong, what to do, and each of it once.

mod common;
mod steps;

use std::fs;
use std::path::Path;

use common::{dataset, matchbench};
use matchbench::datasets::rendered;
use steps::{go, succeeds};

/// What the program says where it ends with an error.
fn refused(folder: &Path, words: &[&str]) -> String {
    let output = go(folder, words);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{words:?}: {said}");
    said
}

#[test]
fn a_number_of_things_that_cannot_be_none_is_a_whole_number() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (command, option) in [
        ("run", "--limit=0"),
        ("run", "--sample=0"),
        ("run", "--repeat=0"),
        ("run", "--time-budget=nan"),
        ("plan", "--shards=0"),
        ("tune", "--limit=-1"),
        ("time", "--pairs=0"),
        ("compare", "--pairs=0"),
    ] {
        let said = refused(folder.path(), &[command, "wall", option]);
        assert!(
            said.contains("give a whole number from 1 on"),
            "{option}: {said}"
        );
    }
}

#[test]
fn blanks_stand_behind_the_commas_of_every_list_and_nothing_does_not() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 3);
    let run = ["run", "wall", "--matchers=sift, orb", "--out=run"];
    succeeds(
        folder,
        &[&run[..], &["--estimator=ransac-e , best"]].concat(),
    );
    for words in [
        &["eval", "run", "--protocol=superglue, roma"][..],
        &["compare", "run", "--matchers=sift , orb"],
        &[
            "tune",
            "wall",
            "--matchers=sift",
            "--parameter=lmeds-e.sampler",
            "--values=uniform, prosac",
            "--out=t",
        ],
    ] {
        succeeds(folder, words);
    }
    let said = refused(
        folder,
        &["paper", "absent", "--out=p", "--sequences=05, 06"],
    );
    assert!(said.contains("paper --where"), "{said}");
    // As a shell hands over `--matchers sift, orb`.
    for words in [
        &["run", "wall", "--matchers", "sift,", "orb", "--out=x"][..],
        &["eval", "run", "--protocol", "superglue,"],
        &["compare", "run", "--matchers", "sift,", "orb"],
        &["paper", "absent", "--out=p", "--sequences", "05,"],
    ] {
        let said = refused(folder, words);
        assert!(
            said.contains("commas separate nothing here"),
            "{words:?}: {said}"
        );
    }
}

#[test]
fn where_one_of_two_arguments_is_needed_both_are_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (words, named) in [
        (
            &["show", "wall", "0", "1", "--out", "x.png"][..],
            ["--matcher <ID>", "--matches <NAME=PATH"],
        ),
        (
            &[
                "tune",
                "wall",
                "--parameter=best.threshold_px",
                "--values=1,2",
                "--out=t",
            ],
            ["--matchers <IDS>", "--matches <NAME=PATH"],
        ),
        (&["eval"], ["RESULTS", "--errors <DIR>"]),
    ] {
        let said = refused(folder.path(), words);
        let missing = said.split("Usage").next().unwrap_or_default();
        assert!(named.iter().all(|name| missing.contains(name)), "{said}");
    }
}

#[test]
fn what_would_be_ignored_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 3);
    let tune = [
        "tune",
        "wall",
        "--matchers=sift",
        "--parameter=best.threshold_px",
        "--values=1,2",
        "--set=best.threshold_px=99",
        "--out=t",
    ];
    let said = refused(folder, &tune);
    assert!(said.contains("leave one of the two out"), "{said}");
    for option in [
        "--resized=10x10",
        "--pixel-center=0.5",
        "--verified",
        "--note=by=me",
        "--matches-format=npz",
    ] {
        let show = [
            "show",
            "wall",
            "0",
            "1",
            "--matcher=sift",
            option,
            "--out=x.png",
        ];
        let said = refused(folder, &show);
        assert!(said.contains("how to read --matches"), "{option}: {said}");
    }
}

#[test]
fn no_run_is_written_into_a_dataset() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 3);
    dataset(folder, "other", 3);
    let plan = ["plan", "wall", "--matchers=sift", "--shards=1", "--out=p"];
    succeeds(folder, &plan);
    for out in ["--out=wall", "--out=other"] {
        let tune = "tune wall --matchers=sift --parameter=best.threshold_px --values=1,2";
        for words in [
            "run wall --matchers=sift",
            "work p --shard=1",
            "merge p",
            tune,
        ] {
            let mut words: Vec<&str> = words.split(' ').collect();
            words.push(out);
            if words[0] == "merge" {
                succeeds(folder, &["work", "p", "--shard=1"]);
            }
            let said = refused(folder, &words);
            assert!(said.contains("is a dataset"), "{words:?}: {said}");
        }
    }
    assert!(!folder.join("wall/records").exists() && !folder.join("other/records").exists());
}

#[test]
fn a_run_and_a_plan_without_matchers_say_how_they_are_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for words in [
        &["run", "wall", "--out", "r"][..],
        &["plan", "wall", "--shards", "2", "--out", "p"],
    ] {
        let said = refused(folder.path(), words);
        assert!(said.contains("--matchers or --matches"), "{said}");
    }
}

#[test]
fn a_cause_is_told_once() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 2);
    let said = refused(folder, &["report", "nowhere"]);
    assert_eq!(said.matches("no such folder").count(), 1, "{said}");

    fs::create_dir_all(folder.join("results/wall")).expect("writable");
    fs::write(folder.join("results/wall/sift.txt"), [0xff; 64]).expect("writable");
    let words = ["eval", "results", "--datasets", "."];
    let said = refused(folder, &words);
    assert_eq!(said.matches("not text in UTF-8").count(), 1, "{said}");

    fs::create_dir(folder.join("matches")).expect("writable");
    for name in ["0_1.txt", "0000_0001.txt"] {
        fs::write(folder.join("matches").join(name), "nan 1 1 1\n").expect("writable");
    }
    let run = [
        "run",
        "wall",
        "--matches",
        "mine=matches",
        "--pixel-center",
        "0",
        "--out",
        "r",
    ];
    let said = refused(folder, &run);
    assert_eq!(said.matches("is there twice").count(), 1, "{said}");
    assert!(
        said.contains("`0_1` and as `0000_0001` in ")
            || said.contains("`0000_0001` and as `0_1` in "),
        "{said}"
    );
    fs::remove_file(folder.join("matches/0_1.txt")).expect("it is ours");
    let said = refused(folder, &run);
    assert_eq!(said.matches("not of finite numbers").count(), 1, "{said}");
    // Under the name of what is built in, they would stand beside true runs of it.
    for (name, why) in [
        ("sift", "built in"),
        ("best", "built in"),
        ("a+b", "letters"),
    ] {
        let asked = format!("{name}=matches");
        let run = ["run", "wall", "--matches", &asked, "--out", "r"];
        let said = refused(folder, &run);
        assert!(
            said.contains(&format!("called `{name}`")) && said.contains(why),
            "{said}"
        );
    }
}

#[test]
fn a_format_that_cannot_be_written_is_answered_with_those_that_can() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for format in ["foo", "superglue"] {
        let said = refused(folder.path(), &["export", "r", "x", "--format", format]);
        assert!(
            said.contains("there are: authors, ") && !said.contains(", superglue"),
            "{said}"
        );
    }
}

#[test]
fn a_pair_without_the_truth_asked_for_is_named_with_what_to_do() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    dataset(folder.path(), "wall", 2);
    let show = [
        "show",
        "wall",
        "0",
        "1",
        "--matcher",
        "sift",
        "--estimator",
        "best-h",
        "--out",
        "x.png",
    ];
    let said = refused(folder.path(), &show);
    assert!(
        said.contains("`wall`") && said.contains("with --estimator"),
        "{said}"
    );
}

#[test]
fn a_manifest_with_an_estimator_that_there_is_not_is_named_by_check_and_run() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    dataset(folder.path(), "wall", 2);
    let text = "name = 'part'\ncommand = ['true']\nestimator = 'foo'\n";
    fs::write(folder.path().join("part.toml"), text).expect("writable");
    let run = ["run", "wall", "--matchers", "part.toml", "--out", "r"];
    for words in [&["check", "part.toml"][..], &run] {
        let said = refused(folder.path(), words);
        assert!(
            said.contains("part.toml:3: unknown estimator `foo`"),
            "{said}"
        );
    }
}

#[test]
fn the_folder_of_a_run_is_no_plan_of_shards() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 2);
    succeeds(folder, &["run", "wall", "--matchers", "orb", "--out", "r"]);
    let said = refused(folder, &["merge", "r", "--out", "x"]);
    assert!(said.contains("r is the folder of a run"), "{said}");
}

#[test]
fn values_that_are_equal_or_equally_good_are_told() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 3);
    let tune = |values: &str| {
        let what = ["--matchers", "sift", "--parameter", "ransac-e.threshold_px"];
        let words = ["tune", "wall", "--values", values, "--out", "tuning"];
        go(folder, &[&words[..], &what].concat())
    };
    let twice = tune("1,1.0");
    let said = String::from_utf8_lossy(&twice.stderr);
    assert_eq!(twice.status.code(), Some(1), "{said}");
    assert!(said.contains("the value 1.0 is there twice"), "{said}");
    // Of two tiny thresholds none has a solution.
    let tuned = tune("1e-8,2e-8");
    let table = String::from_utf8_lossy(&tuned.stdout);
    assert!(
        table.contains("all values are equally good") && !table.contains("<- best"),
        "{table}"
    );
}

#[test]
fn a_damaged_scene_in_the_cache_of_the_demo_is_to_be_deleted() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let cache = folder.path().join("cache");
    let mut scene = rendered::scenes()[0].clone();
    (scene.size.width, scene.size.height) = (16, 12);
    let rendered = rendered::ensure_scenes(&cache.join("scenes"), &[scene], &|_| ());
    let damaged = rendered.expect("it can be rendered").remove(0);
    for scene in rendered::scenes() {
        fs::create_dir_all(damaged.with_file_name(scene.name)).expect("writable");
    }
    fs::write(damaged.join("pairs.txt"), "garbage\n").expect("writable");
    let demo = matchbench()
        .args(["demo", "--out", "run"])
        .current_dir(folder.path())
        .env("MATCHBENCH_CACHE", &cache)
        .output();
    let demo = demo.expect("the program starts");
    let said = String::from_utf8_lossy(&demo.stderr);
    assert_eq!(demo.status.code(), Some(1), "{said}");
    let remedy = format!("delete the folder {}", damaged.display());
    assert!(
        said.contains("pairs.txt:1") && said.contains(&remedy),
        "{said}"
    );
    assert!(!said.contains("correct this line"), "{said}");
}

#[test]
fn a_truth_that_confident_poses_contradict_is_warned_of() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 6);
    let printed = succeeds(folder, &["validate", "wall"]);
    let fingerprint = printed
        .lines()
        .find_map(|line| line.strip_prefix("fingerprint "));
    let wall = folder.join("wall");
    let plan = serde_json::json!({
        "version": "0.1.0",
        "settings": {"seed": 0, "repetitions": 1, "limit": null},
        "datasets": [{"name": "wall", "path": wall, "frames": 6, "pairs": 15, "fingerprint": fingerprint}],
        "matchers": [{"id": "sift", "params": {}, "estimators": [{"id": "best", "params": {}}]}],
    });
    let backwards = "the truth of wall looks wrong: 15 of 15 pairs with a confident pose contradict it, and 15 agree if the \
                     pose of each pair leads from its second image to its first; ";
    let body = "the truth of wall looks wrong: 15 of 15 pairs with a confident pose are 5 degrees or more off, but only 0 \
                if the poses are those of a body to which the camera is fixed, turned by 7.0 degrees and 0.000 away; ";
    // The cameras go to the left by the truth; by the matches to the right, to the left, or a little ahead as well.
    let (sine, cosine) = (0.121_869, 0.992_546);
    for (run, direction, error, words) in [
        ("bad", [1.0, 0.0, 0.0], 180, Some(backwards)),
        ("good", [-1.0, 0.0, 0.0], 0, None),
        ("body", [-cosine, 0.0, sine], 7, Some(body)),
    ] {
        let mut records = String::new();
        for (a, b) in (0..6).flat_map(|a| (a + 1..6).map(move |b| (a, b))) {
            let record = serde_json::json!({
                "task": {
                    "dataset": "wall", "matcher": "sift", "estimator": "best", "a": a, "b": b, "repetition": 0
                },
                "counts": {"features_a": 900, "features_b": 800, "putative": 500, "selected": 90},
                "outcome": {
                    "kind": "pose", "rotation": [1, 0, 0, 0, 1, 0, 0, 0, 1], "translation": direction,
                    "inliers": 70, "support": 80, "iterations": 12, "rotation_error": 0,
                    "translation_error": error, "confidence": 0.99, "overlap_probability": 0.99
                },
                "times": {}
            });
            records.push_str(&record.to_string());
            records.push('\n');
        }
        let run = folder.join(run);
        fs::create_dir_all(run.join("records/wall")).expect("writable");
        fs::write(run.join("plan.json"), plan.to_string()).expect("writable");
        fs::write(run.join("records/wall/sift+best.jsonl"), records).expect("writable");
        let run = run.to_str().expect("UTF-8");
        for command in ["eval", "report"] {
            let output = go(folder, &[command, run]);
            let said = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{said}");
            let told = said.matches("looks wrong").count();
            assert_eq!(told, usize::from(words.is_some()), "{command}: {said}");
            assert!(
                said.contains(words.unwrap_or_default()),
                "{command}: {said}"
            );
        }
        let page = fs::read_to_string(format!("{run}/report/index.html")).expect("it is there");
        assert_eq!(page.contains("looks wrong"), words.is_some());
        assert!(page.contains(words.unwrap_or_default()));
    }
    // Without the dataset no mistake can be tried. Directions alone are then no reason to doubt the truth.
    fs::remove_dir_all(wall).expect("it is ours");
    let eval = || String::from_utf8_lossy(&go(folder, &["eval", "bad"]).stderr).into_owned();
    assert!(!eval().contains("looks wrong"), "{}", eval());
    let file = folder.join("bad/records/wall/sift+best.jsonl");
    let records = fs::read_to_string(&file).expect("it is there");
    let turned = records.replace("\"rotation_error\":0", "\"rotation_error\":90");
    fs::write(&file, turned).expect("writable");
    let words = "contradict it, and to find out which mistake explains that, put the dataset";
    assert!(eval().contains(words), "{}", eval());
}
