//! `prosac-e`: the reference protocol with progressive sampling, at its own threshold.

use matchbench_vision::robust::presets;

use super::Preset;

/// Essential matrix by five-point sample consensus that samples the least ambiguous matches first.
pub(super) const PROSAC_E: Preset = Preset {
    id: "prosac-e",
    summary: "essential matrix by five-point sample consensus, the least ambiguous matches first",
    reference: "O. Chum, J. Matas, \"Matching with PROSAC - Progressive Sample Consensus\", CVPR 2005",
    defaults: presets::prosac_e,
};
