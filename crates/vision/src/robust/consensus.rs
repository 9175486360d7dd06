//! Sample consensus: the best of many models, each made from as few data as possible.
//!
//! Fischler, Bolles, "Random Sample Consensus: A Paradigm for Model Fitting with Applications to
//! Image Analysis and Automated Cartography", Communications of the ACM 24(6), 1981.
//!
//! 1. A [`Sampling`] draws a minimal sample; the [`Problem`] turns it into models.
//! 2. A [`Scoring`] rates each by the residuals of all data. A strictly better one replaces the best.
//! 3. With an inlier ratio w, k samples of s data all contain an outlier with probability
//!    `(1 - w^s)^k`. When that falls below 1 - confidence, no more samples are drawn.
//!
//! | symbol | field | default ([`SampleConsensusParams`](super::SampleConsensusParams)) | source |
//! | --- | --- | --- | --- |
//! | p | `confidence` | 0.999 | reference protocol |
//! | | `max_samples` | 1000 | OpenCV 4 |
//!
//! With `local_steps`, each new best model is improved by [`Problem::refine`], and the improved model replaces it
//! if it is better. This is local optimisation (Chum, Matas, Kittler, "Locally Optimized RANSAC", DAGM 2003), in
//! the form that Lebeda, Matas, Chum, "Fixing the Locally Optimized RANSAC", BMVC 2012 recommend: with a truncated
//! quadratic score.
//!
//! *Differs* from Lebeda et al., and from RansacLib (`lo_starting_iterations`): both draw 50 samples before the
//! first local optimisation. Here every new best model is improved, from the first sample on.
//! [`Extras::min_samples`] does not delay this; it only says how many samples are drawn at least.
//!
//! In the end the best model is compared with its rivals ([`Problem::rivals`]), and with further
//! hypotheses if they are asked for (see `hypotheses`). If the sample of a new best model is degenerate, another
//! model may replace it ([`Problem::resolve_degeneracy`]). Data that cannot belong to it are excluded by a costlier
//! check ([`Problem::exclude_impossible`]). With `sprt`, models that look bad are abandoned early (Matas, Chum,
//! "Randomized RANSAC with Sequential Probability Ratio Test", ICCV 2005), which may lose a good one. With
//! [`Extras::hopeless_after`], a search ends early if what it has found is [hopeless](Problem::is_hopeless).
//!
//! In any case a model is abandoned as soon as an upper bound of its quality
//! ([`Scoring::upper_bound`]) is not above the quality of the best one. Up to the rounding of sums, this changes no
//! result.
//!
//! *Choices*, all as in OpenCV's `RANSAC`: w is the inlier ratio of the best model so far; the number of samples is
//! rounded to the nearest integer (half to even) and never grows; a model needs at least as many inliers as a
//! sample has data; by default there is no local optimisation.

use super::hypotheses::Hypotheses;
use super::sprt::Sprt;
use super::support::{possible_above, sum_above, support_above};
use super::{Problem, Sampling, Scoring, Support};
use crate::geometry::PointPairs;
use crate::seed::Rng;

/// When sampling stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConsensusParams {
    /// Required probability that at least one sample is free of outliers.
    pub confidence: f64,
    /// Largest number of samples.
    pub max_samples: usize,
}

/// The best model and the data that agree with it.
#[derive(Clone, Debug, PartialEq)]
pub struct Consensus<M> {
    /// The model.
    pub model: M,
    /// Its quality and the number of its inliers, without data that [cannot belong to
    /// it](Problem::exclude_impossible).
    pub support: Support,
    /// Indices of the data within the threshold of it, ascending. Data that cannot belong to it are among them, so
    /// they may be more than `support.inliers`.
    pub inliers: Vec<u32>,
    /// Number of samples that were drawn.
    pub samples: usize,
}

