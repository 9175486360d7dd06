//! Runs from Python: the loop of the library runs in its own threads, while the thread of the caller handles
//! Ctrl-C and shows the progress.

use std::ffi::OsString;
use std::iter;
use std::num::{NonZeroU32, NonZeroUsize};
use std::path::{Path, PathBuf};

use matchbench::config::Changes;
use matchbench::counted::counted;
use matchbench::external;
use matchbench::front_door::FrontDoor;
use matchbench::records::{self, KeepMatches, RunFolder};
use matchbench::report::check_target;
use matchbench::run::{Cancel, Run, RunSummary, pair_seed as seed_of_pair};
use matchbench::study::Study;
use matchbench_cli::plain;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::datasets::Dataset;
use crate::detached::{detached, signalled, watched};
use crate::errors::{error, value_error};
use crate::integers::whole;
use crate::progress::{Progress, State};
use crate::study::{AnyEstimator, AnyMatcher, add_estimators, add_matchers, prepare};

/// Numbers of tasks: in total, done before, done now, and failed.
type Tasks = (usize, usize, usize, usize);

/// Runs everything that is not yet recorded in the folder `out`. Returns the numbers of tasks (in the plan,
/// recorded before, recorded now, failed), and warnings: what looks wrong in the datasets or in matches from files,
/// matchers that could not be started or gave up, and why tasks failed.
#[pyfunction]
#[pyo3(signature = (datasets, matchers, estimators, protocols, out, settings, seed, repeat, limit, sample,
                    time_budget_ms, keep_matches, retry_failed, cache, threads, progress))]
pub(crate) fn run(
    py: Python<'_>,
    datasets: Vec<Bound<'_, Dataset>>,
    matchers: Vec<AnyMatcher<'_>>,
    estimators: Vec<AnyEstimator<'_>>,
    protocols: Vec<String>,
    out: PathBuf,
    settings: Vec<String>,
    #[pyo3(from_py_with = whole)] seed: u64,
    #[pyo3(from_py_with = whole)] repeat: Option<NonZeroU32>,
    #[pyo3(from_py_with = whole)] limit: Option<NonZeroUsize>,
    #[pyo3(from_py_with = whole)] sample: Option<NonZeroUsize>,
    #[pyo3(from_py_with = whole)] time_budget_ms: Option<NonZeroU32>,
    keep_matches: &str,
    retry_failed: bool,
    cache: Option<PathBuf>,
    #[pyo3(from_py_with = whole)] threads: Option<NonZeroUsize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Tasks, Vec<String>)> {
    let cancel = Cancel::default();
    let mut study = Study {
        out: Some(out.clone()),
        protocols,
        seed,
        repeat,
        limit,
        sample,
        time_budget: time_budget_ms,
        set: Changes::parse(&settings).map_err(value_error)?,
        cache,
        keep_matches: match keep_matches {
            "all" => KeepMatches::All,
            "inliers" => KeepMatches::Inliers,
            "none" => KeepMatches::None,
            other => {
                let expected = "keep_matches is \"all\", \"inliers\" or \"none\"";
                return Err(value_error(format!("{expected}, not {other:?}")));
            }
        },
        retry_failed,
        ..Study::default()
    };
    let sources = add_matchers(&mut study, matchers, &cancel)?;
    add_estimators(&mut study, &estimators)?;
    let (prepared, mut warnings) = prepare(py, &study, &datasets, sources, &cancel)?;
    let observer = Progress::default();
    let run = prepared.run();
    let summary = listening(py, &run, &observer, &cancel, threads, progress.as_ref())?;
    let State {
        ended,
        others,
        unkept,
        ..
    } = observer.state();
    warnings.extend(ended);
    warnings.extend(others);
    let files = counted(summary.unkept, "file");
    warnings.extend(unkept.map(|reason| format!("{reason}; not kept in the cache: {files}")));
    if summary.failed > 0 {
        warnings.extend(reasons(py, &out, &summary));
    }
    let RunSummary {
        total,
        before,
        now,
        failed,
        ..
    } = summary;
    if !summary.is_complete() && cancel.is_set() {
        let message = "a matcher stopped the run; the same call goes on from there";
        return Err(PyRuntimeError::new_err(message));
    }
    let warnings = warnings.iter().map(|warning| plain(warning)).collect();
    Ok(((total, before, now, failed), warnings))
}

