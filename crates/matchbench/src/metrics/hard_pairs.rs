//! Where methods fail: kinds of hard pairs, the pairs of each kind, and a typical pair of each.
//!
//! The kind of a pair is decided by what is known of it besides the outcome: its true pose, and how many
//! features and matches the matchers found. Counts differ from matcher to matcher. So each count is
//! compared with the median of the same matcher on this dataset, and most matchers that count must agree. A
//! pair may be of several kinds; a typical pair is of one kind only, where there is such a pair.
//!
//! | kind | a pair is of it if |
//! | --- | --- |
//! | [`Hardship::WideAngle`] | the optical axes are [`WIDE_ANGLE`] degrees apart, or more |
//! | [`Hardship::LittleOverlap`] | the upper bound of the overlap is below [`LITTLE_OVERLAP`] |
//! | [`Hardship::LittleTexture`] | an image has less than half of the usual features |
//! | [`Hardship::Ambiguous`] | less than half of the usual share of putative matches is selected, although neither angle, overlap nor texture explains it: mostly repeated structure |

use std::collections::{BTreeMap, BTreeSet};

use matchbench_vision::robust::RIGHT_POSE;

use super::average_matches::is_right;
use super::quantiles::quantile;
use super::{DatasetGeometry, Failure, Model, PairResult, ResultSet};
use crate::records::Counts;

/// Angle between the optical axes from which on a pair is wide, in degrees.
pub const WIDE_ANGLE: f64 = 30.0;
/// Overlap, measured or the largest that the poses allow, below which little is seen twice.
pub const LITTLE_OVERLAP: f64 = 0.5;

/// A reason for which a pair may be hard.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Hardship {
    /// The cameras look in different directions.
    WideAngle,
    /// The images show little of the same.
    LittleOverlap,
    /// There are few features.
    LittleTexture,
    /// There are features, and few of their matches can be told from others.
    Ambiguous,
}

impl Hardship {
    /// All of them, in the order in which they are looked for.
    pub const ALL: [Self; 4] = [
        Self::WideAngle,
        Self::LittleOverlap,
        Self::LittleTexture,
        Self::Ambiguous,
    ];

    /// In a few words.
    pub fn name(self) -> &'static str {
        match self {
            Self::WideAngle => "wide angle",
            Self::LittleOverlap => "little overlap",
            Self::LittleTexture => "little texture",
            Self::Ambiguous => "ambiguous matches",
        }
    }

    /// The criterion, as a phrase without a full stop.
    pub fn told_by(self) -> String {
        match self {
            Self::WideAngle => format!("optical axes at least {WIDE_ANGLE}° apart"),
            Self::LittleOverlap => {
                format!("overlap below {LITTLE_OVERLAP}, measured or at any depth")
            }
            Self::LittleTexture => "an image with less than half of the usual features".into(),
            Self::Ambiguous => {
                "less than half of the usual share of matches passes the selection, and nothing of \
                 the others: repeated structure, mostly"
                    .into()
            }
        }
    }
}

/// The pairs of a dataset that are of one kind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HardPairs {
    /// The kind.
    pub hardship: Hardship,
    /// Its pairs.
    pub pairs: BTreeSet<(u32, u32)>,
    /// An example: the one that most methods fail on, of the pairs that are of this kind alone if there are any; `None`
    /// if no method fails on any.
    pub example: Option<(u32, u32)>,
}

impl HardPairs {
    /// The share of results with a pose error below [`RIGHT_POSE`], on these pairs and on all others; `None`
    /// where there are none.
    pub fn right(&self, set: &ResultSet) -> [Option<f64>; 2] {
        let (inside, outside): (Vec<&PairResult>, Vec<_>) =
            (set.pairs.iter().filter(|pair| is_of_pose(pair)))
                .partition(|pair| self.pairs.contains(&(pair.a, pair.b)));
        [inside, outside].map(|pairs| {
            let right = pairs
                .iter()
                .filter(|pair| is_right(pair, RIGHT_POSE))
                .count();
            (!pairs.is_empty()).then(|| right as f64 / pairs.len() as f64)
        })
    }
}

fn is_of_pose(pair: &PairResult) -> bool {
    pair.model == Model::Pose
}