/// The model with the highest `score` among the models of random samples of the `problem`, and what they are refined
/// to. `None` if no model of a sample has at least as many inliers as a sample has data.
pub fn consensus<P: Problem>(
    problem: &P,
    score: &impl Scoring,
    sampler: &mut impl Sampling,
    params: ConsensusParams,
    rng: &mut Rng,
) -> Option<Consensus<P::Model>> {
    if problem.len() < P::SAMPLE {
        return None;
    }
    consensus_until(problem, score, sampler, params, Extras::NONE, rng, &|_| {
        false
    })
}

/// Optional additions to the plain loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extras {
    /// Least number of samples.
    pub min_samples: usize,
    /// Number of steps of each local optimisation; 0 for none.
    pub local_steps: usize,
    /// Whether bad models are rejected early by a sequential probability ratio test. It has no effect if the
    /// score is not a sum over the data. The data must be in random order.
    pub sprt: bool,
    /// Number of models that differ, with the best among them, which are kept until one is chosen at the end by how far it
    /// lets the data be [trusted](Problem::trust); with 1 the best is the result.
    pub hypotheses: usize,
    /// Number of samples after which the search is given up if what it has found is
    /// [hopeless](Problem::is_hopeless); `None` for never.
    pub hopeless_after: Option<usize>,
}

impl Extras {
    /// No additions.
    pub const NONE: Self = Self {
        min_samples: 0,
        local_steps: 0,
        sprt: false,
        hypotheses: 1,
        hopeless_after: None,
    };
}

/// As [`consensus`], with `extras`, and only until `stop` returns true. It is called before each sample with
/// the number of samples so far. If `stop` uses a clock, results cannot be reproduced, so a time limit is the
/// decision of the caller.
pub fn consensus_until<P: Problem>(
    problem: &P,
    score: &impl Scoring,
    sampler: &mut impl Sampling,
    params: ConsensusParams,
    extras: Extras,
    rng: &mut Rng,
    stop: &dyn Fn(usize) -> bool,
) -> Option<Consensus<P::Model>> {
    if problem.len() < P::SAMPLE {
        return None;
    }
    let mut residuals = vec![0.0; problem.len()];
    let mut drawn = vec![0; P::BATCH * P::SAMPLE];
    let mut models = Vec::with_capacity(P::BATCH);
    let mut best: Option<(P::Model, Support)> = None;
    let mut others = (extras.hypotheses > 1).then(|| Hypotheses::new(extras.hypotheses));
    let mut sprt = extras.sprt.then(Sprt::new);
    let mut needed = params.max_samples;
    let mut samples = 0;
    while samples < needed.max(extras.min_samples).min(params.max_samples) && !stop(samples) {
        if extras.hopeless_after == Some(samples) {
            let found = (best.as_ref()).map(|(model, support)| (model, support.squared_threshold));
            if problem.is_hopeless(found) {
                break;
            }
        }
        // Samples that are drawn together do not depend on results in between, so the last ones may not be
        // needed.
        let next = samples % P::BATCH;
        if next == 0 {
            for sample in drawn.chunks_exact_mut(P::SAMPLE) {
                sampler.draw(rng, sample);
            }
            problem.solve_each(&drawn, &mut models);
        }
        let sample = &drawn[next * P::SAMPLE..][..P::SAMPLE];
        samples += 1;
        for model in models[next].iter() {
            let limit = best
                .as_ref()
                .map_or(f64::NEG_INFINITY, |(_, best)| best.quality);
            let floor = (others.as_ref()).map_or(limit, |others| others.floor(limit).min(limit));
            let sum = sum_above(floor, problem, score, model, sprt.as_mut(), &mut residuals);
            // What is impossible is costly to find, so first it is asked whether the model is still wanted.
            let wanted = sum.filter(|sum| {
                let is_new =
                    |others: &Hypotheses<_>| others.place(problem, model, sum.quality).is_some();
                sum.quality > limit || others.as_ref().is_some_and(is_new)
            });
            let Some(support) = wanted
                .and_then(|sum| possible_above(floor, problem, score, model, sum, &mut residuals))
            else {
                continue;
            };
            if support.inliers < P::SAMPLE {
                continue;
            }
            if let Some(others) = &mut others {
                others.add(problem, model, support.quality);
                if support.quality <= limit {
                    continue;
                }
            }
            let mut found = (model.clone(), support);
            let resolved =
                problem.resolve_degeneracy(&found.0, sample, found.1.squared_threshold, rng);
            found = better_of(problem, score, found, resolved, &mut residuals);
            if extras.local_steps > 0 {
                let refined =
                    problem.refine(&found.0, found.1.squared_threshold, extras.local_steps);
                found = better_of(problem, score, found, refined, &mut residuals);
            }
            let inlier_ratio = found.1.inliers as f64 / problem.len() as f64;
            let mut power = 1.0;
            if let Some(sprt) = &mut sprt {
                sprt.best_is(inlier_ratio);
                power = sprt.power();
            }
            needed = needed.min(samples_needed(inlier_ratio, power, P::SAMPLE, params));
            best = Some(found);
        }
    }
    let mut best = best?;
    for rival in problem.rivals(&best.0, best.1.squared_threshold, rng) {
        let refined = (extras.local_steps > 0)
            .then(|| problem.refine(&rival, best.1.squared_threshold, extras.local_steps))
            .flatten()
            .unwrap_or(rival);
        best = better_of(problem, score, best, Some(refined), &mut residuals);
    }
    if let Some(others) = others {
        best = others.choose(problem, score, best, extras.local_steps);
    }
    Some(with_inliers(problem, best.0, best.1, samples))
}

