//! The traits and results of estimators. An estimator of poses takes matched points and two cameras and returns a
//! relative pose; an estimator of homographies takes matched points alone. Either may find none ([`NoModel`]).

use std::fmt;

use nalgebra::Matrix3;

use crate::geometry::{Camera, MatchedPoints, PointPairs, RelativePose};
use crate::seed::Seed;

/// Matches of two images, and the cameras of these images, which must pass [`Camera::check`]: thresholds are
/// divided by their focal lengths.
#[derive(Clone, Copy, Debug)]
pub struct TwoViews<'a> {
    /// The matches, in pixels.
    pub points: &'a MatchedPoints,
    /// The camera that took `a`.
    pub camera_a: &'a Camera,
    /// The camera that took `b`.
    pub camera_b: &'a Camera,
}

impl TwoViews<'_> {
    /// The matches as points at depth 1: calibration and lens distortion of each camera are undone.
    ///
    /// # Panics
    /// If the lists of the matches have different lengths.
    pub fn at_depth_1(&self) -> PointPairs {
        self.points.at_depth_1(self.camera_a, self.camera_b)
    }

    /// As [`TwoViews::at_depth_1`], and if a lens distorts, with the covariances of image noise at depth 1.
    ///
    /// # Panics
    /// If the lists of the matches have different lengths.
    pub fn at_depth_1_with_covariances(&self) -> PointPairs {
        self.points
            .at_depth_1_with_covariances(self.camera_a, self.camera_b)
    }

    /// Pixels per unit at depth 1: the mean over both cameras and both axes.
    pub(super) fn mean_focal(&self) -> f64 {
        f64::midpoint(self.camera_a.mean_focal(), self.camera_b.mean_focal())
    }
}

/// What an estimator found.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseEstimate {
    /// The relative pose.
    pub b_from_a: RelativePose,
    /// Indices of the matches within the threshold of the estimated matrix (the refined one, if it is refined),
    /// ascending. Some of them may lie behind a camera.
    pub inliers: Vec<u32>,
    /// Number of matches, out of all that were given and whatever their distance from the matrix, whose triangulated
    /// point lies in front of both cameras and nearer than the estimator's largest depth; the count of
    /// correspondences that the MatchBench paper reports. It has nothing to do with the
    /// [`Support`](super::Support) by which models are compared.
    pub support: usize,
    /// Number of samples drawn.
    pub iterations: usize,
}

/// What an estimator of homographies found.
#[derive(Clone, Debug, PartialEq)]
pub struct HomographyEstimate {
    /// Maps pixels of a, as `(x, y, 1)`, to those of b. It has Frobenius norm 1, and the sign for which the
    /// third coordinate of the matches of its first sample is positive.
    pub b_from_a: Matrix3<f64>,
    /// Indices of the matches that agree with it, ascending.
    pub inliers: Vec<u32>,
    /// Number of samples drawn.
    pub iterations: usize,
}

/// Why there is no pose, or no homography. The benchmark counts this as an outcome of the pair. A caller that needs
/// the pose may treat it as an error, since it implements `Error`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(tag = "kind", rename_all = "kebab-case"))]
pub enum NoModel {
    /// There are too few matches.
    TooFewMatches {
        /// Number of given matches.
        found: usize,
        /// Number of required matches.
        needed: usize,
    },
    /// There is no model that enough matches support. The estimators of this module say so in three cases:
    ///
    /// - `found` 0 of the matches of a sample (5 for an essential matrix, 7 for a fundamental one, 4 for a homography): no
    ///   model was found, since models with fewer inliers than a sample has matches are not kept;
    /// - `found` 0 of 1: no match lies in front of both cameras of the best pose, nearer than the largest depth;
    /// - other numbers: so few matches agree with the refined homography.
    ///
    /// Whoever asks for more (a protocol of the benchmark) states the numbers of its own.
    NoSupport {
        /// Number of matches that support the best model.
        found: usize,
        /// Number of required matches.
        needed: usize,
    },
}

impl NoModel {
    /// No match lies in front of both cameras of the best pose, nearer than the largest depth.
    pub(super) const NOTHING_IN_FRONT: Self = Self::NoSupport {
        found: 0,
        needed: 1,
    };

    /// No model has as many inliers as a `sample` has matches.
    pub(super) fn none_found(sample: usize) -> Self {
        Self::NoSupport {
            found: 0,
            needed: sample,
        }
    }
}

