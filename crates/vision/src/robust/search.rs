//! A search by sample consensus, put together from a score, a sampler and a rule to stop: what the estimators of
//! poses and of homographies have in common.

use std::borrow::Cow;
use std::cell::Cell;

use nalgebra::Matrix3;

use super::consensus::judged;
use super::even_weights::EvenWeights;
use super::grid::{MAX_CELLS, span};
use super::noise_scale::noise_scale;
use super::parts::{EarlyStop, Sampler, Score};
use super::turns::trust;
use super::{
    Consensus, ConsensusParams, EvenMarginal, EvenMsac, Extras, InlierCount, KeypointChanges,
    Magsac, MedianOfSquares, Mlesac, Msac, Problem, Prosac, Sampling, Scoring, SpreadSampler,
    Uniform, consensus_until,
};
use crate::geometry::{MatchedPoints, PointPairs};
use crate::params::ParamError;
use crate::seed::Seed;

/// Of so many samples one is drawn before it is asked whether the search is hopeless.
const HOPELESS_AFTER_ONE_IN: usize = 4;

/// The score, the sampler and the limits of one search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Search {
    pub(super) score: Score,
    pub(super) sampler: Sampler,
    pub(super) early_stop: Option<EarlyStop>,
    pub(super) max_iterations: usize,
    pub(super) local_steps: usize,
}

impl Search {
    /// Refuses a part that is out of its range. The error names it as [`Settings`](crate::robust::Settings) do.
    pub(super) fn check(&self) -> Result<(), ParamError> {
        if let Some(threshold) = self.score.threshold_px() {
            ParamError::unless(
                threshold > 0.0 && threshold.is_finite(),
                "threshold_px",
                threshold,
                "positive and finite",
            )?;
        }
        if let Some(cells) = self.score.cells() {
            ParamError::unless(
                (1..=MAX_CELLS).contains(&cells),
                "score_cells",
                cells,
                "1 to 1000",
            )?;
        }
        match self.sampler {
            Sampler::Uniform => {}
            Sampler::Prosac { horizon } => {
                ParamError::unless(horizon > 0, "prosac_horizon", horizon, "at least 1")?;
            }
            Sampler::Spread { cells } => {
                let allowed = (1..=MAX_CELLS).contains(&cells);
                ParamError::unless(allowed, "cells", cells, "1 to 1000")?;
            }
        }
        ParamError::unless(
            self.max_iterations > 0,
            "max_iterations",
            self.max_iterations,
            "at least 1",
        )?;
        if let Some(EarlyStop {
            confidence,
            min_iterations,
        }) = self.early_stop
        {
            ParamError::unless(
                (0.0..1.0).contains(&confidence),
                "confidence",
                confidence,
                "at least 0 and below 1; `early_stop: None`, or 1 by its flat name, is no early stop",
            )?;
            ParamError::unless(
                min_iterations <= self.max_iterations,
                "min_iterations",
                min_iterations,
                "at most `max_iterations`",
            )?;
        }
        let local = self.local_steps;
        ParamError::unless(local <= 1000, "local_steps", local, "0 to 1000")
    }

    /// Number of samples after which it is asked whether the search is hopeless: as many as must be drawn at least, and a
    /// quarter of all. `None` where the search has ended by then.
    pub(super) fn hopeless_after(&self) -> Option<usize> {
        let least = self.early_stop?.min_iterations;
        let after = (self.max_iterations / HOPELESS_AFTER_ONE_IN).max(least);
        // A model needs a sample.
        Some(after.max(1)).filter(|&after| after < self.max_iterations)
    }
}

/// Matches in random order. The sequential test needs this order, and a detector sorts its output by place or
/// by scale.
pub(super) struct Shuffled {
    pub(super) pairs: PointPairs,
    ambiguity: Vec<f32>,
    /// How their keypoints turned and grew, if it is asked for; growths as in the images.
    changes: Option<KeypointChanges>,
    /// The trust in each match, if it is asked for and known.
    trust: Option<Vec<f64>>,
    /// Their earlier indices.
    order: Vec<u32>,
}

impl Shuffled {
    /// The matches `given`, which were made from `points`. The `score` says whether their turns are used.
    pub(super) fn new(
        given: &PointPairs,
        points: &MatchedPoints,
        score: Score,
        seed: Seed,
    ) -> Self {
        let count = u32::try_from(given.len()).expect("matches are numbered by u32");
        let mut order: Vec<u32> = (0..count).collect();
        seed.rng().shuffle(&mut order);
        let MatchedPoints {
            ambiguity,
            turns,
            growths,
            ..
        } = points.chosen(&order);
        let asked_for = |column: Option<Vec<f32>>| column.filter(|_| score.uses_turns());
        let (turns, growths) = (asked_for(turns), asked_for(growths));
        Self {
            pairs: given.chosen(&order),
            ambiguity,
            trust: turns.as_deref().map(trust),
            changes: (turns.is_some() || growths.is_some())
                .then_some(KeypointChanges { turns, growths }),
            order,
        }
    }

