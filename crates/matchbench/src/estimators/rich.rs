//! `rich`: for tens of thousands of matches; our substitute for the unpublished estimator of RepMatch, which
//! the paper uses with CODE, RepMatch and GMS.
//!
//! | field | value | why |
//! | --- | --- | --- |
//! | `sampler` | spatially even | most of very many matches lie on few surfaces |
//! | `score` | even MSAC | the same: crowds of matches on one surface do not dominate |
//! | `threshold_px` | 3 | tuned on the kitchen of 7-Scenes (with GMS and CODE), 1.5 to 4 |
//! | `min_iterations` | 1000 | the same, 50 to 1000 |
//! | `final_loss` | truncated | the same; Cauchy's is no better |
//! | `max_iterations` | 5000 | bounds the time |

use matchbench_vision::robust::{SampleConsensusParams, SamplerKind, ScoreKind};

use super::Preset;

/// Essential matrix from very many matches: spatially even samples and score, local optimisation, refinement over all inliers.
pub(super) const RICH: Preset = Preset {
    id: "rich",
    summary: "essential matrix from very many matches: spatially even samples and score, local optimisation, refinement over all inliers",
    reference: "our substitute for the unpublished estimator of Lin et al., \"RepMatch\", ECCV 2016; Lebeda, Matas, Chum, \"Fixing the Locally Optimized RANSAC\", BMVC 2012",
    defaults: || SampleConsensusParams {
        score: ScoreKind::EvenMsac,
        sampler: SamplerKind::Spread,
        threshold_px: 3.0,
        min_iterations: 1000,
        max_iterations: 5000,
        ..SampleConsensusParams::default()
    },
};
