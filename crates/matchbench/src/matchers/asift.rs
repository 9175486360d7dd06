//! `asift`: SIFT on simulated views; neighbours are compared by place.
//!
//! The same point is found in several views of one image, so the second nearest descriptor usually
//! shows the same place as the nearest and the ratio test would drop nearly all matches.
//! [`PlacewiseNeighbours`] takes the nearest descriptor of another place instead.

use matchbench_vision::ParamError;
use matchbench_vision::features::{Asift, AsiftParams, Extractor, Sift, SiftParams};
use matchbench_vision::matching::{Pipeline, PlacewiseNeighbours, RatioTest, Selector};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;

use super::{BuiltMatcher, Extraction, MatcherEntry};
use crate::config::{ConfigError, Parameter, over, parameters, parse_params, to_json};

pub(super) struct AsiftEntry;

/// Features of simulated views, as all matchers that use them have them.
#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct AsiftExtraction {
    views: AsiftParams,
    #[serde(deserialize_with = "sift_over_default")]
    sift: SiftParams,
}

impl Default for AsiftExtraction {
    fn default() -> Self {
        Self {
            views: AsiftParams::default(),
            sift: default_sift(),
        }
    }
}

/// Simulated views are blurred, so doubling them shows nothing more.
fn default_sift() -> SiftParams {
    SiftParams {
        double_image: false,
        ..SiftParams::default()
    }
}

fn sift_over_default<'de, D: Deserializer<'de>>(given: D) -> Result<SiftParams, D::Error> {
    over(&default_sift(), given)
}

impl AsiftExtraction {
    /// Everything that its features depend on.
    fn extraction(&self) -> Extraction {
        Extraction {
            extractor: "asift".into(),
            params: to_json(self),
            revision: 1,
        }
    }

    /// The extractor.
    fn build(self) -> Result<Box<dyn Extractor>, ParamError> {
        Ok(Box::new(Asift::new(Sift::new(self.sift)?, self.views)?))
    }

    /// The matcher `id` on these features, with the selector of its matches.
    pub(super) fn matcher(
        self,
        id: &'static str,
        params: Value,
        search: PlacewiseNeighbours,
        selector: Box<dyn Selector>,
    ) -> Result<BuiltMatcher, ConfigError> {
        let refused = |error| ConfigError::new(id, error);
        let search = PlacewiseNeighbours::new(search.same_place_px).map_err(refused)?;
        Ok(BuiltMatcher {
            id: id.into(),
            params,
            extraction: self.extraction(),
            detection: None,
            matcher: Box::new(Pipeline {
                extractor: self.build().map_err(refused)?,
                search: Box::new(search),
                selectors: vec![selector],
            }),
        })
    }
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Params {
    extractor: AsiftExtraction,
    search: PlacewiseNeighbours,
    /// Largest ratio of the distances of the nearest neighbour and of the nearest at another place, itself excluded; in
    /// `(0, 1]`.
    ratio: f32,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            extractor: AsiftExtraction::default(),
            search: PlacewiseNeighbours::default(),
            ratio: RatioTest::default().ratio,
        }
    }
}

impl MatcherEntry for AsiftEntry {
    fn id(&self) -> &'static str {
        "asift"
    }

    fn summary(&self) -> &'static str {
        "SIFT on simulated views, exact nearest neighbours, ratio test between places"
    }

    fn reference(&self) -> &'static str {
        "J.-M. Morel, G. Yu, \"ASIFT: A New Framework for Fully Affine Invariant Image \
         Comparison\", SIAM Journal on Imaging Sciences 2(2), 2009"
    }

    fn defaults(&self) -> Value {
        to_json(&Params::default())
    }

    fn parameters(&self) -> Vec<Parameter> {
        parameters::<Params>(&self.defaults())
    }

    fn build(&self, params: Option<&Value>) -> Result<BuiltMatcher, ConfigError> {
        let params: Params = parse_params(self.id(), params)?;
        let ratio = RatioTest::new(params.ratio).map_err(|e| ConfigError::new(self.id(), e))?;
        params
            .extractor
            .matcher(self.id(), to_json(&params), params.search, Box::new(ratio))
    }
}
