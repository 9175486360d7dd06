//! DAISY: smoothed gradients at the petals of a flower.
//!
//! E. Tola, V. Lepetit, P. Fua: "DAISY: An Efficient Dense Descriptor Applied to Wide-Baseline
//! Stereo", IEEE Transactions on Pattern Analysis and Machine Intelligence 32(5), 2010.
//!
//! # How it works
//! 1. Eight maps hold, for each pixel, the positive part of the gradient in each of eight
//!    directions (section 3.2).
//! 2. Each map is smoothed by Gaussians that grow from ring to ring, each made from the one before
//!    (eq. 1). The eight values at a pixel are a histogram of the gradients about it.
//! 3. The descriptor is the histogram at the keypoint and those at eight places on each of three
//!    rings, from maps that are the smoother the farther the ring (eqs. 2 and 3, figure 6).
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | R | [`DaisyParams::radius`] | 15 | table 1; OpenCV |
//! | Q | [`DaisyParams::rings`] | 3 | table 1; OpenCV |
//! | T | [`DaisyParams::angles`] | 8 | table 1; OpenCV |
//! | H | - | 8 | table 1; OpenCV |
//!
//! # How it is computed
//! The paper smooths all maps everywhere, and reads few pixels of them. Smoothing downwards and
//! smoothing sideways can be exchanged, so here maps are smoothed downwards where any keypoint
//! needs them ([`columns`]), and a histogram is one weighted sum along two neighbouring rows, whose
//! weights hold all smoothing sideways and the interpolation between pixels ([`row_weights`]).
//! Besides rounding that is the same.
//!
//! # Choices that the paper leaves open
//! All as OpenCV's `DAISY`: histograms are not normalised, and interpolated between pixels;
//! keypoints lend their place alone, neither size nor orientation; Gaussians reach 2.5 standard
//! deviations; a histogram within two pixels of the right or lower border, or outside the image, is
//! 0.
//!
//! # Differences from OpenCV
//! Keypoints outside the image are dropped, where OpenCV throws.

mod columns;
mod row_weights;

use super::{Describer, DescriptorKind, Descriptors, FloatRows, Keypoint};
use crate::image::{FloatImage, GaussianKernel, GrayImage, Size, gaussian_blur_within};
use crate::params::ParamError;
use crate::simd::pool;
use columns::{Band, Columns, Histogram};
use row_weights::RowWeights;

/// Directions of a histogram.
const DIRECTIONS: usize = 8;
/// Blur of the image before its gradients are taken, and how far it reaches, in pixels.
const FIRST_BLUR: (f64, usize) = (0.5, 2);
/// The blur that maps begin with, in pixels, that of the image included.
const BASE: f64 = 1.6;
/// Rows that are described at once.
const BAND: usize = 128;

/// Parameters of [`Daisy`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct DaisyParams {
    /// Radius of the outermost ring in pixels, 1 to 100.
    pub radius: f64,
    /// Number of rings, 1 to 8.
    pub rings: usize,
    /// Histograms on each ring, 1 to 32.
    pub angles: usize,
}

impl Default for DaisyParams {
    fn default() -> Self {
        Self {
            radius: 15.0,
            rings: 3,
            angles: 8,
        }
    }
}

/// The DAISY descriptor. It drops keypoints outside the image.
#[derive(Clone, Debug)]
pub struct Daisy {
    /// What maps are smoothed with: the first blur, then that of each ring.
    kernels: Vec<GaussianKernel>,
    /// All smoothing up to each ring, sideways.
    weights: Vec<RowWeights>,
    /// Ring and offset from the keypoint of each histogram. The middle one is of the first ring.
    flower: Vec<(usize, [f64; 2])>,
}

/// Where a histogram is read: pixels around it, and how far beyond the upper left one it lies.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// Position of the histogram in the descriptor.
    index: usize,
    ring: usize,
    column: usize,
    row: usize,
    along: f32,
    down: f32,
}

impl Daisy {
    /// A describer with the given parameters.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn new(params: DaisyParams) -> Result<Self, ParamError> {
        let DaisyParams {
            radius,
            rings,
            angles,
        } = params;
        ParamError::unless(
            (1.0..=100.0).contains(&radius),
            "radius",
            radius,
            "1 to 100",
        )?;
        ParamError::unless((1..=8).contains(&rings), "rings", rings, "1 to 8")?;
        ParamError::unless((1..=32).contains(&angles), "angles", angles, "1 to 32")?;

