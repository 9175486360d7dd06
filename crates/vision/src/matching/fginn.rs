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
//! all of `b` is one place, no match is left. Every feature of the other places counts, not only a few nearest.

use super::{Correspondences, RatioTest, Selector, View};
use crate::features::{BinaryRows, Descriptors, FloatRows, Keypoint};
use crate::params::ParamError;
use crate::seed::Seed;
use crate::simd::{near_rows, nearest_bits_among, two_nearest_among};

/// How many radii two features must be apart so that one of them is certainly outside of any circle of that radius: two,
/// and what the rounding of distances may hide.
pub(super) const FAR: f32 = 2.0 * (1.0 + 1e-6);

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
        let places = Places {
            keypoints: &b.features.keypoints,
            radius_px: self.radius_px,
        };
        match (&a.features.descriptors, &b.features.descriptors) {
            (Descriptors::Float(a), Descriptors::Float(b)) => {
                places.find_second_floats(a, b, matches);
            }
            (Descriptors::Binary(a), Descriptors::Binary(b)) => {
                places.find_second_bits(a, b, matches, self.ratio);
            }
            _ => panic!("descriptors of one kind"),
        }
        self.ratio.select(a, b, matches, seed);
    }

    fn uses_seed(&self) -> bool {
        self.ratio.uses_seed()
    }
}

/// The places of the features of `b`.
#[derive(Clone, Copy)]
struct Places<'a> {
    keypoints: &'a [Keypoint],
    radius_px: f32,
}

