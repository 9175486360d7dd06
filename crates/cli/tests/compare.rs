//! Two methods side by side: of one run, of two runs, and the page of the pairs where they differ most.

mod common;
mod steps;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use common::dataset;
use steps::{go, succeeds};

fn refused(folder: &Path, words: &[&str]) -> String {
    let output = go(folder, words);
    assert_eq!(output.status.code(), Some(1), "{words:?}");
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn two_matchers_of_one_run_are_compared_and_shown_side_by_side() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 6);
    let run = [
        "run",
        "wall",
        "--estimator",
        "ransac-e",
        "--out",
        "both",
        "--matchers",
        "sift,orb",
    ];
    // So few matches that some pairs fail.
    let few = ["--set", "orb.extractor.features=40"];
    succeeds(folder, &[&run[..], &few].concat());
    let said = succeeds(
        folder,
        &["compare", "both", "--matchers", "orb,sift", "--out", "page"],
    );
    let row = said
        .lines()
        .find(|line| line.starts_with("wall"))
        .expect("a row");
    assert!(row.contains("orb, sift") && row.contains("15"), "{said}");
    // All pairs of six images: six units, which are enough for an interval and its p-value.
    let head = said.lines().next().expect("a head");
    assert!(
        head.contains("95 % interval  ") && head.contains("  p  "),
        "{said}"
    );
    let p = row.split_whitespace().nth(11).expect("a p-value");
    let value: f64 = p.trim_start_matches('<').parse().expect("a number");
    let interval = row.split_whitespace().skip(8).take(3);
    let ends: Vec<f64> = interval.filter_map(|end| end.parse().ok()).collect();
    assert_eq!(ends.len(), 2, "{said}");
    assert_eq!(value <= 0.05, ends[0] * ends[1] > 0.0, "{said}");
    assert!(
        said.contains("sift + ransac-e") && said.trim_end().ends_with("page/index.html"),
        "{said}"
    );

    let page = fs::read_to_string(folder.join("page/index.html")).expect("it was written");
    assert!(page.contains(&format!(
        "this comparison alone: {}",
        p.replace('<', "&lt;")
    )));
    assert!(
        page.contains("Where orb + ransac-e is better")
            && page.contains("Where sift + ransac-e is better")
    );
    let images = page.matches("<img src=\"images").count();
    let pictures = page.matches("class=\"picture\"").count();
    assert!(
        pictures > 0 && images == 2 * pictures,
        "{images} {pictures}"
    );
    for image in page.split("<img src=\"").skip(1) {
        let path = image
            .split('"')
            .next()
            .expect("it ends")
            .replace("&#x2f;", "/");
        assert!(folder.join("page").join(&path).is_file(), "{path}");
    }
    let csv = fs::read_to_string(folder.join("page/pairs.csv")).expect("it was written");
    assert_eq!(csv.lines().count(), 16, "{csv}");
    assert!(
        csv.starts_with("dataset,first,second,a,b,first_error,second_error,"),
        "{csv}"
    );

    let has_choice = |page: &str| page.contains("id=\"keypoints\"");
    assert!(has_choice(&page) && page.contains("class=\"keypoints\""));

    // The other way round each side wins what it won. Keypoints that are gone cannot be shown.
    fs::remove_dir_all(folder.join("both/cache")).expect("it is there");
    succeeds(
        folder,
        &[
            "compare",
            "both",
            "--matchers",
            "sift,orb",
            "--out",
            "turned",
            "--pairs",
            "3",
        ],
    );
    let turned = fs::read_to_string(folder.join("turned/index.html")).expect("it was written");
    assert!(turned.matches("<article>").count() <= page.matches("<article>").count());
    assert!(!has_choice(&turned) && turned.contains("no keypoints: they were not"));
    let rows = |page: &str| -> Vec<String> {
        let csv = fs::read_to_string(folder.join(page).join("pairs.csv")).expect("it was written");
        csv.lines()
            .skip(1)
            .map(|line| line.split(',').nth(5).unwrap_or_default().to_owned())
            .collect()
    };
    let second = csv
        .lines()
        .skip(1)
        .map(|line| line.split(',').nth(6).unwrap_or_default().to_owned());
    assert_eq!(rows("turned"), second.collect::<Vec<_>>());
}