impl fmt::Display for NoModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooFewMatches { found, needed } => {
                write!(f, "too few matches: {found}, needed {needed}")
            }
            Self::NOTHING_IN_FRONT => f.write_str(
                "no match lies in front of both cameras of the best pose, within the largest depth",
            ),
            Self::NoSupport { found: 0, needed } => {
                write!(f, "no model found that at least {needed} matches support")
            }
            Self::NoSupport { found, needed } => {
                write!(
                    f,
                    "too few matches support the model: {found}, needed {needed}"
                )
            }
        }
    }
}

impl std::error::Error for NoModel {}

/// Estimates the relative pose of two cameras.
pub trait PoseEstimator: Send + Sync {
    /// The pose of `b` relative to `a`; the same seed gives the same bits.
    ///
    /// # Errors
    /// [`NoModel`] if the matches determine none.
    ///
    /// # Panics
    /// If the lists of the matched points have different lengths.
    fn estimate(&self, views: TwoViews<'_>, seed: Seed) -> Result<PoseEstimate, NoModel>;

    /// As [`PoseEstimator::estimate`], but samples are drawn only until `stop` returns true; it is given the number
    /// of samples so far. This allows comparisons at equal time: the caller owns the clock.
    ///
    /// # Errors
    /// [`NoModel`] if the matches determine none, or if the time was too short to find one.
    ///
    /// # Panics
    /// As [`PoseEstimator::estimate`].
    fn estimate_until(
        &self,
        views: TwoViews<'_>,
        seed: Seed,
        stop: &dyn Fn(usize) -> bool,
    ) -> Result<PoseEstimate, NoModel>;
}

/// Estimates the homography between two images, which exists if the scene is a plane or the camera only
/// rotated.
pub trait HomographyEstimator: Send + Sync {
    /// The homography from a to b; the same seed gives the same bits.
    ///
    /// # Errors
    /// [`NoModel`] if the matches determine none.
    ///
    /// # Panics
    /// If the lists of the matches have different lengths.
    fn estimate(&self, points: &MatchedPoints, seed: Seed) -> Result<HomographyEstimate, NoModel>;

    /// As [`HomographyEstimator::estimate`], but samples are drawn only until `stop` returns true, as in
    /// [`PoseEstimator::estimate_until`].
    ///
    /// # Errors
    /// [`NoModel`] if the matches determine none, or if the time was too short to find one.
    ///
    /// # Panics
    /// If the lists of the matches have different lengths.
    fn estimate_until(
        &self,
        points: &MatchedPoints,
        seed: Seed,
        stop: &dyn Fn(usize) -> bool,
    ) -> Result<HomographyEstimate, NoModel>;
}

/// What holds an estimator can be printed, whatever that is.
impl fmt::Debug for dyn PoseEstimator + '_ {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("dyn PoseEstimator")
    }
}

