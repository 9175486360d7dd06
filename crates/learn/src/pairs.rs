//! Pairs of patches of one point or of different points, and how well distances separate the two kinds.

use matchbench_vision::seed::Seed;

use crate::patches::PatchSet;

/// Two patches and whether they show the same point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PatchPair {
    pub(crate) first: usize,
    pub(crate) second: usize,
    pub(crate) same: bool,
}

/// Where the negative of a triplet comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Negatives {
    /// The most similar keypoint elsewhere in the other image.
    Hard,
    /// A random triplet.
    Random,
}

/// The positive of a random triplet other than number `index` (in a set of one triplet, of that one). It may show the
/// same point, or even be a patch of number `index`, since triplets of one scene share points and patches. The tables
/// of the library were learned with it.
pub(crate) fn stranger(set: &PatchSet, index: usize, seed: Seed) -> usize {
    let count = set.triplets.len() as u32;
    let mut rng = seed.number(index as u64).rng();
    let other = (index as u32 + 1 + rng.below(count.max(2) - 1)) % count;
    set.triplets[other as usize].positive as usize
}

/// For each triplet, in an order shuffled by `seed`, its positive pair and one negative pair; hard and random
/// negatives alternate. At most `most` pairs.
pub(crate) fn training_pairs(set: &PatchSet, most: usize, seed: Seed) -> Vec<PatchPair> {
    let mut pairs = Vec::new();
    for (n, &index) in shuffled(set.triplets.len(), seed)
        .iter()
        .take(most / 2)
        .enumerate()
    {
        let triplet = set.triplets[index];
        let first = triplet.anchor as usize;
        let negative = if n.is_multiple_of(2) {
            triplet.negative as usize
        } else {
            stranger(set, index, seed)
        };
        let pair = |second, same| PatchPair {
            first,
            second,
            same,
        };
        pairs.push(pair(triplet.positive as usize, true));
        pairs.push(pair(negative, false));
    }
    pairs
}

/// `0..count` in random order. This is not the order of `Rng::shuffle`, which swaps from the last to the first; the
/// tables of the library were learned with this one.
pub(crate) fn shuffled(count: usize, seed: Seed) -> Vec<usize> {
    let mut rng = seed.child("order").rng();
    let mut order: Vec<usize> = (0..count).collect();
    for i in 1..count {
        order.swap(i, rng.below(i as u32 + 1) as usize);
    }
    order
}

/// The slope of the logistic loss of each pair at the margin `label (score - offset)`, and the offset of least
/// loss. At this offset both kinds of pairs have the same total weight.
pub(crate) fn logistic_weights(labels: &[f32], scores: &[f32]) -> (Vec<f32>, f32) {
    let weights = |offset: f32| {
        let margins = labels.iter().zip(scores);
        margins.map(move |(label, score)| 1.0 / (1.0 + libm::expf(label * (score - offset))))
    };
    let (mut low, mut high) = (-20.0_f32, 20.0_f32);
    for _ in 0..16 {
        let middle = 0.5 * (low + high);
        let excess: f32 = weights(middle)
            .zip(labels)
            .map(|(w, label)| label * w)
            .sum();
        // A larger offset makes pairs of one point weigh more.
        if excess > 0.0 {
            high = middle;
        } else {
            low = middle;
        }
    }
    let offset = 0.5 * (low + high);
    (weights(offset).collect(), offset)
}

/// The share of the `different` pairs that are accepted by the smallest threshold that accepts 95 % of the
/// `same` pairs (FPR95). `None` if either list is empty.
pub(crate) fn fpr95(mut same: Vec<f32>, different: &[f32]) -> Option<f64> {
    same.sort_by(f32::total_cmp);
    let needed = (19 * same.len()).div_ceil(20);
    let threshold = *same.get(needed.checked_sub(1)?)?;
    let accepted = different.iter().filter(|&&d| d <= threshold).count();
    (!different.is_empty()).then(|| accepted as f64 / different.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn false_positives_are_counted_where_95_of_100_are_accepted() {
        let same: Vec<f32> = (1..=100).map(|i| i as f32).collect();
        let different: Vec<f32> = (1..=1000).map(|i| 90.5 + i as f32).collect();
        // Accepted up to 95: 91.5, 92.5, 93.5, 94.5.
        assert_eq!(fpr95(same.clone(), &different), Some(0.004));
        assert_eq!(fpr95(same, &[]), None);
        assert_eq!(fpr95(Vec::new(), &different), None);
    }

    #[test]
    fn an_order_holds_each_number_once() {
        let mut order = shuffled(50, Seed(1));
        assert_ne!(order, shuffled(50, Seed(2)));
        order.sort_unstable();
        assert!(order.into_iter().eq(0..50));
    }
}