    /// How their keypoints turned and grew at depth 1, if it is asked for and known. `focal_ratio` is the focal length of
    /// camera b over that of camera a.
    pub(super) fn changes_at_depth_1(&self, focal_ratio: f64) -> Option<KeypointChanges> {
        let mut changes = self.changes.clone()?;
        let enlarged = libm::log(focal_ratio) as f32;
        for growth in changes.growths.iter_mut().flatten() {
            *growth -= enlarged;
        }
        Some(changes)
    }

    /// The ambiguity of each match, increased for matches that are trusted less. An ambiguity above 1 means that
    /// another candidate was nearer. Then there is no certainty left that trust could reduce, so it is unchanged.
    fn ambiguity(&self) -> Cow<'_, [f32]> {
        let trusted = |ambiguity: f32, trust: f64| {
            if ambiguity < 1.0 {
                1.0 - (1.0 - ambiguity) * trust as f32
            } else {
                ambiguity
            }
        };
        match &self.trust {
            None => Cow::Borrowed(&self.ambiguity),
            Some(trust) => (self.ambiguity.iter().zip(trust))
                .map(|(ambiguity, trust)| trusted(*ambiguity, *trust))
                .collect(),
        }
    }

    /// The earlier indices of these matches, ascending.
    pub(super) fn before(&self, matches: &[u32]) -> Vec<u32> {
        let mut before: Vec<u32> = matches.iter().map(|&i| self.order[i as usize]).collect();
        before.sort_unstable();
        before
    }
}

/// The threshold, in standard deviations of the noise, if the noise is estimated.
const SIGMAS: f64 = 5.0;

/// One search: everything except the problem, the score and the sampler, which are types.
pub(super) struct Task<'a> {
    pub(super) search: Search,
    pub(super) matches: &'a Shuffled,
    /// Pixels per unit of the residuals.
    pub(super) pixels: f64,
    /// Coordinates beyond this are far beside the image; see [`grid`](super::grid).
    pub(super) far: f64,
    /// Number of models that are kept to choose among them; see [`Extras`].
    pub(super) hypotheses: usize,
    pub(super) seed: Seed,
    pub(super) stop: &'a dyn Fn(usize) -> bool,
}

/// The `stop` of a caller, for a search that begins after `drawn` samples of others. It notes the number of samples after
/// which the caller ended the search.
fn noting<'a>(
    stop: &'a dyn Fn(usize) -> bool,
    drawn: usize,
    ended: &'a Cell<Option<usize>>,
) -> impl Fn(usize) -> bool + 'a {
    move |samples| {
        let samples = drawn.saturating_add(samples);
        let stops = stop(samples);
        if stops {
            ended.set(Some(samples));
        }
        stops
    }
}

