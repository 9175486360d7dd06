//! What other benchmarks call AUC and mAA, so that their numbers can be set beside ours.
//!
//! Three things go by these names, and they differ on the same poses:
//!
//! - the paper's AUC, [`SuccessCurve::auc`](super::SuccessCurve::auc): translation signed, mean of
//!   SP at 1 ... 15 degrees;
//! - [`exact_auc`], of SuperGlue (Sarlin et al., CVPR 2020) and most learned matchers since;
//! - [`maa`], of the Image Matching Challenge (Jin et al., "Image Matching across Wide Baselines",
//!   IJCV 2021).
//!
//! The latter two are sign-agnostic: a translation and its opposite count as the same. Failed and
//! missing pairs count in the denominator here too. A table should say which one it shows.

use super::{Model, PairResult, Term};

/// Area under recall over pose error, from 0 to `limit` degrees, divided by `limit`.
///
/// Recall rises by one pair at each of the sorted errors; between them it is taken as linear
/// (trapezoids from the origin), after the last one below the limit as constant. NaN where there
/// are no pairs.
pub fn exact_auc(pairs: &[PairResult], limit: f64) -> f64 {
    let poses = pairs.iter().filter(|pair| pair.model == Model::Pose);
    auc_of(poses.map(PairResult::sign_agnostic_error), limit)
}

/// The same of the corner errors of homographies, up to `limit` pixels: what is reported on HPatches. NaN where
/// there are none.
pub fn corner_auc(pairs: &[PairResult], limit: f64) -> f64 {
    let homographies = (pairs.iter()).filter(|pair| pair.model == Model::Homography);
    auc_of(homographies.map(PairResult::corner_error), limit)
}

/// Area under recall over the errors of all pairs; a pair without one is not recalled.
fn auc_of(errors: impl Iterator<Item = Option<f64>> + Clone, limit: f64) -> f64 {
    let pairs = errors.clone().count() as f64;
    let mut sorted: Vec<f64> = errors.flatten().filter(|error| *error < limit).collect();
    sorted.sort_by(f64::total_cmp);
    let (mut area, mut from, mut recalled) = (0.0, 0.0, 0.0);
    for error in sorted {
        area += (error - from) * (recalled + 0.5);
        from = error;
        recalled += 1.0;
    }
    area += (limit - from) * recalled;
    area / (limit * pairs)
}

/// What each of these errors adds to the area under recall up to `limit`, divided by `limit`; the AUC is the mean. One alone
/// may be above 1.
///
/// From its error e on, a pair that is right adds `limit - e`. The trapezoids of all m right pairs add half of the largest
/// of their errors, which is shared out evenly, since no pair alone decides it.
pub(super) fn areas(errors: &[Option<f64>], limit: f64) -> Vec<f64> {
    let right = || errors.iter().flatten().filter(|error| **error < limit);
    let largest = right().copied().fold(0.0, f64::max);
    let trapezoid = largest / (2.0 * limit * right().count() as f64);
    (errors.iter())
        .map(|error| match error {
            Some(error) if *error < limit => 1.0 - error / limit + trapezoid,
            _ => 0.0,
        })
        .collect()
}

/// What pairs add to [`exact_auc`].
pub(super) fn exact_auc_terms(pairs: &[PairResult], limit: f64) -> Vec<Term> {
    terms_of(pairs, Model::Pose, limit, PairResult::sign_agnostic_error)
}

/// What pairs add to [`corner_auc`].
pub(super) fn corner_auc_terms(pairs: &[PairResult], limit: f64) -> Vec<Term> {
    terms_of(pairs, Model::Homography, limit, PairResult::corner_error)
}

fn terms_of(
    pairs: &[PairResult],
    model: Model,
    limit: f64,
    error: impl Fn(&PairResult) -> Option<f64>,
) -> Vec<Term> {
    let errors: Vec<Option<f64>> = pairs.iter().map(error).collect();
    (pairs.iter().zip(areas(&errors, limit)))
        .map(|(pair, area)| term(pair, model, area))
        .collect()
}

