//! A feature of image `a` together with a feature of image `b`.

use super::MatcherError;
use crate::features::{Features, Keypoint};
use crate::geometry::MatchedPoints;

/// Feature `a` of the first image and feature `b` of the second are assumed to show the same point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correspondence {
    /// Index of the feature in image `a`.
    pub a: u32,
    /// Index of the feature in image `b`.
    pub b: u32,
    /// Distance of the two descriptors: Euclidean, or the number of differing bits.
    pub distance: f32,
    /// Distance from `a` to the second nearest feature of `b`, of those at another place where a search asks for that;
    /// for a candidate that is not the nearest, the distance to the nearest. Infinite if there is none. The ratio test
    /// uses it.
    pub second: f32,
}

impl Correspondence {
    /// Nearest divided by second nearest distance: 0 is certain, 1 is most ambiguous for a nearest neighbour. It
    /// is above 1 if a candidate was chosen that is not the nearest. It is 1 if both distances are zero, and 0 if
    /// there is no second.
    pub fn ambiguity(&self) -> f32 {
        let ratio = self.distance / self.second;
        if ratio.is_nan() { 1.0 } else { ratio }
    }
}

/// Correspondences between two images, ordered by `a` unless a selector says otherwise.
pub type Correspondences = Vec<Correspondence>;

/// Indices of the matches, the least ambiguous first; equally ambiguous ones keep their order.
pub(super) fn clearest_first(matches: &[Correspondence]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..matches.len()).collect();
    order.sort_by(|&i, &j| matches[i].ambiguity().total_cmp(&matches[j].ambiguity()));
    order
}

/// Keeps the matches whose entry in `mask` is `true`, in their order.
///
/// # Panics
/// If the mask has another length.
pub(super) fn retain_masked(matches: &mut Correspondences, mask: &[bool]) {
    assert_eq!(matches.len(), mask.len(), "one entry for each match");
    let mut mask = mask.iter();
    matches.retain(|_| mask.next() == Some(&true));
}

impl MatchedPoints {
    /// The positions of the matched features, the ambiguity of each match, and how far its keypoints are turned and
    /// have grown. Growths are left out if one is not finite, and if all keypoints are equally large: sizes that a
    /// detector does not measure tell nothing.
    ///
    /// # Errors
    /// If a match names a feature that does not exist; only a matcher from outside can do this.
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

    /// The same, if every match is known to name existing keypoints.
    pub(super) fn of_keypoints(matches: &[Correspondence], a: &[Keypoint], b: &[Keypoint]) -> Self {
        let ends = || (matches.iter()).map(|found| (&a[found.a as usize], &b[found.b as usize]));
        let points = Self::new(
            ends().map(|(a, _)| a.at.cast()).collect(),
            ends().map(|(_, b)| b.at.cast()).collect(),
            matches.iter().map(Correspondence::ambiguity).collect(),
        );
        let first = ends().next().map(|(a, _)| a.size);
        let growths: Vec<f32> = ends().map(|(a, b)| a.growth_to(b)).collect();
        let are_measured = growths.iter().all(|growth| growth.is_finite())
            && ends().any(|(a, b)| [a.size, b.size].map(Some) != [first; 2]);
        points
            .with_turns(ends().map(|(a, b)| a.turn_to(b)).collect())
            .with_growths(are_measured.then_some(growths))
    }
}