impl Task<'_> {
    /// The best model of all samples.
    pub(super) fn solve<P>(&self, problem: &P) -> Option<Consensus<Matrix3<f64>>>
    where
        P: Problem<Model = Matrix3<f64>>,
    {
        let squared = |threshold_px| self.squared_threshold(threshold_px);
        let pairs = &self.matches.pairs;
        let weights =
            |cells| EvenWeights::new(pairs, cells, self.far, self.matches.trust.as_deref());
        match self.search.score {
            Score::InlierCount { threshold_px, sprt } => {
                let squared_threshold = squared(threshold_px);
                self.sampled(problem, &InlierCount { squared_threshold }, sprt)
            }
            Score::Msac { threshold_px, sprt } => {
                let squared_threshold = squared(threshold_px);
                self.sampled(problem, &Msac { squared_threshold }, sprt)
            }
            Score::EvenMsac {
                threshold_px,
                cells,
                sprt,
                ..
            } => {
                let score = EvenMsac::weighing(weights(cells), squared(threshold_px));
                self.sampled(problem, &score, sprt)
            }
            Score::EvenMarginal {
                threshold_px,
                noise_iterations,
                cells,
                sprt,
                ..
            } => {
                let guess = EvenMarginal::weighing(weights(cells), squared(threshold_px));
                match noise_iterations {
                    0 => self.sampled(problem, &guess, sprt),
                    _ => self.sampled_for_noise(problem, guess, noise_iterations, sprt),
                }
            }
            Score::Magsac { threshold_px, sprt } => {
                self.sampled(problem, &Magsac::new(squared(threshold_px)), sprt)
            }
            Score::Mlesac { threshold_px } => {
                let score = Mlesac {
                    squared_threshold: squared(threshold_px),
                    span: diagonal(pairs, self.far).max(f64::MIN_POSITIVE),
                };
                self.sampled(problem, &score, false)
            }
            Score::Lmeds => self.sampled(problem, &MedianOfSquares { sample: P::SAMPLE }, false),
        }
    }

    /// The square of a threshold in pixels, in the unit of the points.
    fn squared_threshold(&self, threshold_px: f64) -> f64 {
        let threshold = threshold_px / self.pixels;
        threshold * threshold
    }

    /// Two searches. The first draws `noise_iterations` samples and scores them by a `guess` of the noise; its best model
    /// tells the noise of the pair, by which the second scores.
    fn sampled_for_noise<P>(
        &self,
        problem: &P,
        guess: EvenMarginal,
        noise_iterations: usize,
        sprt: bool,
    ) -> Option<Consensus<Matrix3<f64>>>
    where
        P: Problem<Model = Matrix3<f64>>,
    {
        let ended = Cell::new(None);
        let stop = noting(self.stop, 0, &ended);
        let first = Task {
            stop: &stop,
            ..self.first(noise_iterations)
        };
        let first = first.sampled(problem, &guess, sprt);
        let drawn = (first.as_ref().map(|first| first.samples))
            .or(ended.get())
            .unwrap_or(noise_iterations);
        let score = match &first {
            Some(first) => {
                let sigma = self.noise_px(problem, &first.model);
                guess.at(self.squared_threshold(SIGMAS * sigma))
            }
            None => guess,
        };
        let ended = Cell::new(None);
        let stop = noting(self.stop, drawn, &ended);
        let rest = Task {
            stop: &stop,
            ..*self
        };
        let found = rest.sampled(problem, &score, sprt);
        let found = found.map(|found| Consensus {
            samples: drawn.saturating_add(found.samples),
            ..found
        });
        // So too if the second search has no more samples than the first.
        let most = self.search.max_iterations;
        let few = (most <= noise_iterations).then(|| drawn.saturating_add(most));
        let (Some(first), Some(samples)) = (first, ended.get().or(few)) else {
            return found;
        };
        // Then the model of the first search may be the better one, so both are scored alike.
        let first = judged(problem, &score, first.model, samples);
        let quality = |found: &Option<Consensus<P::Model>>| {
            (found.as_ref()).map_or(f64::NEG_INFINITY, |found| found.support.quality)
        };
        if quality(&first) > quality(&found) {
            first
        } else {
            found
        }
    }

    /// The first search, with so many samples, whose best model is used to estimate the noise.
    fn first(&self, samples: usize) -> Self {
        Task {
            search: Search {
                early_stop: None,
                max_iterations: samples,
                ..self.search
            },
            hypotheses: 1,
            seed: self.seed.child("noise"),
            ..*self
        }
    }

    /// The noise of the pair in pixels, judged by this model.
    fn noise_px<P: Problem>(&self, problem: &P, model: &P::Model) -> f64 {
        let mut squared = vec![0.0; problem.len()];
        problem.squared_residuals(model, 0..problem.len(), &mut squared);
        let in_pixels = squared
            .iter()
            .map(|squared| squared * self.pixels * self.pixels);
        noise_scale(in_pixels)
    }

    fn sampled<P>(
        &self,
        problem: &P,
        score: &impl Scoring,
        sprt: bool,
    ) -> Option<Consensus<Matrix3<f64>>>
    where
        P: Problem<Model = Matrix3<f64>>,
    {
        let matches = self.matches;
        match self.search.sampler {
            Sampler::Uniform => {
                self.run(problem, score, sprt, &mut Uniform::new(matches.pairs.len()))
            }
            Sampler::Prosac { horizon } => {
                let mut sampler = Prosac::new(&matches.ambiguity(), horizon);
                self.run(problem, score, sprt, &mut sampler)
            }
            Sampler::Spread { cells } => {
                let mut sampler = SpreadSampler::within(&matches.pairs, cells, self.far);
                self.run(problem, score, sprt, &mut sampler)
            }
        }
    }

    fn run<P>(
        &self,
        problem: &P,
        score: &impl Scoring,
        sprt: bool,
        sampler: &mut impl Sampling,
    ) -> Option<Consensus<Matrix3<f64>>>
    where
        P: Problem<Model = Matrix3<f64>>,
    {
        let max_samples = self.search.max_iterations;
        // If the least number of samples equals the largest, no sample is left out, whatever the confidence.
        let stop_early = self.search.early_stop.unwrap_or(EarlyStop {
            confidence: 0.0,
            min_iterations: max_samples,
        });
        consensus_until(
            problem,
            score,
            sampler,
            ConsensusParams {
                confidence: stop_early.confidence,
                max_samples,
            },
            Extras {
                min_samples: stop_early.min_iterations,
                local_steps: self.search.local_steps,
                sprt,
                hypotheses: self.hypotheses,
                hopeless_after: self.search.hopeless_after(),
            },
            &mut self.seed.rng(),
            self.stop,
        )
    }
}

