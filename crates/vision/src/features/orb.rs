//! ORB: FAST corners with an orientation, described by 256 comparisons of intensity.
//!
//! E. Rublee, V. Rabaud, K. Konolige, G. Bradski: "ORB: an efficient alternative to SIFT or SURF",
//! ICCV 2011.
//!
//! # How it works
//! 1. A pyramid: each level is the one before, made smaller by the scale factor.
//! 2. On each level FAST-9 corners; of twice the wanted number with the highest FAST score those
//!    with the highest Harris score are kept (section 3.1). The wanted number is shared out among
//!    the levels in proportion to the square root of their areas.
//! 3. The orientation is the direction from the keypoint to the centre of intensity of a circular
//!    patch of radius 15 (section 3.2, equations 1 to 3).
//! 4. The level is smoothed; bit i says whether one place in the patch is darker than another,
//!    both turned by the orientation (section 4.1). The 256 pairs of places were
//!    chosen in the paper by a greedy search for uncorrelated tests of high variance (section 4.3).
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | N | [`OrbParams::features`] | 100,000 | MatchBench |
//! | - | [`OrbParams::scale_factor`] | 1.2 | OpenCV; sqrt 2 in the paper, section 6 |
//! | - | [`OrbParams::levels`] | 8 | OpenCV; 5 in the paper |
//! | - | [`OrbParams::fast_threshold`] | 20 | OpenCV |
//! | n | - | 256 bits, patch 31 | section 4.3 |
//!
//! # Choices that the paper leaves open
//! All as OpenCV's `ORB_create`: Harris weight 0.04 in a window of 7 pixels, border of 31 pixels
//! on each level, a Gaussian of standard deviation 2 pixels instead of the paper's means of 5 x 5,
//! the angle by a polynomial, places turned continuously and rounded, instead of in steps of 12
//! degrees. The pairs are the ones of the authors, which the paper does not print; they were
//! measured (`tables/SOURCES.toml`).
//!
//! Positions on a level are multiplied by its scale `s`, as there. The levels are resampled so that pixel centres
//! correspond at `s (x + 1/2) - 1/2`, so keypoints of coarse levels lie `(s - 1) / 2` pixels too far left and up: 1.3
//! pixels on the eighth. The sides of a level are rounded, which adds up to `s / 2` pixels at the right and the lower border.
//!
//! # Differences from OpenCV
//! None in keypoints; one bit in a million, where sums in floating point round differently. Where
//! more corners are found than wanted, the ones that are kept stay in the order of rows (OpenCV
//! leaves the order in which its selection happens to end); all that tie with the last one are
//! kept, as there.

use nalgebra::Point2;

use super::fast::{Corner, corners};
use super::{
    BinaryRows, DescriptorKind, Descriptors, Extractor, Features, Keypoint, memory_of_features,
    memory_of_pixels,
};
use crate::image::{GrayImage, Size, gaussian_blur_u8_inside, resize};
use crate::params::ParamError;
use crate::simd::{
    PAIR_REACH, PairTable, Pixels, compare_pairs, directions, harris_strengths, intensity_moments,
};
use crate::tables::ORB_PAIRS;

/// Bytes for each pixel of the image, measured: scores and smaller images.
const BYTES_PER_PIXEL: usize = 2;

/// Pixels of the image for each of ORB's features on a wall of small patches, measured, where other extractors find one on
/// [so many](super::PIXELS_PER_FEATURE); 9 without a threshold.
const PIXELS_PER_CORNER: usize = 12;

/// Number of bits of a descriptor.
const BITS: usize = 256;
/// Width and height of the described patch, in pixels of the level.
const PATCH: f32 = 31.0;
/// Distance that keypoints keep from the border of their level, in pixels.
const MARGIN: usize = 31;

/// Parameters of [`Orb`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct OrbParams {
    /// Number of features wanted; a few more are kept if they tie with the last one.
    pub features: usize,
    /// Ratio of the sizes of neighbouring levels, above 1, at most 2.
    pub scale_factor: f32,
    /// Number of levels of the pyramid, the image itself included; 1 to 64.
    pub levels: usize,
    /// FAST threshold, in grey levels.
    pub fast_threshold: u8,
}

