//! `ransac-f`: seven-point RANSAC without calibration, which is used only afterwards.

use matchbench_vision::robust::presets;

use super::Preset;

pub(super) const RANSAC_F: Preset = Preset {
    id: "ransac-f",
    summary: "fundamental matrix by seven-point RANSAC, made essential afterwards",
    reference: "Fischler, Bolles, \"Random Sample Consensus\", CACM 24(6), 1981; Hartley, Zisserman, \"Multiple View Geometry\", 2004, sec. 11.1.2",
    defaults: presets::ransac_f,
};
