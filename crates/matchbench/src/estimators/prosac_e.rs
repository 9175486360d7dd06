//! `prosac-e`: the reference protocol with progressive sampling, at its own threshold.

use matchbench_vision::robust::{SampleConsensusParams, SamplerKind, ScoreKind};

use super::Preset;

/// Essential matrix by five-point sample consensus, the least ambiguous matches first.
pub(super) const PROSAC_E: Preset = Preset {
    id: "prosac-e",
    summary: "essential matrix by five-point sample consensus, the least ambiguous matches first",
    reference: "Chum, Matas, \"Matching with PROSAC - Progressive Sample Consensus\", CVPR 2005",
    defaults: || SampleConsensusParams {
        sampler: SamplerKind::Prosac,
        // Tuned on the kitchen of 7-Scenes, 0.5 to 3.
        threshold_px: 1.5,
        score: ScoreKind::InlierCount,
        min_iterations: 0,
        local_steps: 0,
        final_steps: 0,
        cheirality: false,
        sprt: false,
        ..SampleConsensusParams::default()
    },
};
