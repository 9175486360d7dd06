//! The book in `docs/` holds together: every page stands in its table of contents, every link to a
//! file leads to one, and its lists have what they list.

mod common;
mod steps;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use matchbench::matchers::MATCHERS;

use common::dataset;
use steps::succeeds;

/// Every Markdown file below `folder`.
fn pages(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("it is part of the repository");
    let paths = entries.map(|entry| entry.expect("the folder can be listed").path());
    paths
        .flat_map(|path| match path.extension() {
            _ if path.is_dir() => pages(&path),
            Some(extension) if extension == "md" => vec![path],
            _ => Vec::new(),
        })
        .collect()
}

/// What the links and pictures of a page lead to, addresses apart.
fn links(text: &str) -> impl Iterator<Item = &str> {
    (text.split("](").skip(1))
        .filter_map(|rest| rest.split([')', '#']).next())
        .filter(|link| !link.is_empty() && !link.contains("://"))
}

#[test]
fn every_page_is_listed_and_every_link_leads_to_a_file() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs");
    let contents = docs.join("SUMMARY.md");
    let listed = fs::read_to_string(&contents).expect("it is part of the repository");
    let listed: Vec<PathBuf> = links(&listed).map(|link| docs.join(link)).collect();
    let pages = pages(&docs);
    assert!(pages.len() >= 9, "{pages:?}");
    for page in pages {
        assert!(
            page == contents || listed.contains(&page),
            "SUMMARY.md does not list {}",
            page.display()
        );
        let text = fs::read_to_string(&page).expect("pages are UTF-8");
        for link in links(&text) {
            let file = page.parent().expect("a file").join(link);
            assert!(file.is_file(), "{}: no {link}", page.display());
        }
    }
}

/// A page of the book.
fn page(name: &str) -> String {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs");
    fs::read_to_string(docs.join(name)).expect("it is part of the repository")
}

#[test]
fn matchers_with_an_estimator_of_their_own_are_named() {
    let text = page("estimators.md");
    let mut paragraphs = text.split("\n\n");
    let said = paragraphs.find(|text| text.starts_with("A matcher is run with `ransac-e`"));
    let said = said.expect("the paragraph is there");
    for matcher in MATCHERS.iter().filter(|m| m.estimator() != "ransac-e") {
        let id = format!("`{}`", matcher.id());
        assert!(said.contains(&id), "{id} is not in: {said}");
    }
}

/// A name without the numbers and the end of an interval in it, which stand for all of their kind.
fn kind_of(column: &str) -> String {
    let score = (column.strip_suffix("_low")).or_else(|| column.strip_suffix("_high"));
    let score = score.map_or(column, |_| "auc_low");
    score.chars().filter(|c| !c.is_ascii_digit()).collect()
}

#[test]
fn the_columns_of_the_tables_are_listed() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    dataset(folder, "wall", 2);
    let run = ["run", "wall", "--matchers", "orb", "--out", "run"];
    succeeds(folder, &[&run[..], &["--report"]].concat());
    let heads = |name: &str| -> Vec<String> {
        let table = fs::read_to_string(folder.join("run/report/tables").join(name));
        let table = table.expect("it was written");
        let heads = table.lines().next().expect("a line of heads").split(',');
        heads.map(str::to_owned).collect()
    };
    let text = page("formats.md");
    let rows = text.split("stands for all of its kind:").nth(1);
    let rows = rows.and_then(|rest| rest.split("\n\n").nth(1));
    let first_cells =
        (rows.expect("the table is there").lines()).filter_map(|row| row.split('|').nth(1));
    let listed: BTreeSet<String> = first_cells
        .flat_map(|cell| cell.split('`').skip(1).step_by(2))
        .map(kind_of)
        .collect();
    let written: BTreeSet<String> = heads("scores.csv")
        .iter()
        .map(|head| kind_of(head))
        .collect();
    assert_eq!(listed, written);

    let listed = text.split("matcher, estimator and repetition: ").nth(1);
    let listed = listed.and_then(|rest| rest.split("\n\n").next());
    let words = listed
        .expect("the list is there")
        .split('`')
        .skip(1)
        .step_by(2);
    assert_eq!(words.collect::<Vec<_>>(), heads("pairs.csv"));
}
