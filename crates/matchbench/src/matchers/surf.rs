//! `surf`: with 64 values, as in the paper.

use matchbench_vision::features::surf::{Surf, SurfParams};

use super::local_features::LocalFeatures;

pub(super) const SURF: LocalFeatures<SurfParams> = LocalFeatures {
    id: "surf",
    summary: "SURF, exact nearest neighbours, ratio test",
    reference: "H. Bay, A. Ess, T. Tuytelaars, L. Van Gool, \"Speeded-Up Robust Features (SURF)\", \
                Computer Vision and Image Understanding 110(3), 2008",
    revision: 1,
    extractor: |params| Ok(Box::new(Surf::new(params)?)),
};