impl Places<'_> {
    fn distance(&self, i: u32, j: u32) -> f32 {
        let [i, j] = [i, j].map(|index| self.keypoints[index as usize].at);
        (j - i).norm()
    }

    /// Those of the `indices` that are at another place than a feature.
    fn elsewhere(
        &self,
        feature: u32,
        indices: impl Iterator<Item = u32>,
    ) -> impl Iterator<Item = u32> {
        indices.filter(move |&index| self.distance(index, feature) > self.radius_px)
    }

    /// Sets the second nearest of each match to the nearest row of `b` elsewhere; infinite if there is none.
    fn find_second_floats(&self, a: &FloatRows, b: &FloatRows, matches: &mut Correspondences) {
        let rows = matches.iter().flat_map(|found| a.row(found.a as usize));
        let rows: Vec<f32> = rows.copied().collect();
        // Of two features so far apart one at least is elsewhere, wherever a match is, whatever their distances are
        // rounded to. So the nearest feature elsewhere is never farther than the farther one of two features that are apart.
        let are_apart = |i, j| self.distance(i, j) > FAR * self.radius_px;
        let near = near_rows(&rows, b.data(), a.dim(), b.prepared(), Some(&are_apart));
        let all: Vec<u32> = (0..b.len() as u32).collect();
        let mut elsewhere = Vec::new();
        for (found, near) in matches.iter_mut().zip(near) {
            let near = near.as_deref().unwrap_or(&all);
            elsewhere.clear();
            elsewhere.extend(self.elsewhere(found.b, near.iter().copied()));
            let query = a.row(found.a as usize);
            let nearest = two_nearest_among(query, b.data(), &elsewhere).nearest;
            found.second = nearest.sqrt();
        }
    }

    /// The same of rows of bits, as far as a match passes the test: where one does not, its second nearest is a feature
    /// elsewhere by which it fails, and the others need not be looked at.
    fn find_second_bits(
        &self,
        a: &BinaryRows,
        b: &BinaryRows,
        matches: &mut Correspondences,
        test: RatioTest,
    ) {
        /// Features that are compared before the test is asked.
        const AT_ONCE: usize = 128;
        let mut some = Vec::with_capacity(AT_ONCE);
        for found in matches {
            let query = a.row(found.a as usize);
            let mut elsewhere = self.elsewhere(found.b, 0..b.len() as u32);
            found.second = f32::INFINITY;
            loop {
                some.clear();
                some.extend(elsewhere.by_ref().take(AT_ONCE));
                let Some(bits) = nearest_bits_among(query, b.data(), &some) else {
                    break;
                };
                found.second = found.second.min(bits as f32);
                if !test.keeps(found) {
                    break;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;
    use crate::features::Features;
    use crate::image::Size;
    use crate::matching::{NearestNeighbours, Search};
    use crate::simd::InstructionSet;

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
    fn who_fails_early_would_have_failed_and_who_passes_was_compared_with_all() {
        let mut rng = Seed(9).rng();
        let count = 1_000;
        let mut rows: Vec<u64> = (0..4 * count).map(|_| rng.uniform().to_bits()).collect();
        let a = features(&[0.0; 500], binary(&rows[..2_000]));
        for row in rows.chunks_exact_mut(4).take(100) {
            row[0] ^= 0xf0;
        }
        let places: Vec<f32> = (0..count).map(|i| i as f32).collect();
        let b = features(&places, binary(&rows));
        let found = left(&a, &b, 10.0);
        let mut expected = Vec::new();
        for found in &NearestNeighbours.search(&a, &b) {
            let is_elsewhere = |&j: &usize| (j as f32 - found.b as f32).abs() > 10.0;
            let query = &rows_of(&a)[4 * found.a as usize..][..4];
            let bits = |j: usize| {
                let row = &rows_of(&b)[4 * j..][..4];
                let differing = query.iter().zip(row).map(|(a, b)| (a ^ b).count_ones());
                differing.sum::<u32>()
            };
            let second = (0..count).filter(is_elsewhere).map(bits).min();
            let second = second.expect("there are others") as f32;
            if found.distance < 0.8 * second {
                expected.push((found.a, found.b, second));
            }
        }
        assert!(expected.len() > 90 && expected.len() < 1_000);
        assert_eq!(found, expected);
    }

    fn binary(words: &[u64]) -> Descriptors {
        Descriptors::Binary(BinaryRows::from_vec(256, words.to_vec()))
    }

    fn rows_of(features: &Features) -> &[u64] {
        match &features.descriptors {
            Descriptors::Binary(rows) => rows.data(),
            Descriptors::Float(_) => panic!("these are bits"),
        }
    }

    #[test]
    fn bounds_change_no_second_nearest() {
        // Of each query of `a`, four rows of `b` are near: two on either side of the nearest, which come first and are
        // farther from each other than the radius but not from the nearest; the nearest; and the nearest elsewhere.
        const NEAR: [(f32, f32); 4] = [(-8.0, 0.2), (8.0, 0.3), (0.0, 0.1), (90.0, 0.4)];
        let (count, dim, mut rng) = (200, 64, Seed(5).rng());
        let queries: Vec<f32> = (0..count * dim)
            .map(|_| 9.0 * rng.uniform() as f32)
            .collect();
        let (mut places, mut rows) = (Vec::new(), Vec::new());
        for query in queries.chunks_exact(dim) {
            let place = 500.0 * rng.uniform() as f32;
            for (shift, difference) in NEAR {
                places.push(place + shift);
                let row = query.iter().map(|value| {
                    let noise = 0.02 * rng.normal() as f32;
                    value + difference + noise
                });
                rows.extend(row);
            }
        }
        let rows_a = FloatRows::from_vec(dim, queries);
        let rows_b = FloatRows::from_vec(dim, rows);
        let a = features(&vec![0.0; count], Descriptors::Float(rows_a.clone()));
        let b = features(&places, Descriptors::Float(rows_b.clone()));
        let mut matches = NearestNeighbours.search(&a, &b);
        // One that is no nearest neighbour, as selectors before may leave.
        matches[3].b = (matches[3].b + 11) % rows_b.len() as u32;
        let places = Places {
            keypoints: &b.keypoints,
            radius_px: 10.0,
        };
        let expected: Vec<f32> = (matches.iter())
            .map(|found| {
                let all = places.elsewhere(found.b, 0..rows_b.len() as u32);
                let query = rows_a.row(found.a as usize);
                let found = two_nearest_among(query, rows_b.data(), &all.collect::<Vec<u32>>());
                found.nearest.sqrt()
            })
            .collect();
        InstructionSet::for_each(|set| {
            let mut matches = matches.clone();
            places.find_second_floats(&rows_a, &rows_b, &mut matches);
            let found: Vec<f32> = matches.iter().map(|found| found.second).collect();
            assert_eq!(found, expected, "{set:?}");
        });
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
