//! Datasets that are opened, imported or rendered; and images, decoded as in every command.

use std::path::PathBuf;

use matchbench::counted::counted;
use matchbench::datasets::{
    self, About, DatasetError, Frame, ImageStorage, ImportOptions, PairRule, Sequence, rendered,
};
use matchbench::run;
use matchbench_vision::image::{GrayImage, Size};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;

use crate::arrays::matrix;
use crate::camera::Camera;
use crate::detached::detached;
use crate::errors::{error, value_error};
use crate::integers::{index, whole, width_and_height};
use crate::pickled::{Reduced, by_method};

/// Images with known cameras, and pairs of them with their true relative pose. A pickle holds only the path of the
/// folder, which is opened again.
#[pyclass(frozen, module = "matchbench")]
pub(crate) struct Dataset {
    pub(crate) inner: run::Dataset,
}

impl Dataset {
    fn frame(&self, index: isize) -> PyResult<&Frame> {
        let frames = &self.inner.sequence.frames;
        let found = usize::try_from(index)
            .ok()
            .and_then(|index| frames.get(index));
        found.ok_or_else(|| PyIndexError::new_err(format!("frame {index} of {}", frames.len())))
    }
}

#[pymethods]
impl Dataset {
    /// The dataset in a folder of this project's layout; see `import_dataset` for others.
    #[staticmethod]
    fn open(py: Python<'_>, folder: PathBuf) -> PyResult<Self> {
        let inner = detached(py, || run::Dataset::open(&folder))?.map_err(error)?;
        Ok(Self { inner })
    }

    /// It is pickled as the path of its folder, which is opened again.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        by_method::<Self>(py, ("open", self.path()), None)
    }

    /// The name of the dataset.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.sequence.name
    }

    /// The folder of the dataset.
    #[getter]
    fn path(&self) -> PathBuf {
        self.inner.path.clone()
    }

    /// The image files, one for each frame.
    #[getter]
    fn images(&self) -> Vec<PathBuf> {
        let frames = self.inner.sequence.frames.iter();
        frames.map(|frame| frame.image.clone()).collect()
    }

    /// k x 2: frames a and b.
    #[getter]
    fn pairs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let pairs = &self.inner.sequence.pairs;
        let flat = pairs
            .iter()
            .flat_map(|pair| [pair.a, pair.b])
            .map(i64::from);
        matrix(py, flat.collect(), [pairs.len(), 2])
    }

    /// k x 4 x 4: the true poses; each takes a point from camera a to camera b. NaN if there is none.
    #[getter]
    fn b_from_a<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let pairs = &self.inner.sequence.pairs;
        let poses = pairs.iter().flat_map(|pair| {
            let pose = pair.pose().map(|pose| pose.to_homogeneous().transpose());
            pose.map_or_else(|| vec![f64::NAN; 16], |pose| pose.as_slice().to_vec())
        });
        matrix(py, poses.collect(), [pairs.len(), 4, 4])
    }

    /// k x 3 x 3: true homographies; each maps pixels of a to those of b. NaN if there is none.
    #[getter]
    fn homographies<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let pairs = &self.inner.sequence.pairs;
        let truths = pairs.iter().flat_map(|pair| {
            let truth = pair.homography().map(nalgebra::Matrix::transpose);
            truth.map_or_else(|| vec![f64::NAN; 9], |truth| truth.as_slice().to_vec())
        });
        matrix(py, truths.collect(), [pairs.len(), 3, 3])
    }

    /// The image of a frame, grey, as a matcher gets it in a run.
    fn read<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = index)] frame: isize,
    ) -> PyResult<Bound<'py, PyAny>> {
        let frame = self.frame(frame)?;
        pixels(py, &detached(py, || frame.pixels())?.map_err(error)?)
    }

    /// The camera of a frame.
    fn camera(&self, #[pyo3(from_py_with = index)] frame: isize) -> PyResult<Camera> {
        let inner = self.frame(frame)?.camera;
        Ok(Camera { inner })
    }

    fn __len__(&self) -> usize {
        self.inner.sequence.frames.len()
    }

    fn __repr__(&self) -> String {
        let run::Dataset { sequence, .. } = &self.inner;
        let frames = counted(sequence.frames.len(), "frame");
        let pairs = counted(sequence.pairs.len(), "pair");
        format!("Dataset({:?}, {frames}, {pairs})", sequence.name)
    }
}

/// Converts a folder in another layout to ours; returns the notes of the import.
#[pyfunction]
#[pyo3(signature = (kind, source, out, pairs, sequence, sensor, camera, poses, body_from_camera, tolerance, interpolate,
                    image_root, intrinsics, property, images))]
pub(crate) fn import_dataset(
    py: Python<'_>,
    kind: &str,
    source: PathBuf,
    out: PathBuf,
    pairs: Option<&str>,
    sequence: Option<String>,
    sensor: Option<String>,
    camera: Option<PathBuf>,
    poses: Option<PathBuf>,
    body_from_camera: Option<PathBuf>,
    tolerance: Option<f64>,
    interpolate: bool,
    image_root: Option<PathBuf>,
    intrinsics: Option<PathBuf>,
    property: Option<String>,
    images: &str,
) -> PyResult<Vec<String>> {
    let pairs = pairs.map(str::parse).transpose().map_err(value_error)?;
    let images = storage("images", images)?;
    let report = detached(py, || {
        let options = ImportOptions {
            sequence,
            sensor,
            pairs,
            camera,
            poses,
            body_from_camera,
            tolerance,
            interpolate,
            image_root,
            intrinsics,
            property,
            images,
        };
        datasets::import(kind, &source, &out, &options).map_err(error)
    })??;
    Ok(report.notes)
}

