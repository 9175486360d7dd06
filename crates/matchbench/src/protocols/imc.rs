//! `imc`: the stereo task of the Image Matching Challenge 2020.
//!
//! Jin, Mishkin, Mishchuk, Matas, Fua, Yi, Trulls, "Image Matching across Wide Baselines: From Paper to Practice", IJCV 2021.
//!
//! Images keep their size. DEGENSAC (Chum, Werner, Matas, CVPR 2005) estimates a fundamental matrix with a
//! threshold of 0.5 pixels, confidence 0.999999 and at most 100,000 iterations. K turns it into an essential
//! matrix, and the inliers choose the pose. Fewer than 8 matches or inliers are a failure. The mAA is the mean
//! share of pairs below 1, 2, ... 10 degrees.
//!
//! We use our `usac-f` instead of DEGENSAC, with uniform sampling and without the early test of models: it has
//! seven points, the check for planes and local optimisation too. Its threshold is divided by the mean focal
//! length; that of DEGENSAC is in pixels of each image.

use serde_json::json;

use super::{Centres, EstimatorRule, Focal, Pixels, Protocol, SizeRule};

/// The stereo task of the Image Matching Challenge.
pub const IMC: Protocol = Protocol {
    id: "imc",
    summary: "the stereo task of the Image Matching Challenge 2020, with an estimator of DEGENSAC's kind",
    reference: "Y. Jin, D. Mishkin, A. Mishchuk, J. Matas, P. Fua, K. M. Yi, E. Trulls, \"Image Matching across Wide Baselines: From Paper to Practice\", International Journal of Computer Vision 129(2), 2021",
    source: "ubc-vision/image-matching-benchmark: methods/geom_models/geom_cmp.py, utils/eval_helper.py, utils/pack_helper.py, example/configs",
    size: SizeRule::AsIs,
    estimator: EstimatorRule::Of {
        id: "usac-f",
        params: || {
            json!({
                "sampler": "uniform", "sprt": false, "threshold_px": 0.5, "confidence": 0.999_999,
                "max_iterations": 100_000
            })
        },
    },
    pixels: Pixels::Original,
    focal: Focal::Mean,
    centres: Centres::Kept,
    shuffles: 1,
    min_matches: 8,
    min_inliers: 8,
    min_support: 1,
    scores: &["maa_10"],
    failure: 180.0,
    notes: &[
        "The threshold of 0.5 pixels is that of its example with SIFT; entries were free to tune their own.",
    ],
};
