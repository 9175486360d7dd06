//! `roma`: MegaDepth-1500 as in DKM and RoMa.
//!
//! Edstedt, Sun, Bökman, Wadenbäck, Felsberg, "RoMa: Robust Dense Feature Matching", CVPR 2024.
//!
//! Points and K are scaled to images of 1200 pixels along the longer side. OpenCV's `findEssentialMat` (RANSAC,
//! 0.99999) gets a threshold of 0.5 of these pixels, divided by the mean of all four focal lengths. Each pair
//! is estimated five times with shuffled matches, and the five errors are pooled: 7500 errors of 1500 pairs.
//! The error of a failure is 90 degrees.

use serde_json::json;

use super::{Centres, EstimatorRule, Focal, Pixels, Protocol, SizeRule};

/// The protocol of DKM and RoMa for MegaDepth.
pub const ROMA: Protocol = Protocol {
    id: "roma",
    summary: "DKM and RoMa on MegaDepth-1500",
    reference: "J. Edstedt, Q. Sun, G. Bökman, M. Wadenbäck, M. Felsberg, \"RoMa: Robust Dense Feature Matching\", CVPR 2024",
    source: "Parskatt/RoMa: benchmarks/megadepth_pose_estimation_benchmark.py, utils/utils.py",
    size: SizeRule::LongSide(1200),
    estimator: EstimatorRule::Of {
        id: "ransac-e-inliers",
        params: || json!({"threshold_px": 0.5, "confidence": 0.99999}),
    },
    pixels: Pixels::Resized,
    focal: Focal::Mean,
    centres: Centres::Kept,
    shuffles: 5,
    min_matches: 5,
    min_inliers: 0,
    min_support: 1,
    scores: &["exact_auc_5", "exact_auc_10", "exact_auc_20"],
    failure: 90.0,
    notes: &[
        "Its matcher looks at images of its own size and samples 5000 matches; here all matches of a matcher are used.",
        "Its ScanNet scales to 480 pixels along the shorter side.",
    ],
};