#[test]
fn two_runs_are_compared_as_before_and_their_pairs_shown() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 4);
    let run = |out: &str, more: &[&str]| {
        let words = ["run", "wall", "--matchers", "sift", "--out", out];
        let words = [&words[..], &["--estimator", "ransac-e,best"]].concat();
        succeeds(folder, &[&words[..], more].concat());
    };
    run("first", &[]);
    run(
        "strict",
        &["--set", "sift.ratio=0.5", "--keep-matches", "none"],
    );
    let said = succeeds(folder, &["compare", "first", "strict"]);
    assert!(said.contains("wall with sift + ransac-e"), "{said}");
    let said = succeeds(folder, &["compare", "first", "strict", "--out", "page"]);
    assert!(said.trim_end().ends_with("page/index.html"), "{said}");
    // Both methods have the same two names, those of the runs.
    let page = fs::read_to_string(folder.join("page/index.html")).expect("it was written");
    let csv = fs::read_to_string(folder.join("page/pairs.csv")).expect("it was written");
    for estimator in ["ransac-e", "best"] {
        let on = format!("wall with sift + {estimator}");
        let head = format!("<h2><bdi>{on}</bdi>: first against strict</h2>");
        assert!(page.contains(&head), "{page}");
        let words = page.lines().filter(|line| line.starts_with("<li>"));
        assert_eq!(words.filter(|line| line.contains(&on)).count(), 1);
        let its = format!(",0,sift,{estimator},sift,{estimator}");
        let its = csv.lines().filter(|line| line.ends_with(&its));
        assert_eq!(its.count(), 6, "{csv}");
    }
    // The second run alone has seen another image.
    let noted = folder.join("strict/images/wall.txt");
    let notes = fs::read_to_string(&noted).expect("notes of images");
    let other = notes.lines().map(|line| match line.split_once(' ') {
        Some(("1", _)) => format!("1 {}\n", "0".repeat(64)),
        _ => format!("{line}\n"),
    });
    fs::write(&noted, other.collect::<String>()).expect("writable");
    let said = go(folder, &["compare", "first", "strict", "--out", "page"]);
    let told = String::from_utf8_lossy(&said.stderr);
    assert!(told.contains("0001.pgm is another image"), "{told}");
    fs::write(&noted, notes).expect("writable");
    let said = succeeds(
        folder,
        &["compare", "first", "strict", "--matchers", "sift,sift"],
    );
    assert!(
        said.contains("sift + ransac-e of first") && said.contains("sift + ransac-e of strict"),
        "{said}"
    );
}

#[test]
fn every_repetition_is_in_the_table_of_a_comparison() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 3);
    let run = ["run", "wall", "--matchers", "sift,orb", "--repeat", "2"];
    succeeds(folder, &[&run[..], &["--out", "run"]].concat());
    let compare = ["compare", "run", "--matchers", "sift,orb"];
    succeeds(folder, &[&compare[..], &["--out", "page"]].concat());
    succeeds(folder, &["report", "run"]);
    let rows = |file: &str, columns: &[&str], of: &str| -> BTreeSet<Vec<String>> {
        let csv = fs::read_to_string(folder.join(file)).expect("it was written");
        let mut lines = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
        let head = lines.next().expect("a head");
        let places: Vec<usize> = (columns.iter())
            .map(|name| head.iter().position(|column| column == name).expect(name))
            .collect();
        let rows = lines.filter(|row| row.contains(&of));
        rows.map(|row| places.iter().map(|&place| row[place].to_owned()).collect())
            .collect()
    };
    let compared = ["a", "b", "repetition", "first_error"];
    let compared = rows("page/pairs.csv", &compared, "sift + ransac-e");
    assert_eq!(compared.len(), 6, "three pairs, two repetitions");
    let all = ["a", "b", "repetition", "pose_error"];
    let all = rows("run/report/tables/pairs.csv", &all, "sift");
    assert_eq!(compared, all);
    let page = fs::read_to_string(folder.join("page/index.html")).expect("it was written");
    assert!(page.contains("6 results in common") && page.contains("the first repetition is shown"));
}

#[test]
fn what_cannot_be_compared_is_refused_in_words() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 3);
    succeeds(
        folder,
        &["run", "wall", "--matchers", "sift,orb", "--out", "run"],
    );
    for (words, said) in [
        (&["compare", "run"][..], "--matchers FIRST,SECOND"),
        (&["compare", "run", "--matchers", "sift"], "takes two"),
        (
            &["compare", "run", "--matchers", "sift,sift"],
            "with itself",
        ),
        (
            &["compare", "run", "--matchers", "sift,surf"],
            "no results of `surf`; there are sift+ransac-e",
        ),
        (
            &["compare", "run", "--matchers", "sift,orb", "--pairs", "3"],
            "--out",
        ),
    ] {
        let message = refused(folder, words);
        assert!(message.contains(said), "{words:?}: {message}");
    }
    dataset(folder, "hall", 3);
    let apart = "out = 'apart'\n[[dataset]]\npath = 'wall'\nmatchers = ['sift']\n\
                 [[dataset]]\npath = 'hall'\nmatchers = ['orb']\n";
    fs::write(folder.join("apart.toml"), apart).expect("writable");
    succeeds(folder, &["run", "apart.toml"]);
    for named in ["sift,orb", "sift+ransac-e,orb+ransac-e"] {
        let message = refused(folder, &["compare", "apart", "--matchers", named]);
        assert!(message.contains("have no dataset in common"), "{message}");
        // No name of an estimator would help.
        assert!(!message.contains("name"), "{message}");
    }
    fs::create_dir(folder.join("begun")).expect("writable");
    fs::copy(folder.join("run/plan.json"), folder.join("begun/plan.json")).expect("writable");
    let message = refused(folder, &["compare", "run", "begun"]);
    assert!(message.contains("begun has no results yet"), "{message}");
}

