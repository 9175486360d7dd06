//! What Python asks of a run, as a [`Study`]: matchers and estimators given by name, as objects, from files or as code.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::mem;
use std::num::NonZeroUsize;
use std::path::PathBuf;

use matchbench::config::Changes;
use matchbench::matchers::BuiltPointSource;
use matchbench::run::{Cancel, ContenderError};
use matchbench::study::{MatchesFrom, News, Prepared, Study, StudyError};
use pyo3::prelude::*;
use serde_json::Value;

use crate::callable::PythonMatcher;
use crate::datasets::Dataset;
use crate::detached::interruptible;
use crate::errors::{error, value_error};
use crate::estimators::Estimator;
use crate::matchers::Matcher;

/// A matcher of a run.
#[derive(FromPyObject)]
pub(crate) enum AnyMatcher<'py> {
    /// A name, or the path of a manifest.
    Name(String),
    /// A matcher of the library.
    Native(Bound<'py, Matcher>),
    /// Written in Python: name, version, parameters as JSON, `match`, `extract`, whether images are in colour, and how many
    /// pairs may be matched at once.
    Python(
        String,
        String,
        String,
        Py<PyAny>,
        Option<Py<PyAny>>,
        bool,
        NonZeroUsize,
    ),
    /// From files: the fields of [`MatchesFrom`].
    Files(
        String,
        Vec<PathBuf>,
        Option<String>,
        Option<f64>,
        Option<[u32; 2]>,
        bool,
        BTreeMap<String, String>,
    ),
}

/// An estimator of a run.
#[derive(FromPyObject)]
pub(crate) enum AnyEstimator<'py> {
    /// A name.
    Name(String),
    /// An estimator with parameters.
    Built(Bound<'py, Estimator>),
}

/// Adds the matchers to the study, and returns those that are written in Python.
pub(crate) fn add_matchers(
    study: &mut Study,
    matchers: Vec<AnyMatcher<'_>>,
    cancel: &Cancel,
) -> PyResult<Vec<BuiltPointSource>> {
    let mut sources = Vec::new();
    for matcher in matchers {
        match matcher {
            AnyMatcher::Name(name) => {
                once("matchers", &study.matchers, &name)?;
                study.matchers.push(name);
            }
            AnyMatcher::Native(matcher) => {
                let (id, given) = matcher.get().as_given();
                once("matchers", &study.matchers, id)?;
                change(study, id, given)?;
                study.matchers.push(id.to_owned());
            }
            AnyMatcher::Python(name, version, params, matching, extract, color, workers) => {
                let matcher = PythonMatcher {
                    name,
                    version,
                    params,
                    matching,
                    extract,
                    color,
                    workers,
                };
                sources.push(matcher.into_source(cancel)?);
            }
            AnyMatcher::Files(name, files, format, pixel_center, resized, verified, notes) => {
                study.matches.push(MatchesFrom {
                    name,
                    files,
                    format,
                    pixel_center,
                    resized,
                    verified,
                    notes,
                });
            }
        }
    }
    Ok(sources)
}

/// Adds the estimators to the study.
pub(crate) fn add_estimators(study: &mut Study, estimators: &[AnyEstimator<'_>]) -> PyResult<()> {
    for estimator in estimators {
        match estimator {
            AnyEstimator::Name(id) => {
                once("estimators", &study.estimators, id)?;
                study.estimators.push(id.clone());
            }
            AnyEstimator::Built(estimator) => {
                let (id, given) = estimator.get().as_given();
                once("estimators", &study.estimators, id)?;
                change(study, id, given)?;
                study.estimators.push(id.to_owned());
            }
        }
    }
    Ok(())
}

/// Refuses a matcher or an estimator that was named before, perhaps with other parameters.
fn once(what: &str, named: &[String], id: &str) -> PyResult<()> {
    if named.iter().any(|other| other == id) {
        return Err(value_error(format!(
            "{what}: two of them are `{id}`, and a run has each once. For other parameters make another run, and compare \
             both with the command `matchbench compare`, or the scores of `evaluate`"
        )));
    }
    Ok(())
}

/// Gives the study the parameters that an object was made with. The others stay as they are by name: their defaults, or
/// what a protocol sets.
///
/// # Errors
/// If they are set otherwise too: `settings` are for what is given by name.
fn change(study: &mut Study, id: &str, given: &Value) -> PyResult<()> {
    if study.set.of(id).is_some() {
        let message = format!(
            "`{id}` is an object, which has the parameters that it was made with, and `settings` set some more; give them in one place"
        );
        return Err(value_error(message));
    }
    let own = Changes::of_one(id, given.clone());
    study.set = mem::take(&mut study.set).with(own);
    Ok(())
}

/// Builds and starts what the study names, and reads matches from files. Also returns warnings: what looks wrong, and
/// which matchers could not be started. Ctrl-C sets `cancel`, which ends programs that are not ready, and is raised.
pub(crate) fn prepare(
    py: Python<'_>,
    study: &Study,
    datasets: &[Bound<'_, Dataset>],
    sources: Vec<BuiltPointSource>,
    cancel: &Cancel,
) -> PyResult<(Prepared, Vec<String>)> {
    let datasets = datasets.iter().map(|dataset| dataset.get().inner.clone());
    let datasets: Vec<_> = datasets.collect();
    let mut warnings = Vec::new();
    let prepared = interruptible(py, cancel, || {
        let told = RefCell::new(&mut warnings);
        study.prepare_on(datasets, sources, cancel, &|news| {
            warn(&news, &mut told.borrow_mut());
        })
    })?;
    let prepared = prepared.map_err(refused)?;
    warnings.extend(prepared.absent.iter().map(ToString::to_string));
    Ok((prepared, warnings))
}

/// What a user should know of news.
fn warn(news: &News<'_>, warnings: &mut Vec<String>) {
    match news {
        News::Imported(..) => {}
        News::Problem(problem) => warnings.push(problem.error.to_string()),
        News::Matches(name, source) => {
            for (dataset, files) in source.datasets() {
                let survey = files.survey();
                let remarks = survey.remarks().into_iter();
                let remarks = remarks.chain(survey.warnings.iter().cloned());
                warnings.extend(remarks.map(|remark| format!("{name} on {dataset}: {remark}")));
            }
        }
    }
}

/// The exception for a study that cannot be run.
fn refused(broken: StudyError) -> PyErr {
    use ContenderError::{Config, Name, TakesNoPart};
    match broken {
        StudyError::Contender(Config(_) | Name(_) | TakesNoPart(_)) | StudyError::Name { .. } => {
            value_error(broken)
        }
        _ => error(broken),
    }
}
