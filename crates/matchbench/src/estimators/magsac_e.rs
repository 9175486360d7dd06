//! `magsac-e`: scores models over all noise levels up to a largest one.

use matchbench_vision::robust::presets;

use super::Preset;

pub(super) const MAGSAC_E: Preset = Preset {
    id: "magsac-e",
    summary: "essential matrix by MAGSAC++: no exact threshold, local optimisation",
    reference: "D. Barath, J. Noskova, M. Ivashechkin, J. Matas, \"MAGSAC++, a Fast, Reliable and Accurate Robust Estimator\", CVPR 2020",
    defaults: presets::magsac_e,
};