#[test]
fn results_judged_by_other_truths_are_not_compared() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    let results = |name: &str, truth: &str| {
        let sequence = folder.join(name).join("wall");
        fs::create_dir_all(&sequence).expect("writable");
        fs::write(sequence.join("groundtruth.txt"), truth).expect("writable");
        let rows = "0 1 50 1 0 0 1 0 1 0 0 0 0 1 0\n";
        fs::write(sequence.join("sift.txt"), rows).expect("writable");
    };
    results("one", "0 1 1 0 0 1 0 1 0 0 0 0 1 0\n");
    results("same", "0 1 1 0 0 1 0 1 0 0 0 0 1 0\n");
    results("inverse", "0 1 1 0 0 -1 0 1 0 0 0 0 1 0\n");
    let said = succeeds(folder, &["compare", "one", "same"]);
    assert!(said.contains("wall"), "{said}");
    let message = refused(folder, &["compare", "one", "inverse"]);
    assert!(
        message.contains("different datasets called wall"),
        "{message}"
    );
}

#[test]
fn a_run_that_is_not_finished_is_compared_with_a_warning() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 4);
    succeeds(
        folder,
        &["run", "wall", "--matchers", "sift,orb", "--out", "both"],
    );
    let compared = || go(folder, &["compare", "both", "--matchers", "orb,sift"]);
    assert!(compared().stderr.is_empty());
    let records = folder.join("both/records/wall/sift+ransac-e.jsonl");
    let text = fs::read_to_string(&records).expect("it was written");
    let first: String = text.split_inclusive('\n').take(2).collect();
    fs::write(&records, first).expect("writable");
    let said = compared();
    let warning = String::from_utf8_lossy(&said.stderr);
    assert!(said.status.success(), "{warning}");
    assert_eq!(
        warning.trim_end(),
        "warning: both: sift with ransac-e on wall: 2 of 6 planned tasks recorded"
    );
    let table = String::from_utf8_lossy(&said.stdout);
    let row = table.lines().find(|line| line.starts_with("wall"));
    let pairs = row.and_then(|row| row.split_whitespace().nth(4));
    assert_eq!(pairs, Some("2"), "what both have is compared: {table}");

    // A pair that is not recorded yet has not failed: nothing is said of the method that lacks it.
    let eval = go(folder, &["eval", "both"]);
    let table = String::from_utf8_lossy(&eval.stdout);
    let sift = table.lines().find(|line| line.starts_with("wall     sift"));
    let sift: Vec<&str> = sift.expect("it has results").split_whitespace().collect();
    assert_eq!(sift[3..5], ["2", "0"], "{table}");
    assert!(
        !table.contains("highest AUC") && !table.contains("better than"),
        "{table}"
    );
    for (format, comment) in [("latex", "%"), ("markdown", ">")] {
        let eval = ["eval", "both", "--format", format];
        let by_protocol = [&eval[..], &["--protocol", "imc"]].concat();
        let with_intervals = [&by_protocol[..], &["--intervals"]].concat();
        for eval in [&eval[..], &by_protocol, &with_intervals] {
            let table = succeeds(folder, eval);
            let note = format!("{comment} This run is not finished: 4 of 12 planned results");
            assert!(table.starts_with(&note), "{eval:?}: {table}");
            assert!(table.contains("Scores are of what each method has recorded"));
            // The pairs that the dataset lists count, if it is named.
            let listed = go(folder, &[eval, &["--datasets", "."]].concat());
            let table = String::from_utf8_lossy(&listed.stdout);
            assert!(
                table.starts_with(&note)
                    && table.contains("Missing results count as wrong")
                    && !table.contains("what each method has recorded"),
                "{eval:?}: {table}"
            );
            let warnings = String::from_utf8_lossy(&listed.stderr);
            let of_missing = "warning: both: no result with sift + ransac-e for 4 of 6 pairs of wall, counted as wrong";
            assert!(warnings.contains(of_missing), "{eval:?}: {warnings}");
        }
    }
}

#[test]
fn runs_of_other_repetitions_are_compared_in_what_both_have_and_say_so() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 3);
    for repeat in ["1", "3"] {
        let run = [
            "run",
            "wall",
            "--matchers",
            "orb",
            "--repeat",
            repeat,
            "--out",
            repeat,
        ];
        succeeds(folder, &run);
    }
    let said = go(folder, &["compare", "1", "3"]);
    let note = String::from_utf8_lossy(&said.stderr);
    let expected = "note: orb with ransac-e on wall has 1 repetition in 1 and 3 repetitions in 3; those that both have \
                    are compared";
    assert_eq!(note.trim_end(), expected);
    // Of two methods each is named.
    let other = ["run", "wall", "--matchers", "brisk", "--out", "other"];
    succeeds(folder, &other);
    let said = go(
        folder,
        &["compare", "3", "other", "--matchers", "orb,brisk"],
    );
    let note = String::from_utf8_lossy(&said.stderr);
    let expected = "note: orb with ransac-e on wall has 3 repetitions in 3 and brisk with ransac-e on wall has 1 repetition in \
                    other; those that both have are compared";
    assert_eq!(note.trim_end(), expected);
}
