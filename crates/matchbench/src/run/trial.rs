//! From matched points to an outcome: estimated, and compared with the truth.
//!
//! This is the one place where a run receives matched points. They may come from the stages of a matcher,
//! from the matches of an earlier process or from a source outside; from here on they are
//! [`MatchedPoints`].

use std::time::{Duration, Instant};

use matchbench_vision::geometry::{Camera, MatchedPoints, transfer};
use matchbench_vision::image::Size;
use matchbench_vision::matching::MatcherError;
use matchbench_vision::robust::{HomographyEstimator, PoseEstimator, TwoViews};
use matchbench_vision::seed::Seed;
use nalgebra::Matrix3;

use super::Variant;
use super::guard::{Broken, guard, timed};
use super::matching::count;
use super::seeds::estimation_seed;
use crate::datasets::Truth;
use crate::estimators::Estimator;
use crate::protocols::Protocol;
use crate::records::{Outcome, StageTimes};

/// A pair of images as estimators and the truth see it.
#[derive(Clone, Copy)]
pub(super) struct Trial<'a> {
    /// Cameras of a and b.
    pub(super) cameras: [&'a Camera; 2],
    /// What is known of the pair.
    pub(super) truth: &'a Truth,
    /// Looks up how large image a (0) or b (1) is: a homography is judged on the corners of a, and protocols
    /// have pixels of another size.
    pub(super) size: &'a dyn Fn(usize) -> Result<Size, Broken>,
    /// The seed of the pair and repetition.
    pub(super) seed: Seed,
    /// How long an estimator may draw samples, if not as long as it likes.
    pub(super) time_budget: Option<Duration>,
}

/// What an estimator came to.
pub(super) struct Judged {
    pub(super) outcome: Outcome,
    /// The indices of the matches that agree with the estimate; none where there is none.
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
    /// If the estimator breaks, or the size of an image is needed and cannot be read.
    pub(super) fn evaluate(
        &self,
        points: &MatchedPoints,
        variant: &Variant,
        times: &mut StageTimes,
    ) -> Result<Judged, Broken> {
        let (id, protocol) = (&variant.estimator.id, variant.protocol);
        match &variant.estimator.estimator {
            Estimator::Homography(h) => self.homography(points, id, &**h, times),
            Estimator::Pose(pose) => {
                let needs_sizes = protocol.needs_sizes();
                let sizes =
                    needs_sizes.then(|| Ok::<_, Broken>([(self.size)(0)?, (self.size)(1)?]));
                let [camera_a, camera_b] = self.cameras;
                let original = TwoViews {
                    points,
                    camera_a,
                    camera_b,
                };
                Ok(match protocol.view(self.cameras, sizes.transpose()?) {
                    None => self.pose(original, original, id, &**pose, protocol, times)?,
                    Some(view) => {
                        let [camera_a, camera_b] = self.cameras.map(|camera| view.camera(camera));
                        let seen = TwoViews {
                            points: &view.points(points),
                            camera_a: &camera_a,
                            camera_b: &camera_b,
                        };
                        self.pose(original, seen, id, &**pose, protocol, times)?
                    }
                })
            }
        }
    }

    /// The estimator gets the matches as the protocol has them `seen`. Its pose is trusted by the `original` ones:
    /// what that is calibrated for are pixels of images as they are.
    fn pose(
        &self,
        original: TwoViews<'_>,
        seen: TwoViews<'_>,
        id: &str,
        estimator: &dyn PoseEstimator,
        protocol: &Protocol,
        times: &mut StageTimes,
    ) -> Result<Judged, String> {
        let truth = (self.truth.pose()).ok_or("the pose of the pair is not known")?;
        if let Some(reason) = protocol.too_few(seen.points.len()) {
            return Ok(Outcome::NoPose { reason }.into());
        }
        let what = format_args!("estimation by {id}");
        let estimated = self.timed(id, times, |seed, stop| match stop {
            None => estimator.estimate(seen, seed),
            Some(stop) => estimator.estimate_until(seen, seed, stop),
        })?;
        let estimate = match estimated {
            Err(reason) => return Ok(Outcome::NoPose { reason }.into()),
            Ok(estimate) => estimate,
        };
        if let Some(reason) = protocol.too_weak(estimate.inliers.len(), estimate.support) {
            return Ok(Outcome::NoPose { reason }.into());
        }
        guard(what, || {
            let outcome = Outcome::judged(
                &estimate.b_from_a,
                truth,
                count(estimate.inliers.len()),
                count(estimate.support),
                count(estimate.iterations),
            );
            let outcome =
                outcome.with_probabilities(original.pose_probabilities(&estimate.b_from_a));
            let inliers = estimate.inliers;
            Ok::<_, MatcherError>(Judged { outcome, inliers })
        })
    }

