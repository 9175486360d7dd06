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

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;
    use crate::features::{Descriptors, FloatRows};
    use crate::image::Size;

    fn found(a: u32, b: u32, distance: f32, second: f32) -> Correspondence {
        Correspondence {
            a,
            b,
            distance,
            second,
        }
    }

    fn features(keypoints: &[(f32, f32, f32, f32)]) -> Features {
        let keypoint = |&(x, y, size, angle): &(f32, f32, f32, f32)| Keypoint {
            at: Point2::new(x, y),
            size,
            angle: Some(angle),
            response: 1.0,
            octave: 0,
        };
        Features::new(
            Size::new(100, 80),
            keypoints.iter().map(keypoint).collect(),
            Descriptors::Float(FloatRows::from_vec(1, vec![0.0; keypoints.len()])),
        )
    }

    #[test]
    fn ambiguity_is_the_nearest_distance_over_the_second() {
        for (distance, second, expected) in [
            (2.0, 8.0, 0.25),
            (9.0, 6.0, 1.5), // another candidate is nearer
            (0.0, 5.0, 0.0),
            (0.0, 0.0, 1.0),
            (3.0, f32::INFINITY, 0.0),
        ] {
            assert_eq!(found(0, 0, distance, second).ambiguity(), expected);
        }
    }

    #[test]
    fn the_clearest_come_first_and_equally_clear_ones_keep_their_order() {
        let matches = [(3.0, 4.0), (1.0, 2.0), (1.0, 8.0), (2.0, 4.0), (9.0, 8.0)]
            .map(|(distance, second)| found(0, 0, distance, second));
        assert_eq!(clearest_first(&matches), [2, 1, 3, 0, 4]);
    }

    #[test]
    fn masked_matches_keep_their_order() {
        let mut matches: Correspondences = (0..4).map(|a| found(a, 0, 0.0, 1.0)).collect();
        retain_masked(&mut matches, &[true, false, false, true]);
        assert_eq!(matches.iter().map(|m| m.a).collect::<Vec<_>>(), [0, 3]);
    }

    #[test]
    fn points_turns_and_growths_are_those_from_a_to_b() {
        let a = features(&[(1.0, 2.0, 4.0, 0.25), (3.0, 4.0, 2.0, 1.0)]);
        let b = features(&[(5.0, 6.0, 8.0, 0.75), (7.0, 8.0, 2.0, 1.0)]);
        let matches = [found(1, 0, 1.0, 4.0), found(0, 1, 1.0, 2.0)];
        let points = MatchedPoints::of_matches(&matches, &a, &b).expect("they are there");
        assert_eq!(points.a, [Point2::new(3.0, 4.0), Point2::new(1.0, 2.0)]);
        assert_eq!(points.b, [Point2::new(5.0, 6.0), Point2::new(7.0, 8.0)]);
        assert_eq!(points.ambiguity, [0.25, 0.5]);
        let near = |found: &[f32], expected: [f32; 2]| {
            let far = |(found, expected): (&f32, f32)| (found - expected).abs() > 1e-6;
            assert!(!found.iter().zip(expected).any(far), "{found:?}");
        };
        // From 1.0 to 0.75, nearly a full circle, and from 0.25 to 1.0; from size 2 to 8, and from 4 to 2.
        let turns = points.turns.expect("angles are there");
        near(&turns, [std::f32::consts::TAU - 0.25, 0.75]);
        let growths = points.growths.expect("sizes are measured");
        near(&growths, [4.0_f32.ln(), -(2.0_f32.ln())]);
    }

    #[test]
    fn sizes_that_are_not_measured_tell_no_growth() {
        let growths = |sizes_a: [f32; 2], sizes_b: [f32; 2]| {
            let [a, b] =
                [sizes_a, sizes_b].map(|sizes| features(&sizes.map(|size| (9.0, 9.0, size, 0.0))));
            let matches = [found(0, 0, 0.0, 1.0), found(1, 1, 0.0, 1.0)];
            let points = MatchedPoints::of_matches(&matches, &a, &b);
            points.expect("they are there").growths.is_some()
        };
        assert!(!growths([7.0; 2], [7.0; 2]), "all are equally large");
        assert!(growths([7.0; 2], [7.0, 8.0]) && growths([7.0, 8.0], [7.0; 2]));
        assert!(!growths([7.0, 0.0], [7.0, 8.0]), "one has no size");
    }

    #[test]
    fn a_match_of_a_feature_that_is_not_there_is_an_error_that_names_it() {
        let (a, b) = (features(&[(1.0, 1.0, 1.0, 0.0)]), features(&[]));
        let error = |a: &Features, b: &Features| {
            let matches = [found(0, 0, 0.0, 1.0)];
            let refused = MatchedPoints::of_matches(&matches, a, b);
            refused.expect_err("one is not there").to_string()
        };
        for (a, b) in [(&a, &b), (&b, &a)] {
            assert!(error(a, b).contains("feature 0 of 0"), "{}", error(a, b));
        }
        let both = MatchedPoints::of_matches(&[found(0, 0, 0.0, 1.0)], &a, &a);
        assert_eq!(both.expect("it is there").len(), 1);
    }
}
