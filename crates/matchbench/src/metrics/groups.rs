//! Which methods of a dataset do not differ significantly: all of them compared with all.
//!
//! 1. The difference of two AUCs on the same pairs has a standard error by the paired bootstrap
//!    over reference images (see [`Bootstrap`]): all methods see the same resampled images.
//! 2. A difference of so many standard errors has a two-sided p-value by the normal distribution.
//!    Counting resamples cannot tell p-values below 1 / resamples, which step 3 asks for.
//! 3. Holm, "A Simple Sequentially Rejective Multiple Test Procedure", Scand. J. Statistics 6(2),
//!    1979: with m comparisons, the smallest p-value is held against alpha / m, the next against
//!    alpha / (m - 1) and so on, up to the first that is too large. alpha is 1 - [`Bootstrap::level`].
//! 4. Piepho, "An Algorithm for a Letter-Based Representation of All-Pairwise Comparisons",
//!    J. Comp. Graph. Statistics 13(2), 2004: from one group of all, each significant difference
//!    splits the groups that hold both sides; groups within others are dropped. Each group is a
//!    letter, those with the best method first. Two methods that share a letter do not differ
//!    significantly; two that share none do.

use std::collections::{BTreeMap, BTreeSet};

use super::success::gain;
use super::{Angle, Bootstrap, Model, PairResult, ResultSet};

/// What a table says about its letters.
pub const GROUP_LEVEL_NOTE: &str = "Methods of a dataset that share a letter do not differ significantly \
     (paired bootstrap over images, Holm-corrected, 5 %).";

/// With more groups than letters nothing is marked.
const LETTERS: usize = 26;

/// The letters of each set of results, in the order of `sets`. Empty where a dataset has one set,
/// fewer than two reference images that all sets have, or more groups than letters.
pub fn groups(sets: &[ResultSet], bootstrap: &Bootstrap) -> Vec<String> {
    let mut letters = vec![String::new(); sets.len()];
    // Poses and homographies of one dataset are not compared.
    let key = |set: &ResultSet| (set.dataset.clone(), Model::of_all(&set.pairs));
    let rivals: BTreeSet<(String, Model)> = sets.iter().map(key).collect();
    for rivals in rivals {
        let mut members: Vec<usize> = (0..sets.len())
            .filter(|&i| key(&sets[i]) == rivals)
            .collect();
        let samples = samples(members.iter().map(|&i| &sets[i]).collect(), bootstrap);
        let Some(Samples { aucs, resampled }) = samples else {
            continue;
        };
        let mut order: Vec<usize> = (0..members.len()).collect();
        order.sort_by(|&one, &other| aucs[other].total_cmp(&aucs[one]));
        members = order.iter().map(|&k| members[k]).collect();
        let mut tests = Vec::new();
        for i in 0..order.len() {
            for j in i + 1..order.len() {
                let (one, other) = (order[i], order[j]);
                let p = p_value(aucs[one] - aucs[other], &resampled[one], &resampled[other]);
                tests.push((p, i, j));
            }
        }
        for (member, text) in members
            .iter()
            .zip(letters_of(order.len(), &holm(tests, 1.0 - bootstrap.level)))
        {
            letters[*member] = text;
        }
    }
    letters
}

/// The AUC of each set, and its values on the resampled images, the same images for all sets.
struct Samples {
    aucs: Vec<f64>,
    resampled: Vec<Vec<f64>>,
}

fn samples(sets: Vec<&ResultSet>, bootstrap: &Bootstrap) -> Option<Samples> {
    let key = |pair: &PairResult| (pair.a, pair.b, pair.repetition);
    let mut common: BTreeSet<_> = sets.first()?.pairs.iter().map(key).collect();
    for set in &sets[1..] {
        let own: BTreeSet<_> = set.pairs.iter().map(key).collect();
        common.retain(|pair| own.contains(pair));
    }
    let mut clusters = BTreeMap::<u32, usize>::new();
    for (a, _, _) in &common {
        let next = clusters.len();
        clusters.entry(*a).or_insert(next);
    }
    if sets.len() < 2 || clusters.len() < 2 || bootstrap.resamples < 2 {
        return None;
    }
    let mut sizes = vec![0.0; clusters.len()];
    for (a, _, _) in &common {
        sizes[clusters[a]] += 1.0;
    }
    let sums: Vec<Vec<f64>> = (sets.iter())
        .map(|set| {
            let mut sums = vec![0.0; clusters.len()];
            for pair in set.pairs.iter().filter(|pair| common.contains(&key(pair))) {
                sums[clusters[&pair.a]] += gain(pair, Angle::Pose);
            }
            sums
        })
        .collect();
    let auc = |sums: &[f64], images: &mut dyn Iterator<Item = usize>| {
        let (top, bottom) = images.fold((0.0, 0.0), |(top, bottom), i| {
            (top + sums[i], bottom + sizes[i])
        });
        top / bottom
    };
    let mut rng = bootstrap.seed.child("bootstrap").rng();
    let mut resampled = vec![Vec::with_capacity(bootstrap.resamples); sets.len()];
    for _ in 0..bootstrap.resamples {
        let drawn: Vec<usize> = (0..sizes.len())
            .map(|_| rng.below(sizes.len() as u32) as usize)
            .collect();
        for (values, sums) in resampled.iter_mut().zip(&sums) {
            values.push(auc(sums, &mut drawn.iter().copied()));
        }
    }
    Some(Samples {
        aucs: (sums.iter())
            .map(|sums| auc(sums, &mut (0..sizes.len())))
            .collect(),
        resampled,
    })
}

