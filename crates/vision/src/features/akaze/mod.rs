//! AKAZE: blobs in a nonlinear scale space built by fast explicit diffusion, described by
//! comparisons of means and gradients of cells.
//!
//! P. F. Alcantarilla, J. Nuevo, A. Bartoli: "Fast Explicit Diffusion for Accelerated Features in
//! Nonlinear Scale Spaces", BMVC 2013.
//!
//! 1. Scale space (section 3.1): the image is blurred to sigma and evolves by nonlinear diffusion
//!    ([`crate::image`]) through S levels for each of O octaves; level (o, s) has the scale
//!    `sigma 2^(o + s/S)` (eq. 8) and is reached at time `scale^2 / 2` (eq. 9). Each octave has
//!    half the resolution. The contrast k, above which an edge stops diffusion, is the 70 %
//!    percentile of the gradients of the image; three quarters of it in each further octave.
//! 2. Maxima of the determinant of the Hessian, normalised for scale (eq. 10), above a threshold,
//!    that exceed all maxima near them in their own and both neighbouring levels; position by a
//!    quadratic fit in the level (section 3.2).
//! 3. Orientation: the longest sum of Gaussian-weighted gradients within a window of 60 degrees
//!    that slides around the circle, as in SURF.
//! 4. M-LDB (section 3.3): the patch of 20 steps of 1.5 scales, turned and sampled at these steps, is
//!    divided into 2 x 2, 3 x 3 and 4 x 4 cells; for each pair of cells of a grid three bits
//!    compare the means of intensity and of both derivatives.
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | - | [`AkazeParams::threshold`] | 0.001 | OpenCV |
//! | O | [`AkazeParams::octaves`] | 4 | section 4 |
//! | S | [`AkazeParams::levels`] | 4 | section 4 |
//! | sigma | - | 1.6 | OpenCV; KAZE, section 4 |
//!
//! *Choices the paper leaves open* are those of OpenCV 4 with default arguments: all 486 bits
//! and their order; derivatives by Scharr's operator widened to 1.5 scales, rounded, of the level
//! before its diffusion, smoothed once more; octaves of less than 80 x 40 pixels are not made;
//! times are not divided by the squared ratio of resolutions; the patch must lie within the
//! image; the rules of suppression (`candidates`).
//!
//! Octaves have whole numbers of pixels, and positions are multiplied by 2, 4 and 8, as there. Where a side of the image is
//! no multiple of these, keypoints of coarse octaves lie too far left or up, more so to the right or below: by up to 1, 3
//! and 7 pixels. Orientation and descriptor are read where the position in the image, over the step of the octave, points
//! to, as there: by a quarter to almost half a pixel of the octave right of the maximum and below it.
//!
//! *Differences from OpenCV*: last digits of sums. Corner pixels diffuse like all others. A sample
//! that rounding puts just outside the image is taken from its border, not left out.

mod candidates;
mod descriptor;

use nalgebra::Point2;

use super::{
    BinaryRows, DescriptorKind, Descriptors, Detector, Extractor, Features, Keypoint, memory_of,
};
use crate::image::diffusion::{diffuse, fed_steps};
use crate::image::hessian::{Flat, LevelPass, LevelRows, contrast};
use crate::image::{FloatImage, GrayImage, RowBuffer, Size, gaussian_blur_within, shrink};
use crate::params::ParamError;
use candidates::{Candidate, Candidates};
use descriptor::{BITS, Described, Orientations, describe};

/// Bytes for each pixel of the image, measured: levels with their derivatives.
const BYTES_PER_PIXEL: usize = 28;

/// Blur of the first level.
const SIGMA: f32 = 1.6;
/// Pixels that its kernel reaches to each side.
const SIGMA_RADIUS: usize = 4;
/// Step of derivatives and of samples, in scales.
const STEP: f32 = 1.5;
/// Half a diagonal of the described patch, in steps.
const REACH: f32 = 10.0 * core::f32::consts::SQRT_2;
/// Share of the gradients that the contrast exceeds.
const CONTRAST_SHARE: f32 = 0.7;
/// What the contrast is multiplied by for each further octave.
const CONTRAST_DECAY: f32 = 0.75;
/// Octaves of less width or height are not made, but for the first.
const SMALLEST: Size = Size::new(80, 40);

