//! Matchers by name, whole or stage by stage.

use std::sync::Arc;

use matchbench::counted::counted;
use matchbench::external::Manifest;
use matchbench::matchers::{self, BuiltMatcher};
use matchbench::run::selection_seed;
use matchbench_vision::features::Features as Inner;
use matchbench_vision::geometry::MatchedPoints;
use matchbench_vision::image::GrayImage;
use matchbench_vision::matching::{MatcherError, View};
use matchbench_vision::seed::Seed;
use pyo3::prelude::*;
use pyo3::types::PyType;
use serde_json::Value;

use crate::arrays::{image, index_pairs, known_column, matrix};
use crate::camera::Camera;
use crate::correspondences::{Arrays, Found, found_arrays, of_arrays, same_kind};
use crate::detached::detached;
use crate::errors::{error, value_error};
use crate::estimators::matched;
use crate::features::Features;
use crate::integers::whole;
use crate::params::parse;
use crate::pickled::{Reduced, by_method};

/// A matcher of the library with its parameters, which are JSON; `matchbench.Matcher` is made of it.
#[pyclass(frozen, module = "matchbench._native")]
pub(crate) struct Matcher {
    built: BuiltMatcher,
    /// The parameters that were given, without those at their defaults.
    given: Value,
}

impl Matcher {
    /// Its name, and the parameters that were given: what a run needs, where a protocol may set the others.
    pub(crate) fn as_given(&self) -> (&str, &Value) {
        (&self.built.id, &self.given)
    }
}

fn build(id: &str, params: &Value) -> PyResult<BuiltMatcher> {
    if Manifest::is_path(id) {
        return Err(value_error(format!(
            "`{id}` is the path of a manifest, whose matcher is a process that a run starts; give the path itself to \
             `run` or `show`"
        )));
    }
    let entry = matchers::find(id).map_err(value_error)?;
    matchers::build(entry, Some(params)).map_err(value_error)
}

#[pymethods]
impl Matcher {
    #[new]
    fn new(id: &str, params: &str) -> PyResult<Self> {
        let given = parse(params)?;
        let built = build(id, &given)?;
        Ok(Self { built, given })
    }

    /// Its name in commands, records and tables.
    #[getter]
    fn id(&self) -> &str {
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

    /// The features of an image.
    fn extract(&self, py: Python<'_>, pixels: &Bound<'_, PyAny>) -> PyResult<Features> {
        let image = image(pixels)?;
        let found = detached(py, || self.built.matcher.extract(&image))?.map_err(error)?;
        Ok(found.into())
    }

    /// The putative matches of two images: indices, distances, distances to the second nearest, turns and growths. Where
    /// the matcher has a ratio test, features that fail it may have other neighbours than the two nearest.
    fn search<'py>(&self, py: Python<'py>, a: &Features, b: &Features) -> PyResult<Found<'py>> {
        same_kind(&a.inner, &b.inner)?;
        let found = detached(py, || self.built.matcher.search(&a.inner, &b.inner))?;
        found_arrays(py, &found.map_err(error)?, &a.inner, &b.inner)
    }

    /// The putative matches that the matcher keeps.
    #[pyo3(signature = (a, b, putative, images, cameras, seed))]
    fn select<'py>(
        &self,
        py: Python<'py>,
        a: &Features,
        b: &Features,
        putative: Arrays<'py>,
        images: Option<(Bound<'py, PyAny>, Bound<'py, PyAny>)>,
        cameras: Option<(Camera, Camera)>,
        #[pyo3(from_py_with = whole)] seed: u64,
    ) -> PyResult<Found<'py>> {
        same_kind(&a.inner, &b.inner)?;
        let putative = of_arrays(putative, &a.inner, &b.inner)?;
        let images = match &images {
            Some(given) => {
                let images = [image(&given.0)?, image(&given.1)?];
                of_features(&images, [&*a.inner, &*b.inner])?;
                Some(images)
            }
            None if self.built.matcher.uses_pixels() => {
                let message = format!("{} looks at the pixels; give images=(a, b)", self.built.id);
                return Err(value_error(message));
            }
            None => None,
        };
        let cameras = cameras.map(|(a, b)| [a.inner, b.inner]);
        let view = |features, side: usize| View {
            features,
            image: images.as_ref().map(|images| &images[side]),
            camera: cameras.as_ref().map(|cameras| &cameras[side]),
        };
        let kept = detached(py, || {
            let views = [view(&*a.inner, 0), view(&*b.inner, 1)];
            let seed = selection_seed(Seed(seed));
            self.built
                .matcher
                .select(views[0], views[1], putative, seed)
        })?;
        found_arrays(py, &kept.map_err(error)?, &a.inner, &b.inner)
    }

    /// Matched points of two images: all stages, one after the other.
    #[pyo3(name = "match_images", signature = (a, b, camera_a, camera_b, seed))]
    fn match_images(
        &self,
        py: Python<'_>,
        a: &Bound<'_, PyAny>,
        b: &Bound<'_, PyAny>,
        camera_a: Option<Camera>,
        camera_b: Option<Camera>,
        #[pyo3(from_py_with = whole)] seed: u64,
    ) -> PyResult<Matches> {
        let (image_a, image_b) = (image(a)?, image(b)?);
        let matched = detached(py, || {
            let matcher = &self.built.matcher;
            let features_a = matcher.extract(&image_a)?;
            let features_b = matcher.extract(&image_b)?;
            let putative = matcher.search(&features_a, &features_b)?;
            let view_a = View {
                features: &features_a,
                image: Some(&image_a),
                camera: camera_a.as_ref().map(|camera| &camera.inner),
            };
            let view_b = View {
                features: &features_b,
                image: Some(&image_b),
                camera: camera_b.as_ref().map(|camera| &camera.inner),
            };
            let seed = selection_seed(Seed(seed));
            let kept = matcher.select(view_a, view_b, putative, seed)?;
            Ok::<_, MatcherError>(Matches {
                points: matcher.place(view_a, view_b, &kept)?,
                indices: kept.iter().map(|m| [m.a, m.b].map(i64::from)).collect(),
                features: [features_a, features_b].map(Arc::new),
            })
        });
        matched?.map_err(error)
    }
}

