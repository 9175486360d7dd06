//! `ransac-h`: the baseline for homographies, with samples of four matches.

use matchbench_vision::robust::{HomographyParams, presets};

use super::Preset;

/// Four-point RANSAC as in OpenCV's `findHomography`.
pub(super) const RANSAC_H: Preset<HomographyParams> = Preset {
    id: "ransac-h",
    summary: "homography by four-point RANSAC at 3 pixels, refined over its inliers: the baseline",
    reference: "M. A. Fischler, R. C. Bolles, \"Random Sample Consensus: A Paradigm for Model Fitting with Applications to Image Analysis and Automated Cartography\", Communications of the ACM 24(6), 1981; R. Hartley, A. Zisserman, \"Multiple View Geometry in Computer Vision\", Cambridge University Press, 2004, alg. 4.6",
    defaults: presets::ransac_h,
};
