//! `adaptive`: has no threshold to choose, and uses how keypoints turned and grew.

use matchbench_vision::robust::presets;

use super::Preset;

/// As `best`, but the noise of each pair is estimated, and models are scored over several thresholds around it.
/// Matches whose keypoints are turned by another angle than most are trusted less, and of several poses the one is
/// chosen that predicts how keypoints turned and grew. A hopeless pair is given up early.
pub(super) const ADAPTIVE: Preset = Preset {
    id: "adaptive",
    summary: "our recommendation where keypoints have an orientation, and no threshold to choose: as best, but the noise of each pair is estimated, models are scored over several thresholds about it, matches whose keypoints turned unlike most count less, of several poses the one is chosen that predicts how keypoints turned and grew, and a hopeless pair is given up early",
    reference: "D. Barath, J. Noskova, J. Matas, \"MAGSAC: Marginalizing Sample Consensus\", CVPR 2019; P. H. S. Torr, A. Zisserman, \"MLESAC: A New Robust Estimator with Application to Estimating Image Geometry\", Computer Vision and Image Understanding 78(1), 2000; H. Jégou, M. Douze, C. Schmid, \"Hamming Embedding and Weak Geometric Consistency for Large Scale Image Search\", ECCV 2008",
    defaults: presets::adaptive,
};
