//! The numbers that README prints are those of the files in `docs/results`, and every folder there says how its
//! numbers came about.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use matchbench::matchers::MATCHERS;
use serde_json::Value;

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn text(path: &str) -> String {
    let path = repository().join(path);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The rows of a CSV file without quotes, by the columns of its header.
fn rows(path: &str) -> Vec<BTreeMap<String, String>> {
    let text = text(path);
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned));
    let header: Vec<String> = lines.next().expect("a header").collect();
    let rows: Vec<BTreeMap<String, String>> = lines
        .map(|cells| header.iter().cloned().zip(cells).collect())
        .collect();
    assert!(rows.iter().all(|row| row.len() == header.len()), "{path}");
    rows
}

fn number(row: &BTreeMap<String, String>, column: &str) -> f64 {
    (row[column].parse()).unwrap_or_else(|_| panic!("{column}: {}", row[column]))
}

/// The cells of README's row that begins with this id.
fn readme_row<'a>(readme: &'a str, id: &str) -> Vec<&'a str> {
    let start = format!("| `{id}` |");
    let row = readme.lines().find(|line| line.starts_with(&start));
    let row = row.unwrap_or_else(|| panic!("README.md has no row {start}"));
    row.trim_matches('|').split('|').map(str::trim).collect()
}

#[test]
fn the_table_of_the_readme_is_what_the_files_say() {
    let readme = text("README.md");
    let (scores, times) = (
        rows("docs/results/castle/scores.csv"),
        rows("docs/results/times-amd-avx2/times.csv"),
    );
    let auc = |matcher: &str, estimator: &str| {
        let row = scores.iter().find(|row| {
            row["dataset"] == "castle" && row["matcher"] == matcher && row["estimator"] == estimator
        });
        let row = row?;
        let [auc, low, high] = ["auc", "auc_low", "auc_high"].map(|column| number(row, column));
        Some(format!("{auc:.3} [{low:.3}, {high:.3}]"))
    };
    let rounded = |ms: f64| match ms {
        ms if ms < 10.0 => format!("{ms:.1}"),
        ms => format!("{ms:.0}"),
    };
    assert!(scores.len() >= 36, "{} rows", scores.len());
    for entry in MATCHERS {
        let id = entry.id();
        let cells = readme_row(&readme, id);
        for (cell, estimator) in [(cells[2], "ransac-e"), (cells[3], "best")] {
            match auc(id, estimator) {
                Some(expected) => assert_eq!(cell, expected, "{id} + {estimator}"),
                // No run of it is kept: then there is no interval either.
                None => assert!(!cell.contains('['), "{id} + {estimator}: {cell}"),
            }
        }
        let row = times.iter().find(|row| row["matcher"] == id);
        let row = row.unwrap_or_else(|| panic!("no times of {id}"));
        let stage = |name: &str| number(row, &format!("{name}_ms_median"));
        let pair = stage("matching") + stage("selection");
        let expected = [rounded(stage("detection")), rounded(pair)];
        assert_eq!(cells[4..6], expected, "{id}");
    }
}

#[test]
fn every_folder_of_results_says_how_they_came_about() {
    let folder = repository().join("docs/results");
    let entries = fs::read_dir(folder).expect("it is part of the repository");
    let folders: Vec<PathBuf> = entries
        .map(|entry| entry.expect("it can be listed").path())
        .filter(|path| path.is_dir())
        .collect();
    assert!(folders.len() >= 2, "{folders:?}");
    for folder in folders {
        let file = |name: &str| {
            let path = folder.join(name);
            fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
        };
        for name in ["commands.sh", "machine.txt"] {
            assert!(
                file(name).lines().count() >= 2,
                "{}: {name}",
                folder.display()
            );
        }
        let plan = folder.join("plan.json");
        if !plan.exists() {
            assert!(folder.join("times.csv").exists(), "{}", folder.display());
            continue;
        }
        // Every score is of a matcher and an estimator of the plan.
        let plan: Value = serde_json::from_str(&file("plan.json")).expect("JSON");
        let scores = rows(&format!(
            "docs/results/{}/scores.csv",
            folder.file_name().expect("a name").to_string_lossy()
        ));
        assert!(!scores.is_empty());
        let matchers = plan["matchers"].as_array().expect("a list");
        for row in scores {
            let matcher = matchers
                .iter()
                .find(|matcher| matcher["id"] == row["matcher"]);
            let estimators = matcher.expect("it is in the plan")["estimators"].as_array();
            let estimators = estimators.expect("a list");
            assert!(
                estimators.iter().any(|e| e["id"] == row["estimator"]),
                "{row:?}"
            );
        }
    }
}
