//! Scores of a run as columns, and the report of a run.

use std::path::PathBuf;

use matchbench::metrics::{SCORES, Summary, Unfinished, doubts, load_run};
use matchbench::records::RunFolder;
use matchbench::report::{Content, ReportOptions, RunFacts, of_run, verdicts};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::detached::detached;
use crate::errors::error;
use crate::integers::whole;

/// One row per dataset, matcher and estimator, as a dict of columns; sentences that say which is best; and warnings.
#[pyfunction]
pub(crate) fn evaluate(
    py: Python<'_>,
    folder: PathBuf,
) -> PyResult<(Bound<'_, PyDict>, Vec<String>, Vec<String>)> {
    let (content, warnings) = detached(py, || {
        let run = RunFolder::open(&folder).map_err(error)?;
        let sets = load_run(&run, None).map_err(error)?;
        let unfinished = Unfinished::of(&run, &sets).map_err(error)?;
        let mut warnings = unfinished.map_or_else(Vec::new, |lacks| lacks.sentences);
        warnings.extend(doubts(&run, &sets).map_err(error)?);
        Ok::<_, PyErr>((Content::new(sets, RunFacts::default()), warnings))
    })??;
    let columns = PyDict::new(py);
    let rows = &content.summaries;
    #[expect(clippy::type_complexity, reason = "a table")]
    let texts: [(&str, fn(&Summary) -> &str); 3] = [
        ("dataset", |row| &row.dataset),
        ("matcher", |row| &row.matcher),
        ("estimator", |row| &row.estimator),
    ];
    for (name, text) in texts {
        columns.set_item(name, rows.iter().map(text).collect::<Vec<_>>())?;
    }
    #[expect(clippy::type_complexity, reason = "a table")]
    let counts: [(&str, fn(&Summary) -> usize); 2] =
        [("pairs", |row| row.pairs), ("failed", |row| row.failed)];
    for (name, count) in counts {
        let values: Vec<i64> = rows.iter().map(|row| count(row) as i64).collect();
        columns.set_item(name, PyArray1::from_vec(py, values))?;
    }
    for kind in SCORES {
        let scores: Vec<_> = rows.iter().map(|row| row.scores.get(kind.id)).collect();
        let column = |value: &dyn Fn(usize) -> Option<f64>| {
            let values = (0..scores.len()).map(|row| value(row).unwrap_or(f64::NAN));
            PyArray1::from_vec(py, values.collect())
        };
        columns.set_item(kind.id, column(&|row| scores[row].value))?;
        if kind.has_interval() {
            let interval = |row: usize| scores[row].interval;
            columns.set_item(
                format!("{}_low", kind.id),
                column(&|row| Some(interval(row)?.low)),
            )?;
            columns.set_item(
                format!("{}_high", kind.id),
                column(&|row| Some(interval(row)?.high)),
            )?;
        }
    }
    Ok((columns, verdicts(&content.leads), warnings))
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