/// Parameters of [`Akaze`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct AkazeParams {
    /// Least determinant of the Hessian, normalised for scale, for grey values in 0..=1.
    pub threshold: f32,
    /// Largest number of octaves, 1 to 16.
    pub octaves: usize,
    /// Levels per octave, 1 to 16.
    pub levels: usize,
}

impl Default for AkazeParams {
    fn default() -> Self {
        Self {
            threshold: 0.001,
            octaves: 4,
            levels: 4,
        }
    }
}

/// The AKAZE detector and descriptor. `Keypoint::octave` is the number of the level, `levels` times
/// the octave and the level in it; its size is three scales, which is twice the step of derivatives.
#[derive(Clone, Debug)]
pub struct Akaze {
    params: AkazeParams,
    orientations: Orientations,
}

/// One level of the scale space, before it is made.
struct Level {
    size: Size,
    /// A pixel of this level is `ratio` pixels of the image.
    ratio: usize,
    /// In pixels of the image.
    scale: f32,
    /// In pixels of the level.
    step: usize,
    /// Steps of diffusion from the level before.
    diffusion: Vec<f32>,
}

/// Derivatives of a level.
struct Derivatives {
    dx: FloatImage,
    dy: FloatImage,
}

impl Derivatives {
    fn new(size: Size) -> Self {
        // Not one the copy of the other: memory that is new is zero without being written.
        let [dx, dy] = [(); 2].map(|()| FloatImage::filled(size, 0.0));
        Self { dx, dy }
    }
}

/// Features in the making.
#[derive(Default)]
struct Found {
    keypoints: Vec<Keypoint>,
    /// Where descriptors are wanted.
    words: Option<Vec<u64>>,
}

impl Akaze {
    /// An AKAZE of these parameters.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn new(params: AkazeParams) -> Result<Self, ParamError> {
        let AkazeParams {
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
        ParamError::unless((1..=16).contains(&octaves), "octaves", octaves, "1 to 16")?;
        ParamError::unless((1..=16).contains(&levels), "levels", levels, "1 to 16")?;
        let orientations = Orientations::new();
        Ok(Self {
            params,
            orientations,
        })
    }

    /// What this AKAZE was made with.
    pub fn params(&self) -> &AkazeParams {
        &self.params
    }

    fn levels(&self, size: Size) -> Vec<Level> {
        let mut levels: Vec<Level> = Vec::new();
        let mut time = 0.0;
        for octave in 0..self.params.octaves {
            let size = Size::new(size.width >> octave, size.height >> octave);
            if octave > 0 && (size.width < SMALLEST.width || size.height < SMALLEST.height) {
                break;
            }
            for level in 0..self.params.levels {
                let exponent = level as f32 / self.params.levels as f32 + octave as f32;
                let scale = SIGMA * libm::exp2f(exponent);
                let ratio = 1 << octave;
                let before = std::mem::replace(&mut time, 0.5 * (scale * scale));
                levels.push(Level {
                    size,
                    ratio,
                    scale,
                    step: (scale * STEP / ratio as f32).round_ties_even() as usize,
                    diffusion: fed_steps(time - before),
                });
            }
        }
        levels
    }

    /// Fills `found`.
    ///
    /// Only what is needed of the scale space exists at a time: the image of one level, which is
    /// diffused in place, and the derivatives of this one and the one before. A level is
    /// described when the next has been searched.
    fn run(&self, image: &GrayImage, mut found: Found) -> Found {
        let levels = self.levels(image.size());
        if image.size().area() == 0 {
            return found;
        }
        let mut evolving = image.map(|&v| f32::from(v) / 255.0);
        let mut contrast = contrast(&evolving, CONTRAST_SHARE, Flat::LowestBin);
        evolving = gaussian_blur_within(&evolving, SIGMA.into(), SIGMA_RADIUS);

        let mut candidates: Vec<Candidates> = Vec::new();
        let mut conductivity = FloatImage::filled(image.size(), 0.0);
        let mut derivatives = Derivatives::new(image.size());
        let mut derivatives_before = Derivatives::new(image.size());
        for (number, level) in levels.iter().enumerate() {
            if number > 0 {
                std::mem::swap(&mut derivatives, &mut derivatives_before);
            }
            let mut smaller = None;
            if level.size != evolving.size() {
                smaller = Some(shrink(&evolving, level.size));
                contrast *= CONTRAST_DECAY;
                conductivity = FloatImage::filled(level.size, 0.0);
            }
            if level.size != derivatives.dx.size() {
                derivatives = Derivatives::new(level.size);
            }
            let input = smaller.as_ref().unwrap_or(&evolving);
            let pass = LevelPass {
                smooth: number > 0,
                step: level.step,
                contrast: (number > 0).then_some(contrast),
            };
            candidates.push(self.search(level, pass, input, &mut conductivity, &mut derivatives));
            if number > 0 {
                let [.., finer, coarser] = candidates.as_mut_slice() else {
                    unreachable!("two levels were searched");
                };
                finer.suppress_by_next(coarser, level.ratio / levels[number - 1].ratio);
                let planes = (&evolving, &derivatives_before);
                self.finish(
                    &levels[..number],
                    &mut candidates[..number],
                    planes,
                    &mut found,
                );
                evolving = smaller.unwrap_or(evolving);
                diffuse(&mut evolving, &conductivity, &level.diffusion);
            }
        }
        self.finish(
            &levels,
            &mut candidates,
            (&evolving, &derivatives),
            &mut found,
        );
        found
    }

