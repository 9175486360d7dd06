//! `freak`: FREAK on the keypoints of SURF, as in the paper.

use matchbench_vision::features::DetectThenDescribe;
use matchbench_vision::features::freak::{Freak, FreakParams};
use matchbench_vision::features::surf::{Surf, SurfParams};
use serde::{Deserialize, Serialize};

use super::local_features::LocalFeatures;
use super::surf;

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Params {
    surf: SurfParams,
    freak: FreakParams,
}

pub(super) const FREAK: LocalFeatures<Params> = LocalFeatures {
    id: "freak",
    summary: "FREAK on SURF keypoints, exact nearest neighbours, ratio test",
    reference: "A. Alahi, R. Ortiz, P. Vandergheynst, \"FREAK: Fast Retina Keypoint\", CVPR 2012",
    revision: 1,
    detection: |params| Some(surf::detection(&params.surf)),
    extractor: |params| {
        Ok(Box::new(DetectThenDescribe {
            detector: Surf::new(params.surf)?,
            describer: Freak::new(params.freak)?,
        }))
    },
};