impl fmt::Debug for dyn HomographyEstimator + '_ {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("dyn HomographyEstimator")
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;
    use crate::robust::{
        Ransac, RansacParams, SampleConsensus, SampleConsensusParams, Score, presets,
    };

    /// A threshold of one pixel is 1/1000 at depth 1: the mean of 400, 400, 1600 and 1600 pixels.
    #[test]
    fn thresholds_are_divided_by_the_mean_focal_length_of_both_cameras() {
        let camera_a = Camera::pinhole(400.0, 400.0, 320.0, 240.0);
        let camera_b = Camera::pinhole(1600.0, 1600.0, 1280.0, 960.0);
        // The camera moves to the left: points move along rows, and one that leaves its row by `y` is `y` over the square
        // root of two from where it belongs.
        let mut points = MatchedPoints::default();
        let mut rng = Seed(3).rng();
        for i in 0..60 {
            let [x, y] = [(); 2].map(|()| rng.uniform() - 0.5);
            let off = match i {
                0 => 1.0 / 450.0,  // within a pixel of a alone
                1 => 1.0 / 1250.0, // within 1/1000, and more than a pixel of b
                _ => 0.0,
            };
            let seen = Point2::new(x + 0.1 + 0.3 * rng.uniform(), y + off * 2.0_f64.sqrt());
            let (a, b) = (camera_a.project(Point2::new(x, y)), camera_b.project(seen));
            points.push(a, b, 0.5);
        }
        let views = TwoViews {
            points: &points,
            camera_a: &camera_a,
            camera_b: &camera_b,
        };
        let msac = SampleConsensusParams {
            score: Score::Msac {
                threshold_px: 1.0,
                sprt: false,
            },
            ..presets::ransac_e_inliers()
        };
        let estimators: [Box<dyn PoseEstimator>; 2] = [
            Box::new(Ransac::new(RansacParams::default()).expect("in range")),
            Box::new(SampleConsensus::new(msac).expect("in range")),
        ];
        for estimator in estimators {
            let found = estimator.estimate(views, Seed(1)).expect("a pose");
            assert_eq!(found.inliers, (1..60).collect::<Vec<_>>());
        }
    }

    /// The camera moves to the left, and points move to the right. Other points move to the left, each also down or up by as
    /// much as no other: they agree with no model, and lie in front of both cameras of the opposite motion.
    #[test]
    fn the_pose_is_the_one_that_inliers_choose() {
        let camera = Camera::pinhole(500.0, 500.0, 320.0, 240.0);
        let mut points = MatchedPoints::default();
        let mut rng = Seed(5).rng();
        for i in 0..50 {
            let [x, y] = [(); 2].map(|()| rng.uniform() - 0.5);
            let moved = 0.1 + 0.3 * rng.uniform();
            let seen = match i {
                0..20 => Point2::new(x + moved, y),
                _ => Point2::new(x - moved, y + 0.05 * (f64::from(i) - 34.5)),
            };
            points.push(camera.project(Point2::new(x, y)), camera.project(seen), 0.5);
        }
        let views = TwoViews {
            points: &points,
            camera_a: &camera,
            camera_b: &camera,
        };
        let estimator = SampleConsensus::new(presets::ransac_e_inliers()).expect("in range");
        let found = estimator.estimate(views, Seed(1)).expect("a pose");
        let right = (0..20).all(|i| found.inliers.contains(&i));
        assert!(right && found.inliers.len() < 25, "{:?}", found.inliers);
        let direction = found.b_from_a.direction;
        assert!(direction.x > 0.999, "{direction:?}");
        assert!(found.support < 25, "{}", found.support);
    }

    #[test]
    fn far_inliers_choose_the_pose_where_wrong_matches_are_near() {
        let camera = Camera::pinhole(500.0, 500.0, 320.0, 240.0);
        let mut points = MatchedPoints::default();
        let mut rng = Seed(6).rng();
        for _ in 0..30 {
            let [x, y] = [(); 2].map(|()| rng.uniform() - 0.5);
            // 100 to 1000 baselines away.
            let seen = Point2::new(x + 0.001 + 0.009 * rng.uniform(), y);
            points.push(camera.project(Point2::new(x, y)), camera.project(seen), 0.5);
        }
        let unlimited = presets::ransac_e_inliers();
        let near = SampleConsensusParams {
            max_depth: 50.0,
            ..unlimited
        };
        let estimates = |points: &MatchedPoints| {
            [unlimited, near].map(|params| {
                let views = TwoViews {
                    points,
                    camera_a: &camera,
                    camera_b: &camera,
                };
                let estimator = SampleConsensus::new(params).expect("in range");
                estimator.estimate(views, Seed(1))
            })
        };
        let is_right = |found: &PoseEstimate| found.b_from_a.direction.x > 0.999;
        let [unlimited, near] = estimates(&points);
        let unlimited = unlimited.expect("a pose");
        assert!(is_right(&unlimited));
        assert_eq!(unlimited.support, 30);
        // Nothing at all says which way the camera moved.
        assert_eq!(near, Err(NoModel::NOTHING_IN_FRONT));
        // Wrong matches near the cameras, for which the camera moved the other way.
        for y in [-0.4, 0.1, 0.3] {
            let seen = Point2::new(0.1 - 0.05, y);
            points.push(
                camera.project(Point2::new(0.1, y)),
                camera.project(seen),
                0.5,
            );
        }
        for found in estimates(&points) {
            let found = found.expect("a pose");
            assert!(is_right(&found), "{:?}", found.b_from_a.direction);
        }
    }

    #[test]
    fn a_model_that_was_not_found_is_told_from_one_that_nothing_is_in_front_of() {
        let said = [
            NoModel::none_found(5),
            NoModel::NOTHING_IN_FRONT,
            NoModel::NoSupport {
                found: 9,
                needed: 10,
            },
        ];
        let [none, behind, few] = said.map(|reason| reason.to_string());
        assert!(none.starts_with("no model found"), "{none}");
        assert!(behind.contains("in front of both cameras"), "{behind}");
        assert!(few.ends_with("9, needed 10"), "{few}");
    }
}
