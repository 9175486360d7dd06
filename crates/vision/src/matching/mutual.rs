//! The mutual check: a match is trusted where each feature is the other's nearest.
//!
//! The search from `b` to `a` that this needs is made only for the features of `b` that are still
//! matched, so the check is cheap after a ratio test and costs a second search before one. That
//! search is exact, whichever search made the matches; of equally near features of `a` the one
//! with the lowest index counts.

use super::{Correspondences, Selector, View, two_nearest};
use crate::seed::Seed;

/// Keeps a match if its feature of `a` is the nearest of all features of `a` to its feature of `b`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MutualCheck;

impl Selector for MutualCheck {
    fn select(&self, a: View<'_>, b: View<'_>, matches: &mut Correspondences, _seed: Seed) {
        keep_mutual(a, b, matches, |_| ());
    }

    fn uses_seed(&self) -> bool {
        false
    }
}

/// Keeps a match if its feature of `a` is the nearest to its feature of `b`, and if the match from `b` to `a`
/// passes `select`.
pub(super) fn keep_mutual(
    a: View<'_>,
    b: View<'_>,
    matches: &mut Correspondences,
    select: impl FnOnce(&mut Correspondences),
) {
    let mut matched: Vec<u32> = matches.iter().map(|m| m.b).collect();
    matched.sort_unstable();
    matched.dedup();

    let queries = (b.features.descriptors).select(matched.iter().map(|&b| b as usize));
    let mut back = two_nearest(&queries, &a.features.descriptors);
    select(&mut back);
    let mut nearest_in_a = vec![None; b.features.len()];
    for reverse in back {
        nearest_in_a[matched[reverse.a as usize] as usize] = Some(reverse.b);
    }
    matches.retain(|m| nearest_in_a[m.b as usize] == Some(m.a));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::{BinaryRows, Descriptors, Features, FloatRows};
    use crate::matching::{NearestNeighbours, Search};

    /// Pairs that are left of all nearest neighbours.
    fn mutual(a: Descriptors, b: Descriptors) -> Vec<(u32, u32)> {
        let [a, b] = [a, b].map(Features::of_descriptors);
        let mut matches = NearestNeighbours.search(&a, &b);
        let [a, b] = [&a, &b].map(|features| View {
            features,
            image: None,
            camera: None,
        });
        MutualCheck.select(a, b, &mut matches, Seed(0));
        matches.iter().map(|m| (m.a, m.b)).collect()
    }

    #[test]
    fn only_mutual_matches_stay() {
        let floats = |data: &[f32]| Descriptors::Float(FloatRows::from_vec(1, data.to_vec()));
        // 1 and 3 both choose 2.5, which chooses 3; 8 and 10 are equally near to 9.
        let left = mutual(floats(&[1.0, 3.0, 8.0, 10.0]), floats(&[50.0, 2.5, 9.0]));
        assert_eq!(left, [(1, 1), (2, 2)]);
        assert_eq!(mutual(floats(&[f32::NAN]), floats(&[f32::NAN])), []);
        assert_eq!(mutual(floats(&[1.0]), floats(&[])), []);
    }

    #[test]
    fn binary_descriptors_are_checked_too() {
        let bits = |data: &[u64]| Descriptors::Binary(BinaryRows::from_vec(8, data.to_vec()));
        assert_eq!(
            mutual(bits(&[0, 1, 0xff]), bits(&[3, 0xfe])),
            [(1, 0), (2, 1)]
        );
    }
}
