//! From two sets of features to records: searched, selected, estimated, judged.

use std::mem;
use std::time::{Duration, Instant};

use matchbench_vision::features::Features;
use matchbench_vision::geometry::{Camera, MatchedPoints};
use matchbench_vision::image::GrayImage;
use matchbench_vision::matching::{Correspondences, MatcherError, View};
use matchbench_vision::robust::{NoPose, TwoViews};
use matchbench_vision::seed::Seed;

use super::frame::{Decode, load};
use super::guard::{guard, timed};
use super::part::{Due, Part, Unit};
use super::resident::PairJob;
use crate::datasets::Pair;
use crate::estimators::BuiltEstimator;
use crate::records::matches::MatchesKey;
use crate::records::{
    Counts, MIN_MATCHES, MIN_SUPPORT, MatchesFile, Outcome, RunRecord, SelectedMatches, StageTimes,
    StoreError,
};

/// The stages that are done once per pair.
pub(super) struct PairStages<'a> {
    pub(super) part: &'a Part<'a>,
    pub(super) decode: Decode,
    pub(super) root: Seed,
    /// How long an estimator may draw samples, if not as long as it likes.
    pub(super) time_budget: Option<Duration>,
}

/// What is known of a pair after the search.
struct Searched<'a> {
    a: &'a Features,
    b: &'a Features,
    /// The pixels, for matchers that select by them.
    images: Option<(GrayImage, GrayImage)>,
    putative: Correspondences,
}

/// What came of a pair.
pub(super) struct PairDone {
    /// The records of the tasks that were due, each with the index of its estimator.
    pub(super) records: Vec<(usize, RunRecord)>,
    /// The selected matches of each repetition that was computed.
    pub(super) matches: Vec<(MatchesKey, SelectedMatches)>,
}

impl PairStages<'_> {
    /// Does all tasks that are due of a pair.
    ///
    /// The search is done once. Each repetition selects anew, since a selector may draw random
    /// numbers; all estimators get the same selected matches.
    pub(super) fn run(&self, job: &PairJob<'_>) -> PairDone {
        let mut counts = Counts::default();
        let mut times = StageTimes {
            extract_a: job.a.seconds,
            extract_b: job.b.seconds,
            ..StageTimes::default()
        };
        let searched = self.search(job, &mut counts, &mut times);
        let mut done = PairDone {
            records: Vec::with_capacity(job.due.len()),
            matches: Vec::new(),
        };
        for due in job.due.chunk_by(|x, y| x.repetition == y.repetition) {
            let repetition = due[0].repetition;
            let seed = self.seed(job.pair, repetition);
            let selected = (searched.as_ref().map_err(Clone::clone)).and_then(|searched| {
                self.select(job.pair, searched, seed, &mut counts, &mut times)
            });
            self.estimate_all(job.pair, due, &selected, counts, times, &mut done.records);
            // Whoever comes next finds these results ready, and so without a time.
            times = StageTimes::default();
            if let Ok(matches) = selected {
                done.matches
                    .push(((job.pair.a, job.pair.b, repetition), matches));
            }
        }
        done
    }

    /// Does all tasks that are due of a pair whose selected matches are `stored`.
    ///
    /// # Errors
    /// If they cannot be read.
    pub(super) fn estimate(
        &self,
        unit: &Unit<'_>,
        stored: &MatchesFile,
    ) -> Result<PairDone, StoreError> {
        let mut done = PairDone {
            records: Vec::with_capacity(unit.due.len()),
            matches: Vec::new(),
        };
        for due in unit.due.chunk_by(|x, y| x.repetition == y.repetition) {
            let matches = stored.read((unit.pair.a, unit.pair.b, due[0].repetition))?;
            let matches = matches.expect("the caller saw that they are there");
            let (counts, times) = (matches.counts, StageTimes::default());
            self.estimate_all(
                unit.pair,
                due,
                &Ok(matches),
                counts,
                times,
                &mut done.records,
            );
        }
        Ok(done)
    }

    /// The records of one repetition; the first of them has the `times` of the stages before.
    fn estimate_all(
        &self,
        pair: &Pair,
        due: &[Due],
        selected: &Result<SelectedMatches, String>,
        counts: Counts,
        mut times: StageTimes,
        records: &mut Vec<(usize, RunRecord)>,
    ) {
        let seed = self.seed(pair, due[0].repetition);
        for due in due {
            let estimator = &self.part.contender.estimators[due.estimator];
            let outcome = (selected.as_ref().map_err(Clone::clone)).and_then(|selected| {
                self.judge(pair, &selected.points, estimator, seed, &mut times)
            });
            let record = RunRecord {
                task: self.part.task(pair, &estimator.id, due.repetition),
                counts,
                outcome: outcome.unwrap_or_else(|reason| Outcome::Failed { reason }),
                times: mem::take(&mut times),
            };
            records.push((due.estimator, record));
        }
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

    fn camera(&self, frame: u32) -> &Camera {
        &self.part.sequence.frames[frame as usize].camera
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
        pair: &Pair,
        searched: &Searched<'_>,
        seed: Seed,
        counts: &mut Counts,
        times: &mut StageTimes,
    ) -> Result<SelectedMatches, String> {
        let matcher = &*self.part.contender.matcher.matcher;
        let images = searched.images.as_ref();
        let a = View {
            features: searched.a,
            image: images.map(|(a, _)| a),
            camera: Some(self.camera(pair.a)),
        };
        let b = View {
            features: searched.b,
            image: images.map(|(_, b)| b),
            camera: Some(self.camera(pair.b)),
        };
        let putative = searched.putative.clone();
        let seed = seed.child("select");
        let matches = timed(&mut times.select, || {
            guard("selection", || matcher.select(a, b, putative, seed))
        })?;
        counts.selected = count(matches.len());
        let points = guard("selection", || {
            MatchedPoints::of_matches(&matches, a.features, b.features)
        })?;
        Ok(SelectedMatches::new(*counts, &points))
    }

    /// One estimator on one pair, compared with the truth.
    fn judge(
        &self,
        pair: &Pair,
        points: &MatchedPoints,
        estimator: &BuiltEstimator,
        seed: Seed,
        times: &mut StageTimes,
    ) -> Result<Outcome, String> {
        let found = points.len();
        if found < MIN_MATCHES {
            let needed = MIN_MATCHES;
            let reason = NoPose::TooFewMatches { found, needed };
            return Ok(Outcome::NoPose { reason });
        }
        let views = TwoViews {
            points,
            camera_a: self.camera(pair.a),
            camera_b: self.camera(pair.b),
        };
        let seed = seed.child("estimate").child(&estimator.id);
        let what = format_args!("estimation by {}", estimator.id);
        let estimated = timed(&mut times.estimate, || {
            guard(what, || {
                Ok::<_, MatcherError>(match self.time_budget {
                    None => estimator.estimator.estimate(views, seed),
                    Some(budget) => {
                        let start = Instant::now();
                        let stop = |_| start.elapsed() >= budget;
                        estimator.estimator.estimate_until(views, seed, &stop)
                    }
                })
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

/// Numbers of features, matches and samples fit into 32 bits by far.
fn count(number: usize) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}
