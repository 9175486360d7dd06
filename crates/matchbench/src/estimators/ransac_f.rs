//! `ransac-f`: seven-point RANSAC without calibration, which is used only afterwards.

use matchbench_vision::robust::presets;

use super::Preset;

pub(super) const RANSAC_F: Preset = Preset {
    id: "ransac-f",
    summary: "fundamental matrix by seven-point RANSAC, made essential afterwards",
    reference: "M. A. Fischler, R. C. Bolles, \"Random Sample Consensus: A Paradigm for Model Fitting with Applications to Image Analysis and Automated Cartography\", Communications of the ACM 24(6), 1981; R. Hartley, A. Zisserman, \"Multiple View Geometry in Computer Vision\", Cambridge University Press, 2004, sec. 11.1.2",
    defaults: presets::ransac_f,
};