/// Where the images of a new dataset are stored, as the argument `name` says.
fn storage(name: &str, given: &str) -> PyResult<ImageStorage<'static>> {
    match given {
        "reference" => Ok(ImageStorage::Reference),
        "link" => Ok(ImageStorage::Link),
        "copy" => Ok(ImageStorage::Copy),
        _ => Err(value_error(format!(
            "{name} is \"reference\", \"link\" or \"copy\", not \"{given}\""
        ))),
    }
}

/// How a new dataset gets its pairs.
#[derive(FromPyObject)]
pub(crate) enum ChosenPairs {
    /// By a rule.
    Rule(String),
    /// The numbers of their frames.
    Listed(Vec<(u32, u32)>),
}

/// Writes a dataset of frames: the file of each image, its camera, and its pose, camera-to-world, as 4 x 4 numbers row
/// after row.
#[pyfunction]
#[pyo3(signature = (out, frames, pairs, origin, property, store))]
pub(crate) fn write_dataset(
    py: Python<'_>,
    out: PathBuf,
    frames: Vec<(PathBuf, Camera, [f64; 16])>,
    pairs: ChosenPairs,
    origin: String,
    property: String,
    store: &str,
) -> PyResult<()> {
    let images = storage("store", store)?;
    detached(py, || {
        let posed = frames.into_iter().enumerate();
        let posed = posed.map(|(index, (image, camera, rows))| {
            let pose = datasets::rigid_motion_4x4(&rows).map_err(|what| {
                value_error(format!("world_from_camera: matrix {index}: {what}"))
            })?;
            // A dataset may be written before its images are there, but is opened at once here.
            if !image.is_file() {
                let what = "there is no such file";
                return Err(error(DatasetError::new(image, what, "check the path")));
            }
            Ok(Frame::with_pose(image, camera.inner, pose))
        });
        let frames = posed.collect::<PyResult<Vec<_>>>()?;
        let (frames, pairs) = match pairs {
            ChosenPairs::Rule(rule) => {
                let rule: PairRule = rule.parse().map_err(value_error)?;
                rule.apply(frames).map_err(error)?
            }
            ChosenPairs::Listed(pairs) => {
                let pairs = datasets::pairs_of(&frames, pairs).map_err(value_error)?;
                (frames, pairs)
            }
        };
        if pairs.is_empty() {
            return Err(value_error(
                "pairs: there are none, so nothing would be matched",
            ));
        }
        let sequence = Sequence {
            name: String::new(), // that of the folder
            frames,
            pairs,
        };
        let about = About {
            origin,
            property,
            ..About::default()
        };
        datasets::write_native(&out, &sequence, &about, images).map_err(error)
    })?
}

fn size(value: &Bound<'_, PyAny>) -> PyResult<Option<(usize, usize)>> {
    let given = (!value.is_none()).then_some(value);
    given
        .map(|given| width_and_height(given, "size"))
        .transpose()
}

/// Renders a scene if it does not exist yet; returns the folder of its dataset.
#[pyfunction]
pub(crate) fn rendered_scene(
    py: Python<'_>,
    name: &str,
    cache: PathBuf,
    #[pyo3(from_py_with = whole)] frames: Option<u32>,
    #[pyo3(from_py_with = size)] size: Option<(usize, usize)>,
) -> PyResult<PathBuf> {
    let scenes = rendered::scenes();
    let scene = scenes.iter().find(|scene| scene.name == name);
    let mut scene = scene.cloned().ok_or_else(|| {
        let names: Vec<&str> = scenes.iter().map(|scene| scene.name).collect();
        value_error(format!(
            "no scene \"{name}\"; there are {}",
            names.join(", ")
        ))
    })?;
    let mut cache = cache;
    if let Some(frames) = frames {
        if !(2..=scene.frames).contains(&frames) {
            let most = scene.frames;
            return Err(value_error(format!(
                "{name} has 2 to {most} frames, not {frames}"
            )));
        }
        scene.frames = frames;
        cache.push(format!("frames-{frames}"));
    }
    if let Some((width, height)) = size {
        if !(16..=4096).contains(&width) || !(16..=4096).contains(&height) {
            return Err(value_error("a side of an image is 16 to 4096 pixels"));
        }
        scene.size = Size::new(width, height);
        cache.push(format!("{width}x{height}"));
    }
    let folders = detached(py, || rendered::ensure_scenes(&cache, &[scene], &|_| {}))?;
    Ok(folders.map_err(error)?.swap_remove(0))
}

/// The image in a file as height x width, grey, decoded as in every command.
#[pyfunction]
pub(crate) fn read_gray(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyAny>> {
    let image = detached(py, || datasets::read_gray(&path))?.map_err(error)?;
    pixels(py, &image)
}

/// The image as an array.
pub(crate) fn pixels<'py>(py: Python<'py>, image: &GrayImage) -> PyResult<Bound<'py, PyAny>> {
    let Size { width, height } = image.size();
    matrix(py, image.data().to_vec(), [height, width])
}

/// The planes of an image (grey, or red, green and blue) as an array, height x width x 3.
pub(crate) fn rgb_pixels<'py>(
    py: Python<'py>,
    planes: &[GrayImage],
) -> PyResult<Bound<'py, PyAny>> {
    let Size { width, height } = planes[0].size();
    let mut rgb = vec![0; 3 * width * height];
    for channel in 0..3 {
        let plane = planes.get(channel).unwrap_or(&planes[0]).data();
        for (value, pixel) in plane.iter().zip(rgb.chunks_exact_mut(3)) {
            pixel[channel] = *value;
        }
    }
    matrix(py, rgb, [height, width, 3])
}
