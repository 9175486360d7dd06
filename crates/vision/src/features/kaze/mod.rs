//! KAZE: blobs in a nonlinear scale space, described by sums of gradients.
//!
//! P. F. Alcantarilla, A. Bartoli, A. J. Davison: "KAZE Features", ECCV 2012.
//!
//! 1. Scale space (section 2.3): the image is blurred to sigma and evolves by nonlinear diffusion
//!    through S levels for each of O octaves, all at full resolution; level (o, s) has the scale
//!    `sigma 2^(o + s/S)` (eq. 5) and is reached at time `scale^2 / 2` (eq. 6). The contrast k,
//!    above which an edge stops diffusion, is the 70 % percentile of the gradients of the image.
//! 2. Maxima of the determinant of the Hessian, normalised for scale (eq. 8), above a threshold,
//!    among the 26 neighbours in place and level; of those near each other in neighbouring levels
//!    the strongest; position and scale by a quadratic fit (section 2.4, "feature detection").
//! 3. Orientation: the longest sum of Gaussian-weighted gradients within a window of 60 degrees
//!    that slides around the circle, as in SURF.
//! 4. M-SURF: 4 x 4 overlapping cells of 9 x 9 samples on a grid of 24 x 24 scales, turned. Each
//!    gives the Gaussian-weighted sums of the derivatives along both axes and of their absolute
//!    values; cells are weighted by a Gaussian and the 64 values normalised to unit length
//!    (section 2.4, "feature description").
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | - | [`KazeParams::threshold`] | 0.001 | OpenCV |
//! | O | [`KazeParams::octaves`] | 4 | section 3 |
//! | S | [`KazeParams::levels`] | 4 | section 3 |
//! | sigma | - | 1.6 | OpenCV |
//!
//! *Choices the paper leaves open* are those of OpenCV 4 with default arguments: which kernel
//! sizes; derivatives by Scharr's operator widened to the scale, rounded, of the level before its
//! diffusion, smoothed once more; a distance of three scales to the border; which of two maxima
//! survives (`extrema`); weights within a cell centred on its sixth sample of nine.
//!
//! *Difference from the paper*: the diffusion. The paper takes one semi-implicit step per level
//! (additive operator splitting, eq. 4); OpenCV, since 2014, and this take a cycle of fast
//! explicit diffusion, which follows the equation more closely. The results differ, so that one
//! of the two had to be chosen.
//!
//! *Differences from OpenCV*: last digits of sums, which in flat drawings can move the contrast by a bin of its histogram;
//! the order of keypoints, which is by level here.

mod descriptor;
mod extrema;

use nalgebra::Point2;

use super::{
    DescriptorKind, Descriptors, Detector, Extractor, Features, FloatRows, Keypoint, memory_of,
};
use crate::image::diffusion::{diffuse, fed_steps};
use crate::image::hessian::{Flat, LevelPass, LevelRows, contrast};
use crate::image::{FloatImage, GrayImage, RowBuffer, Size, gaussian_blur_within};
use crate::params::ParamError;
use descriptor::{Gradients, LENGTH};
use extrema::{Maximum, Strongest, find_maxima};

/// Bytes for each pixel of the image, measured: four levels with their derivatives.
const BYTES_PER_PIXEL: usize = 50;

/// Blur of the first level.
const SIGMA: f32 = 1.6;
/// Pixels that its kernel reaches to each side.
const SIGMA_RADIUS: usize = 4;
/// Share of the gradients that the contrast exceeds.
const CONTRAST_SHARE: f32 = 0.7;
/// Distance of keypoints to the border, in scales.
const MARGIN: f32 = 3.0;

/// Parameters of [`Kaze`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct KazeParams {
    /// Least determinant of the Hessian, normalised for scale, for grey values in 0..=1.
    pub threshold: f32,
    /// Number of octaves, 1 to 8.
    pub octaves: usize,
    /// Levels per octave, 1 to 16.
    pub levels: usize,
}

impl Default for KazeParams {
    fn default() -> Self {
        Self {
            threshold: 0.001,
            octaves: 4,
            levels: 4,
        }
    }
}

/// The KAZE detector and descriptor. `Keypoint::octave` is the number of the level, `levels` times
/// the octave and the level in it; the size of a keypoint is twice its scale.
#[derive(Clone, Debug)]
pub struct Kaze {
    params: KazeParams,
}

/// One level of the scale space, before it is made.
struct Level {
    /// In pixels.
    scale: f32,
    /// Steps of diffusion from the level before.
    diffusion: Vec<f32>,
}

impl Level {
    /// The scale in whole pixels: the step of derivatives, and how far maxima keep apart.
    fn step(&self) -> usize {
        self.scale.round_ties_even() as usize
    }
}

