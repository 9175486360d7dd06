//! Pose estimators by name.

use matchbench::estimators::{self, BuiltEstimator, Estimator as Built};
use matchbench::run::estimation_seed;
use matchbench_vision::geometry::MatchedPoints;
use matchbench_vision::robust::{self, TwoViews};
use matchbench_vision::seed::Seed;
use pyo3::prelude::*;
use serde_json::Value;

use crate::arrays::{column, matrix, points};
use crate::camera::Camera;
use crate::detached::detached;
use crate::errors::{NoPose, value_error};
use crate::params::parse;

/// An estimator of the library with its parameters.
#[pyclass(frozen, module = "matchbench")]
pub(crate) struct Estimator {
    built: BuiltEstimator,
}

impl Estimator {
    /// The same estimator once more, for a run to own.
    ///
    /// # Errors
    /// None that was not one before.
    pub(crate) fn rebuild(&self) -> PyResult<BuiltEstimator> {
        build(&self.built.id, &self.built.params)
    }
}

fn build(id: &str, params: &Value) -> PyResult<BuiltEstimator> {
    let entry = estimators::find(id).map_err(value_error)?;
    entry.build(Some(params)).map_err(value_error)
}

#[pymethods]
impl Estimator {
    #[new]
    fn new(id: &str, params: &str) -> PyResult<Self> {
        let built = build(id, &parse(params)?)?;
        Ok(Self { built })
    }

    #[getter]
    pub(crate) fn id(&self) -> &str {
        &self.built.id
    }

    /// All parameters, as JSON.
    #[getter]
    fn params_json(&self) -> String {
        self.built.params.to_string()
    }

    #[pyo3(signature = (points_a, points_b, camera_a, camera_b, *, ambiguity=None, seed=0))]
    fn estimate(
        &self,
        py: Python<'_>,
        points_a: &Bound<'_, PyAny>,
        points_b: &Bound<'_, PyAny>,
        camera_a: Camera,
        camera_b: Camera,
        ambiguity: Option<Bound<'_, PyAny>>,
        seed: u64,
    ) -> PyResult<PoseEstimate> {
        let Built::Pose(pose) = &self.built.estimator else {
            let message = format!(
                "`{}` estimates homographies; call `estimate_homography`",
                self.built.id
            );
            return Err(value_error(message));
        };
        let matches = matched(points_a, points_b, ambiguity)?;
        let count = matches.len();
        let found = detached(py, || {
            let views = TwoViews {
                points: &matches,
                camera_a: &camera_a.inner,
                camera_b: &camera_b.inner,
            };
            let estimate = pose.estimate(views, estimation_seed(Seed(seed), &self.built.id))?;
            let confidence = views.confidence(&estimate.b_from_a);
            Ok::<_, robust::NoPose>((estimate, confidence))
        })?;
        match found {
            Ok((inner, confidence)) => Ok(PoseEstimate {
                inner,
                count,
                confidence,
            }),
            Err(none) => Err(NoPose::new_err(none.to_string())),
        }
    }

    /// Whether it estimates homographies, and not poses.
    #[getter]
    fn of_homographies(&self) -> bool {
        matches!(self.built.estimator, Built::Homography(_))
    }

    #[pyo3(signature = (points_a, points_b, *, ambiguity=None, seed=0))]
    fn estimate_homography(
        &self,
        py: Python<'_>,
        points_a: &Bound<'_, PyAny>,
        points_b: &Bound<'_, PyAny>,
        ambiguity: Option<Bound<'_, PyAny>>,
        seed: u64,
    ) -> PyResult<HomographyEstimate> {
        let Built::Homography(homography) = &self.built.estimator else {
            let message = format!("`{}` estimates poses; call `estimate`", self.built.id);
            return Err(value_error(message));
        };
        let matches = matched(points_a, points_b, ambiguity)?;
        let seed = estimation_seed(Seed(seed), &self.built.id);
        match detached(py, || homography.estimate(&matches, seed))? {
            Ok(inner) => Ok(HomographyEstimate {
                inner,
                count: matches.len(),
            }),
            Err(none) => Err(NoPose::new_err(none.to_string())),
        }
    }

    fn __repr__(&self) -> String {
        format!("Estimator({:?})", self.built.id)
    }
}

