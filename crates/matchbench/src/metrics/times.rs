//! How long each stage took: median and quartiles over the pairs that were timed.

use serde::{Deserialize, Serialize};

use crate::records::{Counts, StageTimes};

use super::quantiles::quantile;
use super::{Failure, PairResult};

/// Quartiles and mean of a set of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quartiles {
    /// A quarter lies below.
    pub lower: f64,
    /// Half lies below.
    pub median: f64,
    /// A quarter lies above.
    pub upper: f64,
    /// The mean, which papers like to show.
    pub mean: f64,
}

impl Quartiles {
    /// Quartiles and mean of the values; `None` where there are none.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut values: Vec<f64> = values.into_iter().collect();
        values.sort_by(f64::total_cmp);
        (!values.is_empty()).then(|| Self {
            lower: quantile(&values, 0.25),
            median: quantile(&values, 0.5),
            upper: quantile(&values, 0.75),
            mean: values.iter().sum::<f64>() / values.len() as f64,
        })
    }
}

/// Features per image and seconds per stage, each where it was recorded: stages that came from a
/// cache have no time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StageQuartiles {
    /// Features of an image.
    pub features: Option<Quartiles>,
    /// Detection and description of an image, in seconds.
    pub extract: Option<Quartiles>,
    /// Search for putative correspondences of a pair, in seconds.
    pub search: Option<Quartiles>,
    /// Selection of a pair, in seconds.
    pub select: Option<Quartiles>,
    /// Pose estimation of a pair, in seconds.
    pub estimate: Option<Quartiles>,
    /// All before the pose of a pair as it was waited for, where a matcher from outside did it: its other
    /// times are its own word. In seconds.
    pub outside: Option<Quartiles>,
}

impl StageQuartiles {
    /// Quartiles over the pairs; an image counts once for each pair it was extracted for.
    pub fn new(pairs: &[PairResult]) -> Self {
        let stage =
            |get: fn(&StageTimes) -> Option<f64>| pairs.iter().filter_map(move |p| get(&p.times));
        let counts: Vec<Counts> = (pairs.iter())
            .filter(|pair| pair.outcome != Err(Failure::Broken))
            .filter_map(|pair| pair.counts)
            .collect();
        // Matches without features are those of a matcher that has none: then a pair without matches has none to count.
        let are_known =
            counts.iter().any(Counts::counts_features) || counts.iter().all(Counts::has_features);
        let features = (counts.iter())
            .filter(|counts| are_known && counts.has_features())
            .flat_map(|counts| [counts.features_a, counts.features_b]);
        Self {
            features: Quartiles::of(features.map(f64::from)),
            extract: Quartiles::of(stage(|t| t.extract_a).chain(stage(|t| t.extract_b))),
            search: Quartiles::of(stage(|t| t.search)),
            select: Quartiles::of(stage(|t| t.select)),
            estimate: Quartiles::of(stage(|t| t.estimate)),
            outside: Quartiles::of(stage(|t| t.outside)),
        }
    }

    /// Whether any stage was timed.
    pub fn is_timed(&self) -> bool {
        [self.extract, self.search, self.select, self.estimate]
            .iter()
            .any(Option::is_some)
    }
}

#[cfg(test)]
mod tests {
    use super::super::pair_result::tests::solved;
    use super::*;
    use crate::records::Counts;

    #[test]
    fn numbers_of_features_may_be_as_large_as_records_hold() {
        let mut pair = solved(0, 1.0, 1.0, 30);
        pair.counts = Some(Counts {
            features_a: u32::MAX,
            features_b: 1,
            putative: 30,
            selected: 30,
        });
        let features = StageQuartiles::new(&[pair]).features;
        assert_eq!(features.map(|f| f.upper > 1e9), Some(true));
    }

    #[test]
    fn a_pair_without_matches_gives_no_features_to_a_matcher_that_has_none() {
        let pair = |counts: [u32; 4]| {
            let [features_a, features_b, putative, selected] = counts;
            PairResult {
                counts: Some(Counts {
                    features_a,
                    features_b,
                    putative,
                    selected,
                }),
                ..solved(0, 1.0, 1.0, 30)
            }
        };
        let median = |pairs: &[PairResult]| StageQuartiles::new(pairs).features.map(|f| f.median);
        let (matched, empty) = (pair([0, 0, 30, 30]), pair([0; 4]));
        assert_eq!(median(&[matched.clone(), empty.clone()]), None);
        // Nothing says that this one has no features.
        assert_eq!(median(&[empty.clone(), empty.clone()]), Some(0.0));
        // One that has features found none in an empty image.
        let counted = pair([80, 40, 30, 30]);
        assert_eq!(median(&[counted.clone(), empty.clone()]), Some(20.0));
        assert_eq!(median(&[counted, matched, empty]), Some(20.0));
    }

    #[test]
    fn cached_stages_have_no_time() {
        let mut first = solved(0, 1.0, 1.0, 30);
        first.times.extract_a = Some(0.2);
        first.times.extract_b = Some(0.4);
        first.times.search = Some(0.1);
        let cached = solved(0, 1.0, 1.0, 30);
        let spreads = StageQuartiles::new(&[first, cached]);
        let extract = spreads.extract.expect("two images were timed");
        assert!((extract.median - 0.3).abs() < 1e-15);
        assert_eq!(spreads.search.map(|s| s.median), Some(0.1));
        assert_eq!((spreads.select, spreads.features), (None, None));
        assert!(spreads.is_timed() && !StageQuartiles::new(&[]).is_timed());
    }

    #[test]
    fn quartiles_by_hand() {
        // A quarter of the way from the first to the last of 1, 2, 4, 8 is at 1 + 3/4, three quarters at 4 + 1/4 of 4.
        let expected = Quartiles {
            lower: 1.75,
            median: 3.0,
            upper: 5.0,
            mean: 3.75,
        };
        assert_eq!(Quartiles::of([4.0, 1.0, 8.0, 2.0]), Some(expected));
        assert_eq!(Quartiles::of([]), None);
    }
}
