//! `best`: our recommendation.
//!
//! | field | value | why |
//! | --- | --- | --- |
//! | `sampler` | PROSAC | the ratio test has ordered the matches; uniform samples need several times as many |
//! | `score` | even MSAC | matches that lie close together are no independent witnesses |
//! | `threshold_px` | 2 | tuned on the kitchen of 7-Scenes, 0.7 to 3 |
//! | `final_loss` | Cauchy | the same |
//! | `min_iterations` | 1000 | the same, 50 to 1000: an early model with many inliers need not be the best |
//! | `max_iterations` | 20,000 | hopeless pairs end after about 0.1 s |

use matchbench_vision::geometry::Loss;
use matchbench_vision::robust::{SampleConsensusParams, SamplerKind, ScoreKind};

use super::Preset;

/// Our recommendation: progressive samples, a score that crowds of matches do not dominate, local optimisation, robust refinement.
pub(super) const BEST: Preset = Preset {
    id: "best",
    summary: "our recommendation: progressive samples, a score that crowds of matches do not dominate, local optimisation, robust refinement",
    reference: "Chum, Matas, \"Matching with PROSAC - Progressive Sample Consensus\", CVPR 2005; Lebeda, Matas, Chum, \"Fixing the Locally Optimized RANSAC\", BMVC 2012",
    defaults: || SampleConsensusParams {
        score: ScoreKind::EvenMsac,
        sampler: SamplerKind::Prosac,
        threshold_px: 2.0,
        final_loss: Loss::Cauchy,
        min_iterations: 1000,
        max_iterations: 20_000,
        ..SampleConsensusParams::default()
    },
};
