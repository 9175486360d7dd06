//! From two sets of features to records: searched, selected, estimated, judged.

use std::mem;

use matchbench_vision::features::{Features, Keypoint};
use matchbench_vision::image::GrayImage;
use matchbench_vision::matching::{Correspondence, Correspondences, MatcherError, View};
use matchbench_vision::robust::{NoPose, TwoViews};
use matchbench_vision::seed::Seed;
use nalgebra::Point2;

use super::frame::{Decode, load};
use super::guard::{guard, timed};
use super::part::Part;
use super::resident::PairJob;
use crate::datasets::Pair;
use crate::estimators::BuiltEstimator;
use crate::records::{Counts, MIN_MATCHES, MIN_SUPPORT, Outcome, RunRecord, StageTimes};

/// The stages that are done once per pair.
pub(super) struct PairStages<'a> {
    pub(super) part: &'a Part<'a>,
    pub(super) decode: Decode,
    pub(super) root: Seed,
}

/// What is known of a pair after the search.
struct Searched<'a> {
    a: &'a Features,
    b: &'a Features,
    /// The pixels, for matchers that select by them.
    images: Option<(GrayImage, GrayImage)>,
    putative: Correspondences,
}

/// The selected matches as the estimators see them: point `a[i]` matches point `b[i]`.
struct Selected {
    a: Vec<Point2<f64>>,
    b: Vec<Point2<f64>>,
    ambiguity: Vec<f32>,
}

