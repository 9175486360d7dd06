//! `lmeds-f`: least median of squares over seven-point samples.

use matchbench_vision::robust::presets;

use super::Preset;

pub(super) const LMEDS_F: Preset = Preset {
    id: "lmeds-f",
    summary: "fundamental matrix by least median of squares, made essential afterwards",
    reference: "P. J. Rousseeuw, \"Least Median of Squares Regression\", Journal of the American Statistical Association 79(388), 1984; R. Hartley, A. Zisserman, \"Multiple View Geometry in Computer Vision\", Cambridge University Press, 2004, sec. 11.1.2",
    defaults: presets::lmeds_f,
};
