//! `usac-f`: the configuration of USAC that the paper's authors used. It has PROSAC, seven-point samples, local
//! optimisation, USAC's sequential probability ratio test and its degeneracy check, a threshold of 1.5 pixels
//! and confidence 0.99.

use matchbench_vision::robust::presets;

use super::Preset;

pub(super) const USAC_F: Preset = Preset {
    id: "usac-f",
    summary: "fundamental matrix by PROSAC with local optimisation, 1.5 pixels",
    reference: "R. Raguram, O. Chum, M. Pollefeys, J. Matas, J.-M. Frahm, \"USAC: A Universal Framework for Random Sample Consensus\", IEEE Transactions on Pattern Analysis and Machine Intelligence 35(8), 2013",
    defaults: presets::usac_f,
};
