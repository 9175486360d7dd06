//! `ransac-h`: the baseline for homographies, with samples of four matches.

use matchbench_vision::robust::{HomographyParams, presets};

use super::Preset;

/// Four-point RANSAC as in OpenCV's `findHomography`.
pub(super) const RANSAC_H: Preset<HomographyParams> = Preset {
    id: "ransac-h",
    summary: "homography by four-point RANSAC at 3 pixels, refined over its inliers: the baseline",
    reference: "Fischler, Bolles, \"Random Sample Consensus\", CACM 24(6), 1981; Hartley, Zisserman, \"Multiple View Geometry in Computer Vision\", 2nd edition, 2004, alg. 4.6",
    defaults: presets::ransac_h,
};
