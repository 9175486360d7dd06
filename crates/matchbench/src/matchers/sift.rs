//! SIFT: the detector and descriptor of Lowe, exact nearest neighbours, the ratio test.
//!
//! D. G. Lowe, "Distinctive Image Features from Scale-Invariant Keypoints", International Journal
//! of Computer Vision 60(2), 2004. The algorithm is in [`matchbench_vision::features::sift`]; this
//! is how the MatchBench paper uses it.
//!
//! | parameter | default | source |
//! | --- | --- | --- |
//! | `extractor` | [`SiftParams`] | those of OpenCV, as in the paper's evaluation |
//! | `ratio` | 0.8 | Lowe, section 7.1; the paper's evaluation |
//!
//! *Differs from the paper's evaluation* in the search, which is exact here and approximate (FLANN)
//! there.

use matchbench_vision::features::sift::{self, SiftParams};
use matchbench_vision::matching::{NearestNeighbours, Pipeline, RatioTest};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{BuiltMatcher, Entry, Extraction};
use crate::config::{ConfigError, parse_params, to_json};

const ID: &str = "sift";

/// Raised whenever the same image and parameters come to give other features, so that those in
/// caches are not used again.
const REVISION: u32 = 1;

/// The entry.
pub(super) struct Sift;

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Params {
    extractor: SiftParams,
    ratio: f32,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            extractor: SiftParams::default(),
            ratio: RatioTest::default().ratio,
        }
    }
}

impl Entry for Sift {
    fn id(&self) -> &'static str {
        ID
    }

    fn summary(&self) -> &'static str {
        "SIFT, exact nearest neighbours, ratio test"
    }

    fn reference(&self) -> &'static str {
        "D. G. Lowe, \"Distinctive Image Features from Scale-Invariant Keypoints\", International \
         Journal of Computer Vision 60(2), 2004"
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
            sift::Sift::new(params.extractor).map_err(|error| ConfigError::new(ID, error))?;
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

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn parameters_are_plain_numbers() {
        assert_eq!(Sift.defaults()["ratio"], json!(0.8));
        assert_eq!(
            Sift.defaults()["extractor"]["contrast_threshold"],
            json!(0.04)
        );
    }

    #[test]
    fn the_ratio_does_not_change_the_features_but_the_extractor_does() {
        let extraction = |params: &Value| Sift.build(Some(params)).unwrap().extraction;
        let default = extraction(&json!({}));
        assert_eq!(extraction(&json!({"ratio": 0.7})), default);
        assert_ne!(extraction(&json!({"extractor": {"sigma": 1.5}})), default);
    }

    #[test]
    fn values_out_of_range_are_refused_by_name() {
        for (params, named) in [
            (json!({"ratio": 0}), "ratio"),
            (json!({"ratio": 1.01}), "ratio"),
            (json!({"ratio": "0.8"}), "0.8"),
            (json!({"extractor": {"octave_layers": 0}}), "octave_layers"),
        ] {
            let message = Sift
                .build(Some(&params))
                .err()
                .expect("refused")
                .to_string();
            assert!(
                message.contains(named) && message.contains("sift"),
                "{message}"
            );
        }
    }
}
