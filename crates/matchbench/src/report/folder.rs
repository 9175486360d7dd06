//! The report as a folder, which can be opened from disk and mailed: `index.html`,
//! `figures/*.{svg,png,vl.json}`, `pairs/*/*.html`, `tables/*.{csv,parquet,json,md,tex}`. For a paper there are
//! `cite/method.{md,tex}` with `cite/cite.bib`, and `cite/commands.sh`, which computes the results again.

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde_json::Value;

use crate::files::refuse_link;
use crate::metrics::{Angle, Model, Portion};

use super::again::Again;
use super::by_estimator::estimator_figure;
use super::content::Content;
use super::figures::{
    Difficulty, accuracy_figure, ap_figure, ap_panel_figure, difficulty_figure, lead_figure,
    most_over, reliabilities, reliability_figure, sp_figure, time_figure,
};
use super::file_names::{file_names, unique};
use super::numbers::bracketed;
use super::overview::Overview;
use super::pages::{FIGURES, Pages};
use super::pair_table::columns;
use super::svg::Target;
use super::{
    Format, booktabs, citations, dataset_table, html, latex, method, pairs_csv, parquet,
    protocol_table, render, render_protocols, vega,
};

/// Writes the report and returns the path of its page. Files of an earlier report are replaced, each in one
/// step.
///
/// # Errors
/// If a file or folder cannot be written; the error names it.
pub fn write_report(folder: &Path, content: &Content) -> io::Result<PathBuf> {
    let out = Pages::new(folder)?;
    let summaries = &content.summaries;
    let overview = Overview::new(summaries);
    let tables = Path::new("tables");
    for (name, format) in [
        ("scores.csv", Format::Csv),
        ("scores.json", Format::Json),
        ("scores.md", Format::Markdown),
        ("auc.tex", Format::Latex),
    ] {
        let table = content.noted(format, render(format, summaries));
        out.write(&tables.join(name), table.as_bytes())?;
    }
    for (name, table) in [
        ("auc-booktabs.tex", booktabs::render(summaries)),
        (
            "auc-intervals.tex",
            latex::render_with(summaries, bracketed),
        ),
    ] {
        let table = content.noted(Format::Latex, table);
        out.write(&tables.join(name), table.as_bytes())?;
    }
    let scores = protocol_table::scores_of(content);
    if !scores.is_empty() {
        for (name, format) in [
            ("protocols.csv", Format::Csv),
            ("protocols.md", Format::Markdown),
            ("protocols.tex", Format::Latex),
        ] {
            let table = content.noted(format, render_protocols(format, &scores));
            out.write(&tables.join(name), table.as_bytes())?;
        }
    }
    let cite = Path::new("cite");
    for (name, text) in [
        ("method.md", method::markdown(content)),
        ("method.tex", method::latex(content)),
        ("cite.bib", citations::render(content)),
    ] {
        out.write(&cite.join(name), text.as_bytes())?;
    }
    let again = Again::of(content);
    if !again.is_empty() {
        out.write(&cite.join("commands.sh"), again.script().as_bytes())?;
    }
    if !content.datasets.is_empty() {
        let table = dataset_table::latex(content);
        out.write(&tables.join("datasets.tex"), table.as_bytes())?;
    }
    let pairs = columns(content);
    out.write(
        &tables.join("pairs.csv"),
        pairs_csv::render(&pairs).as_bytes(),
    )?;
    out.write(&tables.join("pairs.parquet"), &parquet::render(&pairs))?;
    figures(content, &overview)
        .into_par_iter()
        .try_for_each(|(name, svg, spec)| {
            out.write(
                Path::new(&format!("{FIGURES}/{name}.vl.json")),
                format!("{spec:#}\n").as_bytes(),
            )?;
            // A note of a missing picture stands beside the drawing.
            out.write_drawing(&name, &svg).map(drop)
        })?;
    html::pair_pages(content, &overview)
        .into_par_iter()
        .try_for_each(|(name, bytes)| out.write(Path::new(&name), &bytes))?;
    out.write(Path::new("index.html"), html::render(content).as_bytes())?;
    out.remove_earlier()?;
    Ok(folder.join("index.html"))
}

/// The same in a folder inside that of a run or of results. Nobody chose it, and the folder around it may come from
/// somebody else, so it is refused if it is a link.
///
/// # Errors
/// As [`write_report`].
pub fn write_inner_report(folder: &Path, content: &Content) -> io::Result<PathBuf> {
    refuse_link(folder)?;
    write_report(folder, content)
}

/// A figure: its name, its drawing and its specification.
type Figure = (String, String, Value);

