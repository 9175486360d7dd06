//! Pose estimators by name.

use matchbench::counted::counted;
use matchbench::estimators::{self, BuiltEstimator, Estimator as Built};
use matchbench::run::estimation_seed;
use matchbench_vision::geometry::{MatchedPoints, RelativePose};
use matchbench_vision::robust::{self, TwoViews};
use matchbench_vision::seed::Seed;
use nalgebra::{Matrix3, Quaternion, Unit};
use pyo3::prelude::*;
use pyo3::types::PyType;
use serde_json::Value;

use crate::arrays::{chosen, column, matrix, points};
use crate::camera::Camera;
use crate::detached::detached;
use crate::errors::{NoModel, value_error};
use crate::integers::whole;
use crate::params::parse;
use crate::pickled::{Reduced, by_method};

/// An estimator of the library with its parameters, which are JSON; `matchbench.Estimator` is made of it.
#[pyclass(frozen, module = "matchbench._native")]
pub(crate) struct Estimator {
    built: BuiltEstimator,
    /// The parameters that were given, without those at their defaults.
    given: Value,
}

impl Estimator {
    /// Its name, and the parameters that were given: what a run needs, where a protocol may set the others.
    pub(crate) fn as_given(&self) -> (&str, &Value) {
        (&self.built.id, &self.given)
    }

    /// Checks that `turns` and `growths`, if they are given, are used.
    ///
    /// # Errors
    /// If they would do nothing.
    fn check_acting(&self, turns: bool, growths: bool) -> PyResult<()> {
        let id = &self.built.id;
        let setting = self.built.params.get("turns").and_then(Value::as_bool);
        if (turns || growths) && setting != Some(true) {
            let name = if turns { "turns" } else { "growths" };
            let remedy = match setting {
                Some(_) => format!("make it by estimator(\"{id}\", turns=True), or leave them out"),
                None => "leave them out, or use estimator(\"adaptive\")".to_owned(),
            };
            return Err(value_error(format!(
                "`{name}` would do nothing: this `{id}` uses points alone; {remedy}"
            )));
        }
        let hypotheses = self.built.params.get("hypotheses").and_then(Value::as_u64);
        if growths && hypotheses.is_none_or(|hypotheses| hypotheses < 2) {
            let remedy = match hypotheses {
                Some(_) => format!("make it by estimator(\"{id}\", turns=True, hypotheses=8), or "),
                None => String::new(),
            };
            return Err(value_error(format!(
                "`growths` would do nothing: this `{id}` keeps the best model alone; {remedy}leave them out"
            )));
        }
        Ok(())
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
        let given = parse(params)?;
        let built = build(id, &given)?;
        Ok(Self { built, given })
    }

    /// Its name in commands, records and tables.
    #[getter]
    pub(crate) fn id(&self) -> &str {
        &self.built.id
    }

