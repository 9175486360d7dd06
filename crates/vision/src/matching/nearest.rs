//! Exact nearest neighbours: every descriptor of `a` is compared with every descriptor of `b`.
//!
//! Both best neighbours are found in one pass: for real-valued descriptors by Euclidean distance, for binary
//! ones by the number of differing bits. A cheap lower bound rejects most candidates without changing a
//! result (`simd::search`). What is computed from the real values of `b` alone is kept with them, so of many
//! searches among the same candidates the first takes longest.
//!
//! Choices: of equally near features of `b` the one with the lowest index is the nearest, and the
//! next of them gives [`Correspondence::second`]. Euclidean distances are compared squared. A
//! distance that is not a finite number (a descriptor holds NaN) is never the nearest; a
//! feature of `a` with no finite distance has no correspondence.

use super::{Correspondence, Correspondences, Search};
use crate::features::{Descriptors, Features};
use crate::simd::{TwoNearest, two_nearest_bits, two_nearest_floats};

/// Exact search for the nearest neighbours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NearestNeighbours;

impl Search for NearestNeighbours {
    fn search(&self, a: &Features, b: &Features) -> Correspondences {
        two_nearest(&a.descriptors, &b.descriptors)
    }

    fn search_below(&self, a: &Features, b: &Features, ratio: f32) -> Correspondences {
        two_nearest_below(&a.descriptors, &b.descriptors, ratio)
    }
}

/// For each descriptor of `a`, the nearest of `b` and the distance to the second nearest, in the order of `a`.
/// Empty if `b` is empty.
///
/// # Panics
/// If the descriptors are of different kinds.
pub fn two_nearest(a: &Descriptors, b: &Descriptors) -> Correspondences {
    found(a, b, None)
}

/// [`two_nearest`] in less time, for a [`RatioTest`](super::RatioTest) at this `ratio`: see [`Search::search_below`].
///
/// # Panics
/// If the descriptors are of different kinds.
pub fn two_nearest_below(a: &Descriptors, b: &Descriptors, ratio: f32) -> Correspondences {
    found(a, b, Some(ratio))
}

/// [`two_nearest`], or [`two_nearest_below`] a `ratio`.
fn found(a: &Descriptors, b: &Descriptors, ratio: Option<f32>) -> Correspondences {
    assert_eq!(a.kind(), b.kind(), "descriptors of one kind");
    let (best, squared) = match (a, b) {
        (Descriptors::Float(a), Descriptors::Float(b)) => {
            let found = two_nearest_floats(a.data(), b.data(), a.dim(), b.prepared(), ratio);
            (found, true)
        }
        (Descriptors::Binary(a), Descriptors::Binary(b)) => {
            (two_nearest_bits(a.data(), b.data(), a.words()), false)
        }
        _ => unreachable!("the kinds are equal"),
    };
    let distance = |value: f32| if squared { value.sqrt() } else { value };
    let correspondence = |(best, a): (TwoNearest, u32)| Correspondence {
        a,
        b: best.index,
        distance: distance(best.nearest),
        second: distance(best.second),
    };
    best.into_iter()
        .zip(0..)
        .filter(|(best, _)| best.nearest.is_finite())
        .map(correspondence)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::{BinaryRows, DescriptorKind, FloatRows};
    use crate::seed::Seed;

    fn floats(dim: usize, data: &[f32]) -> Descriptors {
        Descriptors::Float(FloatRows::from_vec(dim, data.to_vec()))
    }

    fn correspondence((a, b, distance, second): (u32, u32, f32, f32)) -> Correspondence {
        Correspondence {
            a,
            b,
            distance,
            second,
        }
    }

    #[test]
    fn distances_are_euclidean() {
        let a = floats(2, &[0.0, 0.0, 10.5, 0.0]);
        let b = floats(2, &[3.0, 4.0, 10.0, 0.0, 6.0, 8.0, 10.5, -2.0]);
        let expected = [(0, 0, 5.0, 10.0), (1, 1, 0.5, 2.0)];
        assert_eq!(two_nearest(&a, &b), expected.map(correspondence));
    }

    /// 486 bits (AKAZE) do not fill their words.
    #[test]
    fn distances_of_bits_are_counts() {
        for bits in [8, 256, 486, 512] {
            let mut rng = Seed(3).rng();
            let mut rows = |count: usize| {
                let mut rows = BinaryRows::new(bits);
                for _ in 0..count {
                    let mut row = vec![0; rows.words()];
                    (0..bits)
                        .for_each(|bit| row[bit / 64] |= u64::from(rng.below(2)) << (bit % 64));
                    rows.push(&row);
                }
                rows
            };
            let (a, b) = (rows(7), rows(33));
            let found = two_nearest(
                &Descriptors::Binary(a.clone()),
                &Descriptors::Binary(b.clone()),
            );
            assert_eq!(found.len(), a.len());
            for (found, index) in found.iter().zip(0..) {
                let bit = |row: &[u64], bit: usize| row[bit / 64] >> (bit % 64) & 1;
                let mut all: Vec<(usize, u32)> = (0..b.len())
                    .map(|j| {
                        let differs = |&k: &usize| bit(a.row(index), k) != bit(b.row(j), k);
                        ((0..bits).filter(differs).count(), j as u32)
                    })
                    .collect();
                all.sort_unstable();
                let expected = (index as u32, all[0].1, all[0].0 as f32, all[1].0 as f32);
                assert_eq!(*found, correspondence(expected), "{bits} bits");
            }
        }
    }

    #[test]
    fn lowest_index_wins_a_tie() {
        let found = two_nearest(&floats(1, &[5.0]), &floats(1, &[9.0, 4.0, 6.0, 4.0]));
        assert_eq!(found, [correspondence((0, 1, 1.0, 1.0))]);
    }

    #[test]
    fn one_candidate_has_no_second() {
        let found = two_nearest(&floats(1, &[5.0]), &floats(1, &[1.0]));
        assert_eq!(found, [correspondence((0, 0, 4.0, f32::INFINITY))]);
    }

    #[test]
    fn nothing_is_found_among_nothing() {
        for kind in [
            DescriptorKind::Float { dim: 128 },
            DescriptorKind::Binary { bits: 256 },
        ] {
            let none = Descriptors::empty(kind);
            assert_eq!(two_nearest(&none, &none), []);
        }
        assert_eq!(two_nearest(&floats(1, &[1.0]), &floats(1, &[])), []);
    }

    #[test]
    fn nan_never_wins() {
        let a = floats(1, &[1.0, f32::NAN, 2.0]);
        let b = floats(1, &[f32::NAN, 5.0, f32::INFINITY]);
        let expected = [(0, 1, 4.0, f32::INFINITY), (2, 1, 3.0, f32::INFINITY)];
        assert_eq!(two_nearest(&a, &b), expected.map(correspondence));
        assert_eq!(two_nearest(&a, &floats(1, &[f32::NAN])), []);
    }

    #[test]
    #[should_panic(expected = "descriptors of one kind")]
    fn different_kinds_are_refused() {
        two_nearest(&floats(2, &[]), &floats(3, &[]));
    }
}
