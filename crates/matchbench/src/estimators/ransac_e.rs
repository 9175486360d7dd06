//! `ransac-e`: the reference protocol of the paper.

use matchbench_vision::robust::{Ransac, RansacParams};
use serde_json::Value;

use super::{BuiltEstimator, Estimator, EstimatorEntry};
use crate::config::{ConfigError, Parameter, parameters, parse_params, to_json};

const ID: &str = "ransac-e";

/// Five-point RANSAC as in OpenCV's `findEssentialMat` and `recoverPose`.
pub(super) struct RansacE;

impl EstimatorEntry for RansacE {
    fn id(&self) -> &'static str {
        ID
    }

    fn summary(&self) -> &'static str {
        "essential matrix by five-point RANSAC: the reference protocol"
    }

    fn reference(&self) -> &'static str {
        "D. Nistér, \"An Efficient Solution to the Five-Point Relative Pose Problem\", IEEE Transactions on Pattern Analysis and Machine Intelligence 26(6), 2004; \
         M. A. Fischler, R. C. Bolles, \"Random Sample Consensus: A Paradigm for Model Fitting with Applications to Image Analysis and Automated Cartography\", Communications of the ACM 24(6), 1981"
    }

    fn defaults(&self) -> Value {
        to_json(&RansacParams::default())
    }

    fn parameters(&self) -> Vec<Parameter> {
        parameters::<RansacParams>(&self.defaults())
    }

    fn build(&self, params: Option<&Value>) -> Result<BuiltEstimator, ConfigError> {
        let params: RansacParams = parse_params(ID, params)?;
        let ransac = Ransac::new(params).map_err(|error| ConfigError::new(ID, error))?;
        Ok(BuiltEstimator {
            id: ID.into(),
            params: to_json(&params),
            estimator: Estimator::Pose(Box::new(ransac)),
        })
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn the_defaults_are_the_reference_protocol() {
        let expected = json!({
            "confidence": 0.999, "threshold_px": 1.0, "max_iterations": 1000, "max_depth": 50.0
        });
        assert_eq!(RansacE.defaults(), expected);
    }

    #[test]
    fn a_value_that_is_not_allowed_is_refused_by_name() {
        let refused = RansacE
            .build(Some(&json!({"confidence": 1.5})))
            .err()
            .unwrap();
        assert!(refused.to_string().contains("confidence"), "{refused}");
    }
}
