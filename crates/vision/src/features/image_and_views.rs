//! The features of the image as it is, followed by those of simulated views of it.
//!
//! J.-M. Morel, G. Yu: "ASIFT: A New Framework for Fully Affine Invariant Image Comparison", SIAM
//! Journal on Imaging Sciences 2(2), 438-469, 2009.
//!
//! [`Asift`] shrinks a large image before it simulates views, and keeps the strongest features over all views,
//! the image itself included. So it loses small details of the image first, and these are the features that are
//! located most exactly. Here the two parts are kept apart:
//!
//! 1. An extractor works on the image, which is not shrunk, and all its features are kept.
//! 2. The same extractor works on the tilted views of ASIFT, which are made of the shrunk image. The strongest
//!    of their features follow.
//!
//! Parameters are those of [`AsiftParams`]; `max_pixels` and `limit` concern the tilted views alone, and with
//! `tilts` of 1 there are none. All features have their local affine frames.

use super::asift::{Asift, AsiftParams};
use super::simulation::{SimulatedView, extract_view};
use super::{DescriptorKind, Extractor, Features, memory_of};
use crate::image::{GrayImage, Size};
use crate::params::ParamError;

/// An extractor on the image as it is, then on tilted views of it.
#[derive(Clone, Debug)]
pub struct ImageAndViews<E> {
    views: Asift<E>,
}

impl<E: Extractor> ImageAndViews<E> {
    /// `extractor` on the image and on simulated views.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn new(extractor: E, params: AsiftParams) -> Result<Self, ParamError> {
        Ok(Self {
            views: Asift::new(extractor, params)?,
        })
    }
}

impl<E: Extractor> Extractor for ImageAndViews<E> {
    fn kind(&self) -> DescriptorKind {
        self.views.kind()
    }

    fn extract(&self, image: &GrayImage) -> Features {
        let features = extract_view(self.views.extractor(), image, SimulatedView::IMAGE);
        features.followed_by(&self.views.extract_tilted(image))
    }

    fn memory(&self, size: Size) -> usize {
        let of_image = self.views.extractor().memory(size);
        // The features of the image are kept while views are simulated.
        of_image.max(self.views.memory(size) + memory_of(size, 0, self.kind()))
    }
}

/// Of the features of an [`ImageAndViews`] those of the image itself: the first ones, up to the first that is tilted.
///
/// They are known by their frames. So this is for extractors that describe circles, and where the image has no feature of
/// its own, those of its first view can be taken for them.
pub fn features_of_image(features: &Features) -> Features {
    /// Largest `t + 1/t` of a frame that counts as untilted. A circle has 2, the smallest tilt of ASIFT, sqrt 2, has 2.12.
    const UNTILTED: f32 = 2.05;
    // Features of an image of another aspect are ellipses without a tilt.
    let [across, down] = features.stretch();
    let is_tilted = |&index: &usize| {
        let [xx, xy, yx, yy] = features.frame(index);
        let [xx, xy, yx, yy] = [xx / across, xy / across, yx / down, yy / down];
        let (sum, area) = (xx * xx + xy * xy + yx * yx + yy * yy, xx * yy - xy * yx);
        sum > UNTILTED * area.abs()
    };
    let count = (0..features.len()).find(is_tilted);
    features.first(count.unwrap_or(features.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::{RootSift, Sift, SiftParams};
    use crate::seed::Seed;

    fn textured(size: Size) -> GrayImage {
        GrayImage::from_fn(size, |x, y| {
            let mut rng = Seed(5).number((x / 7) as u64).number((y / 7) as u64).rng();
            30 + rng.below(200) as u8
        })
    }

    fn rootsift() -> RootSift {
        RootSift(Sift::new(SiftParams::default()).expect("its own parameters"))
    }

    #[test]
    fn the_image_keeps_its_features_and_only_the_views_are_limited_and_shrunk() {
        let image = textured(Size::new(200, 150));
        let alone = rootsift().extract(&image);
        let params = AsiftParams {
            tilts: 3,
            max_pixels: Some(100 * 75),
            limit: Some(40),
            ..AsiftParams::default()
        };
        let both = ImageAndViews::new(rootsift(), params).expect("in range");
        let features = both.extract(&image);
        assert!(alone.len() > 40, "{} features", alone.len());
        assert_eq!(features.size, image.size());
        assert_eq!(features.keypoints[..alone.len()], alone.keypoints);
        assert_eq!(features.len(), alone.len() + 40);
        for (index, keypoint) in alone.keypoints.iter().enumerate() {
            assert_eq!(features.frame(index), keypoint.frame());
        }
        let unseen = |index: usize| {
            let [xx, xy, yx, yy] = features.frame(index);
            let (sum, area) = (xx * xx + xy * xy + yx * yx + yy * yy, xx * yy - xy * yx);
            // Equal for a circle.
            sum > 2.1 * area
        };
        assert!(
            (alone.len()..features.len()).all(unseen),
            "a view is tilted"
        );
        let of_image = features_of_image(&features);
        assert_eq!(of_image.keypoints, alone.keypoints);
        assert_eq!(of_image.descriptors, alone.descriptors);
        // Also where the aspect is another: 640x480 for images of all kinds is a size of published protocols.
        for size in [(401, 300), (620, 188), (100, 300)] {
            let size = Size::new(size.0, size.1);
            let resized = features.clone().in_pixels_of(image.size(), size);
            assert_eq!(features_of_image(&resized).len(), alone.len(), "{size}");
        }
    }

    #[test]
    fn without_tilts_it_is_the_extractor() {
        let image = textured(Size::new(120, 90));
        let params = AsiftParams {
            tilts: 1,
            ..AsiftParams::default()
        };
        let both = ImageAndViews::new(rootsift(), params).expect("in range");
        let alone = rootsift().extract(&image);
        assert_eq!(both.extract(&image).keypoints, alone.keypoints);
        let empty = GrayImage::filled(Size::new(0, 0), 0);
        assert!(both.extract(&empty).is_empty());
    }
}
