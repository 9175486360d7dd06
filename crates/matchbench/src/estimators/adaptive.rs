//! `adaptive`: has no threshold to choose, and weights matches by how their keypoints are turned.

use matchbench_vision::robust::presets;

use super::Preset;

/// As `best`, but the noise of each pair is estimated, and models are scored over several thresholds around it.
/// Matches whose keypoints are turned by another angle than most are trusted less.
pub(super) const ADAPTIVE: Preset = Preset {
    id: "adaptive",
    summary: "our recommendation where keypoints have an orientation, and no threshold to choose: as best, but the noise of each pair is estimated, models are scored over several thresholds about it, and matches whose keypoints turned unlike most count less",
    reference: "D. Barath, J. Noskova, J. Matas, \"MAGSAC: Marginalizing Sample Consensus\", CVPR 2019; P. H. S. Torr, A. Zisserman, \"MLESAC: A New Robust Estimator with Application to Estimating Image Geometry\", Computer Vision and Image Understanding 78(1), 2000; H. Jégou, M. Douze, C. Schmid, \"Hamming Embedding and Weak Geometric Consistency for Large Scale Image Search\", ECCV 2008",
    defaults: presets::adaptive,
};
