//! Putative matches as arrays, and the searches that compute them from descriptors.

use matchbench_vision::features::Features as Inner;
use matchbench_vision::geometry::MatchedPoints;
use matchbench_vision::matching::{
    Correspondence, Correspondences, MutualCheck, NearestNeighbours, RatioTest, Search, Selector,
    SymmetricRatioTest, View,
};
use matchbench_vision::seed::Seed;
use pyo3::prelude::*;

use crate::arrays::{column, index_pairs, known_column, matrix};
use crate::detached::detached;
use crate::errors::{error, value_error};
use crate::features::Features;

/// Pairs of indices (m x 2), distances, and distances to the second nearest.
pub(crate) type Arrays<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>);

/// [`Arrays`], then how far keypoints turned and how much they grew, where that is known.
pub(crate) type Found<'py> = (
    Bound<'py, PyAny>,
    Bound<'py, PyAny>,
    Bound<'py, PyAny>,
    Option<Bound<'py, PyAny>>,
    Option<Bound<'py, PyAny>>,
);

/// Nearest neighbours that pass a test: indices, distances, distances to the second nearest, turns and growths; `match`
/// calls it.
#[pyfunction]
#[pyo3(signature = (a, b, method, ratio=None))]
pub(crate) fn search<'py>(
    py: Python<'py>,
    a: &Features,
    b: &Features,
    method: &str,
    ratio: Option<f32>,
) -> PyResult<Found<'py>> {
    let (a, b) = (&*a.inner, &*b.inner);
    same_kind(a, b)?;
    if ratio.is_some() && matches!(method, "nn" | "mutual") {
        return Err(value_error(format!(
            "`ratio` does nothing with method=\"{method}\"; use \"ratio\" or \"smnn\", or leave it out"
        )));
    }
    let ratio = ratio.unwrap_or(RatioTest::default().ratio);
    let selector: Option<Box<dyn Selector>> = match method {
        "nn" => None,
        "mutual" => Some(Box::new(MutualCheck)),
        "ratio" => Some(Box::new(RatioTest::new(ratio).map_err(value_error)?)),
        "smnn" => Some(Box::new(
            SymmetricRatioTest::new(ratio).map_err(value_error)?,
        )),
        _ => {
            return Err(value_error(format!(
                "no method \"{method}\"; there are \"nn\", \"ratio\", \"mutual\" and \"smnn\""
            )));
        }
    };
    let found = detached(py, || {
        let mut found = NearestNeighbours.search_for(a, b, selector.as_deref());
        if let Some(selector) = selector {
            let [a, b] = [a, b].map(|features| View {
                features,
                image: None,
                camera: None,
            });
            selector.select(a, b, &mut found, Seed(0));
        }
        found
    })?;
    found_arrays(py, &found, a, b)
}

/// Checks that two sets of features can be compared.
///
/// # Errors
/// If their descriptors are of different kinds.
pub(crate) fn same_kind(a: &Inner, b: &Inner) -> PyResult<()> {
    let (a, b) = (a.descriptors.kind(), b.descriptors.kind());
    if a == b {
        Ok(())
    } else {
        Err(value_error(format!(
            "descriptors of different kinds cannot be compared: {a} and {b}"
        )))
    }
}

/// The matches of these features as arrays, with the turns and growths that a run gives to its estimators.
///
/// # Errors
/// If a match names a feature that does not exist.
pub(crate) fn found_arrays<'py>(
    py: Python<'py>,
    found: &[Correspondence],
    a: &Inner,
    b: &Inner,
) -> PyResult<Found<'py>> {
    let points = detached(py, || MatchedPoints::of_matches(found, a, b))?.map_err(error)?;
    let indices = found.iter().flat_map(|m| [i64::from(m.a), i64::from(m.b)]);
    Ok((
        matrix(py, indices.collect(), [found.len(), 2])?,
        matrix(
            py,
            found.iter().map(|m| m.distance).collect(),
            [found.len()],
        )?,
        matrix(py, found.iter().map(|m| m.second).collect(), [found.len()])?,
        known_column(py, points.turns.as_ref())?,
        known_column(py, points.growths.as_ref())?,
    ))
}

/// The matches given by arrays.
///
/// # Errors
/// If they are not valid matches of these features.
pub(crate) fn of_arrays(
    (indices, distances, second): (Bound<'_, PyAny>, Bound<'_, PyAny>, Bound<'_, PyAny>),
    a: &Inner,
    b: &Inner,
) -> PyResult<Correspondences> {
    let pairs = index_pairs(&indices, [a.len(), b.len()])?;
    let distances = column(&distances, "distances", pairs.len())?;
    let second = column(&second, "second", pairs.len())?;
    for (name, values) in [("distances", &distances), ("second", &second)] {
        if let Some(row) = values.iter().position(|value| value.is_nan()) {
            return Err(value_error(format!(
                "`{name}` is NaN in row {row}; leave such matches out, or set `second` to infinity where there is no \
                 second candidate"
            )));
        }
    }
    let values = distances.into_iter().zip(second);
    let matches = pairs.into_iter().zip(values);
    Ok(matches
        .map(|([a, b], (distance, second))| Correspondence {
            a,
            b,
            distance,
            second,
        })
        .collect())
}
