//! The book in `docs/` holds together: every page stands in its table of contents, every link to a
//! file leads to one.

use std::fs;
use std::path::{Path, PathBuf};

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
