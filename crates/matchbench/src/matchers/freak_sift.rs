//! `freak-sift`: FREAK on the keypoints of SIFT, as in the authors' evaluation.

use matchbench_vision::features::DetectThenDescribe;
use matchbench_vision::features::freak::{Freak, FreakParams};
use matchbench_vision::features::sift::{Sift, SiftParams};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::local_features::LocalFeatures;
use super::sift;

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Params {
    sift: SiftParams,
    freak: FreakParams,
}

pub(super) const FREAK_SIFT: LocalFeatures<Params> = LocalFeatures {
    id: "freak-sift",
    summary: "FREAK on SIFT keypoints, exact nearest neighbours, ratio test",
    reference: "A. Alahi, R. Ortiz, P. Vandergheynst, \"FREAK: Fast Retina Keypoint\", CVPR 2012",
    revision: 1,
    removed: &[],
    detection: |params| Some(sift::detection(&params.sift)),
    extractor: |params| {
        Ok(Box::new(DetectThenDescribe {
            detector: Sift::new(params.sift)?,
            describer: Freak::new(params.freak)?,
        }))
    },
};
