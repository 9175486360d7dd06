//! Cameras: given by their own fields, or by the names of COLMAP's camera models.

use matchbench::datasets::camera_of_model;
use matchbench_vision::geometry::{self, Distortion, Fisheye, Lens};
use nalgebra::Matrix3;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::arrays::{few, few_numbers, kind_of, matrix, matrix_3x3};
use crate::errors::value_error;
use crate::text;

/// The origin of pixel coordinates: at the centre of the first pixel, or at its corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Origin {
    /// At the centre, as in this library and OpenCV.
    Center,
    /// At the corner, as in COLMAP: the centre of the first pixel is (0.5, 0.5).
    Corner,
}

impl Origin {
    /// The origin with this name.
    ///
    /// # Errors
    /// If there is none.
    pub(crate) fn parse(name: &str) -> PyResult<Self> {
        match name {
            "center" => Ok(Self::Center),
            "corner" => Ok(Self::Corner),
            _ => Err(value_error(format!(
                "origin is \"center\" (the centre of the first pixel is (0, 0): OpenCV, matchbench) or \
                 \"corner\" (it is (0.5, 0.5): COLMAP), not \"{name}\""
            ))),
        }
    }

    /// The number to add to such coordinates to get those of this library.
    pub(crate) fn shift(self) -> f64 {
        match self {
            Self::Center => 0.0,
            Self::Corner => -0.5,
        }
    }
}

/// More numbers than any model of a camera has.
const MOST_NUMBERS: usize = 16;

/// A pinhole camera: `u = fx x + cx`, `v = fy y + cy` for the point (x, y) at depth 1, after lens distortion (k1, k2,
/// p1, p2[, k3], as in OpenCV) or that of a `fisheye` (k1, k2, k3, k4, as in OpenCV's module of this name). `origin`
/// says where the origin of (cx, cy) is: at the centre of the first pixel ("center": OpenCV, and everywhere here) or at
/// its corner ("corner": COLMAP).
#[pyclass(frozen, eq, module = "matchbench")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Camera {
    pub(crate) inner: geometry::Camera,
}

