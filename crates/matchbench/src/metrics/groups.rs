//! Which methods of a dataset do not differ significantly: all of them compared with all.
//!
//! 1. Two methods are compared on the pairs that all of them have (`significance.rs`).
//! 2. Holm, "A Simple Sequentially Rejective Multiple Test Procedure", Scand. J. Statistics 6(2),
//!    1979: with m comparisons, the smallest p-value is held against alpha / m, the next against
//!    alpha / (m - 1) and so on, up to the first that is too large. alpha is 0.05.
//! 3. Piepho, "An Algorithm for a Letter-Based Representation of All-Pairwise Comparisons",
//!    J. Comp. Graph. Statistics 13(2), 2004: from one group of all, each significant difference
//!    splits the groups that hold both sides; groups within others are dropped. Each group is a
//!    letter, those with the best method first. Two methods that share a letter do not differ
//!    significantly; two that share none do.

use std::collections::{BTreeMap, BTreeSet};

use super::gains::gains;
use super::intervals::{Dyads, MIN_IMAGES};
use super::significance::p_value;
use super::students_t::ALPHA;
use super::{Angle, Model, PairResult, ResultSet};

/// What a table says about its letters.
pub const GROUP_LEVEL_NOTE: &str = "Methods of a dataset that share a letter do not differ significantly \
     (paired t test over images, of which there are at least 6, Holm-corrected, 5 %).";

/// What a table says where there are more groups than letters.
pub const NO_LETTERS_NOTE: &str = "Methods of a dataset have no letters if they form more than 26 groups \
     within which they do not differ significantly.";

/// With more groups than letters nothing is marked.
const LETTERS: usize = 26;

/// What comparing all sets of results with each other comes to.
#[derive(Clone, Debug, PartialEq)]
pub struct Groups {
    /// The letters of each set, in the order of the sets. Empty where a dataset has one set, too few images
    /// that all sets have, or more groups than letters.
    pub letters: Vec<String>,
    /// Of each set, whether it has no letter since the sets of its dataset form more groups than there are letters.
    pub beyond_letters: Vec<bool>,
    /// Which sets differ significantly, the lower place first: those without a common letter.
    different: BTreeSet<(usize, usize)>,
}

impl Groups {
    /// Whether the sets at these places differ significantly.
    pub(super) fn differ(&self, one: usize, other: usize) -> bool {
        self.different.contains(&(one.min(other), one.max(other)))
    }

    /// The same of a longer list, in which each set is a copy of the set of these at one of the `places`.
    pub(crate) fn of_copies(&self, places: &[usize]) -> Self {
        let all = (0..places.len()).flat_map(|one| (one + 1..places.len()).map(move |o| (one, o)));
        Self {
            letters: (places.iter().map(|&at| self.letters[at].clone())).collect(),
            beyond_letters: (places.iter().map(|&at| self.beyond_letters[at])).collect(),
            different: (all.filter(|&(one, other)| self.differ(places[one], places[other])))
                .collect(),
        }
    }
}

/// Compares the sets of each dataset, all with all.
pub fn groups(sets: &[ResultSet]) -> Groups {
    let mut letters = vec![String::new(); sets.len()];
    let mut beyond_letters = vec![false; sets.len()];
    let mut different = BTreeSet::new();
    for rivals in Rivals::of_all(sets) {
        let members = &rivals.members;
        let pairs = rivals.different();
        match letters_of(members.len(), &pairs) {
            Some(of_members) => {
                for (member, text) in members.iter().zip(of_members) {
                    letters[*member] = text;
                }
            }
            None => members.iter().for_each(|&i| beyond_letters[i] = true),
        }
        for (i, j) in pairs {
            let (one, other) = (members[i], members[j]);
            different.insert((one.min(other), one.max(other)));
        }
    }
    Groups {
        letters,
        beyond_letters,
        different,
    }
}

