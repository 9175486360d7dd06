//! `lmeds-f`: least median of squares over seven-point samples.

use matchbench_vision::robust::presets;

use super::Preset;

pub(super) const LMEDS_F: Preset = Preset {
    id: "lmeds-f",
    summary: "fundamental matrix by least median of squares, made essential afterwards",
    reference: "Rousseeuw, \"Least Median of Squares Regression\", JASA 79, 1984; Hartley, Zisserman, \"Multiple View Geometry\", 2004, sec. 11.1.2",
    defaults: presets::lmeds_f,
};
