//! A feature of image `a` together with a feature of image `b`.

use super::MatcherError;
use crate::features::{Features, Keypoint};
use crate::geometry::MatchedPoints;

/// Feature `a` of the first image is taken to show the same point as feature `b` of the second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correspondence {
    /// Index of the feature in image `a`.
    pub a: u32,
    /// Index of the feature in image `b`.
    pub b: u32,
    /// Distance of the two descriptors: Euclidean, or the number of differing bits.
    pub distance: f32,
    /// Distance from `a` to the second nearest feature of `b`; infinite where there is none. It is
    /// what the ratio test compares with.
    pub second: f32,
}

impl Correspondence {
    /// Nearest over second nearest distance: 0 is certain, 1 as ambiguous as can be, and more where it is not the nearest
    /// that was chosen. Where both distances are zero it is 1, where there is no second it is 0.
    pub fn ambiguity(&self) -> f32 {
        let ratio = self.distance / self.second;
        if ratio.is_nan() { 1.0 } else { ratio }
    }
}

/// Correspondences between two images, ordered by `a` unless a selector says otherwise.
pub type Correspondences = Vec<Correspondence>;

impl MatchedPoints {
    /// Where the features of `matches` are, how ambiguous each match is, and how far its keypoints turned.
    ///
    /// # Errors
    /// If a match names a feature that is not there, which only a matcher from outside can do.
    pub fn of_matches(
        matches: &[Correspondence],
        a: &Features,
        b: &Features,
    ) -> Result<Self, MatcherError> {
        let missing = |index: u32, features: &Features| index as usize >= features.len();
        for found in matches {
            for (index, features) in [(found.a, a), (found.b, b)] {
                if missing(index, features) {
                    let count = features.len();
                    let message = format!("a match names feature {index} of {count}");
                    return Err(MatcherError(message));
                }
            }
        }
        Ok(Self::of_keypoints(matches, &a.keypoints, &b.keypoints))
    }

    /// The same, where every match is known to name a keypoint.
    pub(super) fn of_keypoints(matches: &[Correspondence], a: &[Keypoint], b: &[Keypoint]) -> Self {
        let ends = || (matches.iter()).map(|found| (&a[found.a as usize], &b[found.b as usize]));
        let points = Self::new(
            ends().map(|(a, _)| a.at.cast()).collect(),
            ends().map(|(_, b)| b.at.cast()).collect(),
            matches.iter().map(Correspondence::ambiguity).collect(),
        );
        points.with_turns(ends().map(|(a, b)| a.turn_to(b)).collect())
    }
}
