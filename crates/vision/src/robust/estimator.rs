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
    /// There is no model, or too few matches agree with the best one, or lie in front of both cameras of the best
    /// pose.
    NoSupport {
        /// Number of these matches; 0 if there is no model, since models with fewer inliers than a sample has
        /// matches are not kept.
        found: usize,
        /// Number of required matches.
        needed: usize,
    },
}

impl fmt::Display for NoModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooFewMatches { found, needed } => {
                write!(f, "too few matches: {found}, needed {needed}")
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
    fn estimate_until(
        &self,
        points: &MatchedPoints,
        seed: Seed,
        stop: &dyn Fn(usize) -> bool,
    ) -> Result<HomographyEstimate, NoModel>;
}