    fn homography(
        &self,
        points: &MatchedPoints,
        id: &str,
        estimator: &dyn HomographyEstimator,
        times: &mut StageTimes,
    ) -> Result<Judged, Broken> {
        let unknown = || "the homography of the pair is not known".to_owned();
        let truth = self.truth.homography().ok_or_else(unknown)?;
        let size_a = (self.size)(0)?;
        let estimated = self.timed(id, times, |seed, stop| match stop {
            None => estimator.estimate(points, seed),
            Some(stop) => estimator.estimate_until(points, seed, stop),
        })?;
        let estimate = match estimated {
            Err(reason) => return Ok(Outcome::NoHomography { reason }.into()),
            Ok(estimate) => estimate,
        };
        let judged = guard(format_args!("estimation by {id}"), || {
            let outcome = Outcome::judged_homography(&estimate, truth, size_a);
            let inliers = estimate.inliers;
            Ok::<_, MatcherError>(Judged { outcome, inliers })
        });
        Ok(judged?)
    }

    /// Runs an estimator with the seed of its id, for as long as it may, and takes the time.
    fn timed<T>(
        &self,
        id: &str,
        times: &mut StageTimes,
        estimate: impl Fn(Seed, Option<&dyn Fn(usize) -> bool>) -> T,
    ) -> Result<T, String> {
        let seed = estimation_seed(self.seed, id);
        timed(&mut times.estimate, || {
            guard(format_args!("estimation by {id}"), || {
                Ok::<_, MatcherError>(match self.time_budget {
                    None => estimate(seed, None),
                    Some(budget) => {
                        let start = Instant::now();
                        estimate(seed, Some(&|_| start.elapsed() >= budget))
                    }
                })
            })
        })
    }
}

/// How many matches lie within 1, 2, ... 10 pixels of where the true homography takes them: what mean matching
/// accuracy counts (Mikolajczyk, Schmid, "A Performance Evaluation of Local Descriptors", PAMI 27(10), 2005;
/// Dusmanu et al., "D2-Net", CVPR 2019).
pub(super) fn correct_matches(homography: &Matrix3<f64>, points: &MatchedPoints) -> [u32; 10] {
    let pairs = points.a.iter().zip(&points.b);
    counts_within(pairs.map(|(&a, b)| (transfer(homography, a) - b).norm())).1
}

/// How many distances there are, and how many of them are 1, 2, ... 10 pixels or less.
pub(super) fn counts_within(distances: impl Iterator<Item = f64>) -> (u32, [u32; 10]) {
    let (mut all, mut within) = (0, [0; 10]);
    for distance in distances {
        all += 1;
        for (k, within) in (1_u32..).zip(&mut within) {
            *within += u32::from(distance <= f64::from(k));
        }
    }
    (all, within)
}

#[cfg(test)]
mod tests {
    use matchbench_vision::geometry::RelativePose;
    use matchbench_vision::robust::{HomographyEstimate, NoModel, PoseEstimate};
    use nalgebra::{Isometry3, Point2, UnitQuaternion, UnitVector3, Vector3};

    use super::*;
    use crate::estimators::BuiltEstimator;
    use crate::protocols::{GLUE_FACTORY, IMC, MATCHBENCH, SUPERGLUE};

    fn variant(estimator: Estimator, protocol: &'static Protocol) -> Variant {
        Variant {
            name: "fixed".into(),
            estimator: BuiltEstimator {
                id: "fixed".into(),
                params: serde_json::Value::Null,
                estimator,
            },
            protocol,
        }
    }

    /// Says the same of any matches.
    struct Fixed(PoseEstimate);

    impl PoseEstimator for Fixed {
        fn estimate(&self, _: TwoViews<'_>, _: Seed) -> Result<PoseEstimate, NoModel> {
            Ok(self.0.clone())
        }

        fn estimate_until(
            &self,
            _: TwoViews<'_>,
            _: Seed,
            _: &dyn Fn(usize) -> bool,
        ) -> Result<PoseEstimate, NoModel> {
            Ok(self.0.clone())
        }
    }

    /// What comes of a pair under a protocol, of so many matches, inliers and matches in front of both cameras.
    fn outcome(
        protocol: &'static Protocol,
        matches: usize,
        inliers: u32,
        support: usize,
    ) -> Outcome {
        let estimator = Fixed(PoseEstimate {
            b_from_a: RelativePose {
                rotation: UnitQuaternion::identity(),
                direction: UnitVector3::new_normalize(Vector3::x()),
            },
            inliers: (0..inliers).collect(),
            support,
            iterations: 1,
        });
        let variant = variant(Estimator::Pose(Box::new(estimator)), protocol);
        let camera = Camera::pinhole(500.0, 500.0, 320.0, 240.0);
        let trial = Trial {
            cameras: [&camera; 2],
            truth: &Truth::Pose(Isometry3::translation(1.0, 0.0, 0.0)),
            size: &|_| Ok(Size::new(640, 480)),
            seed: Seed(1),
            time_budget: None,
        };
        let mut points = MatchedPoints::default();
        for i in 0..matches {
            // All over the images, at several depths, and up to a third of a pixel beside their rows.
            let (x, y) = ((61 * i % 600) as f64, (37 * i % 440) as f64);
            let (moved, off) = (5.0 + 4.0 * (i % 7) as f64, (i % 3) as f64 / 3.0);
            points.push(Point2::new(x, y), Point2::new(x + moved, y + off), 0.5);
        }
        let judged = trial.evaluate(&points, &variant, &mut StageTimes::default());
        judged.unwrap_or_else(|_| panic!("nothing breaks")).outcome
    }

