//! `matchbench`: the protocol of the paper that this benchmark implements.
//!
//! Bian, Yang, Liu, Zhang, Cheng, Reid, Wu, "MatchBench: An Evaluation of Feature Matchers", 2018.
//!
//! Images keep their size. Poses come from OpenCV's `findEssentialMat` and `recoverPose` over all matches, or
//! from the estimator that the paper uses with the matcher. The sign of the translation counts. The AUC is the
//! mean of SP(1) ... SP(15).

use crate::records::{MIN_MATCHES, MIN_SUPPORT};

use super::{Centres, EstimatorRule, Focal, Pixels, Protocol, SizeRule};

/// The paper's protocol.
pub const MATCHBENCH: Protocol = Protocol {
    id: "matchbench",
    summary: "the paper of this benchmark; that of every run without another",
    reference: "J. Bian, R. Yang, Y. Liu, L. Zhang, M.-M. Cheng, I. Reid, W. Wu, \"MatchBench: An Evaluation of Feature Matchers\", 2018",
    source: "the paper and its authors' published results",
    size: SizeRule::AsIs,
    estimator: EstimatorRule::Own,
    pixels: Pixels::Original,
    focal: Focal::Mean,
    centres: Centres::Kept,
    shuffles: 1,
    min_matches: MIN_MATCHES,
    min_inliers: 0,
    min_support: MIN_SUPPORT,
    scores: &["auc"],
    failure: f64::INFINITY,
    notes: &[
        "The angle between translations is signed: the opposite direction is 180 degrees off.",
    ],
};
