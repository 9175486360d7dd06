//! `dlco`: 120 learned values of the keypoints of SIFT, as in the paper.

use matchbench_vision::features::{Dlco, DlcoParams};

use super::local_features::{LocalFeatures, OnSift};

pub(super) const DLCO: LocalFeatures<OnSift<DlcoParams>> = LocalFeatures {
    id: "dlco",
    summary: "SIFT's keypoints, DLCO, exact nearest neighbours, ratio test",
    reference: "K. Simonyan, A. Vedaldi, A. Zisserman, \"Learning Local Feature Descriptors Using \
                Convex Optimisation\", IEEE Transactions on Pattern Analysis and Machine \
                Intelligence 36(8), 2014",
    revision: 1,
    extractor: |params| params.extractor(Dlco::new(params.describer)?),
};