impl Default for OrbParams {
    fn default() -> Self {
        Self {
            features: 100_000,
            scale_factor: 1.2,
            levels: 8,
            fast_threshold: 20,
        }
    }
}

/// The ORB detector and descriptor. [`Keypoint::octave`] is the level, 0 for the image itself.
#[derive(Clone, Debug)]
pub struct Orb {
    params: OrbParams,
    pairs: PairTable,
}

impl Orb {
    /// An extractor with the given parameters.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn new(params: OrbParams) -> Result<Self, ParamError> {
        let OrbParams {
            scale_factor,
            levels,
            ..
        } = params;
        ParamError::unless(
            scale_factor > 1.0 && scale_factor <= 2.0,
            "scale_factor",
            scale_factor,
            "above 1, at most 2",
        )?;
        ParamError::unless((1..=64).contains(&levels), "levels", levels, "1 to 64")?;
        let rows = ORB_PAIRS.as_chunks::<4>().0;
        let column = |i: usize| std::array::from_fn(|bit| f32::from(rows[bit][i].cast_signed()));
        let pairs = PairTable {
            first: [column(0), column(1)],
            second: [column(2), column(3)],
        };
        Ok(Self { params, pairs })
    }

    /// What the descriptor compares, for each of its 256 bits: x and y of the first place and of the
    /// second, in pixels from the keypoint, upright.
    pub fn tests() -> impl ExactSizeIterator<Item = [i8; 4]> {
        let rows = ORB_PAIRS.as_chunks::<4>().0;
        rows.iter().map(|row| row.map(u8::cast_signed))
    }

    /// Ratio of lengths between the image and a level.
    fn scale(&self, level: usize) -> f32 {
        libm::pow(f64::from(self.params.scale_factor), level as f64) as f32
    }

    /// How many features each level may keep: shares that shrink by the scale factor.
    fn wanted(&self) -> Vec<usize> {
        let OrbParams {
            features,
            scale_factor,
            levels,
            ..
        } = self.params;
        let ratio = (1.0 / f64::from(scale_factor)) as f32;
        let total = 1.0 - libm::pow(f64::from(ratio), levels as f64) as f32;
        let mut share = features as f32 * (1.0 - ratio) / total;
        let mut wanted = Vec::with_capacity(levels);
        for _ in 1..levels {
            wanted.push(share.round_ties_even() as usize);
            share *= ratio;
        }
        let finer = wanted
            .iter()
            .fold(0, |sum: usize, &w| sum.saturating_add(w));
        wanted.push(features.saturating_sub(finer));
        wanted
    }

    /// Appends the features of one level. `smooth` is for the smoothed level.
    fn extract_level(
        &self,
        image: &GrayImage,
        level: usize,
        wanted: usize,
        keypoints: &mut Vec<Keypoint>,
        words: &mut Vec<u64>,
        smooth: &mut Vec<u8>,
    ) {
        let pixels = Pixels {
            data: image.data(),
            width: image.width(),
        };
        let mut corners = corners(image, self.params.fast_threshold, MARGIN);
        retain_best(&mut corners, wanted.saturating_mul(2), |corner| {
            f32::from(corner.score)
        });
        let centres: Vec<[u32; 2]> = corners.iter().map(|corner| corner.at).collect();
        let strengths = harris_strengths(pixels, &centres);
        let mut corners: Vec<(Corner, f32)> = corners.into_iter().zip(strengths).collect();
        retain_best(&mut corners, wanted, |corner| corner.1);
        if corners.is_empty() {
            return;
        }

        let centres: Vec<[u32; 2]> = corners.iter().map(|corner| corner.0.at).collect();
        let angles = directions(&intensity_moments(pixels, &centres));
        let scale = self.scale(level);
        keypoints.extend(
            corners
                .iter()
                .zip(&angles)
                .map(|((corner, strength), angle)| Keypoint {
                    at: Point2::from(corner.at.map(|v| v as f32)) * scale,
                    size: PATCH * scale,
                    angle: Some(*angle),
                    response: *strength,
                    octave: level as i16,
                }),
        );

        gaussian_blur_u8_inside(image, 3, 2.0, MARGIN - PAIR_REACH, smooth);
        let pixels = Pixels {
            data: smooth,
            width: image.width(),
        };
        let turns: Vec<[f32; 2]> = angles
            .iter()
            .map(|&angle| [libm::cosf(angle), libm::sinf(angle)])
            .collect();
        words.extend(compare_pairs(pixels, &centres, &turns, &self.pairs));
    }
}

