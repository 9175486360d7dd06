//! The report as a folder that opens from disk and can be mailed: `index.html`, `figures/*.svg`,
//! `tables/*.{csv,json,md,tex}`.

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};

use crate::files::write_whole;
use crate::metrics::{Angle, Summary};

use super::figures::{ap_figure, sp_figure};
use super::overview::Overview;
use super::svg::Place;
use super::{Format, html, render};

/// What a reader should know about the run besides its scores.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RunFacts {
    /// Title of the page.
    pub title: String,
    /// Names and values in the order in which they are shown: version, seed, machine ...
    pub facts: Vec<(String, String)>,
    /// The plan of the run as text.
    pub plan: Option<String>,
}

/// Writes the report and returns the path of its page. Files of an earlier report are replaced, each
/// at once.
///
/// # Errors
/// A file or folder that cannot be written.
pub fn write_report(folder: &Path, summaries: &[Summary], facts: &RunFacts) -> io::Result<PathBuf> {
    let overview = Overview::new(summaries);
    let drawings = folder.join("figures");
    let tables = folder.join("tables");
    let mut taken = BTreeSet::new();
    for (column, dataset) in overview.datasets.iter().enumerate() {
        let name = file_name(dataset, &mut taken);
        for (prefix, angle) in [
            ("sp", Angle::Pose),
            ("sp-rotation", Angle::Rotation),
            ("sp-translation", Angle::Translation),
        ] {
            let svg = sp_figure(&overview, column, angle, Place::File);
            write_whole(
                &drawings.join(format!("{prefix}-{name}.svg")),
                svg.as_bytes(),
            )?;
        }
        let svg = ap_figure(&overview, column, Place::File);
        write_whole(&drawings.join(format!("ap-{name}.svg")), svg.as_bytes())?;
    }
    for (name, format) in [
        ("scores.csv", Format::Csv),
        ("scores.json", Format::Json),
        ("scores.md", Format::Markdown),
        ("auc.tex", Format::Latex),
    ] {
        write_whole(&tables.join(name), render(format, summaries).as_bytes())?;
    }
    let page = folder.join("index.html");
    write_whole(&page, html::render(summaries, facts).as_bytes())?;
    Ok(page)
}

/// A name for a file of this dataset: letters, digits, dots and dashes, different from the others
/// (also where case does not count).
fn file_name(dataset: &str, taken: &mut BTreeSet<String>) -> String {
    let plain: String = (dataset.chars())
        .map(|c| {
            if c.is_ascii_alphanumeric() || ".-_".contains(c) {
                c
            } else {
                '-'
            }
        })
        .take(80)
        .collect();
    let mut name = plain.clone();
    let mut number = 2;
    while !taken.insert(name.to_ascii_lowercase()) {
        name = format!("{plain}-{number}");
        number += 1;
    }
    name
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::tests::summary;
    use super::*;

    #[test]
    fn report_has_all_its_files_and_can_be_replaced() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let summaries = [summary("a/b", "sift", 4), summary("a?b", "sift", 6)];
        let facts = RunFacts::default();
        for _ in 0..2 {
            let page = write_report(folder.path(), &summaries, &facts).expect("it is ours");
            assert!(page.is_file());
        }
        let names = |part: &str| -> Vec<String> {
            let entries = fs::read_dir(folder.path().join(part)).expect("it was just written");
            let mut names: Vec<String> = entries
                .map(|e| {
                    e.expect("readable")
                        .file_name()
                        .to_string_lossy()
                        .into_owned()
                })
                .collect();
            names.sort();
            names
        };
        assert_eq!(
            names("tables"),
            ["auc.tex", "scores.csv", "scores.json", "scores.md"]
        );
        assert_eq!(names("figures").len(), 8);
        assert!(names("figures").contains(&"sp-rotation-a-b-2.svg".to_owned()));
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_named() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("file");
        fs::write(&file, "").expect("it is ours");
        let error = write_report(&file, &[], &RunFacts::default()).expect_err("a file is there");
        assert!(error.to_string().contains("scores.csv"), "{error}");
    }
}