    /// Makes the derivatives of a level and looks for candidates.
    fn search(
        &self,
        level: &Level,
        pass: LevelPass,
        image: &FloatImage,
        conductivity: &mut FloatImage,
        derivatives: &mut Derivatives,
    ) -> Candidates {
        let border = (REACH * level.step as f32).round_ties_even() as usize + 1;
        let mut candidates = Candidates::new(level.step);
        let mut determinant = RowBuffer::new(level.size, 3);
        let mut rows = LevelRows {
            conductivity,
            dx: &mut derivatives.dx,
            dy: &mut derivatives.dy,
            determinant: &mut determinant,
        };
        pass.run(image, &mut rows, |determinant| {
            // The row before the last one has neighbours on both sides.
            let y = determinant.made().saturating_sub(2);
            if y >= border && y + border < level.size.height {
                candidates.search(determinant, y, border, self.params.threshold);
            }
        });
        candidates
    }

    /// Decides about the candidates of the last of these levels, and describes what remains.
    fn finish(
        &self,
        levels: &[Level],
        candidates: &mut [Candidates],
        (image, derivatives): (&FloatImage, &Derivatives),
        found: &mut Found,
    ) {
        let number = levels.len() - 1;
        let level = &levels[number];
        let (finer, last) = candidates.split_at_mut(number);
        if let Some(finer) = finer.last() {
            last[0].suppress_by_previous(finer, level.ratio / levels[number - 1].ratio);
        }
        let described = Described {
            image,
            dx: &derivatives.dx,
            dy: &derivatives.dy,
            step: level.step,
        };
        for candidate in last[0].survivors() {
            let at = level.place(candidate);
            let in_level = at.map(|v| v / level.ratio as f32);
            let angle = self.orientations.dominant(described, in_level);
            found.keypoints.push(Keypoint {
                at: Point2::from(at),
                size: 2.0 * STEP * level.scale,
                angle: Some(angle),
                response: candidate.response,
                octave: number as i16,
            });
            if let Some(words) = &mut found.words {
                words.extend(describe(described, in_level, angle));
            }
        }
    }
}

impl Level {
    /// Position of a candidate in pixels of the image.
    fn place(&self, candidate: &Candidate) -> [f32; 2] {
        let ratio = self.ratio as f32;
        let [x, y] = candidate
            .pixel
            .map(|v| v as f32 * ratio + 0.5 * (ratio - 1.0));
        let [dx, dy] = candidate.offset.map(|v| v * ratio);
        [x + dx, y + dy]
    }
}

impl Detector for Akaze {
    fn detect(&self, image: &GrayImage) -> Vec<Keypoint> {
        self.run(image, Found::default()).keypoints
    }

    fn memory(&self, size: Size) -> usize {
        memory_of(size, BYTES_PER_PIXEL, Extractor::kind(self))
    }
}

impl Extractor for Akaze {
    fn kind(&self) -> DescriptorKind {
        DescriptorKind::Binary { bits: BITS }
    }

    fn extract(&self, image: &GrayImage) -> Features {
        let with_words = Found {
            words: Some(Vec::new()),
            ..Found::default()
        };
        let Found { keypoints, words } = self.run(image, with_words);
        let rows = BinaryRows::from_vec(BITS, words.unwrap_or_default());
        Features::new(image.size(), keypoints, Descriptors::Binary(rows))
    }

    fn memory(&self, size: Size) -> usize {
        memory_of(size, BYTES_PER_PIXEL, self.kind())
    }
}

#[cfg(test)]
mod tests;
