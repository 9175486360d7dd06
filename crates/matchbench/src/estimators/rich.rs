//! `rich`: for tens of thousands of matches; our substitute for the unpublished estimator of RepMatch, which
//! the paper uses with CODE, RepMatch and GMS.

use matchbench_vision::robust::presets;

use super::Preset;

/// Essential matrix from very many matches: spatially uniform samples and score, local optimisation, refinement
/// over all inliers.
pub(super) const RICH: Preset = Preset {
    id: "rich",
    summary: "essential matrix from very many matches: spatially even samples and score, local optimisation, refinement over all inliers",
    reference: "our substitute for the unpublished estimator of: W.-Y. Lin, S. Liu, N. Jiang, M. N. Do, P. Tan, J. Lu, \"RepMatch: Robust Feature Matching and Pose for Reconstructing Modern Cities\", ECCV 2016; K. Lebeda, J. Matas, O. Chum, \"Fixing the Locally Optimized RANSAC\", BMVC 2012",
    defaults: presets::rich,
};