/// What a pair adds to [`maa`], which is a mean.
pub(super) fn maa_term(pair: &PairResult, limit: u32) -> Term {
    let share = passed(pair, limit) as f64 / f64::from(limit);
    term(pair, Model::Pose, share)
}

/// Of a score of such models.
fn term(pair: &PairResult, model: Model, share: f64) -> Term {
    let counts = f64::from(u8::from(pair.model == model));
    Term {
        images: (pair.a, pair.b),
        numerator: counts * share,
        denominator: counts,
    }
}

/// Mean over k = 1, 2, ..., `limit` of the share of pairs with a pose error below k degrees.
///
/// The challenge counts in histogram bins that are open above, all but the last: an error of
/// exactly `limit` degrees still counts in it. NaN where there are no pairs.
pub fn maa(pairs: &[PairResult], limit: u32) -> f64 {
    let poses = || pairs.iter().filter(|pair| pair.model == Model::Pose);
    let below: usize = poses().map(|pair| passed(pair, limit)).sum();
    below as f64 / (f64::from(limit) * poses().count() as f64)
}

/// The number of the challenge's thresholds that a pair passes.
fn passed(pair: &PairResult, limit: u32) -> usize {
    pair.sign_agnostic_error().map_or(0, |error| {
        let passed = (1..=limit).filter(|&k| error < f64::from(k)).count();
        passed + usize::from(error == f64::from(limit))
    })
}

#[cfg(test)]
mod tests {
    use super::super::pair_result::tests::solved;
    use super::super::score_kind::mean_of_terms;
    use super::super::{Failure, Interval, PairResult, Scores};
    use super::*;
    use matchbench_vision::seed::{Rng, Seed};

    fn pairs() -> [PairResult; 4] {
        [
            solved(0, 1.0, 3.0, 30),
            // The opposite direction, 1 degree off: the pose error is 1 when the sign is free.
            solved(0, 0.5, 179.0, 30),
            solved(0, 5.0, 7.0, 30),
            PairResult::failed(0, 1, Failure::NoSupport),
        ]
    }

    #[test]
    fn exact_auc_is_the_area_under_the_trapezoids() {
        // Errors 1, 3, 7 and none of four pairs. Up to 5 degrees, in units of pairs:
        //   0 to 1, recall 0 to 1:  1 * 0.5 = 0.5
        //   1 to 3, recall 1 to 2:  2 * 1.5 = 3.0
        //   3 to 5, recall 2:       2 * 2.0 = 4.0    together 7.5 of 5 * 4 = 20.
        assert!((exact_auc(&pairs(), 5.0) - 7.5 / 20.0).abs() < 1e-15);
        // Up to 10: 0.5 + 3.0 + (3 to 7) 4 * 2.5 + (7 to 10) 3 * 3 = 22.5 of 40.
        assert!((exact_auc(&pairs(), 10.0) - 22.5 / 40.0).abs() < 1e-15);
    }

    #[test]
    fn an_error_at_the_limit_is_not_below_it() {
        assert_eq!(exact_auc(&[solved(0, 5.0, 5.0, 30)], 5.0), 0.0);
    }

    #[test]
    fn maa_is_the_mean_of_ten_shares() {
        // Below k = 1..10: error 1 from k = 2 on (9 times), 3 from 4 on (7), 7 from 8 on (3).
        assert!((maa(&pairs(), 10) - 19.0 / 40.0).abs() < 1e-15);
        // The last bin is closed.
        assert_eq!(maa(&[solved(0, 10.0, 0.0, 30)], 10), 0.1);
        assert_eq!(maa(&[solved(0, 10.1, 0.0, 30)], 10), 0.0);
    }

