//! `lmeds-f`: least median of squares over seven-point samples.

use matchbench_vision::robust::{GeometryKind, SampleConsensusParams, ScoreKind};

use super::Preset;

pub(super) const LMEDS_F: Preset = Preset {
    id: "lmeds-f",
    summary: "fundamental matrix by least median of squares, made essential afterwards",
    reference: "Rousseeuw, \"Least Median of Squares Regression\", JASA 79, 1984; Hartley, Zisserman, \"Multiple View Geometry\", 2004, sec. 11.1.2",
    defaults: || SampleConsensusParams {
        geometry: GeometryKind::Fundamental,
        score: ScoreKind::Median,
        // With half of the matches wrong, 881 samples find a good one with this confidence.
        confidence: 0.999,
        min_iterations: 881,
        max_iterations: 881,
        local_steps: 0,
        final_steps: 0,
        cheirality: false,
        degensac: false,
        sprt: false,
        ..SampleConsensusParams::default()
    },
};
