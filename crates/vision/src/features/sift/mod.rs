//! SIFT: blobs in scale space, described by histograms of gradient directions.
//!
//! D. G. Lowe: "Distinctive Image Features from Scale-Invariant Keypoints", International Journal
//! of Computer Vision 60(2), 91-110, 2004.
//!
//! 1. Scale space of the doubled image ([`ScaleSpaceShape`], section 3); differences of neighbouring
//!    layers, `D` (eq. 1).
//! 2. Extrema of `D` among 26 neighbours; position and scale by a quadratic fit (eq. 2, 3); those
//!    of low contrast or on edges are dropped (section 4).
//! 3. Directions: peaks of a histogram of 36 gradient directions around the keypoint, weighted by
//!    a Gaussian of 1.5 times its scale; one keypoint for each peak of at least 80 % of the
//!    highest (section 5).
//! 4. Descriptor: 4 x 4 histograms of 8 directions over a patch turned to that direction,
//!    trilinear, weighted by a Gaussian; normalised, clipped at 0.2, normalised (section 6).
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | s | `octave_layers` | 3 | section 3.2 |
//! | sigma | `sigma` | 1.6 | section 3.3 |
//! | contrast | `contrast_threshold` | 0.04 | OpenCV; divided by s. Lowe's 0.03 would be 0.09 |
//! | r | `edge_threshold` | 10 | section 4.1 |
//! | - | `double_image` | true | section 3.3 |
//! | - | `limit` | none | OpenCV's `nfeatures` = 0 |
//!
//! *Choices the paper leaves open* are those of OpenCV 4 with default arguments: which kernel
//! sizes, the border of 5 pixels, a candidate's `|D|` above half the contrast threshold (rounded
//! down in grey levels), at most 5 steps of the fit, smoothing of the direction histogram by
//! (1 4 6 4 1) / 16, cells 3 scales wide, gradients at whole pixels about the rounded position,
//! values times 512 rounded to integers 0..=255, keypoints sorted by position and duplicates
//! dropped.
//!
//! *Differences from OpenCV*: positions. Doubling the image moves pixel (x, y) to
//! (2 x + 1/2, 2 y + 1/2); OpenCV halves positions without taking that back, so its keypoints lie
//! 0.25 pixels too far right and down. Here a position is where the pixel centres say.
//! A fit that wanders more than 8 pixels from its extremum is dropped. The last digits of sums
//! differ.

mod descriptor;
mod extrema;
mod orientation;
mod passes;
mod patch;
mod places;

use nalgebra::Point2;

use super::strongest;
use super::{
    Describer, DescriptorKind, Descriptors, Detector, Extractor, Features, FloatRows, Keypoint,
    PIXELS_PER_FEATURE, memory_of_features, memory_of_pixels,
};
use crate::image::{GrayImage, LayerVisitor, Octave, ScaleSpaceShape, Size, columns_of_strips};
use crate::params::ParamError;
use extrema::Extremum;
use passes::Detection;

pub(super) use descriptor::{LENGTH, PatchDescriber, normalized};
pub(super) use orientation::Orientations;
pub(super) use places::BYTES_PER_PLACE;

/// Bytes for each pixel of the image, measured: bases of two octaves, one of them doubled.
const BYTES_PER_PIXEL: usize = 6;

/// Scales that an octave may have.
const MAX_SCALES: usize = 16;

/// Parameters of [`Sift`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct SiftParams {
    /// Keep the keypoints of strongest response, at most this many.
    pub limit: Option<usize>,
    /// Scales per octave, 1 to 16.
    pub octave_layers: usize,
    /// Least contrast times `octave_layers`, for grey values in 0..=1.
    pub contrast_threshold: f32,
    /// Largest ratio of the principal curvatures, above 1; finite.
    pub edge_threshold: f32,
    /// Blur of the first layer of each octave, in its pixels; 0.5 to 8.
    pub sigma: f64,
    /// Whether to start from the image at twice its resolution.
    pub double_image: bool,
}

impl Default for SiftParams {
    fn default() -> Self {
        Self {
            limit: None,
            octave_layers: 3,
            contrast_threshold: 0.04,
            edge_threshold: 10.0,
            sigma: 1.6,
            double_image: true,
        }
    }
}

/// The SIFT detector and describer.
///
/// `Keypoint::octave` is the number of the scale nearest to the keypoint: octave `o`, layer `l` is
/// `octave_layers * o + l`, where layers count from 1 and octave 0 has the pixels of the image.
/// Its blur is `sigma * 2^(octave / octave_layers)`. The size of a keypoint is twice its scale.
///
/// As a [`Describer`] it describes keypoints of any detector: one whose number does not agree with
/// its size is described at the scale nearest to its size, one without an angle gets the highest
/// peak of the direction histogram. Keypoints outside the image, or with a size below 1e-12
/// pixels, are removed.
#[derive(Clone, Debug)]
pub struct Sift {
    params: SiftParams,
}