impl Extractor for Orb {
    fn kind(&self) -> DescriptorKind {
        DescriptorKind::Binary { bits: BITS }
    }

    fn extract(&self, image: &GrayImage) -> Features {
        let mut keypoints = Vec::new();
        let mut words = Vec::new();
        let mut smooth = Vec::new();
        let mut smaller: Option<GrayImage> = None;
        for (level, wanted) in self.wanted().into_iter().enumerate() {
            if level > 0 {
                let size = scaled_size(image.size(), self.scale(level));
                smaller = Some(resize(smaller.as_ref().unwrap_or(image), size));
            }
            let image = smaller.as_ref().unwrap_or(image);
            if image.width() <= 2 * MARGIN || image.height() <= 2 * MARGIN {
                break;
            }
            self.extract_level(
                image,
                level,
                wanted,
                &mut keypoints,
                &mut words,
                &mut smooth,
            );
        }
        let descriptors = Descriptors::Binary(BinaryRows::from_vec(BITS, words));
        Features::new(image.size(), keypoints, descriptors)
    }

    fn memory(&self, size: Size) -> usize {
        let features = (self.params.features).min(size.area() / PIXELS_PER_CORNER);
        memory_of_pixels(size, BYTES_PER_PIXEL) + memory_of_features(features, self.kind())
    }
}

fn scaled_size(size: Size, scale: f32) -> Size {
    let scaled = |length: usize| (length as f32 * (1.0 / scale)).round_ties_even() as usize;
    Size::new(scaled(size.width), scaled(size.height))
}

