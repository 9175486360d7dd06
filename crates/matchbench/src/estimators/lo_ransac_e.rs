//! `lo-ransac-e`: locally optimised sample consensus.

use matchbench_vision::robust::presets;

use super::Preset;

/// Essential matrix by locally optimised five-point sample consensus with the MSAC score.
pub(super) const LO_RANSAC_E: Preset = Preset {
    id: "lo-ransac-e",
    summary: "essential matrix by locally optimised five-point sample consensus with the MSAC score",
    reference: "O. Chum, J. Matas, J. Kittler, \"Locally Optimized RANSAC\", DAGM 2003; K. Lebeda, J. Matas, O. Chum, \"Fixing the Locally Optimized RANSAC\", BMVC 2012",
    defaults: presets::lo_ransac_e,
};
