//! `zeb`: the zero-shot evaluation benchmark of GIM.
//!
//! Shen, Cai, Yin, Müller, Li, Wang, Chen, Wang, "GIM: Learning Generalizable Image Matcher From Internet Videos", ICLR 2024.
//!
//! There are twelve sets of pairs. The score is the mean of the exact AUC at 5 degrees over the sets. OpenCV's
//! `findEssentialMat` (RANSAC, 0.99999) gets a threshold of 0.5 pixels of the original images. The program is
//! LoFTR's, with fx of the first camera and fy of the second, each twice. The error of a failure is 180
//! degrees.

use serde_json::json;

use super::{Centres, EstimatorRule, Focal, Pixels, Protocol, SizeRule};

/// GIM's zero-shot evaluation benchmark.
pub const ZEB: Protocol = Protocol {
    id: "zeb",
    summary: "the zero-shot evaluation benchmark of GIM; its score is the mean over its twelve sets",
    reference: "X. Shen, Z. Cai, W. Yin, M. Müller, Z. Li, K. Wang, X. Chen, C. Wang, \"GIM: Learning Generalizable Image Matcher From Internet Videos\", ICLR 2024",
    source: "xuelunshen/gim: test.py, tools/metrics.py, analysis.py, TEST_ROOT_SIFT.sh",
    size: SizeRule::AsIs,
    estimator: EstimatorRule::Of {
        id: "ransac-e-inliers",
        params: || json!({"threshold_px": 0.5, "confidence": 0.99999}),
    },
    pixels: Pixels::Original,
    focal: Focal::FirstXSecondY,
    centres: Centres::Kept,
    shuffles: 1,
    min_matches: 5,
    min_inliers: 0,
    min_support: 1,
    scores: &["exact_auc_5"],
    failure: 180.0,
    notes: &["Its KITTI is looked at with 1240 pixels along the longer side, its ETH3D with 1600."],
};