/// What is kept of a level as long as it is searched and described.
struct Planes {
    dx: FloatImage,
    dy: FloatImage,
    determinant: RowBuffer,
}

impl Planes {
    fn new(size: Size) -> Self {
        // Not one the copy of the other: memory that is new is zero without being written.
        let [dx, dy] = [(); 2].map(|()| FloatImage::filled(size, 0.0));
        Self {
            dx,
            dy,
            determinant: RowBuffer::whole(size),
        }
    }
}

/// Features in the making.
#[derive(Default)]
struct Found {
    keypoints: Vec<Keypoint>,
    /// Where descriptors are wanted.
    values: Option<Vec<f32>>,
}

impl Kaze {
    /// A KAZE of these parameters.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn new(params: KazeParams) -> Result<Self, ParamError> {
        let KazeParams {
            threshold,
            octaves,
            levels,
        } = params;
        ParamError::unless(
            threshold >= 0.0 && threshold.is_finite(),
            "threshold",
            threshold,
            "at least 0",
        )?;
        ParamError::unless((1..=8).contains(&octaves), "octaves", octaves, "1 to 8")?;
        ParamError::unless((1..=16).contains(&levels), "levels", levels, "1 to 16")?;
        Ok(Self { params })
    }

    /// What this KAZE was made with.
    pub fn params(&self) -> &KazeParams {
        &self.params
    }

    fn levels(&self) -> Vec<Level> {
        let per_octave = self.params.levels as f32;
        let mut time = 0.0;
        (0..self.params.octaves * self.params.levels)
            .map(|number| {
                let scale = SIGMA * libm::exp2f(number as f32 / per_octave);
                let before = std::mem::replace(&mut time, 0.5 * (scale * scale));
                Level {
                    scale,
                    diffusion: fed_steps(time - before),
                }
            })
            .collect()
    }

    /// Fills `found`.
    ///
    /// Only what is needed of the scale space exists at a time: the image of one level, which is
    /// diffused in place, and derivatives and determinants of three. A level is searched when the
    /// next has been made, and described when the next has been searched.
    fn run(&self, image: &GrayImage, mut found: Found) -> Found {
        let size = image.size();
        if size.area() == 0 {
            return found;
        }
        let levels = self.levels();
        let evolving = image.map(|&v| f32::from(v) / 255.0);
        let mut evolving = gaussian_blur_within(&evolving, SIGMA.into(), SIGMA_RADIUS);
        let contrast = contrast(&evolving, CONTRAST_SHARE, Flat::NoGradient);
        let mut conductivity = FloatImage::filled(size, 0.0);
        let mut strongest = Strongest::new(size);
        let mut planes: Vec<Planes> = Vec::with_capacity(3);
        for (number, level) in levels.iter().enumerate() {
            // Buffers of the level that is done with serve again.
            let mut new = if planes.len() == 3 {
                planes.remove(0)
            } else {
                Planes::new(size)
            };
            new.determinant.restart();
            let pass = LevelPass {
                smooth: true,
                step: level.step(),
                contrast: (number > 0).then_some(contrast),
            };
            let mut rows = LevelRows {
                conductivity: &mut conductivity,
                dx: &mut new.dx,
                dy: &mut new.dy,
                determinant: &mut new.determinant,
            };
            let mut maxima = Vec::new();
            pass.run(&evolving, &mut rows, |determinant| {
                // The level before has neighbours on both sides, as has the row before the last.
                let (Some(y), [.., below, middle]) =
                    (determinant.made().checked_sub(2), planes.as_slice())
                else {
                    return;
                };
                if y > 0 {
                    let determinants = [&below.determinant, &middle.determinant, determinant];
                    find_maxima(
                        determinants,
                        number - 1,
                        y,
                        self.params.threshold,
                        &mut maxima,
                    );
                }
            });
            planes.push(new);
            if number > 0 {
                diffuse(&mut evolving, &conductivity, &level.diffusion);
            }
            for maximum in maxima {
                let level = &levels[maximum.level];
                if is_inside(&maximum, level.scale, size) {
                    strongest.add(maximum, level.step());
                }
            }
            if number >= 2 {
                self.describe_level(number - 2, &strongest, &planes[0], &mut found);
            }
        }
        if let [.., last, _] = planes.as_slice() {
            self.describe_level(levels.len() - 2, &strongest, last, &mut found);
        }
        found
    }

    fn describe_level(
        &self,
        level: usize,
        strongest: &Strongest,
        planes: &Planes,
        found: &mut Found,
    ) {
        let gradients = Gradients {
            dx: &planes.dx,
            dy: &planes.dy,
        };
        for maximum in strongest.in_level(level) {
            let Some([dx, dy, dl]) = maximum.offset else {
                continue;
            };
            let at = [maximum.pixel[0] as f32 + dx, maximum.pixel[1] as f32 + dy];
            let exponent = (level as f32 + dl) / self.params.levels as f32;
            let scale = SIGMA * libm::exp2f(exponent);
            let step = scale.round_ties_even();
            let angle = gradients.orientation(at, step);
            found.keypoints.push(Keypoint {
                at: Point2::from(at),
                size: 2.0 * scale,
                angle: Some(angle),
                response: maximum.response,
                octave: level as i16,
            });
            if let Some(values) = &mut found.values {
                values.extend(gradients.describe(at, step, angle));
            }
        }
    }
}

