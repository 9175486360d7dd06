//! `adaptive`: no threshold to choose.

use matchbench_vision::robust::presets;

use super::Preset;

/// As `best`, but the noise of each pair is estimated, and models are scored over several thresholds about it.
pub(super) const ADAPTIVE: Preset = Preset {
    id: "adaptive",
    summary: "no threshold to choose: as best, but the noise of each pair is estimated, and models are scored over several thresholds about it",
    reference: "Barath, Noskova, Matas, \"MAGSAC: Marginalizing Sample Consensus\", CVPR 2019; Torr, Zisserman, \"MLESAC\", CVIU 78(1), 2000",
    defaults: presets::adaptive,
};
