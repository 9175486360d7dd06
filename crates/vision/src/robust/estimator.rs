//! The front door: from matched points and two cameras to a relative pose, or to none.

use std::fmt;

use nalgebra::Point2;

use crate::geometry::{Camera, PointPairs, RelativePose};
use crate::seed::Seed;

/// Matched points of two images: `a[i]` and `b[i]` are taken to show the same point.
#[derive(Clone, Copy, Debug)]
pub struct TwoViews<'a> {
    /// Positions in image `a`, in pixels.
    pub a: &'a [Point2<f64>],
    /// Positions in image `b`, in pixels.
    pub b: &'a [Point2<f64>],
    /// The camera that took `a`.
    pub camera_a: &'a Camera,
    /// The camera that took `b`.
    pub camera_b: &'a Camera,
    /// For each match, how ambiguous it is (nearest over second nearest distance, 0 = certain);
    /// samplers that prefer good matches sort by it.
    pub ambiguity: &'a [f32],
}

impl TwoViews<'_> {
    /// The matches as points at depth 1: calibration and lens distortion of each camera undone.
    ///
    /// # Panics
    /// If there are not as many points in `b` as in `a`.
    pub fn at_depth_1(&self) -> PointPairs {
        assert_eq!(self.a.len(), self.b.len(), "each match has two points");
        (self.a.iter().zip(self.b))
            .map(|(&a, &b)| (self.camera_a.normalize(a), self.camera_b.normalize(b)))
            .collect()
    }
}

/// What an estimator found.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseEstimate {
    /// The relative pose.
    pub b_from_a: RelativePose,
    /// Indices of the matches that agree with the model in the consensus stage, ascending.
    pub inliers: Vec<u32>,
    /// Number of matches, out of all that were given, that lie in front of both cameras; this is
    /// the count of correspondences that the paper reports (its AP bars).
    pub support: usize,
    /// Number of samples that were drawn.
    pub iterations: usize,
}

/// Why there is no pose: an outcome, not an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(tag = "kind", rename_all = "kebab-case"))]
pub enum NoPose {
    /// Not enough matches to begin with.
    TooFewMatches {
        /// Matches that were given.
        found: usize,
        /// Matches that are needed.
        needed: usize,
    },
    /// No model, or none that enough matches agree with.
    NoSupport {
        /// Matches that support the best pose.
        found: usize,
        /// Matches that are needed.
        needed: usize,
    },
}

impl fmt::Display for NoPose {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooFewMatches { found, needed } => {
                write!(f, "too few matches: {found}, needed {needed}")
            }
            Self::NoSupport { found, needed } => {
                write!(
                    f,
                    "too few matches support the pose: {found}, needed {needed}"
                )
            }
        }
    }
}

/// Estimates the relative pose of two cameras.
pub trait PoseEstimator: Send + Sync {
    /// The pose of `b` relative to `a`; the same seed gives the same bits.
    ///
    /// # Errors
    /// [`NoPose`] where the matches determine none.
    fn estimate(&self, views: TwoViews<'_>, seed: Seed) -> Result<PoseEstimate, NoPose>;

    /// As [`PoseEstimator::estimate`], but drawing samples only until `stop` says so, which is told
    /// how many were drawn. For comparisons at equal time: the caller owns the clock.
    ///
    /// # Errors
    /// [`NoPose`] where the matches determine none, or the time was too short to find one.
    fn estimate_until(
        &self,
        views: TwoViews<'_>,
        seed: Seed,
        stop: &dyn Fn(usize) -> bool,
    ) -> Result<PoseEstimate, NoPose>;
}
