//! Exact nearest neighbours where features of one place come in many versions.
//!
//! J.-M. Morel, G. Yu: "ASIFT: A New Framework for Fully Affine Invariant Image Comparison", SIAM
//! Journal on Imaging Sciences 2(2), 438-469, 2009, section 4.3 compares simulated views pair by
//! pair. Here all features are compared at once, in one pass over blocks of `b`:
//!
//! 1. Each block gives its nearest feature and the distance to its second.
//! 2. The nearest of all blocks is the match.
//! 3. [`Correspondence::second`] is the distance to the nearest feature of *another place*: the
//!    nearest of a block that lies farther than `same_place_px` from the match, or the second of a
//!    block whose nearest does not.
//!
//! | field | default | source |
//! | --- | --- | --- |
//! | `same_place_px` | 6 | - |
//!
//! Blocks follow the order of `b`, in which the versions of a place are far apart (each is in
//! another simulated view), so a block seldom holds two of them; where it does, `second` is too
//! small and the ratio test too strict.

use super::{Correspondence, Correspondences, Search, two_nearest};
use crate::features::{BinaryRows, Descriptors, Features, FloatRows};

/// Features in a block.
const BLOCK: usize = 256;

/// Exact search whose second neighbours are of another place.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct PlacewiseNeighbours {
    /// Features nearer to each other than this, in pixels, show the same place.
    pub same_place_px: f32,
}

impl Default for PlacewiseNeighbours {
    fn default() -> Self {
        Self { same_place_px: 6.0 }
    }
}

impl Search for PlacewiseNeighbours {
    fn search(&self, a: &Features, b: &Features) -> Correspondences {
        let blocks: Vec<Correspondences> = (0..b.len())
            .step_by(BLOCK)
            .map(|first| {
                let mut found = two_nearest(&a.descriptors, &rows(&b.descriptors, first));
                for m in &mut found {
                    m.b += first as u32;
                }
                found
            })
            .collect();
        let mut best: Vec<Option<Correspondence>> = vec![None; a.len()];
        for m in blocks.iter().flatten() {
            let best = &mut best[m.a as usize];
            if best.is_none_or(|best| m.distance < best.distance) {
                *best = Some(Correspondence {
                    second: f32::INFINITY,
                    ..*m
                });
            }
        }
        for m in blocks.iter().flatten() {
            let Some(best) = &mut best[m.a as usize] else {
                continue;
            };
            let [place, other] = [best.b, m.b].map(|index| b.keypoints[index as usize].at);
            let elsewhere = (place - other).norm() > self.same_place_px;
            let second = if elsewhere { m.distance } else { m.second };
            best.second = best.second.min(second);
        }
        best.into_iter().flatten().collect()
    }
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
