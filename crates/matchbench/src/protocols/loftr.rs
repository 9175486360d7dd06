//! `loftr`: MegaDepth-1500 as in LoFTR.
//!
//! Sun, Shen, Wang, Bao, Zhou, "LoFTR: Detector-Free Local Feature Matching with Transformers", CVPR 2021.
//!
//! Images have 840 pixels along the longer side, and points are multiplied back to the original size. OpenCV's
//! `findEssentialMat` gets a threshold of 0.5 pixels of the original, divided by a mean focal length. The rest
//! is as in [`SUPERGLUE`](super::SUPERGLUE), whose program was copied.
//!
//! *Oddities that are reproduced here*: the mean focal length uses fx of the first camera and fy of the second,
//! each twice. Points are multiplied by the ratio of the sizes, which
//! moves all of them (see [`Centres::Scaled`](super::Centres::Scaled)).
//!
//! *Differs*: MegaDepth's K counts from the corner of the first pixel, and its program takes points from the centre.
//! Importers here move K, so the half pixel that all points are off there is not reproduced.

use serde_json::json;

use super::{Centres, EstimatorRule, Focal, Pixels, Protocol, SizeRule};

/// LoFTR's protocol for MegaDepth.
pub const LOFTR: Protocol = Protocol {
    id: "loftr",
    summary: "LoFTR on MegaDepth-1500",
    reference: "J. Sun, Z. Shen, Y. Wang, H. Bao, X. Zhou, \"LoFTR: Detector-Free Local Feature Matching with Transformers\", CVPR 2021",
    source: "zju3dv/LoFTR: src/utils/metrics.py, src/utils/dataset.py, src/datasets/megadepth.py",
    size: SizeRule::LongSide(840),
    estimator: EstimatorRule::Of {
        id: "ransac-e-inliers",
        params: || json!({"threshold_px": 0.5, "confidence": 0.99999}),
    },
    pixels: Pixels::Original,
    focal: Focal::FirstXSecondY,
    centres: Centres::Scaled,
    shuffles: 1,
    min_matches: 5,
    min_inliers: 0,
    min_support: 1,
    scores: &["exact_auc_5", "exact_auc_10", "exact_auc_20"],
    failure: f64::INFINITY,
    notes: &[
        "Its program cuts both sides to multiples of 8, enlarges smaller images and resamples without smoothing; here neither is done.",
        "MegaDepth's K counts from the corner of the first pixel and its points from the centre; here both count from the centre.",
        "Its ScanNet is 640x480, as SuperGlue's.",
    ],
};
