//! `sift`: the paper's baseline.

use matchbench_vision::features::sift::{Sift, SiftParams};

use super::local_features::LocalFeatures;

pub(super) const SIFT: LocalFeatures<SiftParams> = LocalFeatures {
    id: "sift",
    summary: "SIFT, exact nearest neighbours, ratio test",
    reference: "D. G. Lowe, \"Distinctive Image Features from Scale-Invariant Keypoints\", \
                International Journal of Computer Vision 60(2), 2004",
    revision: 1,
    extractor: |params| Ok(Box::new(Sift::new(params)?)),
};