/// The `other` model if there is one and its quality is higher, else the one that was `found`.
fn better_of<P: Problem>(
    problem: &P,
    score: &impl Scoring,
    found: (P::Model, Support),
    other: Option<P::Model>,
    residuals: &mut [f64],
) -> (P::Model, Support) {
    let better = other.and_then(|other| {
        let limit = found.1.quality;
        let support = support_above(limit, problem, score, &other, residuals)?;
        Some((other, support))
    });
    better.unwrap_or(found)
}

/// The `model`, which was found with so many samples, with the support that `score` gives it. `None` if fewer data
/// agree with it than a sample has.
pub(super) fn judged<P: Problem>(
    problem: &P,
    score: &impl Scoring,
    model: P::Model,
    samples: usize,
) -> Option<Consensus<P::Model>> {
    let mut residuals = vec![0.0; problem.len()];
    let limit = f64::NEG_INFINITY;
    let support = support_above(limit, problem, score, &model, &mut residuals)?;
    (support.inliers >= P::SAMPLE).then(|| with_inliers(problem, model, support, samples))
}

/// A model with the list of data that agree with it.
fn with_inliers<P: Problem>(
    problem: &P,
    model: P::Model,
    support: Support,
    samples: usize,
) -> Consensus<P::Model> {
    let mut residuals = vec![0.0; problem.len()];
    problem.squared_residuals(&model, 0..problem.len(), &mut residuals);
    // Not without the impossible ones: final refinements take their scale from these, and published results were
    // computed so.
    let inliers = inliers_within(&residuals, support.squared_threshold);
    Consensus {
        model,
        support,
        inliers,
        samples,
    }
}

/// Indices of the data whose squared residual is at most the threshold, ascending.
pub(super) fn inliers_within(squared_residuals: &[f64], squared_threshold: f64) -> Vec<u32> {
    (0_u32..)
        .zip(squared_residuals)
        .filter(|&(_, &squared)| squared <= squared_threshold)
        .map(|(index, _)| index)
        .collect()
}

/// In a local optimisation, matches beyond this multiple of the squared threshold are assumed to stay outliers.
pub(super) const NEAR: f64 = 9.0;