/// Checks that the `images` of a and b are those of these `features`, by their sizes.
///
/// # Errors
/// If one has another size.
fn of_features(images: &[GrayImage; 2], features: [&Inner; 2]) -> PyResult<()> {
    for ((name, image), features) in ["a", "b"].iter().zip(images).zip(features) {
        if image.size() != features.size {
            return Err(value_error(format!(
                "images: image {name} is {}, but its features are of an image of {}; give the image that they were \
                 found in",
                image.size(),
                features.size
            )));
        }
    }
    Ok(())
}

/// Matched points of two images, and the features that they are made of.
#[pyclass(frozen, module = "matchbench")]
pub(crate) struct Matches {
    points: MatchedPoints,
    indices: Vec<[i64; 2]>,
    features: [Arc<Inner>; 2],
}

impl Matches {
    /// The matched points.
    pub(crate) fn points(&self) -> &MatchedPoints {
        &self.points
    }
}

#[pymethods]
impl Matches {
    /// Restores it from a pickle.
    #[staticmethod]
    fn _of_parts(
        points_a: &Bound<'_, PyAny>,
        points_b: &Bound<'_, PyAny>,
        ambiguity: Bound<'_, PyAny>,
        turns: Option<Bound<'_, PyAny>>,
        growths: Option<Bound<'_, PyAny>>,
        indices: &Bound<'_, PyAny>,
        features_a: &Features,
        features_b: &Features,
    ) -> PyResult<Self> {
        let points = matched(points_a, points_b, Some(ambiguity), turns, growths)?;
        let features = [features_a, features_b].map(|features| Arc::clone(&features.inner));
        let indices = index_pairs(indices, [features[0].len(), features[1].len()])?;
        if indices.len() != points.len() {
            let pairs = counted(indices.len(), "pair");
            let count = counted(points.len(), "match");
            return Err(value_error(format!("{pairs} of indices for {count}")));
        }
        Ok(Self {
            points,
            indices: indices
                .into_iter()
                .map(|pair| pair.map(i64::from))
                .collect(),
            features,
        })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        let points = (self.points_a(py)?, self.points_b(py)?);
        let ambiguity = self.ambiguity(py)?;
        let changes = (self.turns(py)?, self.growths(py)?);
        let indices = self.indices(py)?;
        let features = (self.features_a(), self.features_b());
        let call = (
            "_of_parts",
            points.0,
            points.1,
            ambiguity,
            changes.0,
            changes.1,
            indices,
            features.0,
            features.1,
        );
        by_method::<Self>(py, call, None)
    }

    /// m x 2, in pixels of image a.
    #[getter]
    fn points_a<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let values = self.points.a.iter().flat_map(|p| [p.x, p.y]);
        matrix(py, values.collect(), [self.points.len(), 2])
    }

    /// m x 2, in pixels of image b.
    #[getter]
    fn points_b<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let values = self.points.b.iter().flat_map(|p| [p.x, p.y]);
        matrix(py, values.collect(), [self.points.len(), 2])
    }

    /// m: from 0 (certain) to 1 (a second candidate is as good); above 1 where another candidate than the nearest was
    /// chosen (`gaim`).
    #[getter]
    fn ambiguity<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        matrix(py, self.points.ambiguity.clone(), [self.points.len()])
    }

    /// m: the angle by which the keypoint of b is turned relative to that of a, in radians from 0 to 2 pi; None if
    /// keypoints have no orientation.
    #[getter]
    fn turns<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        known_column(py, self.points.turns.as_ref())
    }

    /// m: the natural logarithm of how many times as large the keypoint of b is as that of a, in pixels of each image;
    /// None if sizes are not known.
    #[getter]
    fn growths<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        known_column(py, self.points.growths.as_ref())
    }

    /// m x 2: features of a and of b.
    #[getter]
    fn indices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let flat = self.indices.iter().flatten().copied().collect();
        matrix(py, flat, [self.indices.len(), 2])
    }

    /// The features of image a.
    #[getter]
    fn features_a(&self) -> Features {
        Arc::clone(&self.features[0]).into()
    }

    /// The features of image b.
    #[getter]
    fn features_b(&self) -> Features {
        Arc::clone(&self.features[1]).into()
    }

    fn __len__(&self) -> usize {
        self.points.len()
    }

    fn __repr__(&self) -> String {
        format!("Matches({})", self.points.len())
    }
}
