//! Exact nearest neighbours for features that come in many versions of one place, as simulated views give
//! them.
//!
//! J.-M. Morel, G. Yu: "ASIFT: A New Framework for Fully Affine Invariant Image Comparison", SIAM
//! Journal on Imaging Sciences 2(2), 438-469, 2009, section 4.3 compares simulated views pair by
//! pair. Here all features are compared at once, in blocks of `b`:
//!
//! 1. Each block gives its nearest feature and the distance to its second.
//! 2. The nearest of all blocks is the match.
//! 3. [`Correspondence::second`] is the distance to the nearest feature of *another place*: the
//!    nearest of a block that lies farther than `same_place_px` from the match, or the second of a
//!    block whose nearest does not.
//!
//! This allows to skip candidates. Take two features of `b` that lie farther than twice `same_place_px` from
//! each other. Wherever the match is, at least one of the two is of another place, and its block gives it or
//! a nearer one as the second. So candidates farther than both of them change nothing, and a cheap lower
//! bound of their distance rejects them.
//!
//! | field | default | source |
//! | --- | --- | --- |
//! | `same_place_px` | 6 | - |
//!
//! Blocks follow the order of `b`, in which the versions of a place are far apart (each is in
//! another simulated view), so a block seldom holds two of them; where it does, `second` is too
//! small and the ratio test too strict.

use super::fginn::FAR;
use super::{Correspondence, Correspondences, Search, two_nearest};
use crate::features::{BinaryRows, Descriptors, Features, FloatRows, Keypoint};
use crate::params::ParamError;
use crate::simd::{complete, near_rows, two_nearest_among};

/// Number of features in a block.
const BLOCK: usize = 256;

/// Exact search where the second neighbour must be at another place than the nearest.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct PlacewiseNeighbours {
    /// Features closer to each other than this, in pixels, are at the same place.
    pub same_place_px: f32,
}

impl Default for PlacewiseNeighbours {
    fn default() -> Self {
        Self { same_place_px: 6.0 }
    }
}

impl PlacewiseNeighbours {
    /// A search with this radius of a place.
    ///
    /// # Errors
    /// If the radius is negative or not finite.
    pub fn new(same_place_px: f32) -> Result<Self, ParamError> {
        let allowed = same_place_px >= 0.0 && same_place_px.is_finite();
        ParamError::unless(
            allowed,
            "same_place_px",
            same_place_px,
            "a number from 0 on",
        )?;
        Ok(Self { same_place_px })
    }
}

impl Search for PlacewiseNeighbours {
    fn search(&self, a: &Features, b: &Features) -> Correspondences {
        let of_blocks = complete(self.of_blocks_that_matter(a, b), |missing| {
            let missing = a.descriptors.select(missing.iter().copied());
            of_all_blocks(&missing, &b.descriptors)
        });
        (0..)
            .zip(&of_blocks)
            .filter_map(|(a, of_blocks)| self.match_of(a, of_blocks, &b.keypoints))
            .collect()
    }
}

impl PlacewiseNeighbours {
    /// The nearest feature of each block, for the features of `a` that the fast kernel can handle (none if the
    /// processor lacks it). Blocks that cannot change a result are left out.
    fn of_blocks_that_matter(self, a: &Features, b: &Features) -> Vec<Option<Correspondences>> {
        let (Descriptors::Float(rows_a), Descriptors::Float(rows_b)) =
            (&a.descriptors, &b.descriptors)
        else {
            return vec![None; a.len()];
        };
        assert_eq!(rows_a.dim(), rows_b.dim(), "descriptors of one kind");
        let apart = |i: u32, j: u32| {
            let [i, j] = [i, j].map(|index| b.keypoints[index as usize].at);
            (i - j).norm() > FAR * self.same_place_px
        };
        let (data_a, data_b) = (rows_a.data(), rows_b.data());
        let near = near_rows(
            data_a,
            data_b,
            rows_a.dim(),
            rows_b.prepared(),
            Some(&apart),
        );
        let of_block = |a: usize, block: &[u32]| {
            let found = two_nearest_among(rows_a.row(a), data_b, block);
            Correspondence {
                a: a as u32,
                b: found.index,
                distance: found.nearest.sqrt(),
                second: found.second.sqrt(),
            }
        };
        let of_blocks = |(a, near): (usize, &Option<Vec<u32>>)| {
            let blocks = near.as_ref()?;
            let blocks = blocks.chunk_by(|i, j| i / BLOCK as u32 == j / BLOCK as u32);
            Some(blocks.map(|block| of_block(a, block)).collect())
        };
        near.iter().enumerate().map(of_blocks).collect()
    }

    /// The match of feature `a`, given the nearest feature of each block.
    fn match_of(
        self,
        a: u32,
        of_blocks: &[Correspondence],
        keypoints: &[Keypoint],
    ) -> Option<Correspondence> {
        let (first, others) = of_blocks.split_first()?;
        let mut best = first;
        for other in others {
            if other.distance < best.distance {
                best = other;
            }
        }
        let place = keypoints[best.b as usize].at;
        let of_another_place = |found: &Correspondence| {
            let elsewhere = (place - keypoints[found.b as usize].at).norm() > self.same_place_px;
            if elsewhere {
                found.distance
            } else {
                found.second
            }
        };
        let second = of_blocks.iter().map(of_another_place);
        Some(Correspondence {
            a,
            second: second.fold(f32::INFINITY, f32::min),
            ..*best
        })
    }
}

