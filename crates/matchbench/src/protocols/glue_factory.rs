//! `glue-factory`: MegaDepth-1500 with PoseLib, as in glue-factory.
//!
//! Lindenberger, Sarlin, Pollefeys, "LightGlue: Local Feature Matching at Light Speed", ICCV 2023; Larsson et al.,
//! "PoseLib - Minimal Solvers for Camera Pose Estimation", 2020.
//!
//! Images have 1600 pixels along the longer side. The pose comes from PoseLib's locally optimised RANSAC, with
//! a threshold of 1 pixel of these images, 1000 to 100,000 iterations and confidence 0.9999. PoseLib multiplies
//! the threshold by the mean of the inverse focal lengths. We use our `lo-ransac-e` with these settings
//! instead: the same kind of estimator, but not the same program.

use serde_json::json;

use super::{Centres, EstimatorRule, Focal, Pixels, Protocol, SizeRule};

/// The protocol of glue-factory for MegaDepth.
pub const GLUE_FACTORY: Protocol = Protocol {
    id: "glue-factory",
    summary: "glue-factory on MegaDepth-1500, with an estimator of PoseLib's kind",
    reference: "P. Lindenberger, P.-E. Sarlin, M. Pollefeys, \"LightGlue: Local Feature Matching at Light Speed\", ICCV 2023",
    source: "cvg/glue-factory: gluefactory/eval/megadepth1500.py, eval/utils.py, robust_estimators/relative_pose/poselib.py",
    size: SizeRule::LongSide(1600),
    estimator: EstimatorRule::Of {
        id: "lo-ransac-e",
        params: || {
            json!({
                "threshold_px": 1.0, "confidence": 0.9999, "min_iterations": 1000, "max_iterations": 100_000
            })
        },
    },
    pixels: Pixels::Resized,
    focal: Focal::Harmonic,
    centres: Centres::Kept,
    shuffles: 1,
    min_matches: 5,
    min_inliers: 0,
    min_support: 1,
    scores: &["exact_auc_5", "exact_auc_10", "exact_auc_20"],
    failure: f64::INFINITY,
    notes: &[
        "Unless told otherwise its program tries six thresholds from 0.5 to 3 pixels on the scored pairs and reports the best; here it is 1.",
        "Its mAA is the mean of the three AUCs, and not that of the Image Matching Challenge.",
    ],
};