/// Every kind of hard pairs that a dataset has, from the poses of all methods on it; without a `geometry`, those
/// that counts tell.
pub fn hard_pairs(sets: &[&ResultSet], geometry: Option<&DatasetGeometry>) -> Vec<HardPairs> {
    let mut failed = BTreeMap::<(u32, u32), usize>::new();
    for pair in sets
        .iter()
        .flat_map(|set| &set.pairs)
        .filter(|pair| is_of_pose(pair))
    {
        *failed.entry((pair.a, pair.b)).or_default() += usize::from(!is_right(pair, RIGHT_POSE));
    }
    let [bare, ambiguous] = by_counts(sets);
    let of_pair = |pair: &(u32, u32)| -> BTreeSet<Hardship> {
        let known = geometry.and_then(|geometry| geometry.get(pair));
        let mut found = BTreeSet::new();
        if known
            .and_then(|known| known.view_angle)
            .is_some_and(|angle| angle >= WIDE_ANGLE)
        {
            found.insert(Hardship::WideAngle);
        }
        if known.is_some_and(|known| known.overlap < LITTLE_OVERLAP) {
            found.insert(Hardship::LittleOverlap);
        }
        if bare.contains(pair) {
            found.insert(Hardship::LittleTexture);
        }
        if found.is_empty() && ambiguous.contains(pair) {
            found.insert(Hardship::Ambiguous);
        }
        found
    };
    let kinds: BTreeMap<(u32, u32), BTreeSet<Hardship>> =
        failed.keys().map(|pair| (*pair, of_pair(pair))).collect();
    let of_kind = |hardship: Hardship| {
        let its = kinds.iter().filter(|(_, kinds)| kinds.contains(&hardship));
        // One of this kind alone, then one that most methods fail on, then the first.
        let example = its.clone().filter(|(pair, _)| failed[pair] > 0);
        let example = example.max_by_key(|(pair, kinds)| {
            (kinds.len() == 1, failed[pair], std::cmp::Reverse(**pair))
        });
        HardPairs {
            hardship,
            pairs: its.map(|(pair, _)| *pair).collect(),
            example: example.map(|(pair, _)| *pair),
        }
    };
    let all = Hardship::ALL.map(of_kind).into_iter();
    all.filter(|hard| !hard.pairs.is_empty()).collect()
}

/// Pairs that most matchers find few features in, and those of which they select few matches. A matcher has a voice
/// where it has the counts: one from outside may state no features, and none of what it selected from.
fn by_counts(sets: &[&ResultSet]) -> [BTreeSet<(u32, u32)>; 2] {
    // Estimators of a matcher get the same matches.
    let mut matchers = BTreeMap::<&str, &ResultSet>::new();
    for set in sets {
        matchers.entry(&set.matcher).or_insert(set);
    }
    let [mut features, mut shares] = [Votes::default(), Votes::default()];
    for set in matchers.into_values() {
        // What broke has no counts.
        let counted = (set.pairs.iter())
            .filter(|pair| pair.repetition == 0 && pair.outcome != Err(Failure::Broken))
            .filter_map(|pair| Some(((pair.a, pair.b), pair.counts?)));
        let counted: Vec<((u32, u32), Counts)> = counted.collect();
        let states = counted.iter().any(|(_, its)| its.counts_features());
        features.add(&counted, |its| {
            let fewer = f64::from(its.features_a.min(its.features_b));
            (states && its.has_features()).then_some(fewer)
        });
        // A pair without putative matches has features, but no share.
        let selects = counted.iter().any(|(_, its)| its.selected < its.putative);
        shares.add(&counted, |its| {
            let share = f64::from(its.selected) / f64::from(its.putative);
            (selects && its.putative > 0).then_some(share)
        });
    }
    [features, shares].map(Votes::of_most)
}

/// What matchers say of a number of each pair.
#[derive(Default)]
struct Votes(BTreeMap<(u32, u32), Vote>);

/// How many matchers know the number of a pair, and how many of them call it low.
#[derive(Clone, Copy, Default)]
struct Vote {
    known: usize,
    low: usize,
}

impl Votes {
    /// The vote of a matcher: a `number` is low if it is less than half of its median over all pairs.
    fn add(&mut self, counted: &[((u32, u32), Counts)], number: impl Fn(&Counts) -> Option<f64>) {
        let known = counted.iter().filter_map(|(_, its)| number(its));
        let Some(usual) = median(known.collect()) else {
            return;
        };
        for (pair, its) in counted {
            if let Some(its) = number(its) {
                let vote = self.0.entry(*pair).or_default();
                vote.known += 1;
                vote.low += usize::from(its < usual / 2.0);
            }
        }
    }

    /// The pairs whose number is low as more than half of the matchers say that know it.
    fn of_most(self) -> BTreeSet<(u32, u32)> {
        let most = self
            .0
            .into_iter()
            .filter(|(_, vote)| 2 * vote.low > vote.known);
        most.map(|(pair, _)| pair).collect()
    }
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    (!values.is_empty()).then(|| quantile(&values, 0.5))
}

#[cfg(test)]
mod tests {
    use super::super::PairGeometry;
    use super::super::pair_result::tests::solved;
    use super::*;