/// The nearest feature of each block of `b`, for each row of `a`.
fn of_all_blocks(a: &Descriptors, b: &Descriptors) -> Vec<Correspondences> {
    let mut of_blocks = vec![Correspondences::new(); a.len()];
    for first in (0..b.len()).step_by(BLOCK) {
        for mut m in two_nearest(a, &rows(b, first)) {
            m.b += first as u32;
            of_blocks[m.a as usize].push(m);
        }
    }
    of_blocks
}

/// The rows of one block.
fn rows(descriptors: &Descriptors, first: usize) -> Descriptors {
    let last = (first + BLOCK).min(descriptors.len());
    match descriptors {
        Descriptors::Float(rows) => {
            let data = &rows.data()[first * rows.dim()..last * rows.dim()];
            Descriptors::Float(FloatRows::from_vec(rows.dim(), data.to_vec()))
        }
        Descriptors::Binary(rows) => {
            let data = &rows.data()[first * rows.words()..last * rows.words()];
            Descriptors::Binary(BinaryRows::from_vec(rows.bits(), data.to_vec()))
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;
    use crate::features::Keypoint;
    use crate::image::Size;
    use crate::seed::Seed;

    fn features(points: &[(f32, f32)]) -> Features {
        let keypoint = |&(x, _): &(f32, f32)| Keypoint {
            at: Point2::new(x, 0.0),
            size: 1.0,
            angle: None,
            response: 1.0,
            octave: 0,
        };
        let values = points.iter().map(|&(_, value)| value).collect();
        Features::new(
            Size::new(1000, 1),
            points.iter().map(keypoint).collect(),
            Descriptors::Float(FloatRows::from_vec(1, values)),
        )
    }

    #[test]
    fn the_second_is_of_another_place() {
        // Blocks of padding lie between the versions of the place at 100.
        let padding = || vec![(900.0, 50.0); BLOCK - 1];
        let mut points = vec![(100.0, 1.25)];
        points.extend(padding());
        points.push((101.0, 1.0));
        points.extend(padding());
        points.extend([(500.0, 4.0)]);
        let a = features(&[(0.0, 0.0)]);
        let found = PlacewiseNeighbours::default().search(&a, &features(&points));
        let expected = Correspondence {
            a: 0,
            b: BLOCK as u32,
            distance: 1.0,
            second: 4.0,
        };
        assert_eq!(found, [expected]);
    }

    #[test]
    fn blocks_without_influence_are_no_loss() {
        // Versions of few places, scattered over all blocks, whose descriptors and positions differ
        // by more or less; so that places overlap in both.
        let mut rng = Seed(4).rng();
        let dim = 20;
        let places: Vec<(f32, Vec<f32>)> = (0..60)
            .map(|_| {
                let values = (0..dim).map(|_| rng.normal() as f32).collect();
                (300.0 * rng.uniform() as f32, values)
            })
            .collect();
        let mut draw = |count: usize| {
            let (mut points, mut values) = (Vec::new(), Vec::new());
            for _ in 0..count {
                let (x, place) = &places[rng.below(60) as usize];
                points.push((x + 4.0 * rng.normal() as f32, 0.0));
                let width = rng.uniform() as f32;
                values.extend(
                    place
                        .iter()
                        .map(|value| value + width * rng.normal() as f32),
                );
            }
            let mut features = features(&points);
            features.descriptors = Descriptors::Float(FloatRows::from_vec(dim, values));
            features
        };
        let (a, b) = (draw(700), draw(3000));
        let search = PlacewiseNeighbours::default();
        let all = of_all_blocks(&a.descriptors, &b.descriptors);
        let expected: Correspondences = (0..)
            .zip(&all)
            .filter_map(|(a, of_blocks)| search.match_of(a, of_blocks, &b.keypoints))
            .collect();
        assert_eq!(search.search(&a, &b), expected);

        let matter = search.of_blocks_that_matter(&a, &b);
        let (mut blocks, mut of_all) = (0, 0);
        for (matter, all) in matter.iter().zip(&all) {
            if let Some(matter) = matter {
                blocks += matter.len();
                of_all += all.len();
            }
        }
        assert!(of_all == 0 || blocks < of_all, "all {blocks} blocks matter");
    }

    #[test]
    fn the_nearest_is_that_of_the_plain_search() {
        let mut rng = Seed(2).rng();
        let mut random = |count: usize| {
            let points: Vec<_> = (0..count)
                .map(|_| (1000.0 * rng.uniform() as f32, rng.below(5000) as f32))
                .collect();
            features(&points)
        };
        let (a, b) = (random(300), random(2 * BLOCK + 70));
        let found = PlacewiseNeighbours::default().search(&a, &b);
        let plain = two_nearest(&a.descriptors, &b.descriptors);
        assert_eq!(found.len(), plain.len());
        for (found, plain) in found.iter().zip(&plain) {
            assert_eq!(
                (found.a, found.b, found.distance),
                (plain.a, plain.b, plain.distance)
            );
            assert!(found.second >= plain.second);
        }
    }

    #[test]
    fn nothing_is_found_among_nothing() {
        let (none, one) = (features(&[]), features(&[(1.0, 2.0)]));
        let search = PlacewiseNeighbours::default();
        assert_eq!(search.search(&none, &one), []);
        assert_eq!(search.search(&one, &none), []);
        assert_eq!(search.search(&one, &one)[0].second, f32::INFINITY);
        let nan = features(&[(f32::NAN, f32::NAN)]);
        assert_eq!(search.search(&one, &nan), []);
    }
}
