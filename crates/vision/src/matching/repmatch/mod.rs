//! RepMatch: CODE whose coherence functions are learned from all matches that one epipolar geometry explains,
//! those of repeated structure included.
//!
//! W.-Y. Lin, S. Liu, N. Jiang, M. N. Do, P. Tan, J. Lu: "RepMatch: Robust Feature Matching and Pose
//! for Reconstructing Modern Cities", European Conference on Computer Vision (ECCV) 2016.
//!
//! A repeated structure has two features that look alike, so its matches fail the ratio test and are no seeds
//! of [`Code`]. So nothing is learned where facades repeat. Epipolar geometry tells right matches from wrong
//! ones without looking at descriptors:
//!
//! 1. [`Code`] selects matches.
//! 2. Sample consensus finds the relative pose that the selected ones agree on.
//! 3. *All* matches near their epipolar lines, whether or not they passed a ratio test, are the
//!    training set, from which both functions of CODE are learned anew.
//! 4. All matches are decided by these functions (one of the two is enough) and by the epipolar line.
//! 5. Steps 2 to 4 are repeated with what was kept.
//!
//! | field | default | source |
//! | --- | --- | --- |
//! | `coherence` | those of CODE | the paper builds on it |
//! | `pose` | [`presets::best`] with a truncated loss | - |
//! | `rounds` | 2 | - |
//! | `likelihood` | 0.7 | CODE's second pass |
//! | `max_epipolar` | 1/400 | 2 pixels of 640x480 |
//!
//! *Choices the paper leaves open*: no program was published, so everything that the paper does not say is
//! ours: the number of rounds, the thresholds, and the sample consensus, whose score keeps one repeated
//! facade from outvoting the rest of the scene. Where the cameras are unknown or no pose is found, the
//! matches of CODE are kept.

use super::code::{Code, CodeParams, Coherence, Motions};
use super::correspondence::retain_masked;
use super::{Correspondence, Correspondences, Selector, View};
use crate::geometry::{
    Camera, Loss, MatchedPoints, PointPairs, essential_from_pose, squared_sampson_distances,
};
use crate::image::Size;
use crate::params::ParamError;
use crate::robust::{
    FinalRefinement, PoseEstimator, SampleConsensus, SampleConsensusParams, TwoViews, presets,
};
use crate::seed::Seed;

/// Parameters of [`RepMatch`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct RepMatchParams {
    /// Parameters of the functions and of the first selection.
    pub coherence: CodeParams,
    /// Number of times that the functions are learned again, from the matches that agree with the epipolar
    /// geometry; at most 10.
    pub rounds: usize,
    /// Least likelihood of a match.
    pub likelihood: f64,
    /// Parameters of the estimator that finds the pose of the kept matches.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "pose_over_default"))]
    #[cfg_attr(feature = "schema", schemars(with = "crate::robust::Settings"))]
    pub pose: SampleConsensusParams,
    /// Largest Sampson distance from the epipolar lines, relative to the diagonals of the images;
    /// positive.
    pub max_epipolar: f64,
}

impl Default for RepMatchParams {
    fn default() -> Self {
        Self {
            coherence: CodeParams::default(),
            rounds: 2,
            likelihood: 0.7,
            pose: default_pose(),
            max_epipolar: 1.0 / 400.0,
        }
    }
}

/// [`presets::best`], but with a truncated loss in its refinement, since a threshold also decides whether a
/// match is near its epipolar line.
fn default_pose() -> SampleConsensusParams {
    SampleConsensusParams {
        final_refinement: Some(FinalRefinement {
            loss: Loss::Truncated,
            steps: 25,
        }),
        ..presets::best()
    }
}

/// Parameters that are left out keep the default of this selector, not that of the part.
#[cfg(feature = "serde")]
fn pose_over_default<'de, D>(deserializer: D) -> Result<SampleConsensusParams, D::Error>
where
    D: serde::Deserializer<'de>,
{
    let changes = <crate::robust::Settings as serde::Deserialize>::deserialize(deserializer)?;
    default_pose()
        .with(changes)
        .map_err(serde::de::Error::custom)
}

/// Selection by coherent motion along one epipolar geometry.
#[derive(Clone, Copy, Debug)]
pub struct RepMatch {
    params: RepMatchParams,
    code: Code,
    pose: SampleConsensus,
}

