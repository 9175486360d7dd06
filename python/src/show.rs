//! One pair as a picture.

use matchbench::config::Changes;
use matchbench::files::TemporaryFolder;
use matchbench::records::RunFolder;
use matchbench::run::Cancel;
use matchbench::show::Shown;
use matchbench::study::Study;
use matchbench_cli::plain;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::datasets::Dataset;
use crate::detached::detached;
use crate::errors::{error, value_error};
use crate::integers::whole;
use crate::study::{AnyEstimator, AnyMatcher, add_estimators, add_matchers, prepare};

/// Matches the pair of frames `a` and `b` as a run would; returns the picture, a PNG, and warnings.
#[pyfunction]
#[pyo3(signature = (dataset, a, b, matcher, estimators, settings, seed, keypoints))]
pub(crate) fn show<'py>(
    py: Python<'py>,
    dataset: Bound<'py, Dataset>,
    #[pyo3(from_py_with = whole)] a: u32,
    #[pyo3(from_py_with = whole)] b: u32,
    matcher: AnyMatcher<'py>,
    estimators: Vec<AnyEstimator<'py>>,
    settings: Vec<String>,
    #[pyo3(from_py_with = whole)] seed: u64,
    keypoints: bool,
) -> PyResult<(Bound<'py, PyBytes>, Vec<String>)> {
    // What a matcher from outside leaves behind lies in it, and it must exist longer than the matcher.
    let folder = TemporaryFolder::new().map_err(error)?;
    let mut study = Study {
        out: Some(folder.path().to_owned()),
        set: Changes::parse(&settings).map_err(value_error)?,
        ..Study::default()
    };
    let cancel = Cancel::default();
    let sources = add_matchers(&mut study, vec![matcher], &cancel)?;
    add_estimators(&mut study, &estimators)?;
    let (prepared, warnings) = match prepare(py, &study, &[dataset], sources, &cancel) {
        Err(refused) => {
            if RunFolder::logs_at(folder.path()).exists() && !cancel.is_set() {
                // The message names a log in it.
                folder.keep();
            }
            return Err(refused);
        }
        prepared => prepared?,
    };
    let [contender] = &prepared.contenders[..] else {
        return Err(value_error("show draws the matches of one matcher"));
    };
    let png = detached(py, || {
        let shown = Shown::new(&prepared.datasets[0], [a, b], contender, seed, keypoints);
        let shown = shown.map_err(|broken| broken.to_string())?;
        shown.png().map_err(|broken| broken.to_string())
    })?;
    let warnings = warnings.iter().map(|warning| plain(warning)).collect();
    Ok((PyBytes::new(py, &png.map_err(error)?), warnings))
}
