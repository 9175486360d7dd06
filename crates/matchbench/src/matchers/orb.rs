//! ORB: oriented FAST corners with rotated BRIEF bits, exact nearest neighbours, the ratio test.
//!
//! E. Rublee, V. Rabaud, K. Konolige, G. Bradski, "ORB: an efficient alternative to SIFT or SURF",
//! ICCV 2011. The algorithm is in [`matchbench_vision::features::orb`]; this is how the MatchBench
//! paper uses it.
//!
//! | parameter | default | source |
//! | --- | --- | --- |
//! | `extractor` | [`OrbParams`] | those of OpenCV, but up to 100,000 features, as in the paper's evaluation |
//! | `ratio` | 0.8 | the paper's evaluation |

use matchbench_vision::features::orb::{self, OrbParams};
use matchbench_vision::matching::{NearestNeighbours, Pipeline, RatioTest};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{BuiltMatcher, Entry, Extraction};
use crate::config::{ConfigError, parse_params, to_json};

const ID: &str = "orb";

/// Raised whenever the same image and parameters come to give other features, so that those in
/// caches are not used again.
const REVISION: u32 = 1;

/// The entry.
pub(super) struct Orb;

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Params {
    extractor: OrbParams,
    ratio: f32,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            extractor: OrbParams::default(),
            ratio: RatioTest::default().ratio,
        }
    }
}

impl Entry for Orb {
    fn id(&self) -> &'static str {
        ID
    }

    fn summary(&self) -> &'static str {
        "ORB, exact nearest neighbours, ratio test"
    }

    fn reference(&self) -> &'static str {
        "E. Rublee, V. Rabaud, K. Konolige, G. Bradski, \"ORB: an efficient alternative to SIFT or \
         SURF\", ICCV 2011"
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
            orb::Orb::new(params.extractor).map_err(|error| ConfigError::new(ID, error))?;
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
