//! `sift`: the paper's baseline.

use matchbench_vision::features::sift::{Sift, SiftParams};

use super::Extraction;
use super::local_features::LocalFeatures;
use crate::config::to_json;

pub(super) const SIFT: LocalFeatures<SiftParams> = LocalFeatures {
    id: "sift",
    summary: "SIFT, exact nearest neighbours, ratio test",
    reference: "D. G. Lowe, \"Distinctive Image Features from Scale-Invariant Keypoints\", \
                International Journal of Computer Vision 60(2), 2004",
    revision: 1,
    removed: &[],
    detection: |params| Some(detection(params)),
    extractor: |params| Ok(Box::new(Sift::new(params)?)),
};

/// Everything that the keypoints of SIFT depend on, shared by all matchers that describe them.
pub(super) fn detection(params: &SiftParams) -> Extraction {
    Extraction {
        extractor: "sift-keypoints".into(),
        params: to_json(params),
        revision: SIFT.revision,
    }
}
