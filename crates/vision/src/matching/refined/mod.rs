//! Matches moved to where the pixels about their points agree best: least squares matching.
//!
//! A. W. Gruen, "Adaptive Least Squares Correlation: A Powerful Image Matching Technique", South African Journal of
//! Photogrammetry, Remote Sensing and Cartography 14(3), 1985; in the inverse compositional form of S. Baker and I.
//! Matthews, "Lucas-Kanade 20 Years On: A Unifying Framework", International Journal of Computer Vision 56(3), 2004.
//!
//! A detector finds a point in each image by itself, so the two points of a right match show slightly different places
//! of the scene. ORB's are whole pixels of a smaller image on its coarse levels.
//!
//! *How it works.* For each match:
//! 1. The keypoints say how the neighbourhood of one is turned, scaled and, where they have ellipses, stretched in the other
//!    image.
//! 2. A window of 15 x 15 pixels about the point of `a` is compared with what this affine map makes of it in `b` (see
//!    `window`). Brightness and contrast do not count.
//! 3. Gauss-Newton steps change all six numbers of the map until the windows agree best in the sense of least squares
//!    (see `alignment`). The point of `b` becomes the place of the window's middle.
//!
//! A match keeps its place where that fails: near the border, where scales differ by more than four times, where there is no
//! texture, where the point would move too far, or where the windows are too unlike in the end. No match is left out.
//!
//! The point of `a` stays, and so a keypoint of `b` may lie at several places, one for each match.
//!
//! | parameter | value | source |
//! | --- | --- | --- |
//! | side of the window | 15 samples, a pixel apart in the image that shows them smaller | ours |
//! | smoothing of the images | 0.6 samples | ours |
//! | weights | Gaussian, standard deviation 0.6 of half a window | ours |
//! | steps | at most 12; the last moves the point by less than 0.01 samples | ours |
//! | farthest a point moves | 0.35 of half a window, 2.45 samples | ours |
//! | least correlation | 0.8 | ours |
//!
//! They were chosen on the rendered scenes `office-wide`, `object-wide` and `facade` with `sift`, `orb` and `akaze`. A window that
//! grows with the keypoint, as descriptors have it, is worse: it reaches over edges of things.

mod alignment;
#[cfg(test)]
mod tests;
mod window;

use nalgebra::Matrix2;

use self::alignment::{Weights, aligned};
use super::{Correspondence, Correspondences, Matcher, MatcherError, View};
use crate::features::{DescriptorKind, Detections, Features};
use crate::geometry::MatchedPoints;
use crate::image::{GrayImage, Size};
use crate::seed::Seed;

/// A matcher whose matches are moved by least squares matching. It needs the pixels of both images.
#[derive(Debug)]
pub struct Refined {
    matcher: Box<dyn Matcher>,
}

impl Refined {
    /// The same matches as those of `matcher`, at better places.
    pub fn new(matcher: Box<dyn Matcher>) -> Self {
        Self { matcher }
    }
}

impl Matcher for Refined {
    fn extract(&self, image: &GrayImage) -> Result<Features, MatcherError> {
        self.matcher.extract(image)
    }

    fn extract_sharing(
        &self,
        image: &GrayImage,
        detections: &mut dyn Detections,
    ) -> Result<Features, MatcherError> {
        self.matcher.extract_sharing(image, detections)
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
        let mut points = self.matcher.place(a, b, selected)?;
        let (Some(image_a), Some(image_b)) = (a.image, b.image) else {
            let message = "the pixels of both images are needed to refine matches";
            return Err(MatcherError(message.into()));
        };
        let weights = Weights::new();
        let ends = points.a.iter().zip(&mut points.b);
        for (found, (at_a, at_b)) in selected.iter().zip(ends) {
            let Some(b_from_a) = b_from_a(found, a.features, b.features) else {
                continue;
            };
            if let Some(moved) = aligned(&weights, [image_a, image_b], [*at_a, *at_b], b_from_a) {
                *at_b = moved;
            }
        }
        Ok(points)
    }

    fn uses_pixels(&self) -> bool {
        true
    }

    fn uses_seed(&self) -> bool {
        self.matcher.uses_seed()
    }

    fn extraction_memory(&self, size: Size) -> usize {
        self.matcher.extraction_memory(size)
    }
}

/// The linear map that takes the neighbourhood of one keypoint to that of the other; `None` where one has no area.
fn b_from_a(found: &Correspondence, a: &Features, b: &Features) -> Option<Matrix2<f64>> {
    let frame = |features: &Features, index: u32| {
        Matrix2::from_row_slice(&features.frame(index as usize).map(f64::from))
    };
    Some(frame(b, found.b) * frame(a, found.a).try_inverse()?)
}
