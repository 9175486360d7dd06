//! `best`: our recommendation.

use matchbench_vision::robust::{SampleConsensusParams, SamplerKind};

use super::Preset;

/// Our recommendation: progressive samples, local optimisation, final refinement.
pub(super) const BEST: Preset = Preset {
    id: "best",
    summary: "our recommendation: progressive samples, local optimisation, final refinement",
    reference: "Chum, Matas, \"Matching with PROSAC - Progressive Sample Consensus\", CVPR 2005; Lebeda, Matas, Chum, \"Fixing the Locally Optimized RANSAC\", BMVC 2012",
    defaults: || SampleConsensusParams {
        sampler: SamplerKind::Prosac,
        ..SampleConsensusParams::default()
    },
};
