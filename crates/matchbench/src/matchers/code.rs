//! `code`: ASIFT, all nearest neighbours, and of these the matches that coherence decides for.

use matchbench_vision::matching::{Code, CodeParams, PlacewiseNeighbours};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::asift::AsiftExtraction;
use super::{BuiltMatcher, MatcherEntry};
use crate::config::{ConfigError, Parameter, parameters, parse_params, to_json};

pub(super) struct CodeEntry;

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Params {
    extractor: AsiftExtraction,
    search: PlacewiseNeighbours,
    coherence: CodeParams,
}

impl MatcherEntry for CodeEntry {
    fn id(&self) -> &'static str {
        "code"
    }

    fn summary(&self) -> &'static str {
        "ASIFT, all nearest neighbours, those that move as their neighbours do"
    }

    fn reference(&self) -> &'static str {
        "W.-Y. Lin, F. Wang, M.-M. Cheng, S.-K. Yeung, P. H. S. Torr, M. N. Do, J. Lu, \"CODE: Coherence Based Decision Boundaries for Feature \
         Correspondence\", IEEE Transactions on Pattern Analysis and Machine Intelligence 40(1), 2018"
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

    fn build(&self, params: Option<&Value>) -> Result<BuiltMatcher, ConfigError> {
        let params: Params = parse_params(self.id(), params)?;
        let code = Code::new(params.coherence).map_err(|e| ConfigError::new(self.id(), e))?;
        params
            .extractor
            .matcher(self.id(), to_json(&params), params.search, Box::new(code))
    }
}
