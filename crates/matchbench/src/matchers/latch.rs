//! `latch`: 256 bits on the keypoints of SIFT, as in the paper.

use matchbench_vision::features::{DetectThenDescribe, Latch, LatchParams, Sift, SiftParams};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::local_features::LocalFeatures;
use super::sift;

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Params {
    sift: SiftParams,
    latch: LatchParams,
}

pub(super) const LATCH: LocalFeatures<Params> = LocalFeatures {
    id: "latch",
    summary: "LATCH on SIFT keypoints, exact nearest neighbours, ratio test",
    reference: "G. Levi, T. Hassner, \"LATCH: Learned Arrangements of Three Patch Codes\", WACV 2016",
    revision: 1,
    removed: &[],
    detection: |params| Some(sift::detection(&params.sift)),
    extractor: |params| {
        Ok(Box::new(DetectThenDescribe {
            detector: Sift::new(params.sift)?,
            describer: Latch::new(params.latch)?,
        }))
    },
};
