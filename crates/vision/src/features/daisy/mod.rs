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
//! The paper smooths all maps everywhere, and then reads only few pixels of them. Smoothing downwards and
//! smoothing sideways can be exchanged. So here maps are smoothed downwards where any keypoint needs them
//! (`columns`), and a histogram is one weighted sum along two neighbouring rows, whose weights hold all
//! smoothing sideways and the interpolation between pixels (`row_weights`). Each block of the image adds to the
//! histograms that reach into it and is forgotten. The positive parts in opposite directions differ by the
//! gradient itself, so four of the eight maps and the two of the gradient suffice. Except for rounding, the
//! result is the same.
//!
//! # Choices that the paper leaves open
//! All as OpenCV's `DAISY`: histograms are not normalised, and interpolated between pixels;
//! only the position of a keypoint is used, neither its size nor its orientation; Gaussians reach 2.5 standard
//! deviations; a histogram within two pixels of the right or lower border, or outside the image, is
//! 0.
//!
//! # Differences from OpenCV
//! Keypoints outside the image are dropped, where OpenCV throws.

mod columns;
mod row_weights;

use super::{Describer, DescriptorKind, Descriptors, FloatRows, Keypoint, memory_of};
use crate::image::{GaussianKernel, GrayImage, Size};
use crate::params::ParamError;
use crate::simd::{DAISY_COLUMNS as BLOCK, DAISY_MAPS as MAPS, add_between};
use columns::Columns;
use row_weights::RowWeights;

/// Bytes for each pixel of the image, measured: blurred gradients of a few columns.
const BYTES_PER_PIXEL: usize = 12;

/// Directions of a histogram.
const DIRECTIONS: usize = 8;
/// The values of all maps at one place.
type Histogram = [f32; DIRECTIONS];
/// Blur of the image before its gradients are taken, and how far it reaches, in pixels.
const FIRST_BLUR: (f64, usize) = (0.5, 2);
/// The blur that maps begin with, in pixels, that of the image included.
const BASE: f64 = 1.6;
/// Rows of the image that are worked on at once.
const BAND: usize = 192;

/// Parameters of [`Daisy`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
    /// What a step to the right and a step downwards count in the first four directions; the others
    /// are opposite to them.
    directions: [[f32; 2]; 4],
    /// Ring and offset from the keypoint of each histogram. The middle one is of the first ring.
    flower: Vec<(usize, [f64; 2])>,
    /// No histogram is further from its keypoint, in pixels.
    radius: f32,
}

/// Where a histogram is read: pixels around it, and how far beyond the upper left one it lies.
#[derive(Clone, Copy, Debug)]
struct HistogramSite {
    /// Position of the histogram among those of all keypoints.
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
        Ok(Self {
            kernels,
            directions: std::array::from_fn(|i| {
                let angle = std::f64::consts::TAU * i as f64 / DIRECTIONS as f64;
                [libm::cos(angle) as f32, libm::sin(angle) as f32]
            }),
            flower,
            radius: radius as f32 + 1.0,
        })
    }

    /// The histograms of a keypoint that lie in the image, and not at its right or lower border.
    fn places(
        &self,
        number: usize,
        keypoint: &Keypoint,
        size: Size,
    ) -> impl Iterator<Item = HistogramSite> {
        let at = [f64::from(keypoint.at.x), f64::from(keypoint.at.y)];
        let lengths = [size.width, size.height].map(|length| length as f64 - 2.0);
        let first = number * self.flower.len();
        let place = move |(i, &(ring, offset)): (usize, &(usize, [f64; 2]))| {
            let [x, y] = [at[0] + offset[0], at[1] + offset[1]];
            let inside = x >= 0.0 && y >= 0.0 && x < lengths[0] && y < lengths[1];
            let (column, row) = (x as usize, y as usize);
            inside.then(|| HistogramSite {
                index: first + i,
                ring,
                column,
                row,
                along: (x - column as f64) as f32,
                down: (y - row as f64) as f32,
            })
        };
        self.flower.iter().enumerate().filter_map(place)
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

    fn memory(&self, size: Size) -> usize {
        memory_of(size, BYTES_PER_PIXEL, self.kind())
    }
}

