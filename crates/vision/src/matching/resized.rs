//! A matcher that works on resized images: features are found in the resized image, and their positions are
//! given in pixels of the original.
//!
//! The size of the images changes scores as much as the matcher does, so it has to be the same for matchers
//! that are compared. There are two ways to set it:
//!
//! - A *largest size* ([`shrink_u8`]): pixels of the smaller image are means of areas, and the image is
//!   halved first where it is much smaller.
//! - An *exact size* ([`resize`]), as published protocols have it. Their programs resample bilinearly without
//!   smoothing, as OpenCV's `resize` does unless told otherwise, and do not keep the aspect ratio.
//!
//! A point at `x` lies at `(x + 1/2) s - 1/2` of the original, where `s` is the ratio of the sizes.

use super::{Correspondence, Correspondences, Matcher, MatcherError, View};
use crate::features::{DescriptorKind, Detections, Features};
use crate::geometry::MatchedPoints;
use crate::image::{GrayImage, Size, resize, shrink_u8};
use crate::params::ParamError;
use crate::seed::Seed;

/// The size of the images in which features are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageSize {
    /// At most so many pixels wide and high, with the same aspect ratio. Smaller images are not changed.
    AtMost(usize),
    /// This size, whatever the size and aspect ratio of the image.
    Exactly(Size),
}

/// A matcher whose features are found in images of another size. Their coordinates are those of the original
/// images.
#[derive(Debug)]
pub struct Resized {
    matcher: Box<dyn Matcher>,
    size: ImageSize,
}

impl Resized {
    /// A `matcher` for images of this `size`.
    ///
    /// # Errors
    /// If a largest size is below 16, or an exact one is not from 16 to [`Resized::MOST`] in width and height.
    pub fn new(matcher: Box<dyn Matcher>, size: ImageSize) -> Result<Self, ParamError> {
        match size {
            ImageSize::AtMost(most) => {
                ParamError::unless(most >= 16, "max_size", most, "at least 16")?;
            }
            ImageSize::Exactly(Size { width, height }) => {
                let in_range = |length| (16..=Self::MOST).contains(&length);
                let are_in_range = in_range(width) && in_range(height);
                let what = format!("{width}x{height}");
                ParamError::unless(are_in_range, "size", what, "16 to 8192 wide and high")?;
            }
        }
        Ok(Self { matcher, size })
    }

    /// Largest width and height of an exact size, since a small image may be enlarged to it.
    pub const MOST: usize = 8192;

    /// The size to which an image of `size` is resampled.
    fn size_for(&self, size: Size) -> Size {
        let most = match self.size {
            _ if size.area() == 0 => return size,
            ImageSize::AtMost(most) => most,
            ImageSize::Exactly(exact) => return exact,
        };
        let long = size.width.max(size.height);
        if long <= most {
            return size;
        }
        let factor = most as f64 / long as f64;
        let length = |length: usize| ((length as f64 * factor).round() as usize).max(1);
        Size::new(length(size.width), length(size.height))
    }

    fn resized(&self, image: &GrayImage) -> GrayImage {
        let target = self.size_for(image.size());
        if let ImageSize::Exactly(_) = self.size {
            return resize(image, target);
        }
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
        let small = self.resized(image);
        let features = self.matcher.extract(&small)?;
        Ok(features.in_pixels_of(small.size(), image.size()))
    }

    fn extract_sharing(
        &self,
        image: &GrayImage,
        detections: &mut dyn Detections,
    ) -> Result<Features, MatcherError> {
        let small = self.resized(image);
        let features = self.matcher.extract_sharing(&small, detections)?;
        Ok(features.in_pixels_of(small.size(), image.size()))
    }

