//! The pose estimator of the reference protocol: five-point RANSAC and the cheirality choice.
//!
//! Fischler, Bolles, "Random Sample Consensus: A Paradigm for Model Fitting with Applications to
//! Image Analysis and Automated Cartography", Communications of the ACM 24(6), 1981; Nistér, "An
//! Efficient Solution to the Five-Point Relative Pose Problem", IEEE Transactions on Pattern
//! Analysis and Machine Intelligence 26(6), 2004.
//!
//! 1. Matched pixels become points at depth 1, each by its own camera, lens distortion undone.
//! 2. [`consensus`](super::consensus()) over uniform samples of five matches finds the essential matrix with the most
//!    inliers by squared Sampson distance. It is not refitted to them.
//! 3. [`choose_pose`] decides between its four decompositions over all matches that were given, not
//!    only the inliers, and counts those that support the pose.
//!
//! | symbol | field | default | source |
//! | --- | --- | --- | --- |
//! | p | `confidence` | 0.999 | the protocol of MatchBench (Bian et al.) |
//! | | `threshold_px` | 1.0 | the same |
//! | | `max_iterations` | 1000 | OpenCV 4's `findEssentialMat` |
//! | | `max_depth` | 50 | OpenCV 4's `recoverPose` |
//!
//! This is what OpenCV 4's `findEssentialMat(a, b, K, RANSAC, 0.999, 1.0)` and `recoverPose(E, a, b,
//! K)` without a mask compute; pixels become depth-1 units by the mean of the focal lengths of both
//! cameras, as there. *Differences*: the samples are drawn by another generator, so results agree in
//! distribution only; the solver keeps solutions that OpenCV's polynomial roots miss, and refuses
//! degenerate samples; a pose that no match supports is [`NoModel`].

use super::{
    ConsensusParams, EssentialProblem, Extras, InlierCount, NoModel, PoseEstimate, PoseEstimator,
    Problem, TwoViews, Uniform, consensus_until,
};
use crate::geometry::choose_pose;
use crate::params::ParamError;
use crate::seed::Seed;

/// Parameters of [`Ransac`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct RansacParams {
    /// Required probability that at least one sample is free of wrong matches, in `[0, 1)`.
    pub confidence: f64,
    /// Largest Sampson distance of an inlier, in pixels.
    pub threshold_px: f64,
    /// Largest number of samples.
    pub max_iterations: usize,
    /// Scene points farther than this, in baselines, do not support a pose.
    pub max_depth: f64,
}

impl Default for RansacParams {
    fn default() -> Self {
        Self {
            confidence: 0.999,
            threshold_px: 1.0,
            max_iterations: 1000,
            max_depth: 50.0,
        }
    }
}

/// Five-point RANSAC; cheirality chooses among the four poses.
#[derive(Clone, Copy, Debug)]
pub struct Ransac {
    params: RansacParams,
}

impl Ransac {
    /// An estimator with these parameters.
    ///
    /// # Errors
    /// If one of them is out of its range.
    pub fn new(params: RansacParams) -> Result<Self, ParamError> {
        let RansacParams {
            confidence,
            threshold_px,
            max_iterations,
            max_depth,
        } = params;
        ParamError::unless(
            (0.0..1.0).contains(&confidence),
            "confidence",
            confidence,
            "at least 0 and below 1",
        )?;
        ParamError::unless(
            threshold_px > 0.0 && threshold_px.is_finite(),
            "threshold_px",
            threshold_px,
            "positive and finite",
        )?;
        ParamError::unless(
            max_iterations > 0,
            "max_iterations",
            max_iterations,
            "at least 1",
        )?;
        // Infinity is allowed: no limit.
        ParamError::unless(max_depth > 0.0, "max_depth", max_depth, "positive")?;
        Ok(Self { params })
    }
}

impl PoseEstimator for Ransac {
    fn estimate(&self, views: TwoViews<'_>, seed: Seed) -> Result<PoseEstimate, NoModel> {
        self.estimate_until(views, seed, &|_| false)
    }