/// Two-sided p-value of a difference, by the standard deviation of its resampled values.
fn p_value(difference: f64, one: &[f64], other: &[f64]) -> f64 {
    let differences = || one.iter().zip(other).map(|(one, other)| one - other);
    let mean = differences().sum::<f64>() / one.len() as f64;
    let squares: f64 = differences().map(|d| (d - mean) * (d - mean)).sum();
    let error = (squares / (one.len() - 1) as f64).sqrt();
    if difference == 0.0 {
        1.0
    } else {
        libm::erfc(difference.abs() / error / std::f64::consts::SQRT_2)
    }
}

/// The comparisons that are significant, all of them together at the level `alpha`.
fn holm(mut tests: Vec<(f64, usize, usize)>, alpha: f64) -> Vec<(usize, usize)> {
    tests.sort_by(|one, other| one.0.total_cmp(&other.0));
    let count = tests.len();
    (tests.into_iter().enumerate())
        .take_while(|(rank, (p, _, _))| *p <= alpha / (count - rank) as f64)
        .map(|(_, (_, i, j))| (i, j))
        .collect()
}

/// The letters of `count` methods, the best first, of which the `different` pairs share none.
fn letters_of(count: usize, different: &[(usize, usize)]) -> Vec<String> {
    let nothing = || vec![String::new(); count];
    let mut groups: Vec<BTreeSet<usize>> = vec![(0..count).collect()];
    for &(i, j) in different {
        let (both, mut kept): (Vec<_>, Vec<_>) =
            (groups.into_iter()).partition(|group| group.contains(&i) && group.contains(&j));
        for group in both {
            for out in [i, j] {
                let mut part = group.clone();
                part.remove(&out);
                if !kept.iter().any(|other| part.is_subset(other)) {
                    kept.retain(|other| !other.is_subset(&part));
                    kept.push(part);
                }
            }
        }
        // Real comparisons follow the order of the scores and stay far below; others could double
        // the groups with every step.
        if kept.len() > 20 * LETTERS {
            return nothing();
        }
        groups = kept;
    }
    if groups.len() > LETTERS {
        return nothing();
    }
    groups.sort();
    (0..count)
        .map(|method| {
            (groups.iter().zip('a'..))
                .filter(|(group, _)| group.contains(&method))
                .map(|(_, letter)| letter)
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::pair_result::tests::solved;
    use super::*;

    /// One pair for each of 60 images, whose error the function gives.
    fn set(matcher: &str, error: impl Fn(u32) -> f64) -> ResultSet {
        ResultSet {
            dataset: "room".into(),
            matcher: matcher.into(),
            estimator: String::new(),
            repetitions: 1,
            pairs: (0..60).map(|a| solved(a, error(a), 0.0, 30)).collect(),
            ignored: 0,
        }
    }

    #[test]
    fn equal_methods_share_a_letter_and_worse_ones_do_not() {
        let sets = [
            set("bad", |a| f64::from(a % 7) + 8.5),
            set("good", |a| f64::from(a % 7) + 0.5),
            // Better on half of the images, worse on the other: nobody knows.
            set("rival", |a| {
                f64::from(a % 7) + if a % 2 == 0 { 0.2 } else { 1.6 }
            }),
        ];
        let letters = groups(&sets, &Bootstrap::default());
        assert_eq!(letters[1], "a");
        assert!(letters[2].contains('a') || letters[2] == "b");
        assert!(
            !letters[0].is_empty() && !letters[0].contains('a'),
            "{letters:?}"
        );
        let twice = [sets[1].clone(), sets[1].clone()];
        assert_eq!(groups(&twice, &Bootstrap::default()), ["a", "a"]);
    }

    #[test]
    fn nothing_is_marked_without_a_comparison() {
        assert_eq!(groups(&[set("sift", |_| 1.0)], &Bootstrap::default()), [""]);
        let mut one = set("sift", |_| 1.0);
        one.pairs.truncate(1);
        assert_eq!(groups(&[one.clone(), one], &Bootstrap::default()), ["", ""]);
    }

    #[test]
    fn holm_stops_at_the_first_that_is_too_large() {
        // 0.05 / 3, 0.05 / 2, 0.05: the second fails, so the third does not count either.
        let tests = vec![(0.04, 0, 1), (0.01, 0, 2), (0.03, 1, 2)];
        assert_eq!(holm(tests, 0.05), [(0, 2)]);
        let tests = vec![(0.04, 0, 1), (0.01, 0, 2), (0.02, 1, 2)];
        assert_eq!(holm(tests, 0.05), [(0, 2), (1, 2), (0, 1)]);
    }

    #[test]
    fn letters_overlap_where_the_middle_differs_from_neither() {
        assert_eq!(letters_of(3, &[(0, 2)]), ["a", "ab", "b"]);
        assert_eq!(letters_of(3, &[]), ["a", "a", "a"]);
        assert_eq!(letters_of(3, &[(0, 1), (0, 2), (1, 2)]), ["a", "b", "c"]);
        assert_eq!(
            letters_of(4, &[(0, 2), (0, 3), (1, 3)]),
            ["a", "ab", "bc", "c"]
        );
    }

    #[test]
    fn p_values_are_those_of_the_normal_distribution() {
        // Resampled differences -1 and 1: standard deviation sqrt(4 / 3) of four values.
        let (one, other) = ([1.0, -1.0, 1.0, -1.0], [0.0; 4]);
        let p = p_value(1.959_964 * (4.0_f64 / 3.0).sqrt(), &one, &other);
        assert!((p - 0.05).abs() < 1e-6, "{p}");
        assert_eq!(p_value(0.0, &[0.0; 3], &[0.0; 3]), 1.0);
        assert_eq!(p_value(0.1, &[0.1; 3], &[0.0; 3]), 0.0);
    }
}
