//! BRISK: corners in a scale space with bits from a ring pattern, exact nearest neighbours, the ratio
//! test.
//!
//! S. Leutenegger, M. Chli, R. Y. Siegwart, "BRISK: Binary Robust Invariant Scalable Keypoints",
//! ICCV 2011. The algorithm is in [`matchbench_vision::features::brisk`]; this is how the MatchBench
//! paper uses it.
//!
//! | parameter | default | source |
//! | --- | --- | --- |
//! | `extractor` | [`BriskParams`] | those of OpenCV, as in the paper's evaluation |
//! | `ratio` | 0.8 | the paper's evaluation |

use matchbench_vision::features::brisk::{self, BriskParams};
use matchbench_vision::matching::{NearestNeighbours, Pipeline, RatioTest};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{BuiltMatcher, Entry, Extraction};
use crate::config::{ConfigError, parse_params, to_json};

const ID: &str = "brisk";

/// Raised whenever the same image and parameters come to give other features, so that those in
/// caches are not used again.
const REVISION: u32 = 1;

/// The entry.
pub(super) struct Brisk;

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Params {
    extractor: BriskParams,
    ratio: f32,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            extractor: BriskParams::default(),
            ratio: RatioTest::default().ratio,
        }
    }
}

impl Entry for Brisk {
    fn id(&self) -> &'static str {
        ID
    }

    fn summary(&self) -> &'static str {
        "BRISK, exact nearest neighbours, ratio test"
    }

    fn reference(&self) -> &'static str {
        "S. Leutenegger, M. Chli, R. Y. Siegwart, \"BRISK: Binary Robust Invariant Scalable \
         Keypoints\", ICCV 2011"
    }

    fn defaults(&self) -> Value {
        to_json(&Params::default())
    }

    fn build(&self, params: Option<&Value>) -> Result<BuiltMatcher, ConfigError> {
        let params: Params = parse_params(ID, params)?;
        if !(params.ratio > 0.0 && params.ratio <= 1.0) {
            let reason = format!(
                "ratio is {}, but must be above 0 and at most 1",
                params.ratio
            );
            return Err(ConfigError::new(ID, reason));
        }
        let extractor =
            brisk::Brisk::new(params.extractor).map_err(|error| ConfigError::new(ID, error))?;
        Ok(BuiltMatcher {
            id: ID.into(),
            params: to_json(&params),
            extraction: Extraction {
                extractor: ID.into(),
                params: to_json(&params.extractor),
                revision: REVISION,
            },
            matcher: Box::new(Pipeline {
                extractor: Box::new(extractor),
                search: Box::new(NearestNeighbours),
                selectors: vec![Box::new(RatioTest {
                    ratio: params.ratio,
                })],
            }),
        })
    }
}
