//! `rootsift`: SIFT with descriptors that are compared by the Hellinger kernel.

use matchbench_vision::features::RootSift;
use matchbench_vision::features::sift::{Sift, SiftParams};

use super::local_features::LocalFeatures;
use super::sift;

pub(super) const ROOTSIFT: LocalFeatures<SiftParams> = LocalFeatures {
    id: "rootsift",
    summary: "RootSIFT, exact nearest neighbours, ratio test",
    reference: "R. Arandjelovic, A. Zisserman, \"Three things everyone should know to improve object \
                retrieval\", CVPR 2012",
    revision: 1,
    removed: &[],
    detection: |params| Some(sift::detection(params)),
    extractor: |params| Ok(Box::new(RootSift(Sift::new(params)?))),
};