    /// All parameters, as JSON.
    #[getter]
    fn params(&self) -> String {
        self.built.params.to_string()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> (Bound<'py, PyType>, (&str, String)) {
        (py.get_type::<Self>(), (self.id(), self.given.to_string()))
    }

    /// The relative pose of camera b from matched points, m x 2 in pixels.
    #[pyo3(signature = (points_a, points_b, camera_a, camera_b, ambiguity, turns, growths, seed))]
    fn estimate(
        &self,
        py: Python<'_>,
        points_a: &Bound<'_, PyAny>,
        points_b: &Bound<'_, PyAny>,
        camera_a: Camera,
        camera_b: Camera,
        ambiguity: Option<Bound<'_, PyAny>>,
        turns: Option<Bound<'_, PyAny>>,
        growths: Option<Bound<'_, PyAny>>,
        #[pyo3(from_py_with = whole)] seed: u64,
    ) -> PyResult<PoseEstimate> {
        let Built::Pose(pose) = &self.built.estimator else {
            let message = format!(
                "`{}` estimates homographies; call `estimate_homography`",
                self.built.id
            );
            return Err(value_error(message));
        };
        self.check_acting(turns.is_some(), growths.is_some())?;
        let matches = matched(points_a, points_b, ambiguity, turns, growths)?;
        let count = matches.len();
        let found = detached(py, || {
            let views = TwoViews {
                points: &matches,
                camera_a: &camera_a.inner,
                camera_b: &camera_b.inner,
            };
            let estimate = pose.estimate(views, estimation_seed(Seed(seed), &self.built.id))?;
            let probabilities = views.pose_probabilities(&estimate.b_from_a);
            Ok::<_, robust::NoModel>((estimate, probabilities))
        })?;
        match found {
            Ok((inner, probabilities)) => Ok(PoseEstimate {
                inner,
                count,
                probabilities,
            }),
            Err(none) => Err(NoModel::new_err(none.to_string())),
        }
    }

    /// Whether it estimates homographies, and not poses.
    #[getter]
    fn of_homographies(&self) -> bool {
        matches!(self.built.estimator, Built::Homography(_))
    }

    /// The homography from image a to image b from matched points, m x 2 in pixels.
    #[pyo3(signature = (points_a, points_b, ambiguity, turns, seed))]
    fn estimate_homography(
        &self,
        py: Python<'_>,
        points_a: &Bound<'_, PyAny>,
        points_b: &Bound<'_, PyAny>,
        ambiguity: Option<Bound<'_, PyAny>>,
        turns: Option<Bound<'_, PyAny>>,
        #[pyo3(from_py_with = whole)] seed: u64,
    ) -> PyResult<HomographyEstimate> {
        let Built::Homography(homography) = &self.built.estimator else {
            let message = format!("`{}` estimates poses; call `estimate`", self.built.id);
            return Err(value_error(message));
        };
        self.check_acting(turns.is_some(), false)?;
        let matches = matched(points_a, points_b, ambiguity, turns, None)?;
        let seed = estimation_seed(Seed(seed), &self.built.id);
        match detached(py, || homography.estimate(&matches, seed))? {
            Ok(inner) => Ok(HomographyEstimate {
                inner,
                count: matches.len(),
            }),
            Err(none) => Err(NoModel::new_err(none.to_string())),
        }
    }
}

/// The matches given by two arrays of points, row by row.
///
/// # Errors
/// If they are not points or their numbers differ, if an ambiguity is negative or no number, or if a turn or
/// growth is not finite.
pub(crate) fn matched(
    points_a: &Bound<'_, PyAny>,
    points_b: &Bound<'_, PyAny>,
    ambiguity: Option<Bound<'_, PyAny>>,
    turns: Option<Bound<'_, PyAny>>,
    growths: Option<Bound<'_, PyAny>>,
) -> PyResult<MatchedPoints> {
    let (a, b) = (points(points_a, "points_a")?, points(points_b, "points_b")?);
    if a.len() != b.len() {
        return Err(value_error(format!(
            "{} in image a and {} in image b; row i of both is one match",
            counted(a.len(), "point"),
            b.len()
        )));
    }
    let count = a.len();
    let ambiguity = match ambiguity {
        Some(ambiguity) => column(&ambiguity, "ambiguity", count)?,
        None => vec![0.5; count],
    };
    // It is above 1 where another candidate than the nearest was chosen.
    if let Some(row) = ambiguity.iter().position(|x| !(0.0..).contains(x)) {
        let message = format!(
            "`ambiguity` is from 0 (certain) to 1 (a second candidate is as good), and above 1 where another candidate \
             than the nearest was chosen; row {row} is {}",
            ambiguity[row]
        );
        return Err(value_error(message));
    }
    let finite = |values: Option<Bound<'_, PyAny>>, name: &str, [what, of]: [&str; 2]| {
        let Some(values) = values else {
            return Ok(None);
        };
        let values = column(&values, name, count)?;
        match values.iter().position(|value| !value.is_finite()) {
            Some(row) => Err(value_error(format!(
                "`{name}` are {what}; row {row} is not finite. Where keypoints have no {of}, leave them out"
            ))),
            None => Ok(Some(values)),
        }
    };
    let turns = finite(turns, "turns", ["radians", "orientation"])?;
    let growths = finite(
        growths,
        "growths",
        ["logarithms of ratios of sizes", "size"],
    )?;
    Ok((MatchedPoints::new(a, b, ambiguity).with_turns(turns)).with_growths(growths))
}

/// A mask with one bool for each of `count` matches: whether it is one of the `inliers`.
fn mask<'py>(py: Python<'py>, inliers: &[u32], count: usize) -> PyResult<Bound<'py, PyAny>> {
    let mut agree = vec![false; count];
    for &index in inliers {
        agree[index as usize] = true;
    }
    matrix(py, agree, [count])
}

/// The indices of the inliers in a mask, and the number of all matches; see [`mask`].
fn unmasked(mask: &Bound<'_, PyAny>) -> PyResult<(Vec<u32>, usize)> {
    let count = mask.len()?;
    let agreeing = chosen(mask, count)?;
    Ok((agreeing.into_iter().map(|i| i as u32).collect(), count))
}

/// A homography, `x_b ~ H x_a` for pixels `(x, y, 1)`, and the matches that agree with it.
#[pyclass(frozen, module = "matchbench")]
pub(crate) struct HomographyEstimate {
    inner: robust::HomographyEstimate,
    /// Number of matches that were given.
    count: usize,
}