impl Sift {
    /// A SIFT of these parameters.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn new(params: SiftParams) -> Result<Self, ParamError> {
        let SiftParams {
            octave_layers,
            contrast_threshold,
            edge_threshold,
            sigma,
            ..
        } = params;
        ParamError::unless(
            (1..=MAX_SCALES).contains(&octave_layers),
            "octave_layers",
            octave_layers,
            "1 to 16",
        )?;
        ParamError::unless(
            contrast_threshold >= 0.0 && contrast_threshold.is_finite(),
            "contrast_threshold",
            contrast_threshold,
            "at least 0",
        )?;
        ParamError::unless(
            edge_threshold > 1.0 && edge_threshold.is_finite(),
            "edge_threshold",
            edge_threshold,
            "above 1 and finite",
        )?;
        ParamError::unless((0.5..=8.0).contains(&sigma), "sigma", sigma, "0.5 to 8")?;
        Ok(Self { params })
    }

    /// What this SIFT was made with.
    pub fn params(&self) -> &SiftParams {
        &self.params
    }

    /// Keypoints in their order, and the descriptor of each if wanted.
    fn detect_on_the_way(&self, image: &GrayImage, described: bool) -> (Vec<Keypoint>, FloatRows) {
        let mut pass = Detection::new(self, described);
        self.shape().visit(image, &mut pass);
        let Detection {
            keypoints,
            descriptors,
            ..
        } = pass;
        let mut order = sorted_order(&keypoints);
        if let Some(limit) = self.params.limit {
            keep_strongest(&keypoints, &mut order, limit);
        }
        let mut data = Vec::new();
        if described {
            data.reserve_exact(LENGTH * order.len());
            data.extend(order.iter().flat_map(|&i| descriptors[i].map(f32::from)));
        }
        let keypoints = order.into_iter().map(|i| keypoints[i]).collect();
        (keypoints, FloatRows::from_vec(LENGTH, data))
    }

    /// About how many times as many features these parameters find as the default ones do; 1 where they find fewer.
    /// Measured on the wall of small patches of [`Extractor::memory`]: 2.4 with 8 layers, 6.1 with 16 (9.2 without a least
    /// contrast), 3.9 with a sigma of 0.5.
    fn crowding(&self) -> f64 {
        let default = SiftParams::default();
        let layers = self.params.octave_layers as f64 / default.octave_layers as f64;
        let finer = default.sigma / self.params.sigma;
        layers.max(1.0) * finer.max(1.0)
    }

    /// Bytes of the layers of a strip of the first octave: columns and rows within reach, and a quarter more rows for the
    /// blurs.
    fn memory_of_strip(&self, size: Size) -> usize {
        let Some(&octave) = self.shape().octaves(size).first() else {
            return 0;
        };
        let reach = Detection::new(self, true).reach(octave);
        let reach = reach.map_or(0, |reach| reach.described);
        let columns = octave.size.width.min(columns_of_strips() + 2 * reach);
        let rows = octave.size.height.min(5 * reach / 2);
        size_of::<f32>() * columns * rows * (self.params.octave_layers + 2)
    }

    pub(super) fn shape(&self) -> ScaleSpaceShape {
        ScaleSpaceShape {
            double: self.params.double_image,
            intervals: self.params.octave_layers,
            sigma: self.params.sigma,
            input_sigma: 0.5,
            smallest: 2 * extrema::BORDER + 1,
        }
    }

    /// How far pixel centres moved when the image was doubled, in pixels of the image.
    fn shift(&self) -> f32 {
        if self.params.double_image { 0.25 } else { 0.0 }
    }

    fn keypoint(&self, octave: i32, extremum: &Extremum) -> Keypoint {
        let spacing = spacing(octave);
        Keypoint {
            at: extremum.at.map(|v| v * spacing - self.shift()),
            size: 2.0 * extremum.scale * spacing,
            angle: None,
            response: extremum.response,
            octave: (self.params.octave_layers as i32 * octave + extremum.layer as i32) as i16,
        }
    }

    /// Position and scale of a keypoint in pixels of an octave.
    pub(super) fn in_octave(&self, keypoint: &Keypoint, octave: i32) -> (Point2<f32>, f32) {
        let spacing = spacing(octave);
        let at = keypoint.at.map(|v| (v + self.shift()) / spacing);
        (at, 0.5 * keypoint.size / spacing)
    }

    /// Index of the octave and number of the layer where a keypoint is described.
    fn level(&self, keypoint: &Keypoint, octaves: &[Octave]) -> (usize, usize) {
        let layers = self.params.octave_layers as i32;
        let by_size = layers as f32 * libm::log2f(0.5 * keypoint.size / self.params.sigma as f32);
        let number = f32::from(keypoint.octave);
        // The fit puts a keypoint within half a step of its layer, up to rounding.
        let agrees = (number - by_size).abs() < 0.501;
        let level = (if agrees { number } else { by_size.round() }) as i32;
        let finest = octaves[0].number;
        let coarsest = finest + octaves.len() as i32 - 1;
        let level = level.clamp(layers * finest + 1, layers * (coarsest + 1));
        let octave = (level - 1).div_euclid(layers);
        (
            (octave - finest) as usize,
            (level - layers * octave) as usize,
        )
    }
}

