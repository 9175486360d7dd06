//! `lmeds-e`: least median of squares over five-point samples.

use matchbench_vision::robust::presets;

use super::Preset;

pub(super) const LMEDS_E: Preset = Preset {
    id: "lmeds-e",
    summary: "essential matrix by least median of squares: no threshold, at most half wrong matches",
    reference: "P. J. Rousseeuw, \"Least Median of Squares Regression\", Journal of the American Statistical Association 79(388), 1984",
    defaults: presets::lmeds_e,
};
