//! `dlco`: 120 learned values on the keypoints of SIFT, as in the paper.

use matchbench_vision::features::{DetectThenDescribe, Dlco, DlcoParams, Sift, SiftParams};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::local_features::LocalFeatures;
use super::sift;

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Params {
    sift: SiftParams,
    dlco: DlcoParams,
}

pub(super) const DLCO: LocalFeatures<Params> = LocalFeatures {
    id: "dlco",
    summary: "DLCO on SIFT keypoints, exact nearest neighbours, ratio test",
    reference: "K. Simonyan, A. Vedaldi, A. Zisserman, \"Learning Local Feature Descriptors Using \
                Convex Optimisation\", IEEE Transactions on Pattern Analysis and Machine \
                Intelligence 36(8), 2014",
    revision: 2,
    removed: &[],
    detection: |params| Some(sift::detection(&params.sift)),
    extractor: |params| {
        Ok(Box::new(DetectThenDescribe {
            detector: Sift::new(params.sift)?,
            describer: Dlco::new(params.dlco)?,
        }))
    },
};
