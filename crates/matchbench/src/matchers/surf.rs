//! `surf`: with 64 values, as in the paper.

use matchbench_vision::features::surf::{Surf, SurfParams};

use super::Extraction;
use super::local_features::LocalFeatures;
use crate::config::to_json;

pub(super) const SURF: LocalFeatures<SurfParams> = LocalFeatures {
    id: "surf",
    summary: "SURF, exact nearest neighbours, ratio test",
    reference: "H. Bay, A. Ess, T. Tuytelaars, L. Van Gool, \"Speeded-Up Robust Features (SURF)\", \
                Computer Vision and Image Understanding 110(3), 2008",
    revision: 1,
    removed: &[],
    detection: |params| Some(detection(params)),
    extractor: |params| Ok(Box::new(Surf::new(params)?)),
};

/// What the keypoints of SURF depend on, for all that describe them.
pub(super) fn detection(params: &SurfParams) -> Extraction {
    Extraction {
        extractor: "surf-keypoints".into(),
        params: to_json(params),
        revision: SURF.revision,
    }
}
