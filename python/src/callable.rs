//! A matcher written in Python, as a source of matched points.
//!
//! The rules are those for a matcher that is a program. It gets images and nothing else (no cameras, no truth),
//! and its answer is checked. If it raises an exception, the pair is recorded as failed with the text of the
//! exception, and is tried again when the run is repeated.
//!
//! Pairs are matched one at a time, or as many at once as the matcher has `workers`; meanwhile the other threads of
//! the run decode images and estimate. The time is measured by the clock of the run, from the call on, without
//! decoding and without waiting for that turn. With several workers it contains the turns of the others: while a
//! matcher is pure Python, only one of them computes.

use std::collections::VecDeque;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use matchbench::datasets::{read_gray, read_planes};
use matchbench::external::is_inside;
use matchbench::matchers::{
    BuiltPointSource, ImageFiles, MAX_MATCHES, PointSource, SourceError, SourceSeconds,
    SourcedMatches,
};
use matchbench::records::IN_PYTHON;
use matchbench::run::Cancel;
use matchbench_vision::geometry::MatchedPoints;
use matchbench_vision::image::Size;
use matchbench_vision::seed::Seed;
use nalgebra::Point2;
use numpy::{PyUntypedArray, PyUntypedArrayMethods};
use pyo3::call::PyCallArgs;
use pyo3::exceptions::{PyKeyboardInterrupt, PySystemExit, PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::arrays::{column, few, kind_of, points};
use crate::datasets::{pixels, rgb_pixels};
use crate::matchers::Matches;
use crate::params::parse;
use crate::queue::Queue;

/// Number of images whose features are kept, since pairs are grouped by their first image.
const KEPT: usize = 64;

/// The parts of a Python matcher.
pub(crate) struct PythonMatcher {
    /// Its name in tables.
    pub(crate) name: String,
    /// Its version.
    pub(crate) version: String,
    /// Its parameters, as JSON.
    pub(crate) params: String,
    /// Called with two images, or with the features of two images.
    pub(crate) matching: Py<PyAny>,
    /// Called with an image, if features are found first.
    pub(crate) extract: Option<Py<PyAny>>,
    /// Whether images are RGB.
    pub(crate) color: bool,
    /// How many pairs it may be matching at once.
    pub(crate) workers: NonZeroUsize,
}

impl PythonMatcher {
    /// Makes a source of matches from it. An interrupt inside it sets `cancel`.
    ///
    /// # Errors
    /// If its parameters are not valid JSON, or its version cannot be printed.
    pub(crate) fn into_source(self, cancel: &Cancel) -> PyResult<BuiltPointSource> {
        if self.version.chars().any(char::is_control) {
            let what = format!(
                "version: {:?} has characters that cannot be printed",
                self.version
            );
            return Err(PyValueError::new_err(what));
        }
        Ok(BuiltPointSource {
            id: self.name,
            version: Some(self.version),
            command: None,
            params: parse(&self.params)?,
            notes: vec![IN_PYTHON.into()],
            source: Box::new(InProcess {
                matching: self.matching,
                extract: self.extract,
                color: self.color,
                known: Mutex::default(),
                queue: Queue::new(self.workers),
                cancel: cancel.clone(),
            }),
        })
    }
}

struct InProcess {
    matching: Py<PyAny>,
    extract: Option<Py<PyAny>>,
    color: bool,
    /// Features and sizes of the images that were used last.
    known: Mutex<VecDeque<(PathBuf, Py<PyAny>, Size)>>,
    /// Of the pairs that wait for their turn.
    queue: Queue,
    cancel: Cancel,
}

/// What a matcher is called with for an image (its pixels, or its features), and the size of the image.
type Input = (Py<PyAny>, Size);

impl PointSource for InProcess {
    fn matches(&self, pair: &ImageFiles<'_>, _: Seed) -> Result<SourcedMatches, SourceError> {
        let mut place = self.queue.line_up();
        // While others are matched.
        let decoded_a = self.decoded(pair.images[0])?;
        let decoded_b = self.decoded(pair.images[1])?;
        if !place.enter(&self.cancel) {
            return Err(SourceError::Stopped);
        }
        let mut seconds = SourceSeconds::default();
        let [time_a, time_b] = &mut seconds.extract;
        let (a, size_a) = self.input(pair.images[0], decoded_a, time_a)?;
        let (b, size_b) = self.input(pair.images[1], decoded_b, time_b)?;
        Python::attach(|py| {
            let start = Instant::now();
            let answer = called(self.matching.bind(py), (a, b));
            seconds.matching = Some(start.elapsed().as_secs_f64());
            let points = answer.and_then(|answer| matched_points(&answer));
            let points = points.map_err(|error| self.said(py, &error))?;
            check_inside("points_a", &points.a, size_a).map_err(SourceError::Pair)?;
            check_inside("points_b", &points.b, size_b).map_err(SourceError::Pair)?;
            Ok(SourcedMatches {
                points,
                seconds,
                ..SourcedMatches::default()
            })
        })
    }
}

impl InProcess {
    /// The pixels of an image, unless its features are known.
    fn decoded(&self, path: &Path) -> Result<Option<Input>, SourceError> {
        let is_known = self.extract.is_some() && self.known(path).is_some();
        (!is_known).then(|| self.pixels(path)).transpose()
    }

    /// The pixels of an image, as an array, and its size.
    fn pixels(&self, path: &Path) -> Result<Input, SourceError> {
        let planes = if self.color {
            read_planes(path)
        } else {
            read_gray(path).map(|image| vec![image])
        };
        let planes = planes.map_err(|error| SourceError::Pair(error.to_string()))?;
        Python::attach(|py| {
            let array = if self.color {
                rgb_pixels(py, &planes)
            } else {
                pixels(py, &planes[0])
            };
            let array = array.map_err(|error| self.said(py, &error))?;
            Ok((array.unbind(), planes[0].size()))
        })
    }

    /// The features of an image, if they are known.
    fn known(&self, path: &Path) -> Option<Input> {
        // The lock is never held while Python runs.
        let known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        Python::attach(|py| {
            let found = known.iter().find(|(known, ..)| known == path);
            found.map(|(_, features, size)| (features.clone_ref(py), *size))
        })
    }

    /// What the matcher is called with for an image, which may have been `decoded` before, and the time to compute
    /// features if they were not known.
    fn input(
        &self,
        path: &Path,
        decoded: Option<Input>,
        seconds: &mut Option<f64>,
    ) -> Result<Input, SourceError> {
        let pixels = || decoded.map_or_else(|| self.pixels(path), Ok);
        let Some(extract) = &self.extract else {
            return pixels();
        };
        // Two workers may extract the same image; they get the same features.
        if let Some(features) = self.known(path) {
            return Ok(features);
        }
        let (pixels, size) = pixels()?;
        let features = Python::attach(|py| {
            let start = Instant::now();
            let features = called(extract.bind(py), (pixels,));
            *seconds = Some(start.elapsed().as_secs_f64());
            let features = features.map_err(|error| self.said(py, &error))?;
            Ok::<_, SourceError>((features.clone().unbind(), features.unbind()))
        })?;
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let oldest = (known.len() >= KEPT).then(|| known.pop_front());
        known.push_back((path.into(), features.0, size));
        drop(known);
        drop(oldest);
        Ok((features.1, size))
    }

    /// An exception of the matcher, as the reason why the pair failed.
    fn said(&self, py: Python<'_>, error: &PyErr) -> SourceError {
        if error.is_instance_of::<PyKeyboardInterrupt>(py)
            || error.is_instance_of::<PySystemExit>(py)
        {
            self.cancel.set();
        }
        let place = last_place(py, error).map_or_else(String::new, |place| format!(" ({place})"));
        SourceError::Pair(format!("{error}{place}"))
    }
}

/// Calls code of the matcher. If it forks, the child that comes back here ends: it must not go on with the run, whose
/// files and locks it has too.
fn called<'py>(
    code: &Bound<'py, PyAny>,
    arguments: impl PyCallArgs<'py>,
) -> PyResult<Bound<'py, PyAny>> {
    let process = std::process::id();
    let answer = code.call1(arguments);
    if std::process::id() != process {
        // Not by `exit`, which would run what the parent has registered for its own end.
        code.py().import("os")?.getattr("_exit")?.call1((1,))?;
    }
    answer
}

