//! `gaim`: SURF on simulated views; matches are chosen from the candidates of all features together.

use matchbench_vision::features::{Sheared, ShearedParams, Surf, SurfParams};
use matchbench_vision::matching::{Gaim, GaimParams, Pipeline};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value;

use super::{BuiltMatcher, Extraction, MatcherEntry};
use crate::config::{ConfigError, Parameter, over, parameters, parse_params, to_json};

pub(super) struct GaimEntry;

#[derive(Clone, Copy, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct SimulatedSurf {
    views: ShearedParams,
    #[serde(deserialize_with = "surf_over_default")]
    surf: SurfParams,
}

impl Default for SimulatedSurf {
    fn default() -> Self {
        Self {
            views: ShearedParams::default(),
            surf: default_surf(),
        }
    }
}

fn default_surf() -> SurfParams {
    SurfParams {
        threshold: 400.0,
        ..SurfParams::default()
    }
}

fn surf_over_default<'de, D: Deserializer<'de>>(given: D) -> Result<SurfParams, D::Error> {
    over(&default_surf(), given)
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Params {
    extractor: SimulatedSurf,
    selection: GaimParams,
}

impl MatcherEntry for GaimEntry {
    fn id(&self) -> &'static str {
        "gaim"
    }

    fn summary(&self) -> &'static str {
        "SURF on simulated views, candidates chosen together by affine neighbourhoods"
    }

    fn reference(&self) -> &'static str {
        "T. Collins, P. Mesejo, A. Bartoli, \"An Analysis of Errors in Graph-Based Keypoint Matching \
         and Proposed Solutions\", ECCV 2014"
    }

    fn defaults(&self) -> Value {
        to_json(&Params::default())
    }

    fn parameters(&self) -> Vec<Parameter> {
        parameters::<Params>(&self.defaults())
    }

    fn build(&self, params: Option<&Value>) -> Result<BuiltMatcher, ConfigError> {
        let params: Params = parse_params(self.id(), params)?;
        let error = |error| ConfigError::new(self.id(), error);
        let surf = Surf::new(params.extractor.surf).map_err(error)?;
        let extractor = Sheared::new(surf, params.extractor.views).map_err(error)?;
        let gaim = Gaim::new(params.selection).map_err(error)?;
        Ok(BuiltMatcher {
            id: self.id().into(),
            params: to_json(&params),
            extraction: Extraction {
                extractor: "sheared-surf".into(),
                params: to_json(&params.extractor),
                revision: 1,
            },
            detection: None,
            matcher: Box::new(Pipeline {
                extractor: Box::new(extractor),
                search: Box::new(params.selection.labels),
                selectors: vec![Box::new(gaim)],
            }),
        })
    }
}
