//! `gms`: ORB, all nearest neighbours, grid-based motion statistics; and `gms-s`, which is the same with
//! `selection.scales` on by default.
//!
//! The number of features is that of the published results: 10,000 with FAST threshold 0 for images up to
//! 640x480 pixels, 100,000 with FAST threshold 5 for larger ones.

use matchbench_vision::features::{DescriptorKind, Extractor, Features, Orb, OrbParams};
use matchbench_vision::image::{GrayImage, Size};
use matchbench_vision::matching::{Gms, GmsParams, NearestNeighbours, Pipeline};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{BuiltMatcher, Extraction, MatcherEntry};
use crate::config::{ConfigError, Parameter, parameters, parse_params_over, to_json};

/// Number of pixels up to which an image has the small number of features.
const SMALL: usize = 640 * 480;

/// How many features are searched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
enum Budget {
    /// 10,000 in small images, 100,000 in others, as in the published results.
    #[default]
    Authors,
    /// 10,000 in all images, as in the paper of GMS.
    Small,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Params {
    budget: Budget,
    selection: GmsParams,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            budget: Budget::Authors,
            selection: GmsParams::default(),
        }
    }
}

/// GMS as a matcher.
pub(super) struct GmsEntry {
    id: &'static str,
    summary: &'static str,
    scales: bool,
}

pub(super) const GMS: GmsEntry = GmsEntry {
    id: "gms",
    summary: "ORB, all nearest neighbours, those of cells that move together",
    scales: false,
};

pub(super) const GMS_S: GmsEntry = GmsEntry {
    id: "gms-s",
    summary: "GMS, trying five relative scales of the images",
    scales: true,
};

/// ORB with a number of features that depends on the size of the image.
struct BudgetOrb {
    small: Orb,
    large: Option<Orb>,
}

impl BudgetOrb {
    fn new(budget: Budget) -> Self {
        let orb = |features, fast_threshold| {
            Orb::new(OrbParams {
                features,
                fast_threshold,
                ..OrbParams::default()
            })
            .expect("these parameters are in range")
        };
        Self {
            small: orb(10_000, 0),
            large: (budget == Budget::Authors).then(|| orb(100_000, 5)),
        }
    }

    /// The one for images of this size.
    fn of(&self, size: Size) -> &Orb {
        match &self.large {
            Some(large) if size.area() > SMALL => large,
            _ => &self.small,
        }
    }
}

impl Extractor for BudgetOrb {
    fn kind(&self) -> DescriptorKind {
        self.small.kind()
    }

    fn extract(&self, image: &GrayImage) -> Features {
        self.of(image.size()).extract(image)
    }

    fn memory(&self, size: Size) -> usize {
        self.of(size).memory(size)
    }
}

impl GmsEntry {
    fn params(&self) -> Params {
        Params {
            selection: GmsParams {
                scales: self.scales,
                ..GmsParams::default()
            },
            ..Params::default()
        }
    }
}

impl MatcherEntry for GmsEntry {
    fn id(&self) -> &'static str {
        self.id
    }

    fn summary(&self) -> &'static str {
        self.summary
    }

    fn reference(&self) -> &'static str {
        "J. Bian, W.-Y. Lin, Y. Matsushita, S.-K. Yeung, T.-D. Nguyen, M.-M. Cheng, \"GMS: Grid-based \
         Motion Statistics for Fast, Ultra-robust Feature Correspondence\", CVPR 2017"
    }

    fn estimator(&self) -> &'static str {
        "rich"
    }

    fn defaults(&self) -> Value {
        to_json(&self.params())
    }

    fn parameters(&self) -> Vec<Parameter> {
        parameters::<Params>(&self.defaults())
    }

    fn build(&self, params: Option<&Value>) -> Result<BuiltMatcher, ConfigError> {
        let params = parse_params_over(self.id, self.params(), params)?;
        let gms = Gms::new(params.selection).map_err(|error| ConfigError::new(self.id, error))?;
        Ok(BuiltMatcher {
            id: self.id.into(),
            params: to_json(&params),
            extraction: Extraction {
                extractor: "orb-budget".into(),
                params: to_json(&params.budget),
                revision: 1,
            },
            detection: None,
            matcher: Box::new(Pipeline {
                extractor: Box::new(BudgetOrb::new(params.budget)),
                search: Box::new(NearestNeighbours),
                selectors: vec![Box::new(gms)],
            }),
        })
    }
}
