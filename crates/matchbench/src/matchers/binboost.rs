//! `binboost`: 256 learned bits on the keypoints of SIFT, as in the paper.

use matchbench_vision::features::{BinBoost, BinBoostParams, DetectThenDescribe, Sift, SiftParams};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::local_features::LocalFeatures;
use super::sift;

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Params {
    sift: SiftParams,
    binboost: BinBoostParams,
}

pub(super) const BINBOOST: LocalFeatures<Params> = LocalFeatures {
    id: "binboost",
    summary: "BinBoost on SIFT keypoints, exact nearest neighbours, ratio test",
    reference: "T. Trzcinski, M. Christoudias, P. Fua, V. Lepetit, \"Boosting Binary Keypoint \
                Descriptors\", CVPR 2013",
    revision: 2,
    removed: &[],
    detection: |params| Some(sift::detection(&params.sift)),
    extractor: |params| {
        Ok(Box::new(DetectThenDescribe {
            detector: Sift::new(params.sift)?,
            describer: BinBoost::new(params.binboost)?,
        }))
    },
};