/// The sets of results of a dataset that are compared.
struct Rivals {
    /// Their places among all sets, the highest AUC first.
    members: Vec<usize>,
    /// The pairs of images that all have.
    dyads: Dyads,
    /// For each member and each of these pairs, the sum of what it gains in all repetitions.
    sums: Vec<Vec<f64>>,
    /// The number of repetitions, for each pair.
    sizes: Vec<f64>,
}

impl Rivals {
    /// Those of all datasets with several sets and enough images. Poses and homographies of one
    /// dataset are not compared.
    fn of_all(sets: &[ResultSet]) -> Vec<Self> {
        let mut rivals = BTreeMap::<(&str, Model), Vec<usize>>::new();
        // What is not finished is not compared with what is.
        for (i, set) in sets.iter().enumerate().filter(|(_, set)| set.lacking == 0) {
            let key = (set.dataset.as_str(), set.model());
            rivals.entry(key).or_default().push(i);
        }
        (rivals.into_values())
            .filter_map(|members| Self::new(sets, members))
            .collect()
    }

    fn new(sets: &[ResultSet], members: Vec<usize>) -> Option<Self> {
        let key = |pair: &PairResult| (pair.a, pair.b, pair.repetition);
        let keys = |&i: &usize| -> BTreeSet<_> { sets[i].pairs.iter().map(key).collect() };
        let mut common = members.first().map(keys)?;
        for member in &members[1..] {
            let own = keys(member);
            common.retain(|pair| own.contains(pair));
        }
        let (dyads, places) = Dyads::of(common.iter().map(|&(a, b, _)| (a, b)));
        if members.len() < 2 || dyads.units() < MIN_IMAGES {
            return None;
        }
        let mut sizes = vec![0.0; dyads.len()];
        for place in &places {
            sizes[*place] += 1.0;
        }
        let place_of: BTreeMap<_, usize> = common.into_iter().zip(places).collect();
        let sums = |&i: &usize| {
            let mut sums = vec![0.0; dyads.len()];
            let place = |pair: &PairResult| place_of.get(&key(pair)).copied();
            let (places, pairs): (Vec<usize>, Vec<&PairResult>) = (sets[i].pairs.iter())
                .filter_map(|pair| Some((place(pair)?, pair)))
                .unzip();
            for (place, gain) in places.into_iter().zip(gains(&pairs, Angle::Pose)) {
                sums[place] += gain.expect("poses and homographies have it");
            }
            (i, sums)
        };
        let mut members: Vec<(usize, Vec<f64>)> = members.iter().map(sums).collect();
        let total = |(_, sums): &(usize, Vec<f64>)| sums.iter().sum::<f64>();
        members.sort_by(|one, other| total(other).total_cmp(&total(one)));
        let (members, sums) = members.into_iter().unzip();
        Some(Self {
            members,
            dyads,
            sums,
            sizes,
        })
    }