    /// Why it fails.
    fn failure(
        protocol: &'static Protocol,
        matches: usize,
        inliers: u32,
        support: usize,
    ) -> Option<NoModel> {
        match outcome(protocol, matches, inliers, support) {
            Outcome::NoPose { reason } => Some(reason),
            Outcome::Pose { .. } => None,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_pose_is_trusted_as_much_whatever_size_the_protocol_sees() {
        let probability = |protocol| match outcome(protocol, 60, 60, 60) {
            Outcome::Pose {
                pose_probability: Some(probability),
                ..
            } => probability,
            other => panic!("{other:?}"),
        };
        let camera = Camera::pinhole(500.0, 500.0, 320.0, 240.0);
        let view = GLUE_FACTORY.view([&camera; 2], Some([Size::new(640, 480); 2]));
        assert!(view.is_some(), "it sees images of another size");
        let [ours, theirs] = [&MATCHBENCH, &GLUE_FACTORY].map(probability);
        assert_eq!(ours, theirs);
        // In pixels of another size the matches would say something else.
        assert!((0.01..0.99).contains(&ours), "{ours}");
    }

    #[test]
    fn a_pair_fails_below_the_least_numbers_of_its_protocol() {
        let few = |found, needed| Some(NoModel::TooFewMatches { found, needed });
        let weak = |found, needed| Some(NoModel::NoSupport { found, needed });
        for (protocol, matches, inliers, support, expected) in [
            (&MATCHBENCH, 19, 19, 19, few(19, 20)),
            (&MATCHBENCH, 20, 0, 10, None),
            (&MATCHBENCH, 20, 20, 9, weak(9, 10)),
            (&SUPERGLUE, 4, 4, 4, few(4, 5)),
            (&SUPERGLUE, 5, 0, 1, None),
            (&SUPERGLUE, 5, 5, 0, weak(0, 1)),
            (&IMC, 7, 8, 8, few(7, 8)),
            (&IMC, 8, 7, 8, weak(7, 8)),
            (&IMC, 8, 8, 0, weak(0, 1)),
            (&IMC, 8, 8, 1, None),
        ] {
            let id = protocol.id;
            let found = failure(protocol, matches, inliers, support);
            assert_eq!(found, expected, "{id}: {matches} {inliers} {support}");
        }
    }

    #[test]
    fn a_match_is_correct_within_its_distance_from_the_truth() {
        let mut points = MatchedPoints::default();
        for off in [0.0, 1.0, 1.1, 4.5, 99.0, f64::NAN] {
            points.push(Point2::new(7.0, 3.0), Point2::new(14.0 + off, 6.0), 0.5);
        }
        let twice = Matrix3::new(2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0);
        let expected = [2, 3, 3, 3, 4, 4, 4, 4, 4, 4];
        assert_eq!(correct_matches(&twice, &points), expected);
        assert_eq!(correct_matches(&twice, &MatchedPoints::default()), [0; 10]);
    }

    /// Finds the identity in any matches.
    struct Same;

    impl HomographyEstimator for Same {
        fn estimate(&self, _: &MatchedPoints, _: Seed) -> Result<HomographyEstimate, NoModel> {
            Ok(HomographyEstimate {
                b_from_a: Matrix3::identity(),
                inliers: Vec::new(),
                iterations: 1,
            })
        }

        fn estimate_until(
            &self,
            points: &MatchedPoints,
            seed: Seed,
            _: &dyn Fn(usize) -> bool,
        ) -> Result<HomographyEstimate, NoModel> {
            self.estimate(points, seed)
        }
    }

    #[test]
    fn homographies_are_judged_on_the_corners_of_a() {
        let variant = variant(Estimator::Homography(Box::new(Same)), &MATCHBENCH);
        let stretched = Matrix3::from_diagonal(&Vector3::new(2.0, 1.5, 1.0));
        let camera = Camera::pinhole(8.0, 8.0, 3.5, 3.5);
        let trial = Trial {
            cameras: [&camera; 2],
            truth: &Truth::Homography(stretched),
            size: &|side| Ok([Size::new(8, 8), Size::new(16, 12)][side]),
            seed: Seed(1),
            time_budget: None,
        };
        let points = MatchedPoints::default();
        let judged = trial.evaluate(&points, &variant, &mut StageTimes::default());
        let outcome = judged.unwrap_or_else(|_| panic!("nothing breaks")).outcome;
        let Outcome::Homography { corner_error, .. } = outcome else {
            panic!("{outcome:?}");
        };
        // The corners at 0 and 7 are off by 7 across and 3.5 down.
        let expected = (7.0 + 3.5 + (7.0_f64 * 7.0 + 3.5 * 3.5).sqrt()) / 4.0;
        assert!((corner_error.expect("no corner is far") - expected).abs() < 1e-12);
    }
}