#[pymethods]
impl HomographyEstimate {
    /// Restores it from a pickle: the matrix row after row.
    #[staticmethod]
    fn _of_parts(rows: [f64; 9], inliers: &Bound<'_, PyAny>, iterations: usize) -> PyResult<Self> {
        let (inliers, count) = unmasked(inliers)?;
        let inner = robust::HomographyEstimate {
            b_from_a: Matrix3::from_row_slice(&rows),
            inliers,
            iterations,
        };
        Ok(Self { inner, count })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let rows = self.inner.b_from_a.transpose().as_slice().to_vec();
        let call = ("_of_parts", rows, self.inliers(py)?, self.inner.iterations);
        by_method::<Self>(py, call, None)
    }

    /// 3 x 3, of norm 1: maps pixels of a, as (x, y, 1), to those of b.
    #[getter(H)]
    fn homography<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let rows = self.inner.b_from_a.transpose().as_slice().to_vec();
        matrix(py, rows, [3, 3])
    }

    /// For each match, whether it agrees.
    #[getter]
    fn inliers<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        mask(py, &self.inner.inliers, self.count)
    }

    /// Number of matches that agree.
    #[getter]
    fn num_inliers(&self) -> usize {
        self.inner.inliers.len()
    }

    /// Number of samples drawn.
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

/// A relative pose, `x_b = R x_a + t`, and the matches that agree with it.
#[pyclass(frozen, module = "matchbench")]
pub(crate) struct PoseEstimate {
    inner: robust::PoseEstimate,
    /// Number of matches that were given.
    count: usize,
    probabilities: robust::PoseProbabilities,
}

#[pymethods]
impl PoseEstimate {
    /// Restores it from a pickle; `q` and `t` have length 1.
    #[staticmethod]
    fn _of_parts(
        q: [f64; 4],
        t: [f64; 3],
        inliers: &Bound<'_, PyAny>,
        support: usize,
        iterations: usize,
        pose_probability: f64,
        overlap: f64,
    ) -> PyResult<Self> {
        let (inliers, count) = unmasked(inliers)?;
        let [w, x, y, z] = q;
        let inner = robust::PoseEstimate {
            b_from_a: RelativePose {
                rotation: Unit::new_unchecked(Quaternion::new(w, x, y, z)),
                direction: Unit::new_unchecked(t.into()),
            },
            inliers,
            support,
            iterations,
        };
        let probabilities = robust::PoseProbabilities {
            right: pose_probability,
            overlap,
        };
        Ok(Self {
            inner,
            count,
            probabilities,
        })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let RelativePose {
            rotation,
            direction,
        } = self.inner.b_from_a;
        let call = (
            "_of_parts",
            (rotation.w, rotation.i, rotation.j, rotation.k),
            (direction.x, direction.y, direction.z),
            self.inliers(py)?,
            self.inner.support,
            self.inner.iterations,
            self.probabilities.right,
            self.probabilities.overlap,
        );
        by_method::<Self>(py, call, None)
    }

    /// 3 x 3: R of `x_b = R x_a + t`.
    #[getter(R)]
    fn rotation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let rotation = self.inner.b_from_a.rotation.to_rotation_matrix();
        matrix(
            py,
            rotation.matrix().transpose().as_slice().to_vec(),
            [3, 3],
        )
    }

    /// 3: t of `x_b = R x_a + t`, of length 1, since the scale cannot be known from two images.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        matrix(py, self.inner.b_from_a.direction.as_slice().to_vec(), [3])
    }

    /// R as a quaternion w, x, y, z.
    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let q = self.inner.b_from_a.rotation;
        matrix(py, vec![q.w, q.i, q.j, q.k], [4])
    }

    /// For each match, whether it agrees.
    #[getter]
    fn inliers<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        mask(py, &self.inner.inliers, self.count)
    }

    /// Number of matches that agree.
    #[getter]
    fn num_inliers(&self) -> usize {
        self.inner.inliers.len()
    }

    /// Number of matches whose point is in front of both cameras and nearer than the largest depth.
    #[getter]
    fn support(&self) -> usize {
        self.inner.support
    }

    /// The probability that the pose is within 10 degrees of the truth, estimated from the matches.
    #[getter]
    fn pose_probability(&self) -> f64 {
        self.probabilities.right
    }

    /// The probability that the images overlap and the matches show that; below 0.5 the answer is "no overlap".
    #[getter]
    fn overlap_probability(&self) -> f64 {
        self.probabilities.overlap
    }

    /// Number of samples drawn.
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