    /// Pairs (a, a + 1) of which each is right or not, with these numbers of features and selected matches of 100.
    fn set(pairs: &[(bool, u32, u32)]) -> ResultSet {
        let pair = |(a, &(right, features, selected)): (usize, &(bool, u32, u32))| {
            let a = a as u32;
            let pair = if right {
                solved(a, 0.5, 0.5, 50)
            } else {
                PairResult::failed(a, a + 1, Failure::NoSupport)
            };
            let counts = Counts {
                features_a: 1000,
                features_b: features,
                putative: 100,
                selected,
            };
            PairResult {
                counts: Some(counts),
                ..pair
            }
        };
        ResultSet {
            dataset: "room".into(),
            matcher: "sift".into(),
            estimator: "best".into(),
            repetitions: 1,
            pairs: pairs.iter().enumerate().map(pair).collect(),
            ignored: 0,
            lacking: 0,
        }
    }

    #[test]
    fn each_kind_is_told_by_what_is_known_and_has_an_example() {
        let results = set(&[
            (true, 900, 50),
            (true, 900, 50),
            (false, 900, 50), // wide angle alone
            (false, 100, 50), // wide angle and little texture
            (false, 900, 5),  // ambiguous
            (true, 100, 5),   // little texture, which explains the rest
            (true, 900, 50),
        ]);
        let geometry: DatasetGeometry = (0..7)
            .map(|a| {
                let known = PairGeometry {
                    baseline: Some(1.0),
                    view_angle: Some(if a == 2 || a == 3 { 40.0 } else { 5.0 }),
                    overlap: 0.9,
                    is_measured: false,
                };
                ((a, a + 1), known)
            })
            .collect();
        let found = hard_pairs(&[&results], Some(&geometry));
        let kinds: Vec<_> = found
            .iter()
            .map(|hard| (hard.hardship, hard.pairs.len(), hard.example))
            .collect();
        assert_eq!(
            kinds,
            [
                (Hardship::WideAngle, 2, Some((2, 3))),
                (Hardship::LittleTexture, 2, Some((3, 4))),
                (Hardship::Ambiguous, 1, Some((4, 5))),
            ]
        );
        assert_eq!(found[0].right(&results), [Some(0.0), Some(0.8)]);
        // Without the geometry, counts alone.
        assert_eq!(hard_pairs(&[&results], None).len(), 2);
        assert_eq!(hard_pairs(&[], None), []);
    }

    #[test]
    fn a_pair_without_any_match_may_have_little_texture() {
        let mut results = set(&[(true, 900, 50), (true, 900, 50), (false, 0, 0)]);
        if let Some(counts) = &mut results.pairs[2].counts {
            counts.putative = 0;
        }
        let found = hard_pairs(&[&results], None);
        let kinds: Vec<_> = (found.iter())
            .map(|hard| (hard.hardship, hard.example))
            .collect();
        assert_eq!(kinds, [(Hardship::LittleTexture, Some((2, 3)))]);
    }

    #[test]
    fn a_pair_that_broke_has_no_little_texture() {
        let mut results = set(&[(true, 900, 50), (true, 900, 50), (false, 900, 50)]);
        results.pairs[2].outcome = Err(Failure::Broken);
        results.pairs[2].counts = Some(Counts::default());
        assert_eq!(hard_pairs(&[&results], None), []);
    }

    #[test]
    fn a_matcher_has_no_voice_on_a_pair_that_it_broke_on() {
        let pairs = [(true, 900, 50), (true, 900, 50), (false, 100, 50)];
        let mut broken = set(&pairs);
        broken.matcher = "surf".into();
        broken.pairs[2].outcome = Err(Failure::Broken);
        broken.pairs[2].counts = Some(Counts::default());
        let found = hard_pairs(&[&set(&pairs), &broken], None);
        let kinds: Vec<_> = (found.iter())
            .map(|hard| (hard.hardship, hard.example))
            .collect();
        assert_eq!(kinds, [(Hardship::LittleTexture, Some((2, 3)))]);
    }

    #[test]
    fn a_matcher_without_counts_has_no_voice() {
        let counting = set(&[
            (true, 900, 50),
            (true, 900, 50),
            (false, 100, 50),
            (false, 900, 5),
        ]);
        let mut silent = ResultSet {
            matcher: "mine".into(),
            ..counting.clone()
        };
        for counts in silent
            .pairs
            .iter_mut()
            .filter_map(|pair| pair.counts.as_mut())
        {
            (counts.features_a, counts.features_b) = (0, 0);
            counts.putative = counts.selected;
        }
        let kinds = |sets: &[&ResultSet]| -> Vec<(Hardship, usize)> {
            let found = hard_pairs(sets, None).into_iter();
            found
                .map(|hard| (hard.hardship, hard.pairs.len()))
                .collect()
        };
        let known = [(Hardship::LittleTexture, 1), (Hardship::Ambiguous, 1)];
        assert_eq!(kinds(&[&counting, &silent]), known);
        assert_eq!(kinds(&[&silent]), []);
    }

