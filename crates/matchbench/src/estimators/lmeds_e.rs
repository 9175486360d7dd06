//! `lmeds-e`: least median of squares over five-point samples.

use matchbench_vision::robust::{SampleConsensusParams, ScoreKind};

use super::Preset;

pub(super) const LMEDS_E: Preset = Preset {
    id: "lmeds-e",
    summary: "essential matrix by least median of squares: no threshold, at most half wrong matches",
    reference: "Rousseeuw, \"Least Median of Squares Regression\", JASA 79, 1984",
    defaults: || SampleConsensusParams {
        score: ScoreKind::Median,
        // With half of the matches wrong, 218 samples find a good one with this confidence.
        confidence: 0.999,
        min_iterations: 218,
        max_iterations: 218,
        local_steps: 0,
        final_steps: 0,
        cheirality: false,
        sprt: false,
        ..SampleConsensusParams::default()
    },
};
