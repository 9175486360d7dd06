//! The report as a folder that opens from disk and can be mailed: `index.html`,
//! `figures/*.{svg,png}`, `pairs/*/*.html`, `tables/*.{csv,parquet,json,md,tex}`.

use std::io;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::files::write_whole;
use crate::metrics::Angle;

use super::content::Content;
use super::figures::{
    Difficulty, ap_figure, difficulty_figure, estimator_figure, lead_figure, sp_figure, time_figure,
};
use super::file_names::file_names;
use super::overview::Overview;
use super::pair_table::columns;
use super::raster::png;
use super::svg::Place;
use super::{Format, html, pairs_csv, parquet, render};

/// Pixels of a PNG figure for each unit of its drawing: sharp on dense screens and in print.
const PNG_SCALE: f32 = 2.0;

/// Writes the report and returns the path of its page. Files of an earlier report are replaced, each
/// at once.
///
/// # Errors
/// A file or folder that cannot be written.
pub fn write_report(folder: &Path, content: &Content) -> io::Result<PathBuf> {
    let summaries = &content.summaries;
    let overview = Overview::new(summaries);
    let tables = folder.join("tables");
    for (name, format) in [
        ("scores.csv", Format::Csv),
        ("scores.json", Format::Json),
        ("scores.md", Format::Markdown),
        ("auc.tex", Format::Latex),
    ] {
        write_whole(&tables.join(name), render(format, summaries).as_bytes())?;
    }
    let pairs = columns(content);
    write_whole(
        &tables.join("pairs.csv"),
        pairs_csv::render(&pairs).as_bytes(),
    )?;
    write_whole(&tables.join("pairs.parquet"), &parquet::render(&pairs))?;
    let drawings = folder.join("figures");
    figures(content, &overview)
        .into_par_iter()
        .try_for_each(|(name, svg)| {
            write_whole(&drawings.join(format!("{name}.svg")), svg.as_bytes())?;
            write_whole(
                &drawings.join(format!("{name}.png")),
                &png(&svg, PNG_SCALE)?,
            )
        })?;
    html::pair_pages(content, &overview)
        .into_par_iter()
        .try_for_each(|(name, bytes)| write_whole(&folder.join(name), &bytes))?;
    let page = folder.join("index.html");
    write_whole(&page, html::render(content).as_bytes())?;
    Ok(page)
}

/// Every figure with its name.
fn figures(content: &Content, overview: &Overview<'_>) -> Vec<(String, String)> {
    let mut figures = Vec::new();
    let names = file_names(&overview.datasets);
    for (column, (dataset, name)) in overview.datasets.iter().zip(&names).enumerate() {
        for (prefix, angle) in [
            ("sp", Angle::Pose),
            ("sp-rotation", Angle::Rotation),
            ("sp-translation", Angle::Translation),
        ] {
            let svg = sp_figure(overview, column, angle, Place::File);
            figures.push((format!("{prefix}-{name}"), svg));
        }
        let svg = ap_figure(overview, column, Place::File);
        figures.push((format!("ap-{name}"), svg));
        if let Some(svg) = lead_figure(content, overview, column, Place::File) {
            figures.push((format!("lead-{name}"), svg));
        }
        for difficulty in Difficulty::ALL {
            if let Some(svg) = difficulty_figure(content, overview, column, difficulty, Place::File)
            {
                figures.push((format!("{}-{name}", difficulty.name()), svg));
            }
        }
        if let Some(svg) = time_figure(content, overview, column, Place::File) {
            figures.push((format!("time-{name}"), svg));
        }
        if let Some(svg) = estimator_figure(&content.summaries, Some(dataset), Place::File) {
            figures.push((format!("estimators-{name}"), svg));
        }
    }
    figures
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::tests::content;
    use super::*;

    #[test]
    fn report_has_all_its_files_and_can_be_replaced() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let content = content(&[("a/b", "sift", 4), ("a?b", "sift", 6)]);
        for _ in 0..2 {
            let page = write_report(folder.path(), &content).expect("it is ours");
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
            [
                "auc.tex",
                "pairs.csv",
                "pairs.parquet",
                "scores.csv",
                "scores.json",
                "scores.md"
            ]
        );
        // Four of each dataset, twice.
        assert_eq!(names("figures").len(), 16);
        assert!(names("figures").contains(&"sp-rotation-a-b-2.svg".to_owned()));
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_named() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("file");
        fs::write(&file, "").expect("it is ours");
        let error = write_report(&file, &Content::default()).expect_err("a file is there");
        assert!(error.to_string().contains("scores.csv"), "{error}");
    }
}
