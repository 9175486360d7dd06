//! `ransac-e-inliers`: the OpenCV calls that the scores of SuperGlue, LoFTR and RoMa are based on.

use matchbench_vision::robust::presets;

use super::Preset;

/// Five-point RANSAC; only the inliers choose among the four poses.
pub(super) const RANSAC_E_INLIERS: Preset = Preset {
    id: "ransac-e-inliers",
    summary: "ransac-e as SuperGlue and learned matchers since call it: the inliers alone choose the pose, at any depth",
    reference: "D. Nistér, \"An Efficient Solution to the Five-Point Relative Pose Problem\", IEEE Transactions on Pattern Analysis and Machine Intelligence 26(6), 2004; \
                M. A. Fischler, R. C. Bolles, \"Random Sample Consensus: A Paradigm for Model Fitting with Applications to Image Analysis and Automated Cartography\", Communications of the ACM 24(6), 1981",
    defaults: presets::ransac_e_inliers,
};
