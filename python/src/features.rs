//! The features of one image, as arrays.

use std::sync::Arc;

use matchbench::counted::counted;
use matchbench::external::{is_inside, wrong_angle, wrong_size};
use matchbench_vision::features::{self, DescriptorKind, Keypoint};
use matchbench_vision::image::Size;
use nalgebra::Point2;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyDict;

use crate::arrays::{
    all_finite, chosen, column, descriptors, descriptors_out, matrix, points, refused, rows,
};
use crate::camera::Origin;
use crate::detached::detached;
use crate::integers::{whole, width_and_height};
use crate::pickled::{Reduced, by_method};
use crate::text;

/// Keypoints of an image and their descriptors: row i of every array is feature i. The arrays are read-only; copy
/// one to change it.
#[pyclass(frozen, module = "matchbench")]
pub(crate) struct Features {
    pub(crate) inner: Arc<features::Features>,
    /// Each is made once, when it is first asked for. They are copies, and read-only: a change would not reach searches
    /// and selectors.
    arrays: [PyOnceLock<Py<PyAny>>; 7],
}

impl From<features::Features> for Features {
    fn from(inner: features::Features) -> Self {
        Arc::new(inner).into()
    }
}

impl From<Arc<features::Features>> for Features {
    fn from(inner: Arc<features::Features>) -> Self {
        Self {
            inner,
            arrays: std::array::from_fn(|_| PyOnceLock::new()),
        }
    }
}

impl Features {
    /// The array at `place` of the list; `make` makes it the first time.
    fn array<'py>(
        &self,
        py: Python<'py>,
        place: usize,
        make: impl FnOnce(&features::Features) -> PyResult<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let array = self.arrays[place].get_or_try_init(py, || {
            let array = make(&self.inner)?;
            let locked = PyDict::new(py);
            locked.set_item("write", false)?;
            array.call_method("setflags", (), Some(&locked))?;
            Ok::<_, PyErr>(array.unbind())
        })?;
        Ok(array.bind(py).clone())
    }

    fn column<'py, T: numpy::Element>(
        &self,
        py: Python<'py>,
        place: usize,
        value: impl Fn(&Keypoint) -> T,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, place, |inner| {
            let values = inner.keypoints.iter().map(value).collect();
            matrix(py, values, [inner.len()])
        })
    }
}

fn image_size(value: &Bound<'_, PyAny>) -> PyResult<(usize, usize)> {
    width_and_height(value, "image_size")
}

/// Refuses keypoints outside their image.
fn check_inside(keypoints: &[Keypoint], size: Size) -> PyResult<()> {
    let outside = |keypoint: &Keypoint| !is_inside(keypoint.at.x, keypoint.at.y, size);
    keypoints.iter().position(outside).map_or(Ok(()), |row| {
        Err(PyValueError::new_err(format!(
            "`keypoints` are x, y in pixels of the image; ({}, {}) in row {row} lies outside an image of {size}. \
             image_size is (width, height), and not shape, which is (height, width)",
            keypoints[row].at.x, keypoints[row].at.y
        )))
    })
}

/// Octaves as whole numbers.
fn octaves_of(octaves: &[f32]) -> PyResult<Vec<i16>> {
    if let Some(octave) = octaves.iter().find(|octave| octave.fract() != 0.0) {
        let message = format!("octaves: {octave}, which is no whole number");
        return Err(PyValueError::new_err(message));
    }
    let range = f32::from(i16::MIN)..=f32::from(i16::MAX);
    if let Some(row) = octaves.iter().position(|octave| !range.contains(octave)) {
        return Err(PyValueError::new_err(format!(
            "`octaves` are from -32768 to 32767; row {row} is {}. cv2's SIFT packs octave, layer and scale into \
             one number; take its lowest byte, by (octaves & 255).astype(numpy.int8)",
            octaves[row]
        )));
    }
    Ok(octaves.iter().map(|octave| *octave as i16).collect())
}

/// The 2 x 2 matrices of local affine frames, whose centres must be the keypoints.
fn frames_of(lafs: &Bound<'_, PyAny>, keypoints: &[Point2<f64>]) -> PyResult<Vec<[f32; 4]>> {
    let count = keypoints.len();
    let flat = lafs.call_method1("reshape", (count, 6));
    let flat = flat.map_err(|_| refused(lafs, "lafs", &format!("an array {count} x 2 x 3")))?;
    let lafs = rows(&flat, "lafs", 6)?;
    let centres = lafs.chunks(6).map(|l| [l[2], l[5]]);
    if let Some(row) = (centres.zip(keypoints)).position(|(centre, at)| !lies_at(centre, at)) {
        return Err(PyValueError::new_err(format!(
            "`lafs` have their centres at the keypoints; in row {row} it is ({}, {}), the keypoint is ({}, {})",
            lafs[6 * row + 2],
            lafs[6 * row + 5],
            keypoints[row].x,
            keypoints[row].y
        )));
    }
    Ok(lafs.chunks(6).map(|l| [l[0], l[1], l[3], l[4]]).collect())
}

