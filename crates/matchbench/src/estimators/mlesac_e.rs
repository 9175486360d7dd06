//! `mlesac-e`: the essential matrix with the highest likelihood.

use matchbench_vision::robust::presets;

use super::Preset;

pub(super) const MLESAC_E: Preset = Preset {
    id: "mlesac-e",
    summary: "essential matrix by maximum likelihood over five-point samples",
    reference: "P. H. S. Torr, A. Zisserman, \"MLESAC: A New Robust Estimator with Application to Estimating Image Geometry\", Computer Vision and Image Understanding 78(1), 2000",
    defaults: presets::mlesac_e,
};