/// The matches of two arrays of points, row by row.
fn matched(
    points_a: &Bound<'_, PyAny>,
    points_b: &Bound<'_, PyAny>,
    ambiguity: Option<Bound<'_, PyAny>>,
) -> PyResult<MatchedPoints> {
    let (a, b) = (points(points_a, "points_a")?, points(points_b, "points_b")?);
    if a.len() != b.len() {
        return Err(value_error(format!(
            "{} points in image a and {} in image b; row i of both is one match",
            a.len(),
            b.len()
        )));
    }
    let count = a.len();
    let ambiguity = match ambiguity {
        Some(ambiguity) => column(&ambiguity, "ambiguity", count)?,
        None => vec![0.5; count],
    };
    if let Some(row) = ambiguity.iter().position(|x| !(0.0..=1.0).contains(x)) {
        let message = format!(
            "`ambiguity` is from 0 (certain) to 1; row {row} is {}",
            ambiguity[row]
        );
        return Err(value_error(message));
    }
    Ok(MatchedPoints::new(a, b, ambiguity))
}

/// For each of so many matches whether it is one of the `inliers`.
fn mask<'py>(py: Python<'py>, inliers: &[u32], count: usize) -> PyResult<Bound<'py, PyAny>> {
    let mut agree = vec![false; count];
    for &index in inliers {
        agree[index as usize] = true;
    }
    matrix(py, agree, [count])
}

/// A homography, and the matches that agree with it.
#[pyclass(frozen, module = "matchbench")]
pub(crate) struct HomographyEstimate {
    inner: robust::HomographyEstimate,
    /// Matches that were given.
    count: usize,
}

#[pymethods]
impl HomographyEstimate {
    /// Takes pixels of a, as (x, y, 1), to those of b.
    #[getter(H)]
    fn homography<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let rows = self.inner.b_from_a.transpose().as_slice().to_vec();
        matrix(py, rows, [3, 3])
    }

    /// For each match whether it agrees.
    #[getter]
    fn inliers<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        mask(py, &self.inner.inliers, self.count)
    }

    #[getter]
    fn num_inliers(&self) -> usize {
        self.inner.inliers.len()
    }

    #[getter]
    fn iterations(&self) -> usize {
        self.inner.iterations
    }

    fn __repr__(&self) -> String {
        format!(
            "HomographyEstimate({} of {} agree)",
            self.inner.inliers.len(),
            self.count
        )
    }
}

/// A relative pose, and the matches that agree with it.
#[pyclass(frozen, module = "matchbench")]
pub(crate) struct PoseEstimate {
    inner: robust::PoseEstimate,
    /// Matches that were given.
    count: usize,
    confidence: robust::Confidence,
}

#[pymethods]
impl PoseEstimate {
    /// R of `x_b = R x_a + t`.
    #[getter(R)]
    fn rotation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let rotation = self.inner.b_from_a.rotation.to_rotation_matrix();
        matrix(
            py,
            rotation.matrix().transpose().as_slice().to_vec(),
            [3, 3],
        )
    }

    /// t, of length 1.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        matrix(py, self.inner.b_from_a.direction.as_slice().to_vec(), [3])
    }

    /// The rotation as a quaternion w, x, y, z.
    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let q = self.inner.b_from_a.rotation;
        matrix(py, vec![q.w, q.i, q.j, q.k], [4])
    }

    /// For each match whether it agrees.
    #[getter]
    fn inliers<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        mask(py, &self.inner.inliers, self.count)
    }

    #[getter]
    fn num_inliers(&self) -> usize {
        self.inner.inliers.len()
    }

    #[getter]
    fn support(&self) -> usize {
        self.inner.support
    }

    #[getter]
    fn confidence(&self) -> f64 {
        self.confidence.right
    }

    #[getter]
    fn overlap_probability(&self) -> f64 {
        self.confidence.overlap
    }

    #[getter]
    fn iterations(&self) -> usize {
        self.inner.iterations
    }

    fn __repr__(&self) -> String {
        let t = self.inner.b_from_a.direction;
        let degrees = self.inner.b_from_a.rotation.angle().to_degrees();
        format!(
            "PoseEstimate({} of {} agree, turned by {degrees:.2} degrees, t [{:.3}, {:.3}, {:.3}])",
            self.inner.inliers.len(),
            self.count,
            t.x,
            t.y,
            t.z
        )
    }
}