#[pymethods]
impl Camera {
    #[new]
    #[pyo3(signature = (fx, fy, cx, cy, distortion=None, fisheye=None, *, origin="center"))]
    fn new(
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
        distortion: Option<Bound<'_, PyAny>>,
        fisheye: Option<Bound<'_, PyAny>>,
        #[pyo3(from_py_with = text::origin)] origin: &str,
    ) -> PyResult<Self> {
        let shift = Origin::parse(origin)?.shift();
        let numbers = |given: Option<Bound<'_, PyAny>>, name| {
            given
                .map(|given| few_numbers(&given, name, MOST_NUMBERS))
                .transpose()
        };
        let distortion = numbers(distortion, "distortion")?;
        let fisheye = numbers(fisheye, "fisheye")?;
        let lens = match (distortion.as_deref(), fisheye.as_deref()) {
            (None, None) => None,
            (Some(&[k1, k2, p1, p2]), None) => Some(brown([k1, k2, p1, p2, 0.0])),
            (Some(&[k1, k2, p1, p2, k3]), None) => Some(brown([k1, k2, p1, p2, k3])),
            (None, Some(&[k1, k2, k3, k4])) => Some(Fisheye { k1, k2, k3, k4 }.into()),
            (Some(_), Some(_)) => {
                return Err(value_error("a camera has distortion or fisheye, not both"));
            }
            (Some(other), None) => {
                return Err(value_error(format!(
                    "distortion is (k1, k2, p1, p2) or (k1, k2, p1, p2, k3), not {} numbers",
                    other.len()
                )));
            }
            (None, Some(other)) => {
                return Err(value_error(format!(
                    "fisheye is (k1, k2, k3, k4), not {} numbers",
                    other.len()
                )));
            }
        };
        checked([fx, fy, cx + shift, cy + shift], lens)
    }

    /// A camera, given by its calibration matrix K, 3 x 3: [[fx, 0, cx], [0, fy, cy], [0, 0, 1]].
    #[staticmethod]
    #[pyo3(signature = (matrix, distortion=None, fisheye=None, *, origin="center"))]
    fn from_matrix(
        matrix: &Bound<'_, PyAny>,
        distortion: Option<Bound<'_, PyAny>>,
        fisheye: Option<Bound<'_, PyAny>>,
        #[pyo3(from_py_with = text::origin)] origin: &str,
    ) -> PyResult<Self> {
        let k = matrix_3x3(matrix, "matrix")?;
        let geometry::Camera { fx, fy, cx, cy, .. } =
            geometry::Camera::from_matrix(&k).map_err(value_error)?;
        Self::new(fx, fy, cx, cy, distortion, fisheye, origin)
    }

    /// A camera, given by the name of its model in COLMAP and PoseLib: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL,
    /// OPENCV, FULL_OPENCV where k4, k5 and k6 are 0, SIMPLE_FISHEYE, FISHEYE, SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE or
    /// OPENCV_FISHEYE.
    #[staticmethod]
    #[pyo3(signature = (model, params, *, origin))]
    fn from_model(
        #[pyo3(from_py_with = text::model)] model: &str,
        params: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = text::origin)] origin: &str,
    ) -> PyResult<Self> {
        let params: Vec<f64> = few(params, "params", MOST_NUMBERS)?;
        let shift = Origin::parse(origin)?.shift();
        let given = camera_of_model(model, &params).map_err(value_error)?;
        let geometry::Camera { fx, fy, cx, cy, .. } = given;
        checked([fx, fy, cx + shift, cy + shift], given.distortion)
    }

    /// Focal length along x, in pixels.
    #[getter]
    fn fx(&self) -> f64 {
        self.inner.fx
    }

    /// Focal length along y, in pixels.
    #[getter]
    fn fy(&self) -> f64 {
        self.inner.fy
    }

    /// x of the principal point; the centre of the first pixel is at 0.
    #[getter]
    fn cx(&self) -> f64 {
        self.inner.cx
    }

    /// y of the principal point; the centre of the first pixel is at 0.
    #[getter]
    fn cy(&self) -> f64 {
        self.inner.cy
    }

    /// The calibration matrix, 3 x 3: [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]; `from_matrix` takes it back.
    #[getter(K)]
    fn calibration<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let geometry::Camera { fx, fy, cx, cy, .. } = self.inner;
        let rows = vec![fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0];
        matrix(py, rows, [3, 3])
    }

    /// Lens distortion (k1, k2, p1, p2, k3), as in OpenCV; None if there is none, and of a fisheye.
    #[getter]
    fn distortion(&self) -> Option<(f64, f64, f64, f64, f64)> {
        let lens = self.inner.distortion?.brown()?;
        Some((lens.k1, lens.k2, lens.p1, lens.p2, lens.k3))
    }

    /// Distortion of a fisheye (k1, k2, k3, k4), as in OpenCV; None if it is none.
    #[getter]
    fn fisheye(&self) -> Option<(f64, f64, f64, f64)> {
        match self.inner.distortion? {
            Lens::Fisheye(lens) => Some((lens.k1, lens.k2, lens.k3, lens.k4)),
            Lens::Brown(_) => None,
        }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let geometry::Camera { fx, fy, cx, cy, .. } = self.inner;
        let parts = (fx, fy, cx, cy, self.distortion(), self.fisheye());
        Ok((py.get_type::<Self>(), parts).into_pyobject(py)?.into_any())
    }

    /// Equal cameras have equal hashes, as tuples of their numbers do.
    fn __hash__(&self, py: Python<'_>) -> PyResult<isize> {
        let geometry::Camera { fx, fy, cx, cy, .. } = self.inner;
        (fx, fy, cx, cy, self.distortion(), self.fisheye())
            .into_pyobject(py)?
            .hash()
    }

    fn __repr__(&self) -> String {
        let geometry::Camera { fx, fy, cx, cy, .. } = self.inner;
        let fisheye = self.fisheye().map(|lens| format!(", fisheye={lens:?}"));
        let lens = self.distortion().map(|lens| format!(", {lens:?}"));
        let lens = lens.or(fisheye).unwrap_or_default();
        format!("Camera({fx}, {fy}, {cx}, {cy}{lens})")
    }
}

/// A camera as an argument. Many have their cameras as matrices.
impl<'py> FromPyObject<'_, 'py> for Camera {
    type Error = PyErr;

    fn extract(value: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(camera) = value.cast::<Self>() {
            return Ok(*camera.get());
        }
        Err(PyTypeError::new_err(format!(
            "a camera is a Camera, and this is {}; Camera.from_matrix(K) makes one of a calibration matrix",
            kind_of(&value)
        )))
    }
}

fn brown([k1, k2, p1, p2, k3]: [f64; 5]) -> Lens {
    Distortion { k1, k2, p1, p2, k3 }.into()
}

fn checked([fx, fy, cx, cy]: [f64; 4], distortion: Option<Lens>) -> PyResult<Camera> {
    let k = Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0);
    let pinhole = geometry::Camera::from_matrix(&k).map_err(value_error)?;
    let inner = geometry::Camera {
        distortion,
        ..pinhole
    };
    inner.check().map_err(value_error)?;
    Ok(Camera { inner })
}
