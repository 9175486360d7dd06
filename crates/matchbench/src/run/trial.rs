//! From matched points to an outcome: estimated, and compared with the truth.
//!
//! This is the one place where a run receives matched points. Whatever they came from, a matcher's
//! stages, the matches of an earlier process or a source outside, they are [`MatchedPoints`] from here
//! on.

use std::time::{Duration, Instant};

use matchbench_vision::geometry::{Camera, MatchedPoints};
use matchbench_vision::matching::MatcherError;
use matchbench_vision::robust::{NoPose, TwoViews};
use matchbench_vision::seed::Seed;
use nalgebra::Isometry3;

use super::guard::{guard, timed};
use super::matching::count;
use super::seeds::estimation_seed;
use crate::estimators::BuiltEstimator;
use crate::records::{MIN_MATCHES, MIN_SUPPORT, Outcome, StageTimes};

/// A pair of images as estimators and the truth see it.
#[derive(Clone, Copy)]
pub(super) struct Trial<'a> {
    /// Cameras of a and b.
    pub(super) cameras: [&'a Camera; 2],
    /// The true pose.
    pub(super) b_from_a: &'a Isometry3<f64>,
    /// The seed of the pair and repetition.
    pub(super) seed: Seed,
    /// How long an estimator may draw samples, if not as long as it likes.
    pub(super) time_budget: Option<Duration>,
}

/// What an estimator came to.
pub(super) struct Judged {
    pub(super) outcome: Outcome,
    /// The indices of the matches that agree with the pose; none where there is no pose.
    pub(super) inliers: Vec<u32>,
}

impl From<Outcome> for Judged {
    fn from(outcome: Outcome) -> Self {
        let inliers = Vec::new();
        Self { outcome, inliers }
    }
}

impl Trial<'_> {
    /// One estimator on the matched points, compared with the truth.
    ///
    /// # Errors
    /// If the estimator breaks.
    pub(super) fn evaluate(
        &self,
        points: &MatchedPoints,
        estimator: &BuiltEstimator,
        times: &mut StageTimes,
    ) -> Result<Judged, String> {
        let found = points.len();
        if found < MIN_MATCHES {
            let needed = MIN_MATCHES;
            let reason = NoPose::TooFewMatches { found, needed };
            return Ok(Outcome::NoPose { reason }.into());
        }
        let [camera_a, camera_b] = self.cameras;
        let views = TwoViews {
            points,
            camera_a,
            camera_b,
        };
        let seed = estimation_seed(self.seed, &estimator.id);
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
            Err(reason) => return Ok(Outcome::NoPose { reason }.into()),
            Ok(estimate) => estimate,
        };
        if estimate.support < MIN_SUPPORT {
            let (found, needed) = (estimate.support, MIN_SUPPORT);
            let reason = NoPose::NoSupport { found, needed };
            return Ok(Outcome::NoPose { reason }.into());
        }
        guard(what, || {
            let outcome = Outcome::judged(
                &estimate.b_from_a,
                self.b_from_a,
                count(estimate.inliers.len()),
                count(estimate.support),
                count(estimate.iterations),
            );
            let inliers = estimate.inliers;
            Ok::<_, MatcherError>(Judged { outcome, inliers })
        })
    }
}
