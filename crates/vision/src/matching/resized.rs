//! A matcher that looks at smaller images: its features are found there, and are in pixels of the original.
//!
//! The size of the images moves scores as much as the matcher does, so it has to be the same for matchers
//! that are compared. Pixels of the smaller image are means of areas ([`shrink_u8`]), by halves where it
//! is much smaller; a point at `x` lies at `(x + 1/2) s - 1/2` of the original, `s` the ratio of the sizes.

use super::{Correspondences, Matcher, MatcherError, View};
use crate::features::{Detections, Features};
use crate::image::{GrayImage, Size, shrink_u8};
use crate::params::ParamError;
use crate::seed::Seed;

/// A matcher whose features are found in images of at most `max_size`.
pub struct Resized {
    matcher: Box<dyn Matcher>,
    max_size: usize,
}

impl Resized {
    /// A `matcher` for images that are at most `max_size` pixels wide and high.
    ///
    /// # Errors
    /// Unless `max_size` is at least 16.
    pub fn new(matcher: Box<dyn Matcher>, max_size: usize) -> Result<Self, ParamError> {
        ParamError::unless(max_size >= 16, "max_size", max_size, "at least 16")?;
        Ok(Self { matcher, max_size })
    }

    /// The size that an image of `size` is looked at in: its own, if that is small enough.
    fn size_for(&self, size: Size) -> Size {
        let long = size.width.max(size.height);
        if long <= self.max_size {
            return size;
        }
        let factor = self.max_size as f64 / long as f64;
        let length = |length: usize| ((length as f64 * factor).round() as usize).max(1);
        Size::new(length(size.width), length(size.height))
    }

    fn shrink(&self, image: &GrayImage) -> GrayImage {
        let target = self.size_for(image.size());
        let mut small = image.clone();
        while small.size() != target {
            let length = |now: usize, then: usize| then.max(now.div_ceil(2));
            let next = Size::new(
                length(small.width(), target.width),
                length(small.height(), target.height),
            );
            small = shrink_u8(&small, next);
        }
        small
    }
}

impl Matcher for Resized {
    fn extract(&self, image: &GrayImage) -> Result<Features, MatcherError> {
        let small = self.shrink(image);
        let features = self.matcher.extract(&small)?;
        Ok(features.in_pixels_of(small.size(), image.size()))
    }

    fn extract_sharing(
        &self,
        image: &GrayImage,
        detections: &mut dyn Detections,
    ) -> Result<Features, MatcherError> {
        let small = self.shrink(image);
        let features = self.matcher.extract_sharing(&small, detections)?;
        Ok(features.in_pixels_of(small.size(), image.size()))
    }

    fn search(&self, a: &Features, b: &Features) -> Result<Correspondences, MatcherError> {
        self.matcher.search(a, b)
    }

    fn select(
        &self,
        a: View<'_>,
        b: View<'_>,
        putative: Correspondences,
        seed: Seed,
    ) -> Result<Correspondences, MatcherError> {
        self.matcher.select(a, b, putative, seed)
    }

    fn selects_by_pixels(&self) -> bool {
        self.matcher.selects_by_pixels()
    }

    fn extraction_memory(&self, size: Size) -> usize {
        // The image is copied, and halved, before it is small.
        2 * size.area() + self.matcher.extraction_memory(self.size_for(size))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::{Orb, OrbParams};
    use crate::matching::{NearestNeighbours, Pipeline};

    fn orb() -> Box<dyn Matcher> {
        let extractor = Orb::new(OrbParams::default()).expect("defaults are in range");
        Box::new(Pipeline {
            extractor: Box::new(extractor),
            search: Box::new(NearestNeighbours),
            selectors: Vec::new(),
        })
    }

    /// Squares of random grey, `side` pixels wide.
    fn squares(size: Size, side: usize) -> GrayImage {
        GrayImage::from_fn(size, |x, y| {
            let square = Seed(4).number((x / side) as u64).number((y / side) as u64);
            square.rng().below(256) as u8
        })
    }

    #[test]
    fn features_of_a_smaller_image_lie_where_they_are_in_the_original() {
        // Twice the size, pixel for pixel: the smaller image is the other one exactly.
        let (large, small) = (
            squares(Size::new(480, 320), 16),
            squares(Size::new(240, 160), 8),
        );
        let expected = orb().extract(&small).expect("it cannot fail");
        let found = Resized::new(orb(), 240).expect("in range");
        let found = found.extract(&large).expect("it cannot fail");
        assert!(!found.is_empty() && found.descriptors == expected.descriptors);
        assert_eq!(found.size, large.size());
        for (found, expected) in found.keypoints.iter().zip(&expected.keypoints) {
            assert_eq!(found.at.x, (expected.at.x + 0.5) * 2.0 - 0.5);
            assert_eq!(found.at.y, (expected.at.y + 0.5) * 2.0 - 0.5);
            assert_eq!(found.size, 2.0 * expected.size);
        }
    }

    #[test]
    fn images_that_are_small_enough_are_left_alone_and_sizes_hold_for_all_others() {
        let resized = Resized::new(orb(), 100).expect("in range");
        for (from, to) in [
            ((100, 80), (100, 80)),
            ((0, 0), (0, 0)),
            ((200, 100), (100, 50)),
            ((301, 200), (100, 66)),
            ((2000, 1), (100, 1)),
            ((990, 1234), (80, 100)),
        ] {
            let image = GrayImage::filled(Size::new(from.0, from.1), 9);
            let small = resized.shrink(&image);
            assert_eq!(small.size(), Size::new(to.0, to.1));
            assert!(small.data().iter().all(|&pixel| pixel == 9));
        }
        assert!(Resized::new(orb(), 15).is_err());
    }
}