impl Daisy {
    /// Writes the histograms of all keypoints, one after the other, band by band.
    fn fill(&self, image: &GrayImage, keypoints: &[Keypoint], histograms: &mut [Histogram]) {
        let size = image.size();
        let mut columns = Columns::new(image, &self.directions, &self.kernels);
        let rings: Vec<RowWeights> = (2..=self.kernels.len())
            .map(|count| RowWeights::new(&self.kernels[..count], size.width))
            .collect();

        let mut order: Vec<usize> = (0..keypoints.len()).collect();
        let y = |i: usize| keypoints[i].at.y;
        order.sort_by(|&i, &j| y(i).total_cmp(&y(j)));
        // The places in a band of rows, and which of them reach into each block of it.
        let mut places = Vec::new();
        let mut blocks: Vec<Vec<usize>> = vec![Vec::new(); size.width.div_ceil(BLOCK)];
        for top in (0..size.height).step_by(BAND) {
            let band = top..top + BAND;
            let from = order.partition_point(|&i| y(i) < band.start as f32 - self.radius);
            let to = order.partition_point(|&i| y(i) < band.end as f32 + self.radius);
            places.clear();
            for &i in &order[from..to] {
                let all = self.places(i, &keypoints[i], size);
                places.extend(all.filter(|place| band.contains(&place.row)));
            }
            blocks.iter_mut().for_each(Vec::clear);
            for (i, place) in places.iter().enumerate() {
                let reach = rings[place.ring].columns_between(place.column);
                for block in &mut blocks[reach.start() / BLOCK..=reach.end() / BLOCK] {
                    block.push(i);
                }
            }
            for (block, left) in blocks.iter().zip((0..).step_by(BLOCK)) {
                let rows = block.iter().map(|&i| places[i].row);
                let (Some(first), Some(last)) = (rows.clone().min(), rows.max()) else {
                    continue;
                };
                columns.make(left, first..last + 2);
                for &i in block {
                    let place = &places[i];
                    let rows = columns.rows(place.ring + 2, place.row);
                    let weights = rings[place.ring].block(place.column, left);
                    let (sums, _) = histograms[place.index]
                        .split_first_chunk_mut()
                        .expect("6 of 8");
                    add_between(rows, place.down, weights, place.along, sums);
                }
            }
        }
        for histogram in histograms {
            self.complete(histogram);
        }
    }