/// The `pairs` of a problem whose squared residual is at most `squared`.
pub(super) fn near<P: Problem>(
    problem: &P,
    pairs: &PointPairs,
    model: &P::Model,
    squared: f64,
) -> PointPairs {
    let mut residuals = vec![0.0; problem.len()];
    problem.squared_residuals(model, 0..problem.len(), &mut residuals);
    pairs.chosen(&inliers_within(&residuals, squared))
}

/// Number of samples after which, with the required confidence, at least one was free of outliers and its model
/// was not rejected. `power` is the probability that a right model is not rejected.
fn samples_needed(inlier_ratio: f64, power: f64, sample: usize, params: ConsensusParams) -> usize {
    let clean = (0..sample).fold(power, |clean, _| clean * inlier_ratio);
    let log_failure = libm::log((1.0 - params.confidence).max(f64::MIN_POSITIVE));
    // Confidence 0 needs no sample; with few inliers the other logarithm is 0 too.
    if log_failure == 0.0 {
        return 0;
    }
    let log_spoilt = libm::log(1.0 - clean);
    // Infinite if every datum is an inlier; then the samples so far are enough.
    if log_failure <= params.max_samples as f64 * log_spoilt {
        return params.max_samples;
    }
    (log_failure / log_spoilt).round_ties_even() as usize
}

#[cfg(test)]
mod tests {
    use std::ops::Range;

    use super::*;
    use crate::geometry::solvers::Solutions;
    use crate::robust::{InlierCount, Magsac, MedianOfSquares, Mlesac, Msac, Uniform};
    use crate::seed::Seed;

    /// The line y = m x + c through points, by vertical distance.
    struct Line(Vec<[f64; 2]>);

    impl Problem for Line {
        type Model = [f64; 2];
        type Models = Solutions<[f64; 2], 1>;
        const SAMPLE: usize = 2;

        fn len(&self) -> usize {
            self.0.len()
        }

        fn solve(&self, sample: &[u32]) -> Self::Models {
            let [p, q] = [self.0[sample[0] as usize], self.0[sample[1] as usize]];
            let mut lines = Solutions::none();
            if p[0] != q[0] {
                let slope = (q[1] - p[1]) / (q[0] - p[0]);
                lines.push([slope, p[1] - slope * p[0]]);
            }
            lines
        }

        fn squared_residuals(&self, model: &[f64; 2], range: Range<usize>, out: &mut [f64]) {
            for (out, p) in out.iter_mut().zip(&self.0[range]) {
                let residual = p[1] - model[0] * p[0] - model[1];
                *out = residual * residual;
            }
        }
    }

    const PARAMS: ConsensusParams = ConsensusParams {
        confidence: 0.999,
        max_samples: 1000,
    };

    fn find(points: Vec<[f64; 2]>) -> Option<Consensus<[f64; 2]>> {
        let score = InlierCount {
            squared_threshold: 1e-6,
        };
        let mut sampler = Uniform::new(points.len());
        consensus(
            &Line(points),
            &score,
            &mut sampler,
            PARAMS,
            &mut Seed(1).rng(),
        )
    }

    #[test]
    fn the_line_is_found_among_outliers() {
        let mut rng = Seed(2).rng();
        let mut points: Vec<[f64; 2]> = (0..30)
            .map(|_| [rng.normal(), 5.0 + rng.normal()])
            .collect();
        points.extend((0..20).map(|i| [f64::from(i), 2.0 * f64::from(i) - 7.0]));
        points.push([f64::NAN, 0.0]);
        let found = find(points).unwrap();
        assert!((found.model[0] - 2.0).abs() < 1e-9 && (found.model[1] + 7.0).abs() < 1e-9);
        assert_eq!(found.inliers, (30..50).collect::<Vec<u32>>());
        assert_eq!(found.support.inliers, 20);
        assert!(found.samples < 200, "{}", found.samples);
    }

    /// A line, where data to the left of zero are impossible, and slopes above 1 are hopeless.
    struct Right(Line);

    impl Problem for Right {
        type Model = [f64; 2];
        type Models = Solutions<[f64; 2], 1>;
        const SAMPLE: usize = 2;