impl RepMatch {
    /// A selector with these parameters.
    ///
    /// # Errors
    /// If one of them is out of its range.
    pub fn new(params: RepMatchParams) -> Result<Self, ParamError> {
        let (rounds, max_epipolar) = (params.rounds, params.max_epipolar);
        ParamError::unless(rounds <= 10, "rounds", rounds, "at most 10")?;
        ParamError::unless(
            max_epipolar > 0.0 && max_epipolar.is_finite(),
            "max_epipolar",
            max_epipolar,
            "positive and finite",
        )?;
        ParamError::unless(
            params.likelihood.is_finite(),
            "likelihood",
            params.likelihood,
            "finite",
        )?;
        let code = Code::new(params.coherence)?;
        let pose = SampleConsensus::new(params.pose)?;
        Ok(Self { params, code, pose })
    }

    /// For each match, whether it is kept.
    fn decide(
        &self,
        a: View<'_>,
        b: View<'_>,
        matches: &[Correspondence],
        seed: Seed,
    ) -> Vec<bool> {
        let coherence = &self.params.coherence;
        let motions = Motions::new(a.features, b.features, matches, coherence);
        let mut kept = self.code.decide(&motions, matches, seed.child("code"));
        let (Some(camera_a), Some(camera_b)) = (a.camera, b.camera) else {
            return kept;
        };
        let points =
            MatchedPoints::of_keypoints(matches, &a.features.keypoints, &b.features.keypoints);
        let scene = Scene {
            pairs: points.at_depth_1(camera_a, camera_b),
            points,
            cameras: [camera_a, camera_b],
            diagonal: 0.5 * (diagonal(a, camera_a) + diagonal(b, camera_b)),
        };
        for round in 0..self.params.rounds {
            let seed = seed.number(round as u64);
            let Some(near) = self.near_epipolar_lines(&scene, &kept, seed.child("pose")) else {
                break;
            };
            let candidates = (0..matches.len()).filter(|&i| near[i]).collect();
            let rng = &mut seed.child("coherence").rng();
            let Some(learned) = Coherence::learn(&motions, candidates, coherence, rng) else {
                break;
            };
            let (least, transfer) = (self.params.likelihood, coherence.squared_transfer);
            for (i, kept) in kept.iter_mut().enumerate() {
                *kept = near[i] && learned.accepts(&motions, i, least, transfer);
            }
        }
        kept
    }

    /// For each match, whether it is near its epipolar lines under the pose with which the kept matches agree;
    /// `None` if they determine no pose.
    fn near_epipolar_lines(
        &self,
        scene: &Scene<'_>,
        kept: &[bool],
        seed: Seed,
    ) -> Option<Vec<bool>> {
        let views = TwoViews {
            points: &scene.points.masked(kept),
            camera_a: scene.cameras[0],
            camera_b: scene.cameras[1],
        };
        let found = self.pose.estimate(views, seed).ok()?;
        let essential = essential_from_pose(&found.b_from_a);
        let pairs = &scene.pairs;
        let mut squared = vec![0.0; pairs.len()];
        squared_sampson_distances(&essential, pairs, 0..pairs.len(), &mut squared);
        let limit = self.params.max_epipolar * scene.diagonal;
        Some(squared.iter().map(|&d| d <= limit * limit).collect())
    }
}

impl Selector for RepMatch {
    fn select(&self, a: View<'_>, b: View<'_>, matches: &mut Correspondences, seed: Seed) {
        let kept = self.decide(a, b, matches, seed);
        retain_masked(matches, &kept);
    }
}

/// All matches, with the cameras of their images.
struct Scene<'a> {
    points: MatchedPoints,
    /// The same at depth 1.
    pairs: PointPairs,
    cameras: [&'a Camera; 2],
    /// Mean diagonal of the images at depth 1.
    diagonal: f64,
}

/// Diagonal of an image at depth 1.
fn diagonal(view: View<'_>, camera: &Camera) -> f64 {
    let Size { width, height } = view.features.size;
    let (width, height) = (width as f64, height as f64);
    (width * width + height * height).sqrt() / camera.mean_focal()
}

#[cfg(test)]
mod tests;
