//! `brisk`: the paper's fourth local feature.

use matchbench_vision::features::brisk::{Brisk, BriskParams};

use super::local_features::LocalFeatures;

pub(super) const BRISK: LocalFeatures<BriskParams> = LocalFeatures {
    id: "brisk",
    summary: "BRISK, exact nearest neighbours, ratio test",
    reference: "S. Leutenegger, M. Chli, R. Y. Siegwart, \"BRISK: Binary Robust Invariant Scalable \
                Keypoints\", ICCV 2011",
    revision: 1,
    removed: &[],
    detection: |_| None,
    extractor: |params| Ok(Box::new(Brisk::new(params)?)),
};