    fn descriptors(&self) -> Option<DescriptorKind> {
        self.matcher.descriptors()
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

    fn place(
        &self,
        a: View<'_>,
        b: View<'_>,
        selected: &[Correspondence],
    ) -> Result<MatchedPoints, MatcherError> {
        self.matcher.place(a, b, selected)
    }

    fn uses_pixels(&self) -> bool {
        self.matcher.uses_pixels()
    }

    fn uses_seed(&self) -> bool {
        self.matcher.uses_seed()
    }

    fn extraction_memory(&self, size: Size) -> usize {
        let target = self.size_for(size);
        // The image is copied, and halved, before it is small.
        2 * size.area().max(target.area()) + self.matcher.extraction_memory(target)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::{Descriptors, Orb, OrbParams};
    use crate::matching::{NearestNeighbours, Pipeline};

    const BITS: DescriptorKind = DescriptorKind::Binary { bits: 256 };

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
    fn an_empty_image_has_no_features_however_long_it_is() {
        for size in [Size::new(0, 5000), Size::new(5000, 0), Size::new(0, 0)] {
            for wanted in [
                ImageSize::AtMost(1000),
                ImageSize::Exactly(Size::new(64, 64)),
            ] {
                let resized = Resized::new(orb(), wanted).expect("in range");
                let found = resized.extract(&GrayImage::from_vec(size, Vec::new()));
                assert_eq!(found.expect("it cannot fail").len(), 0);
            }
        }
    }

    #[test]
    fn features_of_a_smaller_image_lie_where_they_are_in_the_original() {
        // Twice the size, pixel for pixel: the smaller image is the other one exactly.
        let (large, small) = (
            squares(Size::new(480, 320), 16),
            squares(Size::new(240, 160), 8),
        );
        let expected = orb().extract(&small).expect("it cannot fail");
        let found = Resized::new(orb(), ImageSize::AtMost(240)).expect("in range");
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
        let resized = Resized::new(orb(), ImageSize::AtMost(100)).expect("in range");
        for (from, to) in [
            ((100, 80), (100, 80)),
            ((0, 0), (0, 0)),
            ((200, 100), (100, 50)),
            ((301, 200), (100, 66)),
            ((2000, 1), (100, 1)),
            ((990, 1234), (80, 100)),
        ] {
            let image = GrayImage::filled(Size::new(from.0, from.1), 9);
            let small = resized.resized(&image);
            assert_eq!(small.size(), Size::new(to.0, to.1));
            assert!(small.data().iter().all(|&pixel| pixel == 9));
        }
        assert!(Resized::new(orb(), ImageSize::AtMost(15)).is_err());
    }

    /// Says what it was asked for.
    struct Echo;

    impl Echo {
        fn said<T>(stage: &str, [a, b]: [&Features; 2]) -> Result<T, MatcherError> {
            Err(MatcherError(format!("{stage} {} with {}", a.size, b.size)))
        }
    }

    impl Matcher for Echo {
        fn extract(&self, image: &GrayImage) -> Result<Features, MatcherError> {
            Err(MatcherError(format!("extract {}", image.size())))
        }

        fn search(&self, a: &Features, b: &Features) -> Result<Correspondences, MatcherError> {
            Self::said("search", [a, b])
        }

        fn select(
            &self,
            a: View<'_>,
            b: View<'_>,
            _: Correspondences,
            _: Seed,
        ) -> Result<Correspondences, MatcherError> {
            Self::said("select", [a.features, b.features])
        }

        fn place(
            &self,
            a: View<'_>,
            b: View<'_>,
            _: &[Correspondence],
        ) -> Result<MatchedPoints, MatcherError> {
            Self::said("place", [a.features, b.features])
        }

        fn extraction_memory(&self, size: Size) -> usize {
            1000 * size.area()
        }
    }

    #[test]
    fn each_stage_is_that_of_the_matcher_on_the_same_two_images() {
        let resized = Resized::new(Box::new(Echo), ImageSize::AtMost(100)).expect("in range");
        let of = |size: Size| Features::new(size, vec![], Descriptors::empty(BITS));
        let (a, b) = (of(Size::new(200, 100)), of(Size::new(30, 40)));
        let view = |features| View {
            features,
            image: None,
            camera: None,
        };
        let image = GrayImage::filled(Size::new(200, 100), 0);
        for (said, expected) in [
            (resized.extract(&image).map(drop), "extract 100x50"),
            (
                resized.search(&a, &b).map(drop),
                "search 200x100 with 30x40",
            ),
            (
                resized
                    .select(view(&a), view(&b), vec![], Seed(0))
                    .map(drop),
                "select 200x100 with 30x40",
            ),
            (
                resized.place(view(&a), view(&b), &[]).map(drop),
                "place 200x100 with 30x40",
            ),
        ] {
            assert_eq!(said.expect_err("it only says").to_string(), expected);
        }
        // That of the reduced image, and the image twice; an enlarged one is the larger of the two.
        assert_eq!(resized.extraction_memory(image.size()), 5_000_000 + 40_000);
        let exactly = ImageSize::Exactly(Size::new(400, 100));
        let enlarged = Resized::new(Box::new(Echo), exactly).expect("in range");
        assert_eq!(
            enlarged.extraction_memory(image.size()),
            40_000_000 + 80_000
        );
    }

    #[test]
    fn an_exact_size_holds_for_every_image_and_is_bilinear() {
        let exactly =
            |width, height| Resized::new(orb(), ImageSize::Exactly(Size::new(width, height)));
        let exact = exactly(120, 160).expect("in range");
        for from in [(480, 320), (60, 40), (120, 160), (1, 1)] {
            let image = squares(Size::new(from.0, from.1), 16);
            assert_eq!(exact.resized(&image), resize(&image, Size::new(120, 160)));
        }
        let empty = GrayImage::filled(Size::new(0, 0), 0);
        assert_eq!(exact.resized(&empty), empty);
        let image = squares(Size::new(480, 320), 16);
        let found = exact.extract(&image).expect("it cannot fail");
        assert!(!found.is_empty() && found.size == image.size());
        assert!(exactly(15, 160).is_err() && exactly(160, 8193).is_err());
    }
}