        fn len(&self) -> usize {
            self.0.len()
        }

        fn solve(&self, sample: &[u32]) -> Self::Models {
            self.0.solve(sample)
        }

        fn squared_residuals(&self, model: &[f64; 2], range: Range<usize>, out: &mut [f64]) {
            self.0.squared_residuals(model, range, out);
        }

        fn exclude_impossible(
            &self,
            _: &[f64; 2],
            squared_threshold: f64,
            out: &mut [f64],
        ) -> bool {
            let mut any = false;
            for (squared, point) in out.iter_mut().zip(&self.0.0) {
                if *squared <= squared_threshold && point[0] < 0.0 {
                    *squared = f64::INFINITY;
                    any = true;
                }
            }
            any
        }

        fn is_hopeless(&self, found: Option<(&[f64; 2], f64)>) -> bool {
            found.is_none_or(|(line, _)| line[0] > 1.0)
        }
    }

    #[test]
    fn a_search_ends_early_if_what_it_found_is_hopeless_or_nothing() {
        let samples = |points: Vec<[f64; 2]>| {
            let problem = Right(Line(points));
            let score = Msac {
                squared_threshold: 1e-6,
            };
            let extras = Extras {
                min_samples: 400,
                hopeless_after: Some(100),
                ..Extras::NONE
            };
            let drawn = std::cell::Cell::new(0);
            let stop = |samples| {
                drawn.set(samples);
                false
            };
            let (sampler, rng) = (&mut Uniform::new(problem.len()), &mut Seed(1).rng());
            let found = consensus_until(&problem, &score, sampler, PARAMS, extras, rng, &stop);
            (found.map(|found| found.samples), drawn.get())
        };
        let line = |slope: f64| {
            (0..50)
                .map(|i| [f64::from(i), slope * f64::from(i)])
                .collect()
        };
        assert_eq!(samples(line(0.5)), (Some(400), 399));
        assert_eq!(samples(line(2.0)), (Some(100), 100));
        assert_eq!(samples(vec![[1.0, 2.0]; 9]), (None, 100));
    }

    #[test]
    fn whatever_the_score_impossible_data_are_no_inliers() {
        // Of the line y = 0 60 data, 10 of them impossible, and 30 far from it on either side.
        let points: Vec<[f64; 2]> = (0..90)
            .map(|i| {
                let x = f64::from(i % 6) - 0.5;
                [
                    x,
                    if i < 60 {
                        1e-3 * f64::from(i % 7)
                    } else {
                        f64::from(i)
                    },
                ]
            })
            .collect();
        let problem = Right(Line(points));
        let (squared_threshold, span) = (0.01, 100.0);
        assert_eq!(inliers(&problem, &Msac { squared_threshold }), 50);
        assert_eq!(inliers(&problem, &Magsac::new(squared_threshold)), 50);
        let likelihood = Mlesac {
            squared_threshold,
            span,
        };
        assert_eq!(inliers(&problem, &likelihood), 50);
        assert_eq!(inliers(&problem, &MedianOfSquares { sample: 2 }), 50);
    }

    /// Of the line y = 0.
    fn inliers(problem: &Right, score: &impl Scoring) -> usize {
        let mut residuals = vec![0.0; problem.len()];
        let limit = f64::NEG_INFINITY;
        let support = support_above(limit, problem, score, &[0.0; 2], &mut residuals);
        support.expect("any quality will do").inliers
    }

    #[test]
    fn there_is_no_line_where_no_sample_makes_one() {
        assert_eq!(find(vec![]), None);
        assert_eq!(find(vec![[1.0, 2.0]]), None);
        assert_eq!(find(vec![[1.0, 2.0]; 9]), None);
        assert_eq!(find(vec![[f64::NAN, 2.0]; 9]), None);
    }