/// Whether a maximum keeps its distance to the border.
fn is_inside(maximum: &Maximum, scale: f32, size: Size) -> bool {
    let within = |v: usize, length: usize| {
        let (v, margin) = (v as f32, MARGIN * scale);
        (v - margin).round_ties_even() >= 0.0 && (v + margin).round_ties_even() < length as f32
    };
    within(maximum.pixel[0], size.width) && within(maximum.pixel[1], size.height)
}

impl Detector for Kaze {
    fn detect(&self, image: &GrayImage) -> Vec<Keypoint> {
        self.run(image, Found::default()).keypoints
    }

    fn memory(&self, size: Size) -> usize {
        memory_of(size, BYTES_PER_PIXEL, Extractor::kind(self))
    }
}

impl Extractor for Kaze {
    fn kind(&self) -> DescriptorKind {
        DescriptorKind::Float { dim: LENGTH }
    }

    fn extract(&self, image: &GrayImage) -> Features {
        let with_values = Found {
            values: Some(Vec::new()),
            ..Found::default()
        };
        let Found { keypoints, values } = self.run(image, with_values);
        let rows = FloatRows::from_vec(LENGTH, values.unwrap_or_default());
        Features::new(image.size(), keypoints, Descriptors::Float(rows))
    }

    fn memory(&self, size: Size) -> usize {
        memory_of(size, BYTES_PER_PIXEL, self.kind())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::extractor_tests::{agreement, assert_odd_images_are_fine, blobs};

    fn kaze() -> Kaze {
        Kaze::new(KazeParams::default()).expect("the default is valid")
    }

    #[test]
    fn features_turn_with_the_image() {
        let upright = kaze().extract(&blobs(0.0));
        for (degrees, twins, distance) in [(90.0, 0.85, 0.1), (37.0, 0.7, 0.2)] {
            let turned = kaze().extract(&blobs(degrees));
            let (share, median) = agreement(&upright, &turned, degrees);
            assert!(share > twins, "{degrees} degrees: {share} have twins");
            assert!(median < distance, "{degrees} degrees: {median} differ");
        }
    }

    #[test]
    fn odd_images_are_fine() {
        assert!(assert_odd_images_are_fine(&kaze()) > 0);
        for (octaves, levels) in [(1, 1), (1, 2), (1, 3), (5, 2)] {
            let params = KazeParams {
                threshold: 0.0,
                octaves,
                levels,
            };
            assert_odd_images_are_fine(&Kaze::new(params).expect("within the ranges"));
        }
    }

    #[test]
    fn a_blob_is_found_where_it_is_at_its_scale() {
        let image = GrayImage::from_fn(Size::new(160, 150), |x, y| {
            let squared = (x as f64 - 80.3).powi(2) + (y as f64 - 70.8).powi(2);
            (20.0 + 200.0 * libm::exp(-0.5 * squared / 36.0)) as u8
        });
        let keypoints = kaze().detect(&image);
        assert_eq!(keypoints, kaze().extract(&image).keypoints);
        let strongest = keypoints
            .iter()
            .max_by(|a, b| a.response.total_cmp(&b.response))
            .expect("a blob is found");
        assert!((strongest.at.x - 80.3).abs() < 0.3, "{strongest:?}");
        assert!((strongest.at.y - 70.8).abs() < 0.3, "{strongest:?}");
        assert!(
            (3.0..9.0).contains(&(0.5 * strongest.size)),
            "{strongest:?}"
        );
    }

    #[test]
    fn levels_have_the_scales_of_the_paper() {
        let steps: Vec<usize> = kaze().levels().iter().map(Level::step).collect();
        assert_eq!(steps, [2, 2, 2, 3, 3, 4, 5, 5, 6, 8, 9, 11, 13, 15, 18, 22]);
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        let default = KazeParams::default();
        for params in [
            KazeParams {
                threshold: f32::INFINITY,
                ..default
            },
            KazeParams {
                octaves: 9,
                ..default
            },
            KazeParams {
                levels: 0,
                ..default
            },
        ] {
            assert!(Kaze::new(params).is_err(), "{params:?}");
        }
    }
}