/// Every figure. No two names are equal, whatever the datasets are called.
fn figures(content: &Content, overview: &Overview<'_>) -> Vec<Figure> {
    let panel = |portion: Portion| {
        let svg = ap_panel_figure(overview, portion, portion.name(), Target::File)?;
        let name = match portion {
            Portion::Fragments => "ap-of-fragments",
            Portion::Other => "ap-of-other-pairs",
        };
        Some((name.to_owned(), svg, vega::ap_panel(overview, portion)))
    };
    let mut figures: Vec<Figure> = Portion::ALL.into_iter().filter_map(panel).collect();
    let names = file_names(&overview.datasets);
    let most = Difficulty::ALL.map(|difficulty| most_over(content, overview, difficulty));
    for (column, (dataset, name)) in overview.datasets.iter().zip(&names).enumerate() {
        for (prefix, angle) in [
            ("sp", Angle::Pose),
            ("sp-rotation", Angle::Rotation),
            ("sp-translation", Angle::Translation),
        ] {
            if let Some(svg) = sp_figure(overview, column, angle, Target::File) {
                let spec = vega::sp(overview, column, angle);
                figures.push((format!("{prefix}-{name}"), svg, spec));
            }
        }
        if let Some(svg) = accuracy_figure(overview, column, Target::File) {
            let spec = vega::accuracy(overview, column);
            figures.push((format!("mma-{name}"), svg, spec));
        }
        if let Some(svg) = ap_figure(overview, column, Target::File) {
            figures.push((format!("ap-{name}"), svg, vega::ap(overview, column)));
        }
        if let Some(svg) = lead_figure(content, overview, column, Target::File) {
            let spec = vega::lead(content, overview, column);
            figures.push((format!("lead-{name}"), svg, spec));
        }
        for (difficulty, most) in Difficulty::ALL.into_iter().zip(most) {
            let scaled = (difficulty, most);
            let svg = difficulty_figure(content, overview, column, scaled, Target::File);
            let spec = vega::difficulty(content, overview, column, difficulty);
            if let (Some(svg), Some(spec)) = (svg, spec) {
                figures.push((format!("{}-{name}", difficulty.name()), svg, spec));
            }
        }
        let reliabilities = reliabilities(content, overview, column);
        if let Some(svg) = reliability_figure(&reliabilities, overview, column, Target::File) {
            let spec = vega::reliability(&reliabilities, overview, column);
            figures.push((format!("reliability-{name}"), svg, spec));
        }
        if let Some(svg) = time_figure(content, overview, column, Target::File) {
            let spec = vega::time(content, overview, column);
            figures.push((format!("time-{name}"), svg, spec));
        }
        for model in [Model::Pose, Model::Homography] {
            let (summaries, on) = (&content.summaries, Some(*dataset));
            if let Some(svg) = estimator_figure(summaries, on, model, Target::File) {
                let spec = vega::estimators(summaries, dataset, model);
                let prefix = match model {
                    Model::Homography if overview.model(column) == Model::Pose => {
                        "estimators-homographies"
                    }
                    _ => "estimators",
                };
                figures.push((format!("{prefix}-{name}"), svg, spec));
            }
        }
    }
    // `sp-rotation-room` is a figure of `room` and one of `rotation-room`.
    let mut taken = BTreeSet::new();
    for (name, ..) in &mut figures {
        *name = unique(name, &mut taken);
    }
    figures
}

#[cfg(test)]
mod tests {
    use super::super::tests::content;
    use std::fs;

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
                "auc-booktabs.tex",
                "auc-intervals.tex",
                "auc.tex",
                "pairs.csv",
                "pairs.parquet",
                "scores.csv",
                "scores.json",
                "scores.md"
            ]
        );
        // Four of each dataset and one of their portion, each as four files.
        assert_eq!(names("figures").len(), 36);
        assert!(names("figures").contains(&"sp-rotation-a-b-2.svg".to_owned()));
    }

    #[test]
    fn what_the_report_before_had_is_gone_and_what_is_not_ours_stays() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let figure = |name: &str| folder.path().join(format!("figures/sp-{name}.svg"));
        write_report(
            folder.path(),
            &content(&[("a", "sift", 4), ("b", "sift", 4)]),
        )
        .expect("ours");
        fs::write(figure("mine"), "mine").expect("it is ours");
        assert!(figure("a").is_file() && figure("b").is_file());
        write_report(folder.path(), &content(&[("a", "sift", 4)])).expect("it is ours");
        assert!(figure("a").is_file() && figure("mine").is_file());
        assert!(!figure("b").exists(), "a figure of the report before");
    }

    #[test]
    fn figures_of_datasets_with_odd_names_do_not_replace_each_other() {
        let names = ["room", "rotation-room", "of-other-pairs"];
        let content = content(&names.map(|name| (name, "sift", 4)));
        let figures = figures(&content, &Overview::new(&content.summaries));
        let names: BTreeSet<&str> = figures.iter().map(|(name, ..)| &**name).collect();
        assert_eq!(names.len(), figures.len());
        for (name, text) in [
            ("sp-rotation-room", "SP curves of the rotation: room ("),
            ("sp-rotation-room-2", "SP curves: rotation-room ("),
            ("ap-of-other-pairs", "AP bars at 5 degrees: other pairs"),
            (
                "ap-of-other-pairs-2",
                "AP bars at 5 degrees: of-other-pairs (",
            ),
        ] {
            let figure = figures.iter().find(|(other, ..)| other == name);
            let (_, svg, _) = figure.expect("there is one");
            assert!(svg.contains(text), "{name}: {svg}");
        }
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_named() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join("file");
        fs::write(&file, "").expect("it is ours");
        let error = write_report(&file, &Content::default()).expect_err("a file is there");
        let named = file.join(".files").display().to_string();
        assert!(error.to_string().contains(&named), "{error}");
    }
}