/// Diagonal of the rectangle around the points in b.
fn diagonal(pairs: &PointPairs, far: f64) -> f64 {
    let (width, height) = (span(&pairs.b_x, far), span(&pairs.b_y, far));
    let diagonal = (width * width + height * height).sqrt();
    // `hypot` differs in the last bit, so it is used only where the squares are too large.
    if diagonal.is_finite() {
        diagonal
    } else {
        libm::hypot(width, height)
    }
}

/// The kind of distance of inliers.
#[derive(Clone, Copy, Debug)]
pub(super) enum DistanceFrom {
    /// Distance from a line: one normal error, half of which are within 1 / 1.4826 standard deviations.
    Line,
    /// Distance from a point: two normal errors, half of which are within sqrt(2 ln 2) standard deviations
    /// (Rayleigh).
    Point,
}

/// The square of the scale at which Cauchy's loss keeps 95 % of the efficiency of least squares: 2.385 standard
/// deviations (Holland, Welsch, "Robust Regression Using Iteratively Reweighted Least-Squares", Communications
/// in Statistics 6(9), 1977). The standard deviation is estimated from the median distance of the inliers.
pub(super) fn squared_cauchy_scale(
    squared_residuals: &[f64],
    inliers: &[u32],
    from: DistanceFrom,
) -> f64 {
    let mut squared: Vec<f64> = (inliers.iter())
        .map(|&index| squared_residuals[index as usize])
        .collect();
    if squared.is_empty() {
        return f64::MIN_POSITIVE;
    }
    let middle = squared.len() / 2;
    let (_, median, _) = squared.select_nth_unstable_by(middle, f64::total_cmp);
    let factor = match from {
        DistanceFrom::Line => 2.385 * 1.4826,
        DistanceFrom::Point => 2.385 / 1.177_41,
    };
    // Exact matches have no scale; any positive one will do.
    (factor * factor * *median).max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;

    const BY_TURNS: Score = Score::EvenMsac {
        threshold_px: 1.0,
        cells: 10,
        turns: true,
        sprt: false,
    };

    /// Matches of which the last has another turn than the others, so that it is trusted less.
    fn ambiguity_of_last(ambiguity: f32) -> f32 {
        let point = |i: usize| Point2::new(i as f64, 0.0);
        let points: Vec<_> = (0..20).map(point).collect();
        let mut ambiguities = vec![0.5; 20];
        ambiguities[19] = ambiguity;
        let mut turns = vec![0.0; 20];
        turns[19] = 2.0;
        let matches = MatchedPoints::new(points.clone(), points, ambiguities);
        let matches = matches.with_turns(Some(turns));
        let shuffled = Shuffled::new(&matches.in_pixels(), &matches, BY_TURNS, Seed(0));
        let place = shuffled.order.iter().position(|&i| i == 19);
        shuffled.ambiguity()[place.expect("it is one of them")]
    }

    /// A keypoint that is as large in the images of both cameras is half as large at depth 1 where the focal length is
    /// twice as long.
    #[test]
    fn growths_at_depth_1_are_those_of_the_images_less_that_of_the_focal_length() {
        let points: Vec<_> = (0..3).map(|i| Point2::new(f64::from(i), 0.0)).collect();
        let growths = vec![0.0, 2.0_f32.ln(), -1.0];
        let matches = MatchedPoints::new(points.clone(), points, vec![0.5; 3]);
        let matches = matches.with_growths(Some(growths.clone()));
        let shuffled = Shuffled::new(&matches.in_pixels(), &matches, BY_TURNS, Seed(0));
        let changes = shuffled.changes_at_depth_1(2.0).expect("growths are known");
        let found = changes.growths.expect("growths are known");
        for (found, &index) in found.iter().zip(&shuffled.order) {
            let expected = growths[index as usize] - 2.0_f32.ln();
            assert!((found - expected).abs() < 1e-6, "{index}: {found}");
        }
    }

    #[test]
    fn less_trust_never_makes_a_match_come_earlier() {
        // One of 20 is farther than 45 degrees from the others, where three of four turns are: 1 / 0.75 over 19 / 0.25.
        let trust = (1.0 / 0.75) / (19.0 / 0.25);
        assert!((ambiguity_of_last(0.5) - (1.0 - 0.5 * trust)).abs() < 1e-6);
        let mut before = 0.0;
        for ambiguity in [0.0, 0.5, 0.9, 1.0, 1.5, 6.0] {
            let found = ambiguity_of_last(ambiguity);
            assert!(found >= ambiguity && found > before, "{ambiguity}: {found}");
            before = found;
        }
        assert!(ambiguity_of_last(f32::NAN).is_nan());
    }
}
