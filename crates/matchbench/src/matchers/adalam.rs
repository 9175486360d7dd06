//! `adalam`: RootSIFT, all nearest neighbours, and of these the matches that follow significant local affine
//! maps.
//!
//! | parameter | default | source |
//! | --- | --- | --- |
//! | `extractor.contrast_threshold` | 0.01 | ours, chosen on the kitchen |
//! | `extractor`, all others | those of `sift` | OpenCV's |
//! | `descriptors` | `rootsift` | ours, chosen on the kitchen |
//! | `selection` | see [`Adalam`] | the authors' program |
//!
//! A neighbourhood of AdaLAM is a small part of the image and must have some ten matches in it. So this matcher
//! needs many features: its authors work with 8000 of an image. The features were chosen on 231 pairs of the
//! kitchen (22 images of 7-Scenes, every seventh). There the AUC with `ransac-e` and `best` is 0.138 and 0.246
//! with the features of `sift`, 0.257 and 0.320 with their contrast threshold at 0.01, and 0.293 and 0.343 with
//! the roots of these descriptors too. Seeds of ratio 0.9 (0.286 and 0.344) or 4 inliers (0.284 and 0.349) make
//! no difference, so the selection keeps its authors' values.

use matchbench_vision::features::{Extractor, RootSift, Sift, SiftParams};
use matchbench_vision::matching::{Adalam, AdalamParams, NearestNeighbours, Pipeline};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::rootsift::ROOTSIFT;
use super::sift::SIFT;
use super::{BuiltMatcher, Extraction, MatcherEntry};
use crate::config::{ConfigError, Parameter, parameters, parse_params_over, to_json};

pub(super) struct AdalamEntry;

#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Params {
    extractor: SiftParams,
    descriptors: DescriptorName,
    selection: AdalamParams,
}

/// How the keypoints of SIFT are described.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
enum DescriptorName {
    /// The square roots of SIFT's descriptors (RootSIFT).
    #[default]
    RootSift,
    /// As SIFT does.
    Sift,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            extractor: SiftParams {
                contrast_threshold: 0.01,
                ..SiftParams::default()
            },
            descriptors: DescriptorName::default(),
            selection: AdalamParams::default(),
        }
    }
}

impl MatcherEntry for AdalamEntry {
    fn id(&self) -> &'static str {
        "adalam"
    }

    fn summary(&self) -> &'static str {
        "RootSIFT, all nearest neighbours, those of significant local affine maps"
    }

    fn title(&self) -> String {
        "AdaLAM".into()
    }

    fn reference(&self) -> &'static str {
        "L. Cavalli, V. Larsson, M. R. Oswald, T. Sattler, M. Pollefeys, \"Handcrafted Outlier Detection \
         Revisited\", ECCV 2020"
    }

    fn defaults(&self) -> Value {
        to_json(&Params::default())
    }

    fn parameters(&self) -> Vec<Parameter> {
        parameters::<Params>(&self.defaults())
    }

    fn build(&self, params: Option<&Value>) -> Result<BuiltMatcher, ConfigError> {
        let params = parse_params_over(self.id(), Params::default(), params)?;
        let sift = Sift::new(params.extractor).map_err(|e| ConfigError::new(self.id(), e))?;
        let adalam = Adalam::new(params.selection).map_err(|e| ConfigError::new(self.id(), e))?;
        let (extractor, of): (Box<dyn Extractor>, _) = match params.descriptors {
            DescriptorName::RootSift => (Box::new(RootSift(sift)), &ROOTSIFT),
            DescriptorName::Sift => (Box::new(sift), &SIFT),
        };
        Ok(BuiltMatcher {
            id: self.id().into(),
            params: to_json(&params),
            // The features are those of `rootsift` or `sift` with the same parameters, so they are found in the
            // cache.
            extraction: Extraction {
                extractor: of.id.into(),
                params: to_json(&params.extractor),
                revision: of.revision,
            },
            detection: None,
            matcher: Box::new(Pipeline {
                extractor,
                search: Box::new(NearestNeighbours),
                selectors: vec![Box::new(adalam)],
            }),
        })
    }
}