        let step = radius / rings as f64;
        let mut kernels = vec![kernel((BASE * BASE - FIRST_BLUR.0 * FIRST_BLUR.0).sqrt())];
        let mut flower = vec![(0, [0.0; 2])];
        let mut last = 0.0;
        for ring in 0..rings {
            let sigma = (ring + 1) as f64 * step / 2.0;
            kernels.push(kernel((sigma * sigma - last * last).sqrt()));
            last = sigma;
            for i in 0..angles {
                let angle = std::f64::consts::TAU * i as f64 / angles as f64;
                let radius = (ring + 1) as f64 * step;
                let offset = [radius * libm::cos(angle), radius * libm::sin(angle)];
                flower.push((ring, offset));
            }
        }
        let weights = (0..rings)
            .map(|ring| RowWeights::new(&kernels[..ring + 2]))
            .collect();
        Ok(Self {
            kernels,
            weights,
            flower,
        })
    }

    /// The histograms of a keypoint that lie in the image, and not at its right or lower border.
    fn places(&self, keypoint: &Keypoint, size: Size) -> impl Iterator<Item = Place> {
        let at = [f64::from(keypoint.at.x), f64::from(keypoint.at.y)];
        let lengths = [size.width, size.height].map(|length| length as f64 - 2.0);
        let place = move |(index, &(ring, offset)): (usize, &(usize, [f64; 2]))| {
            let [x, y] = [at[0] + offset[0], at[1] + offset[1]];
            let inside = x >= 0.0 && y >= 0.0 && x < lengths[0] && y < lengths[1];
            inside.then(|| Place {
                index,
                ring,
                column: x as usize,
                row: y as usize,
                along: (x - x.floor()) as f32,
                down: (y - y.floor()) as f32,
            })
        };
        self.flower.iter().enumerate().filter_map(place)
    }

    /// Those of them that begin in the rows of `band`.
    fn places_in(
        &self,
        keypoint: &Keypoint,
        size: Size,
        band: usize,
    ) -> impl Iterator<Item = Place> {
        let places = self.places(keypoint, size);
        places.filter(move |place| place.row / BAND == band)
    }
}

/// A Gaussian with OpenCV's size for DAISY.
fn kernel(sigma: f64) -> GaussianKernel {
    GaussianKernel::with_radius(sigma, ((5.0 * sigma) as usize | 1).max(3) / 2)
}

impl Describer for Daisy {
    fn kind(&self) -> DescriptorKind {
        let dim = self.flower.len() * DIRECTIONS;
        DescriptorKind::Float { dim }
    }

    fn describe(&self, image: &GrayImage, keypoints: &mut Vec<Keypoint>) -> Descriptors {
        let size = image.size();
        keypoints.retain(|keypoint| {
            let inside = |v: f32, length: usize| v >= 0.0 && v < length as f32;
            inside(keypoint.at.x, size.width) && inside(keypoint.at.y, size.height)
        });
        let mut histograms = vec![[0.0; DIRECTIONS]; keypoints.len() * self.flower.len()];
        if !keypoints.is_empty() {
            self.fill(image, keypoints, &mut histograms);
        }
        let dim = self.flower.len() * DIRECTIONS;
        Descriptors::Float(FloatRows::from_vec(dim, histograms.into_flattened()))
    }
}

impl Daisy {
    /// Writes the histograms of all keypoints, one after the other, band by band.
    fn fill(&self, image: &GrayImage, keypoints: &[Keypoint], histograms: &mut [Histogram]) {
        let size = image.size();
        let (sigma, reach) = FIRST_BLUR;
        let pixels =
            FloatImage::from_vec(size, image.data().iter().copied().map(f32::from).collect());
        let blurred = gaussian_blur_within(&pixels, sigma, reach);
        drop(pixels);
        let mut columns = Columns::new(&blurred, &self.kernels);
        let mut band = Band::new(size, self.weights.len(), BAND);
        let mut weights = Vec::new();
        for index in 0..size.height.div_ceil(BAND) {
            band.restart(index * BAND);
            for keypoint in keypoints {
                for place in self.places_in(keypoint, size, index) {
                    let reach = self.weights[place.ring].columns(place.column, size.width);
                    band.need(reach, place.row);
                }
            }
            columns.fill(&mut band);
            for (keypoint, flower) in keypoints
                .iter()
                .zip(histograms.chunks_exact_mut(self.flower.len()))
            {
                for place in self.places_in(keypoint, size, index) {
                    let first = self.weights[place.ring].at(
                        place.column,
                        place.along,
                        size.width,
                        &mut weights,
                    );
                    let (map, start) = band.map(place.ring, place.row, first);
                    let rows = [1.0 - place.down, place.down];
                    flower[place.index] = pool(map, band.stride(), start, &weights, &rows);
                }
            }
        }
    }
}