/// Refuses points outside their image, as for a matcher that is a program.
fn check_inside(name: &str, points: &[Point2<f64>], size: Size) -> Result<(), String> {
    let outside = |point: &&Point2<f64>| !is_inside(point.x as f32, point.y as f32, size);
    points.iter().find(outside).map_or(Ok(()), |point| {
        Err(format!(
            "`{name}` has ({}, {}), outside its image of {size} pixels; points are pixels of the original \
             image, x before y",
            point.x, point.y
        ))
    })
}

/// The file and line where an exception was raised.
fn last_place(py: Python<'_>, error: &PyErr) -> Option<String> {
    let mut entry = error.traceback(py)?.into_any();
    while let Ok(next) = entry.getattr("tb_next")
        && !next.is_none()
    {
        entry = next;
    }
    let code = entry.getattr("tb_frame").ok()?.getattr("f_code").ok()?;
    let file: String = code.getattr("co_filename").ok()?.extract().ok()?;
    let line: usize = entry.getattr("tb_lineno").ok()?.extract().ok()?;
    Some(format!("{file}:{line}"))
}

/// The answer of a Python matcher: `Matches`, or (points_a, points_b), or (points_a, points_b, ambiguity).
fn matched_points(answer: &Bound<'_, PyAny>) -> PyResult<MatchedPoints> {
    if let Ok(matches) = answer.cast::<Matches>() {
        let mut points = matches.get().points().clone();
        // It is above 1 where another candidate than the nearest was chosen, which no run takes from outside.
        for ambiguity in &mut points.ambiguity {
            *ambiguity = ambiguity.min(1.0);
        }
        return Ok(points);
    }
    let parts: Option<Vec<Bound<'_, PyAny>>> = few(answer, "answer", 3).ok();
    let (a, b, ambiguity) = match parts.as_deref() {
        Some([a, b]) => (a, b, None),
        Some([a, b, ambiguity]) => (a, b, (!ambiguity.is_none()).then_some(ambiguity)),
        _ => {
            return Err(PyTypeError::new_err(format!(
                "a matcher returns (points_a, points_b) or (points_a, points_b, ambiguity), m x 2 each and \
                 m; this one returned {}",
                kind_of(answer)
            )));
        }
    };
    for (points, name) in [(a, "points_a"), (b, "points_b")] {
        // Before they are copied: an array may claim any number of rows (`numpy.broadcast_to`).
        if let Ok(array) = points.cast::<PyUntypedArray>()
            && (array.shape().first()).is_some_and(|&rows| rows > MAX_MATCHES)
        {
            let rows = array.shape()[0];
            return Err(PyValueError::new_err(format!(
                "`{name}` has {rows} rows; {MAX_MATCHES} are the most"
            )));
        }
    }
    let (a, b) = (points(a, "points_a")?, points(b, "points_b")?);
    let ambiguity = match ambiguity {
        Some(ambiguity) => column(ambiguity, "ambiguity", a.len())?,
        None => vec![0.5; a.len()],
    };
    // If lengths differ, the run finds and reports it.
    Ok(MatchedPoints {
        a,
        b,
        ambiguity,
        ..MatchedPoints::default()
    })
}