/// Whether the centre of a local affine frame is at a keypoint, but for rounding to single precision.
fn lies_at(centre: [f32; 2], at: &Point2<f64>) -> bool {
    (centre.into_iter().zip([at.x, at.y])).all(|(centre, at)| {
        (f64::from(centre) - at).abs() <= 1e-3 + f64::from(f32::EPSILON) * at.abs()
    })
}

#[pymethods]
impl Features {
    /// Features from your own arrays: keypoints n x 2 (x, y in pixels), descriptors n x d (float32, or uint8 for
    /// bits), and width and height of the image, in which the keypoints lie. `bits` is the number of bits of a row of bytes that are used; default: all. Every
    /// number must be finite, except that an angle is NaN if there is none. Angles are radians, from -2 pi to 2 pi.
    /// Sizes must not be below 0. Octaves are whole numbers from -32768 to 32767. The centres of `lafs` are the keypoints.
    #[staticmethod]
    #[pyo3(signature = (keypoints, descriptors, image_size, *, sizes=None, angles=None, responses=None,
                        octaves=None, lafs=None, bits=None, origin="center"))]
    fn from_arrays(
        keypoints: &Bound<'_, PyAny>,
        descriptors: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = image_size)] image_size: (usize, usize),
        sizes: Option<Bound<'_, PyAny>>,
        angles: Option<Bound<'_, PyAny>>,
        responses: Option<Bound<'_, PyAny>>,
        octaves: Option<Bound<'_, PyAny>>,
        lafs: Option<Bound<'_, PyAny>>,
        #[pyo3(from_py_with = whole)] bits: Option<usize>,
        #[pyo3(from_py_with = text::origin)] origin: &str,
    ) -> PyResult<Self> {
        let shift = Origin::parse(origin)?.shift();
        let at = points(keypoints, "keypoints")?;
        let described = self::descriptors(descriptors, bits)?;
        if described.len() != at.len() {
            return Err(PyValueError::new_err(format!(
                "{} with {}; give one descriptor for each keypoint",
                counted(at.len(), "keypoint"),
                counted(described.len(), "descriptor")
            )));
        }
        let size = Size::new(image_size.0, image_size.1);
        if (size.width == 0 || size.height == 0) && !at.is_empty() {
            return Err(PyValueError::new_err(format!(
                "image_size: {size}, which has no place for keypoints; give width and height of the image"
            )));
        }
        let read = |value: Option<Bound<'_, PyAny>>, name, default: f32| match value {
            Some(value) => {
                let values = column(&value, name, at.len())?;
                // If the default is NaN, NaN means that there is no value.
                let allowed = |x: &f32| x.is_finite() || (x.is_nan() && default.is_nan());
                all_finite(name, values.iter().map(allowed))?;
                Ok::<_, PyErr>(values)
            }
            None => Ok(vec![default; at.len()]),
        };
        let (sizes, angles) = (
            read(sizes, "sizes", 1.0)?,
            read(angles, "angles", f32::NAN)?,
        );
        if let Some(wrong) = wrong_size(&sizes) {
            return Err(PyValueError::new_err(format!("`sizes` are {wrong}")));
        }
        if let Some(wrong) = wrong_angle(&angles) {
            return Err(PyValueError::new_err(format!("`angles`: {wrong}")));
        }
        let responses = read(responses, "responses", 0.0)?;
        let octaves = octaves_of(&read(octaves, "octaves", 0.0)?)?;
        let keypoints: Vec<_> = (0..at.len())
            .map(|i| Keypoint {
                at: [(at[i].x + shift) as f32, (at[i].y + shift) as f32].into(),
                size: sizes[i],
                angle: Some(angles[i]).filter(|angle| !angle.is_nan()),
                response: responses[i],
                octave: octaves[i],
            })
            .collect();
        // Positions that are too large for single precision.
        let finite = |k: &Keypoint| k.at.x.is_finite() && k.at.y.is_finite();
        all_finite("keypoints", keypoints.iter().map(finite))?;
        check_inside(&keypoints, size)?;
        let mut inner = features::Features::new(size, keypoints, described);
        if let Some(lafs) = lafs {
            inner = inner.with_frames(frames_of(&lafs, &at)?);
        }
        Ok(inner.into())
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let keywords = PyDict::new(py);
        keywords.set_item("sizes", self.sizes(py)?)?;
        keywords.set_item("angles", self.angles(py)?)?;
        keywords.set_item("responses", self.responses(py)?)?;
        keywords.set_item("octaves", self.octaves(py)?)?;
        // Without frames, the features are circles of these sizes.
        if self.inner.frames.is_some() {
            keywords.set_item("lafs", self.lafs(py)?)?;
        }
        keywords.set_item("bits", self.bits())?;
        let call = (
            "from_arrays",
            self.keypoints(py)?,
            self.descriptors(py)?,
            self.image_size(),
        );
        by_method::<Self>(py, call, Some(&keywords))
    }

    /// n x 2: x, y in pixels of the image; the centre of the first pixel is (0, 0).
    #[getter]
    fn keypoints<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, 0, |inner| {
            let values = inner.keypoints.iter().flat_map(|k| [k.at.x, k.at.y]);
            matrix(py, values.collect(), [inner.len(), 2])
        })
    }

    /// n: diameters of the described neighbourhoods, in pixels.
    #[getter]
    fn sizes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, 1, |keypoint| keypoint.size)
    }

    /// n: orientations in radians, from the x axis towards the y axis; NaN if there is none.
    #[getter]
    fn angles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, 2, |keypoint| keypoint.angle.unwrap_or(f32::NAN))
    }

    /// n: strength of the detector's response.
    #[getter]
    fn responses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, 3, |keypoint| keypoint.response)
    }

    /// n: pyramid levels, as the detector numbers them.
    #[getter]
    fn octaves<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.column(py, 4, |keypoint| i32::from(keypoint.octave))
    }

    /// n x 2 x 3: local affine frames in the form of kornia. Each maps the unit circle to the region that was
    /// described.
    #[getter]
    fn lafs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, 5, |inner| {
            let values = (0..inner.len()).flat_map(|i| {
                let ([xx, xy, yx, yy], at) = (inner.frame(i), inner.keypoints[i].at);
                [xx, xy, at.x, yx, yy, at.y]
            });
            matrix(py, values.collect(), [inner.len(), 2, 3])
        })
    }

    /// n x d: float32, or uint8 for bits (eight per byte, the least significant first).
    #[getter]
    fn descriptors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, 6, |inner| descriptors_out(py, &inner.descriptors))
    }

    /// Width and height of the image.
    #[getter]
    fn image_size(&self) -> (usize, usize) {
        (self.inner.size.width, self.inner.size.height)
    }

    /// Bits of a descriptor; None if it has real values.
    #[getter]
    fn bits(&self) -> Option<usize> {
        match self.inner.descriptors.kind() {
            DescriptorKind::Binary { bits } => Some(bits),
            DescriptorKind::Float { .. } => None,
        }
    }

    /// The features at these indices, in that order, or those for which a mask is true.
    fn select(&self, py: Python<'_>, indices: Bound<'_, PyAny>) -> PyResult<Self> {
        let inner = &self.inner;
        let indices = chosen(&indices, inner.len())?;
        detached(py, || {
            let keypoints = indices.iter().map(|&i| inner.keypoints[i]).collect();
            let descriptors = inner.descriptors.select(indices.iter().copied());
            let mut kept = features::Features::new(inner.size, keypoints, descriptors);
            if let Some(frames) = &inner.frames {
                kept = kept.with_frames(indices.iter().map(|&i| frames[i]).collect());
            }
            kept.into()
        })
    }

    /// A dict with LightGlue's keys: keypoints, descriptors, keypoint_scores, scales, oris, image_size; without its
    /// batch axis.
    #[pyo3(signature = (*, origin="center"))]
    fn to_dict<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = text::origin)] origin: &str,
    ) -> PyResult<Bound<'py, PyDict>> {
        let shift = Origin::parse(origin)?.shift() as f32;
        let keypoints = if shift == 0.0 {
            self.keypoints(py)?
        } else {
            let at = self.inner.keypoints.iter();
            let moved = at.flat_map(|k| [k.at.x - shift, k.at.y - shift]);
            matrix(py, moved.collect(), [self.inner.len(), 2])?
        };
        let dict = PyDict::new(py);
        dict.set_item("keypoints", keypoints)?;
        dict.set_item("descriptors", self.descriptors(py)?)?;
        dict.set_item("keypoint_scores", self.responses(py)?)?;
        dict.set_item("scales", self.sizes(py)?)?;
        dict.set_item("oris", self.angles(py)?)?;
        let size = vec![self.inner.size.width as f32, self.inner.size.height as f32];
        dict.set_item("image_size", matrix(py, size, [2])?)?;
        Ok(dict)
    }

    fn __len__(&self) -> usize {
        self.inner.len()
    }

    fn __repr__(&self) -> String {
        let kind = self.inner.descriptors.kind();
        let (count, size) = (self.inner.len(), self.inner.size);
        format!("Features({count} of an image of {size}, descriptors of {kind})")
    }
}