impl Detector for Sift {
    fn detect(&self, image: &GrayImage) -> Vec<Keypoint> {
        self.detect_on_the_way(image, false).0
    }

    fn memory(&self, size: Size) -> usize {
        Extractor::memory(self, size)
    }
}

impl Describer for Sift {
    fn kind(&self) -> DescriptorKind {
        DescriptorKind::Float { dim: LENGTH }
    }

    fn describe(&self, image: &GrayImage, keypoints: &mut Vec<Keypoint>) -> Descriptors {
        let is_describable = !self.shape().octaves(image.size()).is_empty();
        keypoints.retain(|keypoint| is_describable && keypoint.is_describable_in(image.size()));
        let (mut describer, mut orientations) =
            (PatchDescriber::default(), Orientations::default());
        let mut descriptors = vec![0.0; LENGTH * keypoints.len()];
        self.look_at(image, keypoints.clone(), |place| {
            let (layer, at, scale) = (place.layer, place.at, place.scale);
            let angle = *keypoints[place.index].angle.get_or_insert_with(|| {
                let pixel = [at.x, at.y].map(|v| v.round_ties_even().max(0.0) as usize);
                orientations.strongest(layer, pixel, scale)
            });
            let descriptor = describer.describe(layer, at, scale, angle);
            descriptors[LENGTH * place.index..][..LENGTH]
                .copy_from_slice(&descriptor.map(f32::from));
        });
        Descriptors::Float(FloatRows::from_vec(LENGTH, descriptors))
    }

    fn memory(&self, size: Size) -> usize {
        Extractor::memory(self, size)
    }
}

/// Keypoints are neither recalled nor remembered for other extractors: they are described while the
/// scale space passes by, so that nobody could say what finding them alone would have cost.
impl Extractor for Sift {
    fn kind(&self) -> DescriptorKind {
        DescriptorKind::Float { dim: LENGTH }
    }

    fn extract(&self, image: &GrayImage) -> Features {
        let (keypoints, descriptors) = self.detect_on_the_way(image, true);
        Features::new(image.size(), keypoints, Descriptors::Float(descriptors))
    }

    /// With twice as many features as the wall has, or with as many and a strip if that is more: beside a large image,
    /// whose features the first allows for, a strip is small.
    fn memory(&self, size: Size) -> usize {
        let features = size.area() / PIXELS_PER_FEATURE;
        let features = (self.crowding() * features as f64) as usize;
        let of_features = memory_of_features(features, Extractor::kind(self));
        let beside = of_features.max(of_features / 2 + self.memory_of_strip(size));
        memory_of_pixels(size, BYTES_PER_PIXEL) + beside
    }
}

/// Width of a pixel of an octave in pixels of the image.
fn spacing(octave: i32) -> f32 {
    libm::scalbnf(1.0, octave)
}

/// Indices of the keypoints: by column, then row, larger before smaller, then angle, and stronger
/// before weaker; of those that agree in place, size and angle the first alone.
fn sorted_order(keypoints: &[Keypoint]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..keypoints.len()).collect();
    order.sort_by(|&a, &b| {
        let (a, b) = (&keypoints[a], &keypoints[b]);
        let by_angle = |k: &Keypoint| k.angle.unwrap_or(0.0);
        (a.at.x.total_cmp(&b.at.x))
            .then(a.at.y.total_cmp(&b.at.y))
            .then(b.size.total_cmp(&a.size))
            .then(by_angle(a).total_cmp(&by_angle(b)))
            .then(b.response.total_cmp(&a.response))
            .then(b.octave.cmp(&a.octave))
    });
    order.dedup_by(|later, first| {
        let [later, first] = [&keypoints[*later], &keypoints[*first]];
        (later.at, later.size, later.angle) == (first.at, first.size, first.angle)
    });
    order
}

/// Removes all but the `limit` strongest from `order`, earlier ones first among equals, without
/// reordering.
fn keep_strongest(keypoints: &[Keypoint], order: &mut Vec<usize>, limit: usize) {
    let kept = strongest(order.len(), limit, |place| keypoints[order[place]].response);
    *order = kept.into_iter().map(|place| order[place]).collect();
}

#[cfg(test)]
mod tests;