/// Keeps the `count` items of highest value, and those that tie with the last of them, in order.
fn retain_best<T>(items: &mut Vec<T>, count: usize, value: impl Fn(&T) -> f32) {
    if count == 0 {
        items.clear();
    } else if items.len() > count {
        let mut values: Vec<f32> = items.iter().map(&value).collect();
        let (_, &mut last, _) = values.select_nth_unstable_by(count - 1, |a, b| b.total_cmp(a));
        items.retain(|item| value(item) >= last);
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::TAU;

    use super::*;
    use crate::seed::Seed;

    fn orb(features: usize, fast_threshold: u8) -> Orb {
        let params = OrbParams {
            features,
            fast_threshold,
            ..OrbParams::default()
        };
        Orb::new(params).expect("parameters in their ranges")
    }

    /// Blocks of 5 x 4 pixels in many shades.
    fn blocks() -> GrayImage {
        GrayImage::from_fn(Size::new(120, 110), |x, y| {
            let (x, y) = (x / 5, y / 4);
            ((37 * x + 101 * y) ^ (13 * x * y)) as u8
        })
    }

    #[test]
    fn bits_are_those_of_opencv() {
        // cv2.ORB_create(3, fastThreshold=20) of OpenCV 4.14.0 on the same pixels.
        let expected = [
            (
                [57.0, 65.0, 31.0, 209.162_38, 0.015_443_68],
                [
                    0xe8c3cb9ce14c2934,
                    0x13019d302a5b186,
                    0x3c5dab3a701b805a,
                    0xa2dc0bf455a189c9,
                ],
            ),
            (
                [52.800_003, 54.000_004, 37.2, 104.396_96, 0.012_121_117],
                [
                    0x1d254ea2ed91d150,
                    0x77e8b3d6604b3b2b,
                    0x1a95141203c5db6,
                    0x29857220b676b0b5,
                ],
            ),
        ];
        let features = orb(3, 20).extract(&blocks());
        let Descriptors::Binary(rows) = &features.descriptors else {
            panic!("ORB describes by bits");
        };
        assert_eq!(features.len(), expected.len());
        for (i, (numbers, bits)) in expected.iter().enumerate() {
            let k = features.keypoints[i];
            let angle = k.angle.expect("ORB assigns orientations").to_degrees();
            let found = [k.at.x, k.at.y, k.size, angle, k.response];
            for (found, number) in found.iter().zip(numbers) {
                assert!((found / number - 1.0).abs() < 1e-6, "{found}, not {number}");
            }
            assert_eq!((k.octave, rows.row(i)), (i as i16, &bits[..]));
        }
    }

    #[test]
    fn a_turned_image_has_turned_features() {
        let image = blocks();
        let (w, h) = (image.width(), image.height());
        let turned = GrayImage::from_fn(Size::new(h, w), |x, y| image.at(y, h - 1 - x));
        let params = OrbParams {
            levels: 1,
            ..OrbParams::default()
        };
        let orb = Orb::new(params).expect("parameters in their ranges");
        let (a, b) = (orb.extract(&image), orb.extract(&turned));
        assert_eq!((a.len(), b.len()), (17, 17));
        for (i, k) in a.keypoints.iter().enumerate() {
            let at = Point2::new((h - 1) as f32 - k.at.y, k.at.x);
            let j = b
                .keypoints
                .iter()
                .position(|k| k.at == at)
                .expect("a turned keypoint");
            let angle = |k: &Keypoint| k.angle.expect("ORB assigns orientations").to_degrees();
            let turn = (angle(&b.keypoints[j]) - angle(k)).rem_euclid(360.0);
            assert!((turn - 90.0).abs() < 0.03, "{turn}");
            let (Descriptors::Binary(a), Descriptors::Binary(b)) = (&a.descriptors, &b.descriptors)
            else {
                panic!("ORB describes by bits");
            };
            let differing: u32 = a
                .row(i)
                .iter()
                .zip(b.row(j))
                .map(|(a, b)| (a ^ b).count_ones())
                .sum();
            assert!(differing <= 12, "{differing} bits differ");
        }
    }

    #[test]
    fn images_too_small_or_flat_have_no_features() {
        for (width, height) in [(0, 0), (0, 70), (1, 1), (62, 500), (63, 63), (64, 80)] {
            for value in [0, 255] {
                let image = GrayImage::filled(Size::new(width, height), value);
                assert!(orb(1000, 0).extract(&image).is_empty());
            }
        }
        assert!(orb(0, 0).extract(&blocks()).is_empty());
    }

    /// Section 3.1: the Harris strength decides among twice as many corners as are wanted, and these have the highest FAST
    /// scores.
    #[test]
    fn the_strongest_by_harris_are_taken_among_twice_as_many_by_fast() {
        let image = blocks();
        let of_one_level = |features| {
            let params = OrbParams {
                features,
                levels: 1,
                ..OrbParams::default()
            };
            let orb = Orb::new(params).expect("parameters in their ranges");
            orb.extract(&image).keypoints
        };
        let all = of_one_level(100_000);
        let fast = corners(&image, 20, MARGIN);
        assert!(all.len() == 17 && fast.len() == 17);
        let mut differ = 0;
        for wanted in 1..9 {
            let mut order: Vec<usize> = (0..17).collect();
            order.sort_by_key(|&i| std::cmp::Reverse(fast[i].score));
            // No tie at either limit.
            let tie = |limit: usize| fast[order[limit - 1]].score == fast[order[limit]].score;
            if tie(2 * wanted) {
                continue;
            }
            let by_harris = |i: &usize, j: &usize| all[*j].response.total_cmp(&all[*i].response);
            let mut expected = order[..2 * wanted].to_vec();
            expected.sort_by(by_harris);
            expected.truncate(wanted);
            expected.sort_unstable();
            let expected: Vec<Keypoint> = expected.iter().map(|&i| all[i]).collect();
            assert_eq!(of_one_level(wanted), expected, "{wanted} wanted");
            order.sort_by(by_harris);
            order.truncate(wanted);
            order.sort_unstable();
            differ += usize::from(expected != order.iter().map(|&i| all[i]).collect::<Vec<_>>());
        }
        assert!(differ > 0, "the strongest of all by Harris would do");
    }

    #[test]
    fn keypoints_come_as_near_to_the_border_as_31_pixels() {
        let mut rng = Seed(2).rng();
        let mut of_first_level = |width, height| -> Vec<Keypoint> {
            let noise = GrayImage::from_fn(Size::new(width, height), |_, _| rng.below(256) as u8);
            let keypoints = orb(100_000, 0).extract(&noise).keypoints;
            keypoints.into_iter().filter(|k| k.octave == 0).collect()
        };
        let keypoints = of_first_level(230, 240);
        for (along, length) in [(0, 230.0), (1, 240.0)] {
            let places = || keypoints.iter().map(|k| k.at[along]);
            assert_eq!(places().fold(f32::MAX, f32::min), 31.0);
            assert_eq!(places().fold(0.0, f32::max), length - 32.0);
        }
        // One column or one row is left.
        let (narrow, low) = (of_first_level(63, 900), of_first_level(900, 63));
        assert!(!narrow.is_empty() && narrow.iter().all(|k| k.at.x == 31.0));
        assert!(!low.is_empty() && low.iter().all(|k| k.at.y == 31.0));
    }

    #[test]
    fn noise_yields_as_many_features_as_wanted() {
        let mut rng = Seed(1).rng();
        let noise = GrayImage::from_fn(Size::new(1800, 1800), |_, _| rng.below(256) as u8);
        let features = orb(200_000, 0).extract(&noise);
        // Ties with the last feature of a level are kept, and the highest levels have too few.
        assert!(
            (195_000..=200_100).contains(&features.len()),
            "{}",
            features.len()
        );
        assert_eq!(features, orb(200_000, 0).extract(&noise));
        for k in &features.keypoints {
            let angle = k.angle.expect("ORB assigns orientations");
            assert!((0.0..TAU).contains(&angle));
            let scale = k.size / PATCH;
            let inside = |v: f32| (31.0 * scale..1800.0 - 30.0 * scale).contains(&v);
            assert!(inside(k.at.x) && inside(k.at.y), "{k:?}");
        }
    }

    #[test]
    fn shares_of_the_levels_sum_to_the_wanted_number() {
        for features in [0, 1, 500, 10_000, 100_000] {
            let wanted = orb(features, 20).wanted();
            assert_eq!(wanted.len(), 8);
            assert_eq!(wanted.iter().sum::<usize>(), features);
        }
        assert_eq!(orb(500, 20).wanted(), [109, 90, 75, 63, 52, 44, 36, 31]);
    }

    #[test]
    fn ties_with_the_last_are_kept() {
        let mut items = vec![3, 1, 2, 5, 2, 2, 4];
        retain_best(&mut items, 4, |&item| item as f32);
        assert_eq!(items, [3, 2, 5, 2, 2, 4]);
        retain_best(&mut items, 9, |&item| item as f32);
        assert_eq!(items.len(), 6);
        retain_best(&mut items, 0, |&item| item as f32);
        assert!(items.is_empty());
    }

    #[test]
    fn parameters_out_of_range_are_refused() {
        let refused = |params| Orb::new(params).expect_err("refused").to_string();
        let params = OrbParams {
            scale_factor: 1.0,
            ..OrbParams::default()
        };
        assert_eq!(
            refused(params),
            "`scale_factor` is 1, but must be above 1, at most 2"
        );
        let params = OrbParams {
            levels: 0,
            ..OrbParams::default()
        };
        assert_eq!(refused(params), "`levels` is 0, but must be 1 to 64");
        let params = OrbParams {
            scale_factor: f32::NAN,
            ..OrbParams::default()
        };
        assert!(Orb::new(params).is_err());
    }

    #[test]
    fn any_number_of_features_may_be_wanted() {
        let squares = |x: usize, y: usize| {
            let noise = Seed(3).number(x as u64).number(y as u64).rng().below(20) as u8;
            noise + if x % 12 < 5 && y % 12 < 5 { 200 } else { 20 }
        };
        let image = GrayImage::from_fn(Size::new(150, 140), squares);
        let count = |features, levels| {
            let params = OrbParams {
                features,
                levels,
                ..OrbParams::default()
            };
            Orb::new(params).expect("in range").extract(&image).len()
        };
        assert!(count(100_000, 1) > 0);
        for levels in [1, 8] {
            assert_eq!(count(usize::MAX, levels), count(100_000, levels));
            assert_eq!(count(1 << 63, levels), count(100_000, levels));
        }
    }
}