    #[test]
    fn the_terms_of_pairs_make_the_score() {
        let pairs = pairs();
        let of_maa = mean_of_terms(&pairs, |pair| maa_term(pair, 10));
        assert!((of_maa - maa(&pairs, 10)).abs() < 1e-15);
        // Errors 1, 3 and 7 of four pairs: 4/5 + 2/5 and half of 3/5, and 9/10 + 7/10 + 3/10 and half of 7/10.
        for (limit, sum) in [(5.0, 1.5), (10.0, 2.25)] {
            let terms = exact_auc_terms(&pairs, limit);
            let added: f64 = terms.iter().map(|term| term.numerator).sum();
            assert!((added - sum).abs() < 1e-15);
            assert!((added / 4.0 - exact_auc(&pairs, limit)).abs() < 1e-15);
        }
        // The half is shared by those that are right.
        let added = exact_auc_terms(&pairs, 5.0)
            .into_iter()
            .map(|term| term.numerator);
        let expected = [0.4 + 0.15, 0.8 + 0.15, 0.0, 0.0];
        assert!(
            added
                .zip(expected)
                .all(|(added, expected)| (added - expected).abs() < 1e-15)
        );
        // Where none is right nothing is shared.
        assert_eq!(areas(&[Some(5.0), None], 5.0), [0.0, 0.0]);
    }

    /// All pairs of so many images. Errors are `median exp(v)` degrees, v normal with variance 0.75: a quarter of each image
    /// and one of the pair.
    fn drawn(rng: &mut Rng, images: usize, median: f64) -> Vec<PairResult> {
        let effects: Vec<f64> = (0..images).map(|_| rng.normal()).collect();
        (0..images)
            .flat_map(|a| (a + 1..images).map(move |b| (a, b)))
            .map(|(a, b)| {
                let v = 0.5 * (effects[a] + effects[b] + rng.normal());
                PairResult {
                    a: a as u32,
                    b: b as u32,
                    ..solved(0, median * libm::exp(v), 0.0, 30)
                }
            })
            .collect()
    }

    #[test]
    fn intervals_of_what_others_call_auc_hold_the_true_score_in_19_of_20_cases() {
        // With s^2 = 0.75 and P the normal distribution, the exact AUC at 5 degrees is 1 / 2 - exp(0.375) P(-s); mAA is the
        // mean of P(log(k / 5) / s) over k = 1 ... 10.
        let truths = [("exact_auc_5", 0.218_840), ("maa_10", 0.483_304)];
        let mut rng = Seed(31).rng();
        let (images, cases) = (16, 400);
        let mut held = [0; 2];
        for _ in 0..cases {
            let pairs = drawn(&mut rng, images, 5.0);
            let scores = Scores::new(&pairs);
            for (held, (id, truth)) in held.iter_mut().zip(truths) {
                let interval = scores.get(id).interval.expect("images enough");
                *held += usize::from((interval.low..interval.high).contains(&truth));
            }
        }
        assert!(
            held.iter().all(|held| (364..=392).contains(held)),
            "{held:?} of {cases}"
        );
    }

    #[test]
    #[ignore = "prints a measurement of the book"]
    fn how_often_intervals_hold_where_few_pairs_are_right() {
        // With errors that are larger by a factor. The true score is the mean one.
        for (images, factor) in [8, 16]
            .into_iter()
            .flat_map(|images| [1.0, 2.0, 3.0, 5.0, 7.5].map(|factor| (images, factor)))
        {
            let (mut rng, cases) = (Seed(7).rng(), 4000);
            let mut found = Vec::new();
            let (mut right, mut all) = (0, 0);
            for _ in 0..cases {
                let pairs = drawn(&mut rng, images, 5.0 * factor);
                let is_right = |pair: &&PairResult| pair.sign_agnostic_error() < Some(5.0);
                right += pairs.iter().filter(is_right).count();
                all += pairs.len();
                let score = Scores::new(&pairs).get("exact_auc_5");
                let value = score.value.expect("there are pairs");
                found.push((value, score.interval.expect("images enough")));
            }
            let truth = found.iter().map(|(value, _)| value).sum::<f64>() / f64::from(cases);
            let holds = |interval: &Interval| (interval.low..interval.high).contains(&truth);
            let held = found.iter().filter(|(_, interval)| holds(interval)).count();
            println!(
                "{images} images, {:.1} % right, exact AUC {truth:.4}: {:.1} %",
                100.0 * right as f64 / all as f64,
                100.0 * held as f64 / f64::from(cases)
            );
        }
    }

    #[test]
    fn without_pairs_nothing_is_known() {
        assert!(exact_auc(&[], 5.0).is_nan() && maa(&[], 10).is_nan());
    }
}