    fn estimate_until(
        &self,
        views: TwoViews<'_>,
        seed: Seed,
        stop: &dyn Fn(usize) -> bool,
    ) -> Result<PoseEstimate, NoModel> {
        let pairs = views.at_depth_1();
        let needed = EssentialProblem::SAMPLE;
        if pairs.len() < needed {
            return Err(NoModel::TooFewMatches {
                found: pairs.len(),
                needed,
            });
        }
        let threshold = self.params.threshold_px / views.mean_focal();
        let found = consensus_until(
            &EssentialProblem {
                pairs: &pairs,
                cheirality: false,
                plane_poses: false,
                changes: None,
                hopeless: None,
            },
            &InlierCount {
                squared_threshold: threshold * threshold,
            },
            &mut Uniform::new(pairs.len()),
            ConsensusParams {
                confidence: self.params.confidence,
                max_samples: self.params.max_iterations,
            },
            Extras::NONE,
            &mut seed.rng(),
            stop,
        )
        .ok_or(NoModel::none_found(needed))?;
        match choose_pose(&found.model, &pairs, self.params.max_depth) {
            Some((b_from_a, support)) if support > 0 => Ok(PoseEstimate {
                b_from_a,
                inliers: found.inliers,
                support,
                iterations: found.samples,
            }),
            _ => Err(NoModel::NOTHING_IN_FRONT),
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point2, UnitQuaternion, UnitVector3, Vector3};

    use super::*;
    use crate::geometry::{Camera, Distortion, Lens, MatchedPoints, RelativePose};

    const CAMERA_A: Camera = Camera::pinhole(700.0, 710.0, 320.0, 240.0);
    const CAMERA_B: Camera = Camera {
        distortion: Some(Lens::Brown(Distortion {
            k1: 0.1,
            k2: -0.2,
            p1: 0.001,
            p2: -0.002,
            k3: 0.0,
        })),
        ..Camera::pinhole(520.0, 515.0, 310.0, 250.0)
    };

    fn truth() -> RelativePose {
        RelativePose {
            rotation: UnitQuaternion::from_euler_angles(0.05, -0.2, 0.1),
            direction: UnitVector3::new_normalize(Vector3::new(0.9, 0.1, 0.3)),
        }
    }

    type Matches = (Vec<Point2<f64>>, Vec<Point2<f64>>);

    /// The matches, none more certain than another.
    fn points((a, b): &Matches) -> MatchedPoints {
        MatchedPoints::new(a.clone(), b.clone(), vec![0.5; a.len()])
    }

    /// Matches of which the first `right` see the scene with `noise` pixels and the others nothing.
    fn matches(right: usize, wrong: usize, noise: f64, seed: u64) -> Matches {
        let mut rng = Seed(seed).rng();
        (0..right + wrong)
            .map(|i| {
                let mut pixel = || Point2::new(640.0 * rng.uniform(), 480.0 * rng.uniform());
                let (a, anything) = (pixel(), pixel());
                let ray = CAMERA_A.normalize(a).to_homogeneous();
                let depth = 2.0 + 6.0 * rng.uniform();
                let x = truth().rotation * (ray * depth) + truth().direction.into_inner();
                let b = CAMERA_B.project(Point2::new(x.x / x.z, x.y / x.z));
                let shift = Vector3::from_fn(|_, _| noise * rng.normal());
                (a, if i < right { b + shift.xy() } else { anything })
            })
            .unzip()
    }

    fn estimate(matches: &Matches, seed: u64) -> Result<PoseEstimate, NoModel> {
        let views = TwoViews {
            points: &points(matches),
            camera_a: &CAMERA_A,
            camera_b: &CAMERA_B,
        };
        Ransac::new(RansacParams::default())
            .unwrap()
            .estimate(views, Seed(seed))
    }

    #[test]
    fn the_pose_is_found_up_to_half_wrong() {
        for (wrong, noise, degrees) in [
            (0, 0.0, 1e-6),
            (0, 0.3, 3.0),
            (100, 0.0, 1e-5),
            (200, 0.2, 3.0),
        ] {
            let found = estimate(&matches(200, wrong, noise, 7), 1).unwrap();
            let error = found.b_from_a.error(&truth()).max().to_degrees();
            assert!(
                error < degrees,
                "{wrong} wrong, {noise} px: {error} degrees"
            );
            let right = found.inliers.iter().filter(|&&i| i < 200).count();
            assert!(right >= if noise == 0.0 { 200 } else { 120 }, "{right}");
            assert!(found.inliers.is_sorted());
            // Wrong matches in front of both cameras support the pose too.
            assert!(
                found.support >= 195 && found.support <= 200 + wrong,
                "{}",
                found.support
            );
            assert!(found.iterations < 1000);
        }
    }

    #[test]
    fn hopeless_matches_exhaust_the_iterations() {
        let found = estimate(&matches(0, 300, 0.0, 3), 1).expect("some pose");
        assert_eq!(found.iterations, 1000);
        assert!(found.inliers.len() < 60, "{}", found.inliers.len());
    }

    #[test]
    fn the_same_seed_gives_the_same_bits_and_another_seed_other_samples() {
        let matches = matches(100, 100, 0.5, 5);
        assert_eq!(estimate(&matches, 3), estimate(&matches, 3));
        assert_ne!(estimate(&matches, 3), estimate(&matches, 4));
    }

    #[test]
    fn five_matches_are_enough_and_four_are_not() {
        let (a, b) = matches(5, 0, 0.0, 1);
        assert_eq!(
            estimate(&(a.clone(), b.clone()), 1).unwrap().inliers,
            [0, 1, 2, 3, 4]
        );
        let four = (a[..4].to_vec(), b[..4].to_vec());
        let too_few = |found| Err(NoModel::TooFewMatches { found, needed: 5 });
        assert_eq!(estimate(&four, 1), too_few(4));
        assert_eq!(estimate(&Matches::default(), 1), too_few(0));
    }

    #[test]
    fn degenerate_matches_have_no_pose() {
        let equal = vec![Point2::new(100.0, 200.0); 50];
        let line: Vec<_> = (0..50)
            .map(|i| Point2::new(10.0 + 3.0 * f64::from(i), 200.0))
            .collect();
        let shifted: Vec<_> = line
            .iter()
            .map(|p| Point2::new(p.x + 7.0, 0.5 * p.x))
            .collect();
        let nan = vec![Point2::new(f64::NAN, 1.0); 50];
        let far = vec![Point2::new(f64::INFINITY, -f64::INFINITY); 50];
        let none = Err(NoModel::NoSupport {
            found: 0,
            needed: 5,
        });
        for (a, b) in [(&equal, &equal), (&nan, &line), (&line, &nan), (&far, &far)] {
            assert_eq!(estimate(&(a.clone(), b.clone()), 1), none);
        }
        // Pinhole cameras: through a distorting lens a line is not straight.
        let views = TwoViews {
            points: &points(&(line, shifted)),
            camera_a: &CAMERA_A,
            camera_b: &CAMERA_A,
        };
        let ransac = Ransac::new(RansacParams::default()).unwrap();
        assert_eq!(ransac.estimate(views, Seed(1)), none);
    }

    #[test]
    fn a_few_broken_matches_do_not_disturb() {
        let (mut a, b) = matches(100, 0, 0.0, 2);
        a[7].x = f64::NAN;
        a[50].y = f64::INFINITY;
        let found = estimate(&(a, b), 1).unwrap();
        assert_eq!(found.inliers.len(), 98);
        assert!(found.b_from_a.error(&truth()).max() < 1e-7);
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let default = RansacParams::default();
        for (name, params) in [
            (
                "confidence",
                RansacParams {
                    confidence: 1.0,
                    ..default
                },
            ),
            (
                "threshold_px",
                RansacParams {
                    threshold_px: f64::NAN,
                    ..default
                },
            ),
            (
                "max_iterations",
                RansacParams {
                    max_iterations: 0,
                    ..default
                },
            ),
            (
                "max_depth",
                RansacParams {
                    max_depth: -1.0,
                    ..default
                },
            ),
        ] {
            let message = Ransac::new(params).unwrap_err().to_string();
            assert!(message.contains(name), "{message}");
        }
    }

    #[test]
    fn points_beyond_the_largest_depth_support_no_pose() {
        let exact = |depths: std::ops::Range<f64>, count: usize, seed: u64| -> Matches {
            let mut rng = Seed(seed).rng();
            let mut seen = || {
                let a = Point2::new(640.0 * rng.uniform(), 480.0 * rng.uniform());
                let depth = depths.start + (depths.end - depths.start) * rng.uniform();
                let x = truth().rotation * (CAMERA_A.normalize(a).to_homogeneous() * depth)
                    + truth().direction.into_inner();
                (a, CAMERA_B.project(Point2::new(x.x / x.z, x.y / x.z)))
            };
            (0..count).map(|_| seen()).unzip()
        };
        let far = exact(60.0..90.0, 40, 3);
        assert_eq!(estimate(&far, 1), Err(NoModel::NOTHING_IN_FRONT));
        let mut both = exact(3.0..30.0, 25, 4);
        both.0.extend(&far.0);
        both.1.extend(&far.1);
        let found = estimate(&both, 1).expect("a pose");
        assert_eq!((found.support, found.inliers.len()), (25, 65));
        let views = TwoViews {
            points: &points(&far),
            camera_a: &CAMERA_A,
            camera_b: &CAMERA_B,
        };
        let unlimited = RansacParams {
            max_depth: f64::INFINITY,
            ..RansacParams::default()
        };
        let unlimited = Ransac::new(unlimited).unwrap().estimate(views, Seed(1));
        assert_eq!(unlimited.expect("a pose").support, 40);
    }
}
