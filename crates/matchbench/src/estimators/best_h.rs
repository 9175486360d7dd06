//! `best-h`: our recommendation for homographies.

use matchbench_vision::robust::{HomographyParams, presets};

use super::Preset;

/// Our recommendation for homographies: as `best`, with samples of four matches.
pub(super) const BEST_H: Preset<HomographyParams> = Preset {
    id: "best-h",
    summary: "homography, our recommendation: progressive samples, a score that crowds of matches do not dominate, local optimisation, robust refinement",
    reference: "O. Chum, J. Matas, \"Matching with PROSAC - Progressive Sample Consensus\", CVPR 2005; K. Lebeda, J. Matas, O. Chum, \"Fixing the Locally Optimized RANSAC\", BMVC 2012",
    defaults: presets::best_h,
};
