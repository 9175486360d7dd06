//! Scores of easy and hard pairs apart: AUC over baseline, view angle or overlap.

use super::{DatasetGeometry, PairGeometry, PairResult, ResultSet, ranking_auc};

/// A range of difficulty, with about as many pairs as the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stratum {
    /// Least value of its pairs.
    pub low: f64,
    /// Largest value of its pairs.
    pub high: f64,
}

/// Cuts the pairs of a dataset into at most `count` strata of about equal size by `value`; equal
/// values stay together, and pairs without a value are in none.
pub fn strata(
    geometry: &DatasetGeometry,
    value: impl Fn(&PairGeometry) -> Option<f64>,
    count: usize,
) -> Vec<Stratum> {
    let mut values: Vec<f64> = geometry.values().filter_map(value).collect();
    values.sort_by(f64::total_cmp);
    let mut strata: Vec<Stratum> = Vec::new();
    let mut start = 0;
    for part in 1..=count {
        let mut end = values.len() * part / count;
        while end > start && end < values.len() && values[end] == values[end - 1] {
            end += 1;
        }
        if end > start {
            let (low, high) = (values[start], values[end - 1]);
            strata.push(Stratum { low, high });
            start = end;
        }
    }
    strata
}

/// The AUC that methods are ranked by ([`ranking_auc`]) of the pairs in each stratum; `None` where the results
/// have none.
pub fn auc_by_stratum(
    results: &ResultSet,
    geometry: &DatasetGeometry,
    value: impl Fn(&PairGeometry) -> Option<f64>,
    strata: &[Stratum],
) -> Vec<Option<f64>> {
    let mut inside: Vec<Vec<PairResult>> = vec![Vec::new(); strata.len()];
    for pair in &results.pairs {
        let Some(value) = geometry.get(&(pair.a, pair.b)).and_then(&value) else {
            continue;
        };
        let holds = |stratum: &Stratum| stratum.low <= value && value <= stratum.high;
        if let Some(at) = strata.iter().position(holds) {
            inside[at].push(pair.clone());
        }
    }
    (inside.iter())
        .map(|pairs| (!pairs.is_empty()).then(|| ranking_auc(pairs)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::corner_auc;
    use super::super::pair_result::tests::{solved, transferred};
    use super::*;

    fn geometry(baselines: &[f64]) -> DatasetGeometry {
        let pair = |(a, &baseline): (usize, &f64)| {
            let geometry = PairGeometry {
                baseline: Some(baseline),
                view_angle: Some(0.0),
                overlap: 1.0,
                is_measured: false,
            };
            ((a as u32, a as u32 + 1), geometry)
        };
        baselines.iter().enumerate().map(pair).collect()
    }

    fn results(pairs: Vec<PairResult>) -> ResultSet {
        ResultSet {
            dataset: String::new(),
            matcher: String::new(),
            estimator: String::new(),
            repetitions: 1,
            pairs,
            ignored: 0,
            lacking: 0,
        }
    }

    #[test]
    fn strata_have_as_many_pairs_and_equal_values_stay_together() {
        let cut = |values: &[f64]| strata(&geometry(values), |g| g.baseline, 2);
        let (low, high) = (
            Stratum {
                low: 1.0,
                high: 2.0,
            },
            Stratum {
                low: 3.0,
                high: 9.0,
            },
        );
        assert_eq!(cut(&[3.0, 1.0, 9.0, 2.0]), [low, high]);
        assert_eq!(
            cut(&[1.0; 5]),
            [Stratum {
                low: 1.0,
                high: 1.0
            }]
        );
        assert_eq!(cut(&[]), []);
    }

    #[test]
    fn each_pair_counts_in_its_stratum() {
        let geometry = geometry(&[1.0, 5.0, 6.0]);
        // The last pair has no geometry: it is in no stratum.
        let results = results(vec![
            solved(0, 0.1, 0.1, 30),
            solved(1, 0.1, 12.0, 30),
            solved(2, 0.1, 20.0, 30),
            solved(7, 0.1, 0.1, 30),
        ]);
        let strata = [
            Stratum {
                low: 1.0,
                high: 1.0,
            },
            Stratum {
                low: 5.0,
                high: 6.0,
            },
            Stratum {
                low: 7.0,
                high: 8.0,
            },
        ];
        let auc = auc_by_stratum(&results, &geometry, |g| g.baseline, &strata);
        assert_eq!(auc, [Some(1.0), Some(0.1), None]);
    }

    #[test]
    fn homographies_have_the_score_of_tables() {
        let pairs = vec![transferred(0, 0.0, 30), transferred(1, 1.5, 30)];
        let all = corner_auc(&pairs, 3.0);
        let geometry = geometry(&[1.0, 1.0]);
        let strata = strata(&geometry, |g| g.baseline, 4);
        let auc = auc_by_stratum(&results(pairs), &geometry, |g| g.baseline, &strata);
        assert_eq!(auc, [Some(all)]);
        // The mean of 1 - error / 3 px is another number.
        assert!(all > 0.75 + 0.1, "{all}");
    }
}
