//! The ratio test against the first geometrically inconsistent neighbour: a match is trusted where the nearest feature
//! of *another place* is clearly further away.
//!
//! D. Mishkin, J. Matas, M. Perdoch: "MODS: Fast and Robust Method for Two-View Matching", Computer Vision and Image
//! Understanding 141, 2015, section 2.3.
//!
//! A detector often finds one place several times: with two directions, or at neighbouring scales. Their
//! descriptors are alike, so each makes the others look ambiguous, and the ratio test (Lowe 2004) drops them
//! all. Here, features of `b` within `radius_px` of the nearest are skipped when the second nearest is looked
//! for.
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | - | [`Fginn::ratio`] | 0.8 | section 2.3; as [`RatioTest`] |
//! | n | [`Fginn::radius_px`] | 10 | section 2.3 |
//!
//! *Left open by the paper*: as with the ratio test, a match without a second neighbour is dropped. So where
//! all of `b` is one place, no match is left. Distances are compared with every feature of the other places,
//! not only with a few nearest.

use super::{Correspondences, RatioTest, Selector, View, two_nearest};
use crate::features::{Descriptors, Features};
use crate::params::ParamError;
use crate::seed::Seed;
use crate::simd::two_nearest_among;

/// Keeps a match if its distance is below a ratio of the distance to the nearest feature at another place. That
/// feature becomes its second nearest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fginn {
    /// The test that a match has to pass.
    pub ratio: RatioTest,
    /// Features of `b` within this distance of the nearest, in pixels, are at the same place.
    pub radius_px: f32,
}

impl Default for Fginn {
    fn default() -> Self {
        Self {
            ratio: RatioTest::default(),
            radius_px: 10.0,
        }
    }
}

impl Fginn {
    /// A test with this ratio and radius.
    ///
    /// # Errors
    /// If the radius is negative or not finite.
    pub fn new(ratio: RatioTest, radius_px: f32) -> Result<Self, ParamError> {
        let allowed = radius_px >= 0.0 && radius_px.is_finite();
        ParamError::unless(allowed, "radius_px", radius_px, "a number from 0 on")?;
        Ok(Self { ratio, radius_px })
    }
}

impl Selector for Fginn {
    fn select(&self, a: View<'_>, b: View<'_>, matches: &mut Correspondences, seed: Seed) {
        let places = &b.features.keypoints;
        let mut elsewhere = Vec::with_capacity(places.len());
        for found in &mut *matches {
            let place = places[found.b as usize].at;
            let is_elsewhere =
                |index: &u32| (places[*index as usize].at - place).norm() > self.radius_px;
            elsewhere.clear();
            elsewhere.extend((0..places.len() as u32).filter(is_elsewhere));
            found.second = nearest_among(a.features, found.a, b.features, &elsewhere);
        }
        self.ratio.select(a, b, matches, seed);
    }
}

/// The distance from a feature of `a` to the nearest of the `chosen` features of `b`; infinite if there are
/// none.
fn nearest_among(a: &Features, query: u32, b: &Features, chosen: &[u32]) -> f32 {
    match (&a.descriptors, &b.descriptors) {
        (Descriptors::Float(a), Descriptors::Float(b)) => {
            let query = a.row(query as usize);
            two_nearest_among(query, b.data(), chosen).nearest.sqrt()
        }
        (a, b) => {
            let query = a.select([query as usize]);
            let chosen = b.select(chosen.iter().map(|&index| index as usize));
            let nearest = two_nearest(&query, &chosen);
            (nearest.first()).map_or(f32::INFINITY, |nearest| nearest.distance)
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;
    use crate::features::{BinaryRows, FloatRows, Keypoint};
    use crate::image::Size;
    use crate::matching::{NearestNeighbours, Search};

    fn features(places: &[f32], descriptors: Descriptors) -> Features {
        let keypoint = |&x: &f32| Keypoint {
            at: Point2::new(x, 0.0),
            size: 1.0,
            angle: None,
            response: 1.0,
            octave: 0,
        };
        Features::new(
            Size::new(100, 1),
            places.iter().map(keypoint).collect(),
            descriptors,
        )
    }

    /// The matches that are left of all nearest neighbours, each with its second distance.
    fn left(a: &Features, b: &Features, radius_px: f32) -> Vec<(u32, u32, f32)> {
        let mut matches = NearestNeighbours.search(a, b);
        let [a, b] = [a, b].map(|features| View {
            features,
            image: None,
            camera: None,
        });
        let test = Fginn::new(RatioTest::default(), radius_px).unwrap();
        test.select(a, b, &mut matches, Seed(0));
        matches.iter().map(|m| (m.a, m.b, m.second)).collect()
    }

    #[test]
    fn neighbours_of_one_place_do_not_make_a_match_ambiguous() {
        let floats = |data: &[f32]| Descriptors::Float(FloatRows::from_vec(1, data.to_vec()));
        let a = features(&[7.0], floats(&[1.0]));
        let b = features(&[20.0, 30.0, 41.0], floats(&[1.5, 1.6, 5.0]));
        assert_eq!(left(&a, &b, 9.0), []);
        assert_eq!(left(&a, &b, 10.0), [(0, 0, 4.0)]);
        assert_eq!(left(&a, &b, 21.0), []); // no other place
    }

    #[test]
    fn bits_have_places_too() {
        let bits = |data: &[u64]| Descriptors::Binary(BinaryRows::from_vec(8, data.to_vec()));
        let a = features(&[7.0], bits(&[0]));
        let b = features(&[20.0, 25.0, 41.0], bits(&[1, 2, 0xff]));
        assert_eq!(left(&a, &b, 4.0), []);
        assert_eq!(left(&a, &b, 10.0), [(0, 0, 8.0)]);
    }

    #[test]
    fn without_a_radius_it_is_the_ratio_test_among_different_places() {
        let floats = |data: &[f32]| Descriptors::Float(FloatRows::from_vec(1, data.to_vec()));
        let a = features(&[1.0, 2.0, 3.0], floats(&[0.0, 4.0, 9.9]));
        let b = features(&[1.0, 2.0, 3.0], floats(&[0.1, 5.0, 9.0]));
        let mut matches = NearestNeighbours.search(&a, &b);
        let view = |features| View {
            features,
            image: None,
            camera: None,
        };
        RatioTest::default().select(view(&a), view(&b), &mut matches, Seed(0));
        let expected: Vec<_> = matches.iter().map(|m| (m.a, m.b, m.second)).collect();
        assert_eq!(left(&a, &b, 0.0), expected);
        assert!(Fginn::new(RatioTest::default(), f32::NAN).is_err());
    }
}
