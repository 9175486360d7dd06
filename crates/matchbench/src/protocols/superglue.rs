//! `superglue`: ScanNet-1500 as in SuperGlue.
//!
//! Sarlin, DeTone, Malisiewicz, Rabinovich, "SuperGlue: Learning Feature Matching with Graph Neural Networks", CVPR 2020.
//!
//! Images become 640x480 whatever their aspect ratio, and K is divided by the ratios. OpenCV's
//! `findEssentialMat` (RANSAC, 0.99999) gets a threshold of 1 pixel of these images, divided by a mean focal
//! length. `recoverPose` gets the inliers alone, with depths up to 1e9. Errors are `max(R, min(t, 180 - t))`;
//! the AUC is exact at 5, 10 and 20 degrees.
//!
//! *Oddities that are reproduced here*: the "mean focal length" uses fx of the first camera and fy of the
//! second, each twice. Coordinates and K are multiplied by the ratio of the sizes, which
//! moves all of them (see [`Centres::Scaled`](super::Centres::Scaled)).

use serde_json::json;

use super::{Centres, EstimatorRule, Focal, Pixels, Protocol, SizeRule};

/// SuperGlue's protocol for ScanNet.
pub const SUPERGLUE: Protocol = Protocol {
    id: "superglue",
    summary: "SuperGlue on ScanNet-1500",
    reference: "P.-E. Sarlin, D. DeTone, T. Malisiewicz, A. Rabinovich, \"SuperGlue: Learning Feature Matching with Graph Neural Networks\", CVPR 2020",
    source: "magicleap/SuperGluePretrainedNetwork: match_pairs.py, models/utils.py",
    size: SizeRule::Exactly(640, 480),
    estimator: EstimatorRule::Of {
        id: "ransac-e-inliers",
        params: || json!({"threshold_px": 1.0, "confidence": 0.99999}),
    },
    pixels: Pixels::Resized,
    focal: Focal::FirstXSecondY,
    centres: Centres::Scaled,
    shuffles: 1,
    min_matches: 5,
    min_inliers: 0,
    min_support: 1,
    scores: &["exact_auc_5", "exact_auc_10", "exact_auc_20"],
    failure: f64::INFINITY,
    notes: &[
        "Images are resampled bilinearly without smoothing, as OpenCV's resize does unless told otherwise.",
        "Its program resizes an image before it turns it, so one that a list turns by a quarter becomes 480x640; here it becomes 640x480.",
    ],
};