    /// The members that differ significantly, by their places among the members.
    fn different(&self) -> Vec<(usize, usize)> {
        let mut tests = Vec::new();
        for i in 0..self.members.len() {
            for j in i + 1..self.members.len() {
                let tops = (self.sums[i].iter())
                    .zip(&self.sums[j])
                    .map(|(one, other)| one - other);
                let sums: Vec<(f64, f64)> = tops.zip(self.sizes.iter().copied()).collect();
                let ratio = self.dyads.ratio(&sums).expect("there are pairs");
                tests.push((p_value(&ratio).expect("there are enough images"), i, j));
            }
        }
        holm(tests, ALPHA)
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

/// The letters of `count` methods, the best first, of which the `different` pairs share none; `None` if there are more
/// groups than letters.
fn letters_of(count: usize, different: &[(usize, usize)]) -> Option<Vec<String>> {
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
            return None;
        }
        groups = kept;
    }
    if groups.len() > LETTERS {
        return None;
    }
    groups.sort();
    let letters = (0..count).map(|method| {
        (groups.iter().zip('a'..))
            .filter(|(group, _)| group.contains(&method))
            .map(|(_, letter)| letter)
            .collect()
    });
    Some(letters.collect())
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
            lacking: 0,
        }
    }

    #[test]
    fn equal_methods_share_a_letter_and_worse_ones_do_not() {
        let sets = [
            set("bad", |a| f64::from(a % 7) + 8.5),
            set("good", |a| f64::from(a % 7) + 1.5),
            // One threshold better on half of the images, one worse on the others: nobody knows.
            set("rival", |a| {
                f64::from(a % 7) + if a % 2 == 0 { 0.5 } else { 2.5 }
            }),
            // One worse on half of them, better on none.
            set("worse", |a| {
                f64::from(a % 7) + if a % 2 == 0 { 1.5 } else { 2.5 }
            }),
        ];
        assert_eq!(groups(&sets).letters, ["c", "a", "a", "b"]);
        let twice = [sets[1].clone(), sets[1].clone()];
        assert_eq!(groups(&twice).letters, ["a", "a"]);
    }

    #[test]
    fn nothing_is_marked_without_a_comparison() {
        assert_eq!(groups(&[set("sift", |_| 1.0)]).letters, [""]);
        let mut one = set("sift", |_| 1.0);
        one.pairs.truncate(5);
        assert_eq!(groups(&[one.clone(), one]).letters, ["", ""]);
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
    fn groups_beyond_z_have_no_letters_and_that_is_noted() {
        // Each is worse than the one before by one threshold, on every other image.
        let sets: Vec<ResultSet> = (0..28)
            .map(|level: u32| {
                set(&level.to_string(), |a| {
                    (f64::from(level + a % 2) / 2.0).floor() + 0.5
                })
            })
            .collect();
        let all = groups(&sets[..26]);
        let letters: Vec<String> = ('a'..='z').map(String::from).collect();
        assert_eq!(
            (all.letters, all.beyond_letters),
            (letters, vec![false; 26])
        );
        let more = groups(&sets);
        assert_eq!(
            (more.letters, more.beyond_letters),
            (vec![String::new(); 28], vec![true; 28])
        );
    }

    #[test]
    fn letters_overlap_where_the_middle_differs_from_neither() {
        let letters_of = |count, different: &[(usize, usize)]| {
            letters_of(count, different).expect("there are enough")
        };
        assert_eq!(letters_of(3, &[(0, 2)]), ["a", "ab", "b"]);
        assert_eq!(letters_of(3, &[]), ["a", "a", "a"]);
        assert_eq!(letters_of(3, &[(0, 1), (0, 2), (1, 2)]), ["a", "b", "c"]);
        assert_eq!(
            letters_of(4, &[(0, 2), (0, 3), (1, 3)]),
            ["a", "ab", "bc", "c"]
        );
    }

    #[test]
    fn methods_are_compared_on_what_all_have_in_all_repetitions() {
        let whole = set("sift", |a| f64::from(a % 7) + 0.5);
        let mut half = whole.clone();
        half.pairs.truncate(30);
        assert_eq!(groups(&[whole.clone(), half]).letters, ["a", "a"]);
        // What is not finished is compared with nothing.
        let unfinished = ResultSet {
            lacking: 1,
            ..whole.clone()
        };
        let worse = set("orb", |a| f64::from(a % 7) + 4.5);
        let found = groups(&[whole.clone(), unfinished, worse]);
        assert_eq!(found.letters, ["a", "", "b"]);
        // Better in one repetition by as much as worse in the other.
        let twice = |first: f64, second: f64| {
            let again = |repetition, more: f64| {
                set("sift", |a| f64::from(a % 7) + more)
                    .pairs
                    .into_iter()
                    .map(move |pair| PairResult { repetition, ..pair })
            };
            ResultSet {
                repetitions: 2,
                pairs: again(0, first).chain(again(1, second)).collect(),
                ..whole.clone()
            }
        };
        assert_eq!(
            groups(&[twice(1.5, 3.5), twice(3.5, 1.5)]).letters,
            ["a", "a"]
        );
        assert_eq!(
            groups(&[twice(1.5, 3.5), twice(2.5, 3.5)]).letters,
            ["a", "b"]
        );
    }
}
