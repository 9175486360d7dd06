//! FAST: corners by the accelerated segment test.
//!
//! E. Rosten, T. Drummond: "Machine Learning for High-Speed Corner Detection", ECCV 2006;
//! E. Rosten, R. Porter, T. Drummond: "Faster and Better: A Machine Learning Approach to Corner
//! Detection", IEEE Transactions on Pattern Analysis and Machine Intelligence 32(1), 2010.
//!
//! # How it works
//! A pixel is a corner if nine neighbours in a row, on the circle of sixteen pixels around it (radius 3), are
//! all brighter than it by more than a threshold, or all darker (FAST-9). Its score is the largest threshold
//! for which that holds. Of corners that touch, only those with the larger score are kept (section 2.3 of the
//! first paper). The papers learn a decision tree that visits few of the sixteen pixels. Here 32 or 64 pixels
//! are tested side by side, with all sixteen neighbours of each, unless the four on the axes already exclude
//! all of these pixels.
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | t | [`FastParams::threshold`] | 10 | OpenCV |
//! | n | - | 9 | the second paper: the most repeatable |
//!
//! # Choices that the papers leave open
//! A corner must score higher than each of its eight neighbours: of two equal neighbours neither
//! is kept, and a corner of score 0 never is. The size of a keypoint is 7, the diameter of the
//! circle. These are OpenCV's choices; the corners and their order (row by row) are equal.

use nalgebra::Point2;

use super::{Detector, Keypoint};
use crate::image::GrayImage;
use crate::simd::{segment_scores, strict_maxima};

/// Parameters of [`Fast`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct FastParams {
    /// Nine neighbours must differ by more than this, in grey levels.
    pub threshold: u8,
}

impl Default for FastParams {
    fn default() -> Self {
        Self { threshold: 10 }
    }
}

/// The FAST-9 corner detector.
#[derive(Clone, Copy, Debug, Default)]
pub struct Fast {
    params: FastParams,
}

impl Fast {
    /// A detector with the given parameters.
    pub fn new(params: FastParams) -> Self {
        Self { params }
    }
}

impl Detector for Fast {
    fn detect(&self, image: &GrayImage) -> Vec<Keypoint> {
        let keypoint = |corner: Corner| Keypoint {
            at: Point2::new(corner.at[0] as f32, corner.at[1] as f32),
            size: 7.0,
            angle: None,
            response: f32::from(corner.score),
            octave: 0,
        };
        let corners = corners(image, self.params.threshold, 3);
        corners.into_iter().map(keypoint).collect()
    }
}

/// A corner at a whole pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Corner {
    /// Column and row.
    pub at: [u32; 2],
    /// The largest threshold for which it is a corner.
    pub score: u8,
}

/// The corners of `image` at least `margin` pixels from its border, row by row.
pub(crate) fn corners(image: &GrayImage, threshold: u8, margin: usize) -> Vec<Corner> {
    let (width, height) = (image.width(), image.height());
    let margin = margin.max(3);
    let mut corners = Vec::new();
    if width <= 2 * margin || height <= 2 * margin {
        return corners;
    }
    // Scores of three rows, those of row y at y % 3; of the columns that a corner's neighbours lie in, and
    // three more to each side, which have none.
    let (first, last) = (margin - 1, height - margin);
    let looked_at = first.saturating_sub(3)..width.min(width - first + 3);
    let mut scores = [(); 3].map(|()| vec![0; looked_at.len()]);
    let mut columns = Vec::new();
    for y in first..=last {
        let row = &mut scores[y % 3];
        if (3..height - 3).contains(&y) {
            let around = std::array::from_fn(|i| &image.row(y + i - 3)[looked_at.clone()]);
            segment_scores(around, threshold, row);
        } else {
            row.fill(0);
        }
        if y < first + 2 {
            continue;
        }
        let middle = y - 1;
        let rows = [middle - 1, middle, middle + 1].map(|y| &scores[y % 3][..]);
        columns.clear();
        strict_maxima(rows, &mut columns);
        let inside = columns.iter().map(|&x| (looked_at.start + x, rows[1][x]));
        let inside = inside.filter(|&(x, _)| margin <= x && x < width - margin);
        corners.extend(inside.map(|(x, score)| Corner {
            at: [x as u32, middle as u32],
            score,
        }));
    }
    corners
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Size;
    use crate::seed::Seed;

    /// A bright square whose corner pixels are brighter still: else each would tie with the next
    /// one on the diagonal.
    fn square(size: Size) -> GrayImage {
        let value = |v: usize| match v {
            10 | 19 => 2,
            11..19 => 1,
            _ => 0,
        };
        GrayImage::from_fn(size, |x, y| match value(x) * value(y) {
            0 => 50,
            4 => 210,
            _ => 200,
        })
    }

    #[test]
    fn a_square_has_four_corners() {
        let image = square(Size::new(30, 31));
        let keypoints = Fast::default().detect(&image);
        let found: Vec<_> = keypoints
            .iter()
            .map(|k| (k.at.x, k.at.y, k.response))
            .collect();
        let places = [(10.0, 10.0), (19.0, 10.0), (10.0, 19.0), (19.0, 19.0)];
        assert_eq!(found, places.map(|(x, y)| (x, y, 159.0)));
        let detect = |threshold| Fast::new(FastParams { threshold }).detect(&image).len();
        assert_eq!((detect(159), detect(160)), (4, 0));
    }

    #[test]
    fn the_margin_only_removes_corners() {
        let mut rng = Seed(3).rng();
        let noise = GrayImage::from_fn(Size::new(90, 50), |_, _| rng.below(256) as u8);
        let all = corners(&noise, 20, 3);
        for margin in [4, 7, 20, 24] {
            let inside = |corner: &&Corner| {
                let [x, y] = corner.at.map(|v| v as usize);
                (margin..90 - margin).contains(&x) && (margin..50 - margin).contains(&y)
            };
            let expected: Vec<Corner> = all.iter().filter(inside).copied().collect();
            assert_eq!(corners(&noise, 20, margin), expected);
        }
        assert!(all.len() > 50 && corners(&noise, 20, 25).is_empty());
    }

    #[test]
    fn images_too_small_or_flat_have_no_corners() {
        for (width, height) in [(0, 0), (0, 9), (1, 1), (6, 100), (100, 6), (7, 7)] {
            let size = Size::new(width, height);
            assert!(
                Fast::new(FastParams { threshold: 0 })
                    .detect(&GrayImage::filled(size, 9))
                    .is_empty()
            );
        }
        let mut dot = GrayImage::filled(Size::new(7, 7), 0);
        dot.set(3, 3, 255);
        assert_eq!(Fast::default().detect(&dot).len(), 1);
    }
}