    #[test]
    fn where_nothing_is_counted_nothing_is_said() {
        let mut results = set(&[(false, 1, 1), (true, 900, 50)]);
        results.pairs.iter_mut().for_each(|pair| pair.counts = None);
        assert_eq!(hard_pairs(&[&results], None), []);
    }

    #[test]
    fn a_pose_is_right_below_ten_degrees() {
        let mut results = set(&[(true, 900, 50); 3]);
        results.pairs = vec![
            solved(0, 9.9, 0.5, 50),
            solved(1, 0.5, 10.0, 50),
            solved(2, 10.1, 0.5, 50),
        ];
        let hard = HardPairs {
            hardship: Hardship::WideAngle,
            pairs: [(0, 1), (1, 2), (2, 3)].into(),
            example: None,
        };
        assert_eq!(hard.right(&results), [Some(1.0 / 3.0), None]);
    }

    /// The kinds of each of the pairs (a, a + 1), by what is known of their geometry.
    fn kinds_of(results: &[&ResultSet], known: &[(f64, f64)]) -> Vec<Vec<Hardship>> {
        let geometry: DatasetGeometry = (0..)
            .zip(known)
            .map(|(a, &(angle, overlap))| {
                let known = PairGeometry {
                    baseline: Some(1.0),
                    view_angle: Some(angle),
                    overlap,
                    is_measured: false,
                };
                ((a, a + 1), known)
            })
            .collect();
        let found = hard_pairs(results, Some(&geometry));
        let of_pair = |a: u32| {
            let its = found.iter().filter(|hard| hard.pairs.contains(&(a, a + 1)));
            its.map(|hard| hard.hardship).collect()
        };
        (0..known.len() as u32).map(of_pair).collect()
    }

    #[test]
    fn a_pair_is_wide_from_30_degrees_on_and_has_little_overlap_below_a_half() {
        let results = set(&[(true, 900, 50); 4]);
        let known = [(29.9, 0.5), (30.0, 0.9), (5.0, 0.499), (31.0, 0.1)];
        let (wide, little) = (Hardship::WideAngle, Hardship::LittleOverlap);
        assert_eq!(
            kinds_of(&[&results], &known),
            [vec![], vec![wide], vec![little], vec![wide, little]]
        );
    }

    #[test]
    fn the_image_with_fewer_features_counts_and_more_than_half_of_the_matchers_decide() {
        let mut results = set(&[(true, 900, 50); 5]);
        let counts = results.pairs[1].counts.as_mut().expect("counted");
        (counts.features_a, counts.features_b) = (100, 900);
        // Just half of the usual is enough.
        results.pairs[2]
            .counts
            .as_mut()
            .expect("counted")
            .features_b = 450;
        // What other repetitions count is the same again, whatever it is.
        for pair in results.pairs.clone() {
            let counts = pair.counts.map(|counts| Counts {
                features_a: 10,
                ..counts
            });
            results.pairs.push(PairResult {
                repetition: 1,
                counts,
                ..pair
            });
        }
        let easy = [(5.0, 0.9); 5];
        let bare = |results: &[&ResultSet]| -> Vec<usize> {
            let kinds = kinds_of(results, &easy).into_iter().enumerate();
            let bare = kinds.filter(|(_, kinds)| kinds.contains(&Hardship::LittleTexture));
            bare.map(|(a, _)| a).collect()
        };
        assert_eq!(bare(&[&results]), [1]);
        let other = ResultSet {
            matcher: "surf".into(),
            ..set(&[(true, 900, 50); 5])
        };
        assert_eq!(bare(&[&results, &other]), [0; 0]);
        let third = ResultSet {
            matcher: "orb".into(),
            ..results.clone()
        };
        assert_eq!(bare(&[&results, &other, &third]), [1]);
    }

    #[test]
    fn the_example_is_the_pair_that_most_methods_fail_on() {
        let wide = set(&[(false, 900, 50); 3]);
        let mut other = wide.clone();
        other.estimator = "rich".into();
        other.pairs[0] = solved(0, 0.5, 0.5, 50);
        other.pairs[2] = solved(2, 0.5, 0.5, 50);
        let known = PairGeometry {
            baseline: Some(1.0),
            view_angle: Some(40.0),
            overlap: 0.9,
            is_measured: false,
        };
        let geometry: DatasetGeometry = (0..3).map(|a| ((a, a + 1), known)).collect();
        let found = hard_pairs(&[&wide, &other], Some(&geometry));
        assert_eq!(found[0].example, Some((1, 2)));
    }
}