/// Reasons of failures that are told.
const REASONS: usize = 5;

/// How many tasks of the run in the folder `out` failed, and the most frequent reasons.
fn reasons(py: Python<'_>, out: &Path, summary: &RunSummary) -> Vec<String> {
    let failed = format!(
        "{} of {} failed, counted as wrong",
        summary.failed,
        counted(summary.total, "task")
    );
    // The run is done; that its reasons cannot be read takes nothing from it.
    let broken = detached(py, || RunFolder::open(out).ok()?.broken().ok());
    let reasons = broken
        .ok()
        .flatten()
        .unwrap_or_default()
        .into_iter()
        .take(REASONS);
    let reasons = reasons.map(|broken| broken.to_string());
    iter::once(failed).chain(reasons).collect()
}

/// Executes the run in its own threads. The first Ctrl-C stops it after the pairs that are being matched, and
/// is raised when these are recorded; so does an error of `progress`, which is not called again. A further Ctrl-C
/// also ends the programs of matchers from outside.
fn listening(
    py: Python<'_>,
    run: &Run<'_>,
    observer: &Progress,
    cancel: &Cancel,
    threads: Option<NonZeroUsize>,
    progress: Option<&Py<PyAny>>,
) -> PyResult<RunSummary> {
    let pool = matchbench_cli::pool(threads).map_err(|broken| error(format!("{broken:#}")))?;
    let mut interrupted = None;
    // Until this run is over: none takes their place, but the next run has its own.
    let mut all_ended = None;
    let mut shown = None;
    let look = || {
        let state = observer.state();
        // The first error is raised in the end, and nothing is shown after it.
        if let Some(raised) = signalled() {
            cancel.set();
            if interrupted.is_some() {
                all_ended.get_or_insert_with(external::end_all);
            }
            interrupted.get_or_insert(raised);
        }
        if let Some(progress) = progress
            && interrupted.is_none()
            && state.total > 0
            && shown.as_ref() != Some(&state)
        {
            let (dataset, matcher) = &state.part;
            let told = (state.done, state.total, dataset, matcher);
            if let Err(raised) = Python::attach(|py| progress.call1(py, told).map(drop)) {
                cancel.set();
                interrupted = Some(raised);
            }
        }
        shown = Some(state);
    };
    let ended = watched(py, || pool.install(|| run.execute(observer, cancel)), look)?;
    let ended = ended.map_err(|_| error("the run broke; its message is on standard error"))?;
    match interrupted {
        Some(raised) => Err(raised),
        None => ended.map_err(error),
    }
}

/// Joins runs into one; returns how many results are planned, recorded and failed.
#[pyfunction]
pub(crate) fn join(py: Python<'_>, runs: Vec<PathBuf>, out: PathBuf) -> PyResult<(u64, u64, u64)> {
    let done = detached(py, || {
        // Neither inside of a run or a dataset, nor where a dataset is.
        check_target(&out).map_err(error)?;
        check_target(&out.join("dataset.toml")).map_err(error)?;
        records::join(&runs, &out).map_err(error)
    })??;
    Ok((done.planned, done.recorded, done.failed))
}

/// The seed of a pair in a run.
#[pyfunction]
pub(crate) fn pair_seed(
    dataset: &str,
    matcher: &str,
    #[pyo3(from_py_with = whole)] a: u32,
    #[pyo3(from_py_with = whole)] b: u32,
    #[pyo3(from_py_with = whole)] seed: u64,
    #[pyo3(from_py_with = whole)] repetition: u32,
) -> u64 {
    seed_of_pair(seed, dataset, matcher, (a, b), repetition).0
}

/// Runs the program `matchbench` with these arguments; returns its exit code.
#[pyfunction]
pub(crate) fn command_line(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    let before = FrontDoor::now();
    FrontDoor::CommandLine.open();
    let code = py.detach(|| matchbench_cli::run(arguments));
    before.open();
    code
}