    /// Makes a histogram of the sums over all maps.
    fn complete(&self, histogram: &mut Histogram) {
        let [_, _, _, _, dx, dy, ..] = *histogram;
        for (i, [right, down]) in self.directions.iter().enumerate() {
            histogram[i + 4] = (histogram[i] - (right * dx + down * dy)).max(0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;
    use crate::image::{FloatImage, gaussian_blur_within};
    use crate::seed::Seed;

    fn keypoint(x: f32, y: f32) -> Keypoint {
        Keypoint {
            at: Point2::new(x, y),
            size: 7.0,
            angle: Some(0.5),
            response: 1.0,
            octave: 0,
        }
    }

    fn describe(
        params: DaisyParams,
        image: &GrayImage,
        keypoints: &mut Vec<Keypoint>,
    ) -> Vec<Vec<f32>> {
        let daisy = Daisy::new(params).expect("the parameters are valid");
        let Descriptors::Float(rows) = daisy.describe(image, keypoints) else {
            panic!("DAISY describes by values");
        };
        (0..rows.len()).map(|i| rows.row(i).to_vec()).collect()
    }

    fn norm(values: &[f32]) -> f32 {
        values.iter().map(|v| v * v).sum::<f32>().sqrt()
    }

    #[test]
    fn values_are_those_of_opencv() {
        // cv2.xfeatures2d.DAISY_create() of OpenCV 4.14.0: three norms, and four histograms.
        let image = GrayImage::from_fn(Size::new(120, 110), |x, y| {
            let (x, y) = (x / 5, y / 4);
            ((37 * x + 101 * y) ^ (13 * x * y)) as u8
        });
        let mut keypoints = vec![
            keypoint(60.3, 50.75),
            keypoint(4.5, 103.25),
            keypoint(119.4, 0.2),
        ];
        let rows = describe(DaisyParams::default(), &image, &mut keypoints);
        for (row, expected) in rows.iter().zip([0.556_342_54, 0.393_720_54, 0.219_922_9]) {
            assert!(
                (norm(row) - expected).abs() < 1e-6,
                "{} {expected}",
                norm(row)
            );
        }
        let expected = [
            (
                0,
                0,
                [
                    0.02784369, 0.02965184, 0.02374281, 0.07073222, 0.08603623, 0.07015437,
                    0.02282951, 0.02893809,
                ],
            ),
            (
                0,
                14,
                [
                    0.04066606, 0.04134971, 0.0239257, 0.03611483, 0.03767598, 0.03630158,
                    0.01977665, 0.03529532,
                ],
            ),
            (
                1,
                0,
                [
                    0.007409296,
                    0.02290838,
                    0.03183669,
                    0.04057374,
                    0.03837025,
                    0.06303009,
                    0.0576164,
                    0.03691004,
                ],
            ),
            (
                1,
                24,
                [
                    0.02040812, 0.04134307, 0.04777498, 0.04230601, 0.02225213, 0.04302473,
                    0.04830919, 0.04137984,
                ],
            ),
        ];
        for (keypoint, histogram, expected) in expected {
            let found = &rows[keypoint][8 * histogram..][..8];
            for (found, expected) in found.iter().zip(expected) {
                assert!(
                    (found - expected).abs() < 1e-7,
                    "{found} {expected}, {histogram}"
                );
            }
        }
        // Above the image.
        assert_eq!(rows[2][8 * 23..8 * 24], [0.0; 8]);
    }

    /// The definition: every map smoothed everywhere, and read at each place.
    fn by_definition(daisy: &Daisy, image: &GrayImage, keypoint: &Keypoint) -> Vec<f32> {
        let Size { width, height } = image.size();
        let pixels = FloatImage::from_fn(image.size(), |x, y| f32::from(image.at(x, y)) / 255.0);
        let pixels = gaussian_blur_within(&pixels, FIRST_BLUR.0, FIRST_BLUR.1);
        let at = |x: usize, y: usize| pixels.at(x.clamp(1, width) - 1, y.clamp(1, height) - 1);
        let mut maps: Vec<FloatImage> = (0..DIRECTIONS)
            .map(|i| {
                let (sin, cos) = (i as f32 * std::f32::consts::TAU / 8.0).sin_cos();
                FloatImage::from_fn(image.size(), |x, y| {
                    let dx = at(x + 2, y + 1) - at(x, y + 1);
                    let dy = at(x + 1, y + 2) - at(x + 1, y);
                    (0.5 * (cos * dx + sin * dy)).max(0.0)
                })
            })
            .collect();
        let mut rings: Vec<Vec<FloatImage>> = Vec::new();
        for kernel in &daisy.kernels {
            let sigma = (2.0 * (kernel.taps()[kernel.radius()] / kernel.taps()[0]).ln()).sqrt();
            let sigma = kernel.radius() as f64 / f64::from(sigma);
            maps = (maps.iter())
                .map(|map| gaussian_blur_within(map, sigma, kernel.radius()))
                .collect();
            rings.push(maps.clone());
        }
        let mut values = Vec::new();
        for &(ring, [dx, dy]) in &daisy.flower {
            let (x, y) = (f64::from(keypoint.at.x) + dx, f64::from(keypoint.at.y) + dy);
            let inside = x >= 0.0 && y >= 0.0 && x < width as f64 - 2.0 && y < height as f64 - 2.0;
            for map in &rings[ring + 1] {
                values.push(if inside {
                    let (column, row) = (x as usize, y as usize);
                    let (along, down) = ((x - x.floor()) as f32, (y - y.floor()) as f32);
                    let between = |a: f32, b: f32, share: f32| a + share * (b - a);
                    let on = |row| between(map.at(column, row), map.at(column + 1, row), along);
                    between(on(row), on(row + 1), down)
                } else {
                    0.0
                });
            }
        }
        values
    }

    #[test]
    fn smoothing_only_what_is_read_changes_nothing() {
        let mut rng = Seed(5).rng();
        let small = DaisyParams {
            radius: 6.5,
            rings: 2,
            angles: 5,
        };
        // From less than a block to several bands.
        for (size, params) in [
            (Size::new(40, 300), DaisyParams::default()),
            (Size::new(85, 30), DaisyParams::default()),
            (Size::new(11, 9), DaisyParams::default()),
            (Size::new(60, 140), small),
        ] {
            let image = GrayImage::from_fn(size, |_, _| rng.below(256) as u8);
            let daisy = Daisy::new(params).expect("valid");
            let mut keypoints: Vec<Keypoint> = (0..12)
                .map(|_| {
                    let mut within = |length: usize| rng.below(8 * length as u32) as f32 / 8.0;
                    keypoint(within(size.width), within(size.height))
                })
                .collect();
            let rows = describe(params, &image, &mut keypoints);
            assert_eq!(rows.len(), keypoints.len());
            for (keypoint, row) in keypoints.iter().zip(rows) {
                let expected = by_definition(&daisy, &image, keypoint);
                assert_eq!(row.len(), expected.len());
                for (found, expected) in row.iter().zip(expected) {
                    assert!(
                        (found - expected).abs() < 2e-6,
                        "{found} {expected}, {size}"
                    );
                }
            }
        }
    }

    #[test]
    fn what_cannot_be_described_is_dropped() {
        let image = GrayImage::filled(Size::new(40, 30), 9);
        let mut keypoints = vec![
            keypoint(f32::NAN, 5.0),
            keypoint(5.0, f32::INFINITY),
            keypoint(-0.5, 5.0),
            keypoint(40.0, 5.0),
            keypoint(39.9, 29.9),
        ];
        let rows = describe(DaisyParams::default(), &image, &mut keypoints);
        assert_eq!((rows.len(), keypoints.len()), (1, 1));
        assert_eq!(rows[0], [0.0; 200]);
        let mut keypoints = vec![keypoint(0.0, 0.0)];
        let empty = GrayImage::filled(Size::new(0, 0), 0);
        assert!(describe(DaisyParams::default(), &empty, &mut keypoints).is_empty());
        assert!(describe(DaisyParams::default(), &image, &mut Vec::new()).is_empty());
        for (width, height) in [(1, 1), (2, 1), (1, 50), (3, 3)] {
            let image = GrayImage::filled(Size::new(width, height), 200);
            let mut keypoints = vec![keypoint(0.0, 0.0)];
            let rows = describe(DaisyParams::default(), &image, &mut keypoints);
            assert_eq!(rows, [vec![0.0; 200]], "{width} x {height}");
        }
    }

    #[test]
    fn many_keypoints_at_one_place_are_alike() {
        let image = GrayImage::from_fn(Size::new(50, 50), |x, y| (x * x + 3 * y) as u8);
        let mut keypoints = vec![keypoint(25.3, 24.0); 20_000];
        let rows = describe(DaisyParams::default(), &image, &mut keypoints);
        assert_eq!(rows.len(), 20_000);
        assert!(rows.iter().all(|row| *row == rows[0]));
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        let default = DaisyParams::default();
        let no_radius = DaisyParams {
            radius: f64::NAN,
            ..default
        };
        let no_rings = DaisyParams {
            rings: 0,
            ..default
        };
        let many_angles = DaisyParams {
            angles: 33,
            ..default
        };
        for (params, name) in [
            (no_radius, "radius"),
            (no_rings, "rings"),
            (many_angles, "angles"),
        ] {
            let error = Daisy::new(params).expect_err("out of range");
            assert!(error.to_string().contains(name), "{error}");
        }
    }
}