impl PairStages<'_> {
    /// The records of all tasks that are due of a pair, each with the index of its estimator.
    ///
    /// The search is done once. Each repetition selects anew, since a selector may draw random
    /// numbers; all estimators get the same selected matches.
    pub(super) fn run(&self, job: &PairJob<'_>) -> Vec<(usize, RunRecord)> {
        let mut records = Vec::with_capacity(job.due.len());
        let mut counts = Counts::default();
        let mut times = StageTimes {
            extract_a: job.a.seconds,
            extract_b: job.b.seconds,
            ..StageTimes::default()
        };
        let searched = self.search(job, &mut counts, &mut times);
        for due in job.due.chunk_by(|x, y| x.repetition == y.repetition) {
            let repetition = due[0].repetition;
            let seed = self.seed(job.pair, repetition);
            let selected = (searched.as_ref().map_err(Clone::clone))
                .and_then(|searched| self.select(searched, seed, &mut counts, &mut times));
            for index in due.iter().map(|due| due.estimator) {
                let estimator = &self.part.contender.estimators[index];
                let outcome = (selected.as_ref().map_err(Clone::clone)).and_then(|selected| {
                    self.estimate(job.pair, selected, estimator, seed, &mut times)
                });
                let record = RunRecord {
                    task: self.part.task(job.pair, &estimator.id, repetition),
                    counts,
                    outcome: outcome.unwrap_or_else(|reason| Outcome::Failed { reason }),
                    // Whoever comes next finds these results ready, and so without a time.
                    times: mem::take(&mut times),
                };
                records.push((index, record));
            }
        }
        records
    }

    /// The seed of a pair: it depends on what is done, never on when or where.
    fn seed(&self, pair: &Pair, repetition: u32) -> Seed {
        (self.root)
            .child(&self.part.sequence.name)
            .child(&self.part.contender.matcher.id)
            .number(pair.a.into())
            .number(pair.b.into())
            .number(repetition.into())
    }

    fn search<'j>(
        &self,
        job: &PairJob<'j>,
        counts: &mut Counts,
        times: &mut StageTimes,
    ) -> Result<Searched<'j>, String> {
        let (a, b) = (job.a.features?, job.b.features?);
        (counts.features_a, counts.features_b) = (count(a.len()), count(b.len()));
        let matcher = &*self.part.contender.matcher.matcher;
        let putative = timed(&mut times.search, || {
            guard("search", || matcher.search(a, b))
        })?;
        counts.putative = count(putative.len());
        let image = |frame: u32| {
            load(
                self.decode,
                &self.part.sequence.frames[frame as usize].image,
            )
        };
        Ok(Searched {
            a,
            b,
            images: (matcher.selects_by_pixels())
                .then(|| Ok::<_, String>((image(job.pair.a)?, image(job.pair.b)?)))
                .transpose()?,
            putative,
        })
    }

    fn select(
        &self,
        searched: &Searched<'_>,
        seed: Seed,
        counts: &mut Counts,
        times: &mut StageTimes,
    ) -> Result<Selected, String> {
        let matcher = &*self.part.contender.matcher.matcher;
        let images = searched.images.as_ref();
        let a = View {
            features: searched.a,
            image: images.map(|(a, _)| a),
        };
        let b = View {
            features: searched.b,
            image: images.map(|(_, b)| b),
        };
        let putative = searched.putative.clone();
        let seed = seed.child("select");
        let matches = timed(&mut times.select, || {
            guard("selection", || matcher.select(a, b, putative, seed))
        })?;
        counts.selected = count(matches.len());
        guard("selection", || {
            Selected::new(&matches, a.features, b.features)
        })
    }

    fn estimate(
        &self,
        pair: &Pair,
        selected: &Selected,
        estimator: &BuiltEstimator,
        seed: Seed,
        times: &mut StageTimes,
    ) -> Result<Outcome, String> {
        let found = selected.a.len();
        if found < MIN_MATCHES {
            let needed = MIN_MATCHES;
            let reason = NoPose::TooFewMatches { found, needed };
            return Ok(Outcome::NoPose { reason });
        }
        let camera = |frame: u32| &self.part.sequence.frames[frame as usize].camera;
        let views = TwoViews {
            a: &selected.a,
            b: &selected.b,
            camera_a: camera(pair.a),
            camera_b: camera(pair.b),
            ambiguity: &selected.ambiguity,
        };
        let seed = seed.child("estimate").child(&estimator.id);
        let what = format_args!("estimation by {}", estimator.id);
        let estimated = timed(&mut times.estimate, || {
            guard(what, || {
                Ok::<_, MatcherError>(estimator.estimator.estimate(views, seed))
            })
        })?;
        let estimate = match estimated {
            Err(reason) => return Ok(Outcome::NoPose { reason }),
            Ok(estimate) => estimate,
        };
        if estimate.support < MIN_SUPPORT {
            let (found, needed) = (estimate.support, MIN_SUPPORT);
            let reason = NoPose::NoSupport { found, needed };
            return Ok(Outcome::NoPose { reason });
        }
        guard(what, || {
            Ok::<_, MatcherError>(Outcome::judged(
                &estimate.b_from_a,
                &pair.b_from_a,
                count(estimate.inliers.len()),
                count(estimate.support),
                count(estimate.iterations),
            ))
        })
    }
}

impl Selected {
    /// # Errors
    /// If a match names a feature that is not there.
    fn new(matches: &[Correspondence], a: &Features, b: &Features) -> Result<Self, String> {
        let point = |features: &Features, index: u32| {
            let keypoint: Option<&Keypoint> = features.keypoints.get(index as usize);
            let at = keypoint.map(|keypoint| keypoint.at.cast::<f64>());
            at.ok_or_else(|| format!("a match names feature {index} of {}", features.len()))
        };
        Ok(Self {
            a: (matches.iter().map(|m| point(a, m.a))).collect::<Result<_, _>>()?,
            b: (matches.iter().map(|m| point(b, m.b))).collect::<Result<_, _>>()?,
            ambiguity: matches.iter().map(ambiguity).collect(),
        })
    }
}

/// Nearest over second nearest distance; 1 where both are zero, since nothing tells them apart.
fn ambiguity(m: &Correspondence) -> f32 {
    let ratio = m.distance / m.second;
    if ratio.is_nan() { 1.0 } else { ratio }
}

/// Numbers of features, matches and samples fit into 32 bits by far.
fn count(number: usize) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}
