//! `ransac-f`: seven-point RANSAC for a fundamental matrix. Lens and calibration are undone before, so the threshold is
//! one of pixels of the mean focal length; that the matrix is essential is used only afterwards.

use matchbench_vision::robust::presets;

use super::Preset;

pub(super) const RANSAC_F: Preset = Preset {
    id: "ransac-f",
    summary: "fundamental matrix by seven-point RANSAC, made essential afterwards",
    reference: "M. A. Fischler, R. C. Bolles, \"Random Sample Consensus: A Paradigm for Model Fitting with Applications to Image Analysis and Automated Cartography\", Communications of the ACM 24(6), 1981; R. Hartley, A. Zisserman, \"Multiple View Geometry in Computer Vision\", Cambridge University Press, 2004, sec. 11.1.2",
    defaults: presets::ransac_f,
};