    #[test]
    fn number_of_samples_is_the_textbooks() {
        // Hartley and Zisserman, 2nd edition, table 4.3, for p = 0.99; rounded up there.
        let params = ConsensusParams {
            confidence: 0.99,
            ..PARAMS
        };
        for (sample, outliers, printed) in
            [(2, 0.5, 17), (5, 0.3, 26), (5, 0.5, 146), (8, 0.4, 272)]
        {
            let needed = samples_needed(1.0 - outliers, 1.0, sample, params);
            assert!(
                needed == printed || needed + 1 == printed,
                "{needed} {printed}"
            );
        }
        assert_eq!(samples_needed(1.0, 1.0, 5, PARAMS), 0);
        assert_eq!(samples_needed(0.0, 1.0, 5, PARAMS), 1000);
        assert_eq!(samples_needed(0.01, 1.0, 5, PARAMS), 1000);
        // To the nearest number: log 0.001 / log(1 - 1/4) is 24.01. A right model that is rejected in one of two cases is worth
        // half of a sample: log 0.001 / log(1 - 1/64) is 438.6.
        assert_eq!(samples_needed(0.5, 1.0, 2, PARAMS), 24);
        assert_eq!(samples_needed(0.5, 0.5, 5, PARAMS), 439);
    }

    /// The place of one datum after the other.
    struct InTurn(u32);

    impl Sampling for InTurn {
        fn draw(&mut self, _: &mut Rng, sample: &mut [u32]) {
            sample[0] = self.0 % 10;
            self.0 += 1;
        }
    }

    /// Places of data on a line.
    struct Places([f64; 10]);

    impl Problem for Places {
        type Model = f64;
        type Models = Solutions<f64, 1>;
        const SAMPLE: usize = 1;

        fn len(&self) -> usize {
            self.0.len()
        }

        fn solve(&self, sample: &[u32]) -> Self::Models {
            let mut places = Solutions::none();
            places.push(self.0[sample[0] as usize]);
            places
        }

        fn squared_residuals(&self, place: &f64, range: Range<usize>, out: &mut [f64]) {
            for (out, datum) in out.iter_mut().zip(&self.0[range]) {
                *out = (datum - place) * (datum - place);
            }
        }
    }

    #[test]
    fn the_number_of_samples_never_grows() {
        // Nine data are within 1 of the first, which is enough after three samples. The next place is better, and has four.
        let data = [
            0.0, 0.95, 0.95, 0.95, -0.95, -0.95, -0.95, -0.95, -0.95, 9.0,
        ];
        let score = Msac {
            squared_threshold: 1.0,
        };
        let rng = &mut Seed(1).rng();
        let found = consensus(&Places(data), &score, &mut InTurn(0), PARAMS, rng).expect("a place");
        assert_eq!((found.model, found.support.inliers), (0.95, 4));
        assert_eq!(found.samples, 3);
    }

    #[test]
    fn no_confidence_needs_no_samples_however_few_inliers_there_are() {
        let params = ConsensusParams {
            confidence: 0.0,
            ..PARAMS
        };
        for inlier_ratio in [1.0, 0.5, 1e-3, 5e-4, 0.0] {
            assert_eq!(samples_needed(inlier_ratio, 1.0, 5, params), 0);
        }
    }

    #[test]
    fn a_model_counts_without_what_is_impossible() {
        // Of the line y = 0 there are 20, of which 15 are impossible; of y = 5 there are 10.
        let on = |y: f64, from: i32, to: i32| (from..to).map(move |x| [f64::from(x) + 0.5, y]);
        let problem = Right(Line(on(0.0, -15, 5).chain(on(5.0, 0, 10)).collect()));
        let score = InlierCount {
            squared_threshold: 1e-6,
        };
        let (sampler, rng) = (&mut Uniform::new(30), &mut Seed(1).rng());
        let found = consensus(&problem, &score, sampler, PARAMS, rng).expect("a line");
        assert_eq!((found.model, found.support.inliers), ([0.0, 5.0], 10));
    }
}
