//! `freak`: FREAK on the keypoints of SURF, as in the paper.

use matchbench_vision::features::DetectThenDescribe;
use matchbench_vision::features::freak::{Freak, FreakParams};
use matchbench_vision::features::surf::{Surf, SurfParams};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::local_features::LocalFeatures;
use super::surf;

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Params {
    surf: SurfKeypoints,
    freak: FreakParams,
}

/// The parameters of SURF that its keypoints depend on; see [`SurfParams`].
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct SurfKeypoints {
    /// Least determinant of the Hessian, for grey values of 0 to 255; at least 0.
    threshold: f32,
    /// Number of octaves, 1 to 6.
    octaves: usize,
    /// Layers of an octave in which keypoints are found, 1 to 8.
    layers: usize,
}

impl Default for SurfKeypoints {
    fn default() -> Self {
        let SurfParams {
            threshold,
            octaves,
            layers,
            // Parameters of SURF's descriptors, which FREAK replaces, and of its orientations, which FREAK
            // computes again.
            extended: _,
            upright: _,
        } = SurfParams::default();
        Self {
            threshold,
            octaves,
            layers,
        }
    }
}

impl SurfKeypoints {
    fn params(self) -> SurfParams {
        let Self {
            threshold,
            octaves,
            layers,
        } = self;
        SurfParams {
            threshold,
            octaves,
            layers,
            ..SurfParams::default()
        }
    }
}

pub(super) const FREAK: LocalFeatures<Params> = LocalFeatures {
    id: "freak",
    summary: "FREAK on SURF keypoints, exact nearest neighbours, ratio test",
    reference: "A. Alahi, R. Ortiz, P. Vandergheynst, \"FREAK: Fast Retina Keypoint\", CVPR 2012",
    revision: 1,
    removed: &[
        ("/extractor/surf", "extended"),
        ("/extractor/surf", "upright"),
    ],
    detection: |params| Some(surf::detection(&params.surf.params())),
    extractor: |params| {
        Ok(Box::new(DetectThenDescribe {
            detector: Surf::new(params.surf.params())?,
            describer: Freak::new(params.freak)?,
        }))
    },
};
