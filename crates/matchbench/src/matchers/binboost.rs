//! `binboost`: 256 learned bits of the keypoints of SIFT, as in the paper.

use matchbench_vision::features::{BinBoost, BinBoostParams};

use super::local_features::{LocalFeatures, OnSift};

pub(super) const BINBOOST: LocalFeatures<OnSift<BinBoostParams>> = LocalFeatures {
    id: "binboost",
    summary: "SIFT's keypoints, BinBoost, exact nearest neighbours, ratio test",
    reference: "T. Trzcinski, M. Christoudias, P. Fua, V. Lepetit, \"Boosting Binary Keypoint \
                Descriptors\", CVPR 2013",
    revision: 1,
    extractor: |params| params.extractor(BinBoost::new(params.describer)?),
};
