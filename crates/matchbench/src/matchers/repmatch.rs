//! `repmatch`: ASIFT, all nearest neighbours, and of these the matches that coherence and epipolar geometry
//! decide for.

use matchbench_vision::matching::{PlacewiseNeighbours, RepMatch, RepMatchParams};
use matchbench_vision::robust::Settings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::asift::AsiftExtraction;
use super::{BuiltMatcher, MatcherEntry};
use crate::config::{ConfigError, Parameter, parameters, parse_params, to_json};

pub(super) struct RepMatchEntry;

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Params {
    extractor: AsiftExtraction,
    search: PlacewiseNeighbours,
    selection: RepMatchParams,
}

impl MatcherEntry for RepMatchEntry {
    fn id(&self) -> &'static str {
        "repmatch"
    }

    fn summary(&self) -> &'static str {
        "CODE, learned again on the matches that one epipolar geometry explains"
    }

    fn reference(&self) -> &'static str {
        "W.-Y. Lin, S. Liu, N. Jiang, M. N. Do, P. Tan, J. Lu, \"RepMatch: Robust Feature Matching \
         and Pose for Reconstructing Modern Cities\", ECCV 2016"
    }

    fn estimator(&self) -> &'static str {
        "rich"
    }

    fn defaults(&self) -> Value {
        to_json(&Params::default())
    }

    fn parameters(&self) -> Vec<Parameter> {
        parameters::<Params>(&self.defaults())
    }

    fn modernized(&self, written: &Value) -> Value {
        let mut params = written.clone();
        if let Some(pose) = params.pointer_mut("/selection/pose")
            && let Ok(settings) = parse_params::<Settings>(self.id(), Some(pose))
        {
            let acting = settings.of_earlier_version(&RepMatchParams::default().pose);
            *pose = to_json(&acting);
        }
        params
    }

    fn build(&self, params: Option<&Value>) -> Result<BuiltMatcher, ConfigError> {
        let params: Params = parse_params(self.id(), params)?;
        let repmatch =
            RepMatch::new(params.selection).map_err(|e| ConfigError::new(self.id(), e))?;
        params.extractor.matcher(
            self.id(),
            to_json(&params),
            params.search,
            Box::new(repmatch),
        )
    }
}
