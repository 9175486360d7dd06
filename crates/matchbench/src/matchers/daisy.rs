//! `daisy`: 200 values on the keypoints of SIFT, as in the paper.

use matchbench_vision::features::{Daisy, DaisyParams, DetectThenDescribe, Sift, SiftParams};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::local_features::LocalFeatures;
use super::sift;

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Params {
    sift: SiftParams,
    daisy: DaisyParams,
}

pub(super) const DAISY: LocalFeatures<Params> = LocalFeatures {
    id: "daisy",
    summary: "DAISY on SIFT keypoints, exact nearest neighbours, ratio test",
    reference: "E. Tola, V. Lepetit, P. Fua, \"DAISY: An Efficient Dense Descriptor Applied to \
                Wide-Baseline Stereo\", IEEE Transactions on Pattern Analysis and Machine \
                Intelligence 32(5), 2010",
    revision: 1,
    removed: &[],
    detection: |params| Some(sift::detection(&params.sift)),
    extractor: |params| {
        Ok(Box::new(DetectThenDescribe {
            detector: Sift::new(params.sift)?,
            describer: Daisy::new(params.daisy)?,
        }))
    },
};
