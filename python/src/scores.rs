//! Scores and results of a run, as the text of tables that `matchbench` writes itself; and the report of a run.

use std::path::{Path, PathBuf};

use matchbench::metrics::{ResultSet, Unfinished, doubts, load_run, under_protocols};
use matchbench::protocols;
use matchbench::records::RunFolder;
use matchbench::report::{
    Content, Format, ReportOptions, RunFacts, content_of_run, of_run, render, render_pairs,
    render_protocols, verdicts,
};
use pyo3::prelude::*;

use crate::detached::detached;
use crate::errors::{error, value_error};
use crate::integers::whole;

/// The scores of a run as CSV, one row per dataset, matcher and estimator; sentences that say which is best; and warnings.
#[pyfunction]
pub(crate) fn evaluate(
    py: Python<'_>,
    folder: PathBuf,
) -> PyResult<(String, Vec<String>, Vec<String>)> {
    detached(py, || {
        let (_, sets, warnings) = results(&folder)?;
        let content = Content::new(sets, RunFacts::default());
        let table = render(Format::Csv, &content.summaries);
        Ok((table, verdicts(&content.leads), warnings))
    })?
}

/// The scores of a run by evaluation protocols as CSV; the same as the command prints them; and warnings.
#[pyfunction]
pub(crate) fn evaluate_under(
    py: Python<'_>,
    folder: PathBuf,
    protocols: Vec<String>,
) -> PyResult<(String, String, Vec<String>)> {
    let asked = protocols::find_all(&protocols).map_err(value_error)?;
    detached(py, || {
        let (run, sets, warnings) = results(&folder)?;
        let scores = under_protocols(&sets, Some(run.plan()), &asked);
        let [table, printed] =
            [Format::Csv, Format::Table].map(|format| render_protocols(format, &scores));
        Ok((table, printed, warnings))
    })?
}

/// A run, its results, and warnings: what it lacks, and which truths look wrong.
fn results(folder: &Path) -> PyResult<(RunFolder, Vec<ResultSet>, Vec<String>)> {
    let run = RunFolder::open(folder).map_err(error)?;
    let sets = load_run(&run, None).map_err(error)?;
    let unfinished = Unfinished::of(&run, &sets).map_err(error)?;
    let mut warnings = unfinished.map_or_else(Vec::new, |lacks| lacks.sentences);
    warnings.extend(doubts(&run, &sets).map_err(error)?);
    Ok((run, sets, warnings))
}

/// The results of all pairs of a run as CSV, and warnings: what is missing in it, and which truths look wrong.
#[pyfunction]
pub(crate) fn pairs(py: Python<'_>, folder: PathBuf) -> PyResult<(String, Vec<String>)> {
    detached(py, || {
        let run = RunFolder::open(&folder).map_err(error)?;
        let options = ReportOptions {
            pictures: 0,
            ..ReportOptions::default()
        };
        let (content, notes) = content_of_run(&run, &options).map_err(error)?;
        Ok((render_pairs(&content), notes))
    })?
}

/// Writes the report of a run; returns the path of its page and what is missing in it.
#[pyfunction]
pub(crate) fn report(
    py: Python<'_>,
    folder: PathBuf,
    out: Option<PathBuf>,
    bundle: Option<PathBuf>,
    #[pyo3(from_py_with = whole)] pictures: usize,
) -> PyResult<(PathBuf, Vec<String>)> {
    let reported = detached(py, || {
        let run = RunFolder::open(&folder).map_err(error)?;
        let options = ReportOptions {
            out: out.as_deref(),
            bundle: bundle.as_deref(),
            pictures,
            ..ReportOptions::default()
        };
        of_run(&run, &options).map_err(error)
    })??;
    Ok((reported.page, reported.notes))
}
