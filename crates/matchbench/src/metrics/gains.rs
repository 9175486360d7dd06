//! What each pair adds to the score that methods are ranked by: the terms of every comparison of methods.
//!
//! Of poses the share of the paper's thresholds that the error is below, whose mean is the paper's AUC. Of homographies the
//! [area](areas) under recall over the corner error, whose mean is the AUC at 3 pixels.

use super::auc::areas;
use super::success::{HEADLINE_PX, share_of_thresholds};
use super::{Angle, Model, PairResult};

/// Those of these pairs, by one angle of the error; `None` for the angles of a homography, which has a score for
/// [`Angle::Pose`] alone.
pub(super) fn gains(pairs: &[&PairResult], angle: Angle) -> Vec<Option<f64>> {
    let corners: Vec<Option<f64>> = pairs.iter().map(|pair| pair.corner_error()).collect();
    (pairs.iter().zip(areas(&corners, HEADLINE_PX)))
        .map(|(pair, area)| match (pair.model, angle) {
            (Model::Pose, _) => Some(share_of_thresholds(pair.error(angle))),
            (Model::Homography, Angle::Pose) => Some(area),
            (Model::Homography, _) => None,
        })
        .collect()
}
