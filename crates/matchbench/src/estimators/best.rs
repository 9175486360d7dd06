//! `best`: our recommendation if nothing but the coordinates of matches is used.

use matchbench_vision::robust::presets;

use super::Preset;

/// Our recommendation: progressive sampling, a score that dense groups of matches do not dominate, local
/// optimisation, robust refinement.
pub(super) const BEST: Preset = Preset {
    id: "best",
    summary: "our recommendation for points alone: progressive samples, a score that crowds of matches do not dominate, local optimisation, robust refinement",
    reference: "O. Chum, J. Matas, \"Matching with PROSAC - Progressive Sample Consensus\", CVPR 2005; K. Lebeda, J. Matas, O. Chum, \"Fixing the Locally Optimized RANSAC\", BMVC 2012",
    defaults: presets::best,
};
