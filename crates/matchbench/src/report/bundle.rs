//! The report as one file that can be mailed: the page, with its tables inside as files that can be saved.
//!
//! The file stays below [`MAX_BUNDLED`]. If it would be larger, pictures are left out first, then files, then
//! pairs from the list of pairs. Scores and figures are always included.

use std::io;
use std::path::{Path, PathBuf};

use crate::files::write_whole;

use super::again::Again;
use super::content::Content;
use super::html::{Extent, render_extent};
use super::numbers::bracketed;
use super::pair_table::columns;
use super::target::check_target;
use super::{Format, booktabs, citations, latex, method, pairs_csv, render};

/// Most bytes of the file.
pub const MAX_BUNDLED: usize = 5_000_000;

/// Writes the file and returns its path.
///
/// # Errors
/// If the file cannot be written or belongs to a run or a dataset, or if scores and figures alone are too large.
pub fn write_bundle(file: &Path, content: &Content) -> io::Result<PathBuf> {
    check_target(file)?;
    write_whole(file, bundled(content)?.as_bytes())?;
    Ok(file.to_path_buf())
}

/// The file's content.
///
/// # Errors
/// If scores and figures alone are too large.
pub fn bundled(content: &Content) -> io::Result<String> {
    bundle(content, MAX_BUNDLED).ok_or_else(|| {
        io::Error::new(
            io::ErrorKind::FileTooLarge,
            format!(
                "the figures alone are larger than {MAX_BUNDLED} bytes; report fewer datasets, or \
                 write a folder with --out"
            ),
        )
    })
}

/// The page with as much content as fits into so many bytes.
fn bundle(content: &Content, most: usize) -> Option<String> {
    let summaries = &content.summaries;
    let again = Again::of(content);
    let table = |format| content.noted(format, render(format, summaries));
    let small = || {
        [
            ("scores.csv", table(Format::Csv)),
            ("scores.md", table(Format::Markdown)),
            ("auc.tex", table(Format::Latex)),
            (
                "auc-booktabs.tex",
                content.noted(Format::Latex, booktabs::render(summaries)),
            ),
            (
                "auc-intervals.tex",
                content.noted(Format::Latex, latex::render_with(summaries, bracketed)),
            ),
            ("method.tex", method::latex(content)),
            ("cite.bib", citations::render(content)),
        ]
        .into_iter()
        .chain((!again.is_empty()).then(|| ("commands.sh", again.script())))
        .collect::<Vec<_>>()
    };
    let all = || {
        let mut files = small();
        files.push(("pairs.csv", pairs_csv::render(&columns(content))));
        files
    };
    let extents = [
        (150_000, 3_500_000, true),
        (150_000, 2_000_000, true),
        (150_000, 2_000_000, false),
        (150_000, 500_000, false),
        (50_000, 500_000, false),
        (10_000, 0, false),
        (1, 0, false),
    ];
    (extents.into_iter())
        .map(|(results, pictures, complete)| Extent {
            results,
            pictures,
            files: if complete { all() } else { small() },
        })
        .map(|extent| render_extent(content, &extent))
        .find(|page| page.len() <= most)
}

#[cfg(test)]
mod tests {
    use super::super::tests::content;
    use super::*;

    #[test]
    fn one_file_holds_everything_and_refers_to_nothing_beside_it() {
        let content = content(&[("room", "sift", 6), ("room", "orb", 2)]);
        let page = bundle(&content, MAX_BUNDLED).expect("it is small");
        for name in ["scores.csv", "cite.bib", "pairs.csv", "auc.tex"] {
            assert!(page.contains(&format!("download=\"{name}\"")), "{name}");
        }
        assert!(page.contains("all pairs are in the file <code>pairs.csv</code>"));
        assert!(page.contains(r#""all_pairs":"pairs.csv""#));
        assert!(!page.contains("tables/pairs.csv"));
        for beside in [
            "href=\"figures/",
            "href=\"tables/",
            "href=\"cite/",
            "href=\"http",
        ] {
            assert!(!page.contains(beside), "{beside}");
        }
    }

    #[test]
    fn what_is_too_large_loses_pairs_before_scores() {
        let content = content(&[("room", "sift", 6), ("room", "orb", 2)]);
        let whole = bundle(&content, MAX_BUNDLED).expect("it is small");
        let less = bundle(&content, whole.len() - 1).expect("without its pairs it fits");
        assert!(less.len() < whole.len() && !less.contains("download=\"pairs.csv\""));
        assert!(less.contains("This list needs JavaScript.</p>"));
        assert!(!less.contains(r#""all_pairs""#) && !less.contains("tables/pairs.csv"));
        assert!(less.contains("scores.csv"));
        assert_eq!(bundle(&content, 1000), None);
    }
}
